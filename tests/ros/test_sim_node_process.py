"""How the node starts, what it refuses, and how it ends."""

import signal

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosgraph_msgs.msg import Clock

from bilayer_core import Simulator, load_scene
from bilayer_core.log.run.log_reader import read_info, read_log, read_state
from bilayer_core.runs.replay import verify

FAST = {"scene": "bending", "real_time_factor": 0}


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"sceen": "bending"}, "no parameter 'sceen': did you mean 'scene'?"),
        ({"rate": "fast"}, "'rate' is 'fast'; allowed is a finite number >= 0"),
        ({"rate": -1.0}, "'rate' is -1.0; allowed is a finite number >= 0"),
        ({"dt": ".nan"}, "'dt' is nan; allowed is a finite number >= 0"),
        ({"publish_clock": 1}, "'publish_clock' is 1; allowed is true or false"),
        ({"stimulus_fallback": "holt"}, "one of hold, zero, schedule"),
        ({"scene": "griping"}, "gripping"),
        ({"model": "three_rod"}, "three_rod"),
        ({"log": "missing/run.mcap"}, "missing"),
        ({"scene": "bending", "lockstep": True, "publish_clock": False}, "'publish_clock' is False; with 'lockstep'"),
        (
            {"scene": "bending", "lockstep": True, "dt": 2e-3, "control_period": 1e-3},
            "'control_period' is 0.001; allowed is a finite number >= 0.002",
        ),
        ({"rerun": "served"}, "served: the name of a rerun recording ends in .rrd"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_a_bad_parameter_ends_the_node_with_exit_code_2_and_one_message(start, domain, parameters, said):
    node = start("sim_node", domain, parameters)
    assert node.wait() == 2
    assert said in node.output
    assert "Traceback" not in node.output


def test_an_existing_log_is_refused_before_the_simulation_starts(start, domain, tmp_path):
    log = tmp_path / "run.mcap"
    log.write_bytes(b"dear to somebody")
    node = start("sim_node", domain, FAST | {"log": log, "duration": 0.1})
    assert node.wait() == 2
    assert str(log) in node.output
    assert log.read_bytes() == b"dear to somebody"


def test_a_rerun_recording_is_written_when_the_run_ends(start, domain, tmp_path):
    recording = tmp_path / "run.rrd"
    node = start("sim_node", domain, FAST | {"rerun": recording, "duration": 0.1})
    assert node.wait() == 0, node.output
    assert recording.stat().st_size > 10_000


def test_frames_at_another_rate_are_at_their_times_and_the_run_is_the_plain_one(start, domain, tmp_path):
    log = tmp_path / "run.mcap"
    parameters = {"rate": 30.0, "duration": 0.5, "tolerance": 1e-3, "stimulus_fallback": "schedule"}
    node = start("sim_node", domain, FAST | parameters | {"log": log})
    assert node.wait() == 0, node.output
    assert read_log(log).times == pytest.approx(np.arange(16) / 30.0, abs=1e-9)  # logs count nanoseconds
    assert read_info(log).complete and read_info(log).settings["tolerance"] == "0.001"
    unwatched = Simulator(load_scene("bending"), tolerance=1e-3)
    unwatched.run(0.5)
    np.testing.assert_array_equal(read_state(log)[0], unwatched.save_state())


def test_a_rate_above_that_of_the_scene_has_all_its_frames_at_their_times(start, domain, tmp_path):
    log = tmp_path / "run.mcap"
    parameters = {"rate": 200, "marker_rate": 200, "duration": 0.3, "stimulus_fallback": "schedule"}
    node = start("sim_node", domain, FAST | parameters | {"log": log})
    assert node.wait() == 0, node.output
    assert read_log(log).times == pytest.approx(np.arange(61) / 200.0, abs=1e-9)
    assert read_info(log).topics["/bilayer_sim/markers"]["count"] == 61
    assert verify(log).passed


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"rate": 2e6}, "'rate' is 2e+06; allowed is at most 1e+06 Hz"),
        ({"marker_rate": 100}, "'marker_rate' is 100; allowed is at most the rate of frames, 50 Hz"),
    ],
)
def test_a_rate_that_cannot_be_kept_is_refused(start, domain, parameters, said):
    node = start("sim_node", domain, FAST | parameters)
    assert node.wait() == 2
    assert said in node.output


def test_dt_alone_asks_for_fixed_steps(start, domain, tmp_path):
    log = tmp_path / "run.mcap"
    node = start("sim_node", domain, FAST | {"log": log, "duration": 0.05, "dt": 2e-3})
    assert node.wait() == 0, node.output
    settings = read_info(log).settings
    assert (settings["dt"], settings["tolerance"]) == ("0.002", "none")


def test_a_simulation_that_cannot_go_on_ends_with_3_and_a_log_up_to_its_last_step(start, domain, root, tmp_path):
    scene = yaml.safe_load((root / "config" / "scenes" / "bending.yaml").read_text())
    scene["stimuli"]["swelling"]["schedule"] = {"type": "table", "times": [0.05, 0.051], "values": [0.0, 1.0]}
    scene["solver"] = {"max_newton_iterations": 1, "max_halvings": 0}
    path, log = tmp_path / "hopeless.yaml", tmp_path / "run.mcap"
    path.write_text(yaml.safe_dump(scene))
    parameters = FAST | {"scene": path, "log": log, "stimulus_fallback": "schedule", "rate": 10}
    node = start("sim_node", domain, parameters)
    assert node.wait() == 3, node.output
    assert "sim_node: stopped at t = 0.05 s" in node.output
    assert "Traceback" not in node.output
    info = read_info(log)
    assert not info.complete
    assert "stopped at t = 0.05 s" in info.termination
    assert info.last_time == pytest.approx(0.05)  # the last accepted step, between two frames of 10 Hz


def test_an_argument_that_nobody_reads_is_refused(start, domain):
    node = start("sim_node", domain, arguments=["bending"])
    assert node.wait() == 2
    assert "unrecognized arguments: bending" in node.output


def test_a_missing_file_of_parameters_is_refused_in_one_line(start, domain):
    node = start("sim_node", domain, arguments=["--ros-args", "--params-file", "none.yaml"])
    assert node.wait() == 2
    assert "none.yaml" in node.output and len(node.output.splitlines()) == 1


def test_help_lists_the_parameters(start, domain):
    node = start("sim_node", domain, arguments=["--help"])
    assert node.wait() == 0
    assert "stimulus_timeout" in node.output


def test_a_run_that_reaches_its_duration_leaves_a_complete_log(start, domain, tmp_path):
    log = tmp_path / "run.mcap"
    node = start("sim_node", domain, FAST | {"log": log, "duration": 0.1, "rate": 50})
    assert node.wait() == 0, node.output
    info = read_info(log)
    assert info.complete
    assert info.last_time == pytest.approx(0.1)
    assert info.topics["/clock"]["count"] == 6


@pytest.mark.parametrize("signals", [[signal.SIGINT], [signal.SIGINT] * 2, [signal.SIGTERM]])
def test_an_interrupted_node_ends_with_0_and_a_log_readable_to_its_end(start, connect, domain, tmp_path, signals):
    log = tmp_path / "run.mcap"
    node = start("sim_node", domain, FAST | {"log": log})
    clock = connect(node).listen(Clock, "/clock")
    for number in signals:
        node.send(number)
    assert node.wait(30) == 0, node.output
    assert "Traceback" not in node.output
    info = read_info(log)
    reason = f"ended by {signals[0].name}"
    assert (info.complete, info.termination) == (False, reason) and f"{reason} at t = " in node.output
    assert read_log(log).events[-1].text == f"run {reason}"
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_summary() is not None
        times = [message.log_time * 1e-9 for _, _, message in reader.iter_messages(topics=["/clock"])]
    assert times == sorted(times)
    assert times[-1] >= clock[-1].clock.sec + clock[-1].clock.nanosec * 1e-9


def test_a_paused_node_can_be_interrupted(start, connect, domain):
    node = start("sim_node", domain, FAST | {"start_paused": True})
    connect(node).listen(Clock, "/clock")
    node.send(signal.SIGINT)
    assert node.wait(30) == 0


def test_a_reset_finishes_the_log_and_begins_a_numbered_one(start, connect, domain, tmp_path):
    log = tmp_path / "run.mcap"
    node = start("sim_node", domain, FAST | {"log": log, "start_paused": True, "rate": 50.0})
    client = connect(node)
    for name in ("step", "step", "reset", "step"):
        assert client.call(name).success
    node.send(signal.SIGINT)
    node.wait(30)
    assert read_info(log).last_time == pytest.approx(0.04)
    assert read_info(log).termination == "reset"
    assert read_info(tmp_path / "run_1.mcap").last_time == pytest.approx(0.02)

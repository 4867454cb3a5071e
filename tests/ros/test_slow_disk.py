"""The node and its log on a disk that hangs, or is full: steps keep their rhythm, and what is lost is told."""

import resource
import signal
import threading
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Float64
from support.acted_scenes import pushed
from support.slow_disks import Full, Valve

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import OutputError
from bilayer_core.log.file import mcap_log
from bilayer_core.log.file.mcap_log import QUEUE_LENGTH
from bilayer_core.log.messages.encoders import decode_input
from bilayer_core.log.messages.topics import INPUTS
from bilayer_core.log.run.log_reader import read_info, read_log, read_messages
from bilayer_core.observed.inputs import STIMULUS
from bilayer_core.runs.replay import verify
from bilayer_core.scene.schedule import Hold
from bilayer_sim_ros.control.control_ticks import Control
from bilayer_sim_ros.control.pacing import Pacer
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.control.stimulus import Channel, StimulusInputs
from bilayer_sim_ros.node.worker import SimulationWorker
from bilayer_sim_ros.publishing.conversions import to_diagnostics
from bilayer_sim_ros.publishing.run_files import Recording

RATE, DURATION, STALL = 200.0, 2.4, 1.5


class Nobody:
    """Subscribes to nothing."""

    wanted = False


@pytest.fixture
def valve(monkeypatch):
    valve = Valve()
    monkeypatch.setattr(mcap_log, "open_alone", valve.file)
    yield valve
    valve.open()


def no_inputs():
    """Of the scene's one channel."""
    return StimulusInputs([Channel("heat", 0.0, 1.0, Hold(type="hold", value=0.0))], 0.0, "hold")


def worker_of(simulator, inputs, recording, duration, report=lambda status: None):
    """The node's worker in real time, and what is set when it has ended."""
    finished = threading.Event()
    worker = SimulationWorker(
        simulator,
        control=Control(inputs, Commands(lambda reason: None), 50.0),
        publisher=Nobody(),
        recording=recording,
        rate=RATE,
        pacer=Pacer(1.0),
        duration=duration,
        report=report,
        finished=finished.set,
    )
    return worker, finished


class Timed(Recording):
    """Notes how long the stepping thread was held up by the log [s]."""

    longest = 0.0

    def observe(self, frame):
        begin = time.monotonic()
        super().observe(frame)
        self.longest = max(self.longest, time.monotonic() - begin)


def test_while_the_disk_hangs_steps_keep_their_rhythm_and_the_log_still_replays(tmp_path, valve):
    log, statuses = tmp_path / "run.mcap", []
    simulator, inputs = Simulator(load_scene(pushed())), no_inputs()
    simulator.compile()
    recording = Timed(str(log), "", RATE, 20.0, patience=0.0)
    worker, finished = worker_of(simulator, inputs, recording, DURATION, statuses.append)
    sent, begin = 0, time.monotonic()
    worker.start()
    time.sleep(0.3)
    valve.shut()
    assert valve.stalled.wait(20.0)
    at_stall, end = simulator.time, time.monotonic() + STALL
    while time.monotonic() < end:
        sent += 1
        inputs.receive("heat", (sent % 10) / 10)
        time.sleep(0.02)
    went_on = simulator.time - at_stall
    valve.open()
    assert finished.wait(60.0)
    worker.stop()
    assert worker.error is None and time.monotonic() - begin < 60.0
    assert went_on > 0.6 * STALL  # of 1.0 on a machine that does nothing else
    assert recording.longest < 0.5 * STALL
    dropped = worker.log_status.dropped
    assert dropped > 0.5 * STALL * RATE - QUEUE_LENGTH and worker.log_status.failure == ""
    assert statuses[-1].log.dropped > 0 and sum(status.dropped for status in statuses) == statuses[-1].log.dropped
    shown = [to_diagnostics(status, "/sim", {}).status[0] for status in statuses if status.dropped]
    told = [{value.key: value.value for value in report.values} for report in shown]
    assert {report.level for report in shown} == {DiagnosticStatus.WARN}
    assert max(int(values["in the queue of the log"]) for values in told) >= QUEUE_LENGTH
    assert int(told[-1]["frames left out of the log"]) > 0
    told = [decode_input(data) for _, _, _, data in read_messages(log, {INPUTS.full_name()}) if data is not None]
    heats = [of for of in told if of.kind == STIMULUS and at_stall < of.time < at_stall + went_on]
    assert len(heats) > 0.5 * sent
    times = read_log(log).times
    assert len(times) < DURATION * RATE - dropped + 10 and times[-1] == pytest.approx(DURATION)
    result = verify(log)
    assert result.passed and result.states == len(times)


def test_a_log_lost_before_a_reset_is_told_at_the_end_and_the_next_one_is_whole(tmp_path, monkeypatch):
    first, open_alone = tmp_path / "run.mcap", mcap_log.open_alone

    def no_room_for_the_first(path, force):
        return Full(path.open("xb"), 60_000) if path == first else open_alone(path, force)

    monkeypatch.setattr(mcap_log, "open_alone", no_room_for_the_first)
    simulator = Simulator(load_scene(pushed()))
    simulator.compile()
    worker, finished = worker_of(simulator, no_inputs(), Recording(str(first), "", RATE, 20.0, 0.0), 3.0)
    worker.start()
    while not worker.log_status.failure:
        assert not finished.is_set()
        time.sleep(0.01)
    assert worker.reset().result(20.0) == "reset to t = 0 s"
    assert worker.log_status.failure == ""
    time.sleep(0.2)
    worker.stop()
    assert isinstance(worker.error, OutputError) and "run.mcap could not be written: No space" in str(worker.error)
    assert verify(tmp_path / "run_1.mcap").passed


def test_on_a_full_disk_the_node_goes_on_tells_and_ends_with_exit_code_3(start, connect, domain, tmp_path):
    log = tmp_path / "run.mcap"
    node = start("sim_node", domain, {"scene": "bending", "log": log, "rate": 200, "start_paused": True})
    client = connect(node)
    reports = client.listen(DiagnosticArray, "/diagnostics")
    send = client.sender(Float64, "/bilayer_sim/stimulus/swelling")
    assert client.call("resume").success
    room = log.stat().st_size + 300_000
    resource.prlimit(node.pid, resource.RLIMIT_FSIZE, (room, room))

    def failed():
        return reports[-1].status[0].level == DiagnosticStatus.ERROR

    client.spin_until(failed, "an error in the diagnostics")
    values = {value.key: value.value for value in reports[-1].status[0].values}
    assert reports[-1].status[0].message.endswith(", without its log")
    assert values["log"].endswith("run.mcap could not be written: File too large")
    before = float(values["simulated time [s]"])
    send(Float64(data=0.1))
    count = len(reports)
    client.spin_until(lambda: len(reports) > count + 1, "more diagnostics")
    later = {value.key: value.value for value in reports[-1].status[0].values}
    assert float(later["simulated time [s]"]) > before
    node.send(signal.SIGINT)
    assert node.wait() == 3, node.output
    assert node.output.count("the simulation goes on without it") == 1
    assert "frames" not in node.output  # no second message that blames the disk's speed
    assert "File too large; it can be read up to t = " in node.output and "Traceback" not in node.output
    assert not read_info(log).complete and len(read_log(log).times) > 1

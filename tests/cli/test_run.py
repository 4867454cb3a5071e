"""`bilayer run`: outputs, restarts, ways of ending."""

import json
import os
import pty
import signal
import subprocess
import time

import numpy as np
import pytest
from support.processes import TIMEOUT, command, environment

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main, watch
from bilayer_core.jit import compile_all
from bilayer_core.log.run.log_reader import read_info, read_log, read_state, scene_from_log
from bilayer_core.scene.loader import parse_scene

SUMMARY_KEYS = """
    scene model dimension integrator nodes dof dt duration simulated steps rejected_steps newton_iterations cpu_time
    wall_time compile_time real_time_factor converged termination terms com_start com_end com_max_height max_curvature
    max_strain mean_curvature tip_positions min_gap max_contact_force energy versions
""".split()
HOPELESS = [
    "--set",
    "solver.max_newton_iterations=1",
    "--set",
    "solver.max_halvings=0",
    "--set",
    "solver.newton_tolerance=1e-15",
]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty directory to run in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_check_and_run_say_that_friction_shakes_an_undamped_material(capsys, here):
    run = ["run", "crawling_inchworm", "--duration", "20 ms", "--summary", "run.json", "--force"]
    for change, told in ((), True), (("--set", "materials.film.retardation_time=1ms"), False):
        assert main(["check", "crawling_inchworm", *change]) == 0
        assert ("  not seen      vibrations that friction excites" in capsys.readouterr().out) is told
        assert main([*run, *change]) == 0
        shown = capsys.readouterr().out
        assert ("  not seen              vibrations that friction excites" in shown) is told
        assert ("materials.film.retardation_time damps them" in shown) is told
        assert bool(json.loads((here / "run.json").read_text())["unseen"]) is told


def test_a_run_leaves_log_and_summary_and_tells_what_happened(here, capsys):
    outputs = ["--log", "run.mcap", "--log-rate", "100", "--summary", "run.json"]
    assert main(["run", "cantilever", "--duration", "50 ms", *outputs, "--verbose"]) == 0
    summary = json.loads((here / "run.json").read_text())
    assert not set(SUMMARY_KEYS) - set(summary)
    assert summary["warnings"] == []
    assert summary["simulated"] == summary["duration"] == 0.05 and summary["converged"] is True
    assert set(summary["reasons"]) == {"model", "dimension", "integrator", "stepping"}
    info = read_info("run.mcap")
    assert info.complete and info.termination == "completed" and info.last_time == pytest.approx(0.05)
    assert info.topics["/bilayer_sim/com"]["count"] == 6
    told = capsys.readouterr().out
    assert told.startswith(f"cantilever: completed, 0.05 s in {summary['steps']} steps and ")
    assert f"  stepping              {summary['stepping']} ({summary['reasons']['stepping']})\n" in told
    assert "times as fast as real time\n" in told and "run.mcap" in told
    assert f"  largest curvature     {summary['max_curvature']:.3g} 1/m in the run, times thickness " in told
    assert "% of an outermost fibre, " in told and "% of an edge, without eigenstrain\n" in told


@pytest.mark.parametrize(
    ("asked", "tolerance"),
    [(["--dt", "2 ms"], None), (["--tolerance", "1e-3"], 1e-3), (["--dt", "2 ms", "--tolerance", "1e-3"], 1e-3)],
)
def test_dt_alone_asks_for_fixed_steps_and_a_tolerance_for_adaptive_ones(here, capsys, asked, tolerance):
    of_scene = ["--set", "solver={dt: 2 ms, tolerance: 1e-2}", "--duration", "0.02"]
    assert main(["run", "cantilever", *of_scene, *asked, "--summary", "run.json"]) == 0
    summary = json.loads((here / "run.json").read_text())
    assert (summary["tolerance"], summary["dt"]) == (tolerance, 2e-3)
    assert summary["stepping"].startswith("fixed, 2 ms" if tolerance is None else "adaptive")
    assert (summary["steps"] == 10) == (tolerance is None)


def test_a_run_shows_on_request_where_its_energy_went(here, capsys):
    assert main(["run", "cantilever", "--duration", "50 ms", "--budget", "--summary", "run.json"]) == 0
    budget = json.loads((here / "run.json").read_text())["budget"]
    assert set(budget) == {"supplied", "stored", "lost", "work", "residual", "relative_residual"}
    assert budget["stored"]["gravity"] < 0.0 < budget["stored"]["bending"]
    table = capsys.readouterr().out
    assert f"{budget['stored']['bending']:.4e}" in table and "numerical" in table and "twisting" not in table
    assert main(["run", "cantilever", "--duration", "50 ms", "--summary", "run.json", "--force"]) == 0
    assert "budget" not in json.loads((here / "run.json").read_text())
    assert "residual" in table and "residual" not in capsys.readouterr().out


@pytest.mark.parametrize("steps", [["--dt", "1 ms"], ["--tolerance", "1e-4"]], ids=["fixed", "adaptive"])
def test_the_end_of_a_run_is_the_same_bit_for_bit_whatever_records_it(here, steps):
    watched = [
        [],
        ["--log", "slow.mcap", "--log-rate", "7"],
        ["--log", "fast.mcap", "--log-rate", "1 kHz"],
        ["--log", "own.mcap", "--rrd", "run.rrd"],
        ["--rrd", "other.rrd", "--log-rate", "30"],
        ["--budget"],
    ]
    for place, options in enumerate(watched):
        run = ["run", "cantilever", "--duration", "0.33", "--quiet", "--save-state", f"{place}.npz"]
        assert main([*run, *steps, *options]) == 0
    states = [np.load(f"{place}.npz")["state"] for place in range(len(watched))]
    for state in states[1:]:
        np.testing.assert_array_equal(state, states[0])
    slow, fast = read_log("slow.mcap").times, read_log("fast.mcap").times
    assert slow[-1] == fast[-1] == pytest.approx(0.33) and len(slow) == 4 < len(fast)
    assert slow == pytest.approx([0.0, 1 / 7, 2 / 7, 0.33], abs=1e-9)


def test_the_log_holds_the_scene_with_all_changes(here):
    options = ["--dt", "2 ms", "--set", "rods.strip.stations=21", "--log-rate", "10", "--quiet", "--log", "run.mcap"]
    assert main(["run", "cantilever", "--duration", "0.01", *options]) == 0
    changes = ["rods.strip.stations=21", "solver.dt=0.002"]
    assert parse_scene(scene_from_log("run.mcap"), "log") == load_scene("cantilever", changes)


def test_stimuli_and_loads_may_be_given_in_place_of_their_schedules(here, capsys):
    assert (
        main(["run", "bending", "--duration", "0.1", "--quiet", "--log", "a.mcap", "--stimulus", "swelling=0.5"]) == 0
    )
    assert set(read_log("a.mcap")["stimulus/swelling"].values.ravel()[1:]) == {0.5}
    assert main(["replay", "a.mcap", "--verify"]) == 0
    assert main(["run", "bending", "--stimulus", "heat=0.5"]) == 2
    assert "heat" in capsys.readouterr().err


def test_quiet_prints_nothing(here, capfd):
    assert main(["run", "cantilever", "--duration", "0.002", "--quiet"]) == 0
    assert capfd.readouterr() == ("", "")


def test_info_tells_what_the_log_holds(here, capsys):
    assert main(["run", "bending", "--duration", "0.01", "--quiet", "--log", "run.mcap"]) == 0
    assert main(["info", "run.mcap"]) == 0
    text = capsys.readouterr().out
    assert "complete  yes (completed)" in text and "stimuli   swelling" in text and "/bilayer_sim/state" in text
    assert main(["info", "run.mcap", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["complete"] is True and content["channels"] == ["swelling"]


@pytest.mark.parametrize("saved", ["half.npz", "half.mcap"])
def test_a_run_in_two_parts_is_the_whole_run_bit_for_bit(here, saved):
    first = ["--duration", "0.02", "--quiet", "--save-state", "half.npz", "--log", "half.mcap"]
    assert main(["run", "cantilever", *first]) == 0
    assert (
        main(["run", "cantilever", "--duration", "0.02", "--quiet", "--from-state", saved, "--log", "rest.mcap"]) == 0
    )
    whole = Simulator(load_scene("cantilever"))
    whole.run(0.02)
    whole.run(0.02)
    np.testing.assert_array_equal(read_state("rest.mcap")[0], whole.save_state())
    assert read_state("rest.mcap")[1] == pytest.approx(0.04)


def test_a_state_of_another_scene_is_refused(here, capsys):
    assert main(["run", "cantilever", "--duration", "0.001", "--quiet", "--save-state", "state.npz"]) == 0
    assert main(["run", "bending", "--from-state", "state.npz"]) == 2
    assert "state.npz: holds a state of another scene: position has shape (51, 3)" in capsys.readouterr().err


@pytest.mark.parametrize("saved", ["state.npz", "state.mcap"])
def test_a_state_of_another_material_is_refused_and_of_another_gravity_it_is_not(here, capsys, saved):
    first = ["--duration", "0.001", "--quiet", "--save-state", "state.npz", "--log", "state.mcap"]
    assert main(["run", "cantilever", *first]) == 0
    again = ["run", "cantilever", "--duration", "0.001", "--quiet", "--from-state", saved, "--set"]
    assert main([*again, "materials.gel.youngs_modulus=2 MPa"]) == 2
    told = f"{saved}: saved state: is of another scene, with other materials; allowed to differ are schedules"
    assert told in capsys.readouterr().err
    assert main([*again, "gravity=[0, 0, -1]"]) == 0


def test_a_state_of_a_version_without_its_time_is_refused(here, capsys):
    assert main(["run", "cantilever", "--duration", "0.001", "--quiet", "--save-state", "state.npz"]) == 0
    with np.load("state.npz") as saved:
        layout, state, scene = json.loads(str(saved["layout"])), saved["state"], saved["scene"]
    assert layout[0] == ["time", [1]]
    np.savez("old.npz", state=state[1:], layout=np.array(json.dumps(layout[1:])), scene=scene)
    assert main(["run", "cantilever", "--from-state", "old.npz"]) == 2
    told = "old.npz: holds a state without 'time', of another version of this program; run its scene again"
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 broken", b"text\n"])
def test_a_file_that_is_no_state_is_refused(here, capsys, content):
    (here / "state.npz").write_bytes(content)
    assert main(["run", "cantilever", "--from-state", "state.npz"]) == 2
    assert "state.npz: is not a saved state" in capsys.readouterr().err


def test_a_state_at_the_end_of_the_scene_needs_a_duration(here, capsys):
    short = ["run", "cantilever", "--set", "duration=0.002", "--quiet"]
    assert main([*short, "--save-state", "end.npz"]) == 0
    assert main([*short, "--from-state", "end.npz"]) == 2
    assert "the scene ends at 0.002 s; say with --duration how long to go on" in capsys.readouterr().err


@pytest.fixture
def no_simulation(monkeypatch):
    """Nothing may be simulated."""

    def refuse(scene):
        raise AssertionError("a simulation was started")

    monkeypatch.setattr("bilayer_core.simulation.simulator.Simulator", refuse)


OUTPUTS = [("--log", ".mcap"), ("--rrd", ".rrd"), ("--summary", ".json"), ("--save-state", ".npz")]


@pytest.mark.parametrize(("option", "suffix"), OUTPUTS)
@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("there{}", "there{}: exists already; choose another name, or replace it with --force"),
        ("absent/file{}", "absent/file{}: cannot be written: there is no directory absent"),
        (".", "cannot be written: it is a directory"),
        ("file", "file: must end in {}\n"),
        ("file.txt", "file.txt: must end in {}\n"),
    ],
)
def test_an_output_that_cannot_be_written_is_refused_before_the_simulation(
    here, capsys, no_simulation, option, suffix, path, message
):
    there = here / f"there{suffix}"
    there.write_text("precious")
    assert main(["run", "cantilever", option, path.format(suffix)]) == 2
    assert message.format(suffix) in capsys.readouterr().err
    assert there.read_text() == "precious" and list(here.iterdir()) == [there]


@pytest.mark.parametrize(("option", "suffix"), OUTPUTS)
def test_a_directory_without_permission_is_refused_before_the_simulation(
    here, capsys, no_simulation, option, suffix, monkeypatch
):
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write everywhere
    assert main(["run", "cantilever", option, f"file{suffix}"]) == 2
    assert f"file{suffix}: cannot be written: no permission to write in" in capsys.readouterr().err


def test_one_file_for_two_outputs_is_refused(here, capsys, no_simulation):
    assert main(["run", "cantilever", "--log", "/dev/null", "--summary", "/dev/../dev/null", "--force"]) == 2
    assert "is named for two outputs" in capsys.readouterr().err


def test_force_replaces_a_log(here):
    (here / "run.mcap").write_text("old")
    assert main(["run", "cantilever", "--duration", "0.002", "--quiet", "--force", "--log", "run.mcap"]) == 0
    assert read_info("run.mcap").complete


def test_a_simulation_that_cannot_go_on_ends_with_3_and_whole_files(here, capsys):
    assert main(["run", "cantilever", *HOPELESS, "--log", "run.mcap", "--summary", "run.json"]) == 3
    printed = capsys.readouterr()
    told = printed.err.splitlines()[-1]  # the first start may tell before that it compiles
    assert told.startswith("bilayer: stopped at t = ") and "Traceback" not in printed.err
    assert printed.out.startswith("cantilever: failed")
    summary = json.loads((here / "run.json").read_text())
    assert summary["termination"] == "failed" and summary["reason"] in printed.err
    info = read_info("run.mcap")
    assert not info.complete and info.termination == "failed"


def start_long_run(here):
    """A run of minutes in a process of its own, once its log has grown."""
    options = ["--dt", "0.1 ms", "--duration", "1000", "--log", "run.mcap", "--summary", "run.json"]
    arguments, pipe = command("run", "cantilever", *options), subprocess.PIPE
    run = subprocess.Popen(arguments, env=environment(), stdout=pipe, stderr=pipe, text=True)
    deadline = time.monotonic() + TIMEOUT
    while not (here / "run.mcap").exists() or (here / "run.mcap").stat().st_size < 100_000:
        assert run.poll() is None and time.monotonic() < deadline, run.communicate()
        time.sleep(0.05)
    return run


@pytest.mark.parametrize(
    ("number", "line"), [(signal.SIGINT, "bilayer: interrupted\n"), (signal.SIGTERM, "bilayer: ended by SIGTERM\n")]
)
def test_an_interrupted_run_ends_with_a_line_and_whole_files(here, number, line):
    run = start_long_run(here)
    run.send_signal(number)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 128 + number, err
    assert out.startswith("cantilever: interrupted") and err.endswith(line)
    assert err.count("\n") == 1 or watch.COMPILING_NOTICE in err
    info = read_info("run.mcap")
    assert not info.complete and info.termination == "interrupted"
    summary = json.loads((here / "run.json").read_text())
    assert summary["termination"] == "interrupted"
    assert summary["simulated"] == pytest.approx(info.last_time) and summary["simulated"] > 0.0
    assert read_log("run.mcap").times[-1] == pytest.approx(info.last_time)


@pytest.fixture
def heeding():
    """A process that heeds interrupts; one started in the background may ignore them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeding")
def test_a_second_signal_is_not_put_off():
    with watch.Interrupt() as interrupt:
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupt.wished == signal.SIGINT and not interrupt.granted
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1.0)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_on_a_terminal_progress_shows_simulated_time_and_real_time_factor(here):
    terminal, end = pty.openpty()
    run = subprocess.Popen(
        command("run", "cantilever", "--duration", "0.5"),
        env={**environment(), "COLUMNS": "120", "TERM": "xterm"},
        stdout=subprocess.DEVNULL,
        stderr=end,
    )
    os.close(end)
    shown = b""
    try:
        while part := os.read(terminal, 4096):
            shown += part
    except OSError:  # what Linux says when the other side is closed
        pass
    os.close(terminal)
    assert run.wait(TIMEOUT) == 0
    text = shown.decode()
    assert "0.50/0.5 s" in text and "real time x" in text and "left" in text


def _compiles(pieces):
    """In place of `ensure_compiled`: reports as if it compiled so many pieces."""

    def ensure_compiled(report, needed):
        for done in range(pieces and pieces + 1):
            report(done, pieces)

    return ensure_compiled


def test_a_start_that_compiles_says_so_and_any_other_says_nothing(monkeypatch, capfd):
    monkeypatch.setattr(compile_all, "ensure_compiled", _compiles(0))
    watch.compile_kernels(quiet=False)
    assert capfd.readouterr().err == ""
    monkeypatch.setattr(compile_all, "ensure_compiled", _compiles(3))
    watch.compile_kernels(quiet=False)
    assert capfd.readouterr().err == f"{watch.COMPILING_NOTICE}\n"


def test_a_quiet_start_does_not_say_that_it_compiles(monkeypatch, capfd):
    monkeypatch.setattr(compile_all, "ensure_compiled", _compiles(3))
    watch.compile_kernels(quiet=True)
    assert capfd.readouterr().err == ""

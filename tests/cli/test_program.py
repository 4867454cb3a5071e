"""The program as its users start it: exit codes, messages, what is imported."""

import json
import os
import subprocess

import pytest
import yaml
from support.processes import bilayer, command, environment, python
from support.sample_scenes import everything

import bilayer_core.cli.program
from bilayer_core.cli import main
from bilayer_core.scene.bundled import bundled_scenes

VERBS = ("scenes", "new", "schema", "check", "run", "converge", "validate", "info", "view", "render")


@pytest.fixture
def scene_file(tmp_path):
    """Writes a scene to a file; returns its path."""

    def write(content):
        path = tmp_path / "robot.yaml"
        path.write_text(yaml.safe_dump(content))
        return path

    return write


def refusal(result) -> str:
    """The message of a command that refused its input."""
    assert result.returncode == 2, result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    return result.stderr.strip()


def test_help_and_the_list_of_scenes_import_nothing_that_is_slow():
    slow = {"numba", "numpy", "scipy", "rerun", "mcap", "pint", "rich.progress"}
    program = (
        "import sys, contextlib, io; from bilayer_core.cli import main\n"
        "with contextlib.redirect_stdout(io.StringIO()): codes = main(['--help']), main(['scenes'])\n"
        f"print(codes, sorted({slow!r} & set(sys.modules)))"
    )
    assert python(program) == "(0, 0) []"


def test_a_run_without_a_log_imports_neither_the_units_library_nor_that_of_logs():
    program = (
        "import sys; from bilayer_core.cli import main\n"
        "code = main(['run', 'cantilever', '--duration', '1 ms', '--quiet'])\n"
        "print(code, sorted({'mcap', 'pint', 'rich.progress', 'rerun'} & set(sys.modules)))"
    )
    assert python(program) == "0 []"


def test_the_garbage_collector_rests_while_a_command_runs_and_at_the_end_of_the_process():
    program = (
        "import atexit, gc; from bilayer_core.cli import main; from bilayer_core.cli.program import program\n"
        "atexit.register(lambda: print(gc.get_freeze_count() > 1000))\n"
        "before, during = gc.get_threshold(), []\n"
        "program.main = lambda *_, **__: during.append(gc.get_threshold())\n"
        "main(['scenes'])\n"
        "print(during[0][0] > 10 * before[0], gc.get_threshold() == before, gc.get_freeze_count() > 1000)"
    )
    assert python(program).split() == ["True", "True", "False", "True"]


def test_help_names_every_verb_and_every_exit_code(capsys):
    assert main(["--help"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert all(f" {verb} " in text for verb in VERBS)
    assert "Exit codes: 0 done, 1 a check failed, 2 bad input, 3" in text
    assert "130 interrupted (SIGINT), 143 ended (SIGTERM)." in text


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(verb, capsys):
    assert main([verb, "--help"]) == 0
    assert f"Usage: bilayer {verb}" in capsys.readouterr().out


def test_the_list_of_scenes_has_a_line_for_each(capsys):
    assert main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(bundled_scenes())
    assert all(len(line.split()) > 3 for line in lines)


def test_check_says_what_is_computed_and_why_the_rest_is_skipped(capsys):
    assert main(["check", "bending"]) == 0
    text = capsys.readouterr().out
    for line in (
        "  strip         100 mm long, 10 mm wide, 41 stations 2.5 mm apart; start held by wall",
        "bottom to top: passive 1 mm, active 1 mm",
        "eigenstrain up to 1 %: if nothing hinders it, curvature up to 7.5 1/m, radius 133 mm",
        "  swelling      0 to 1 [1], ramp",
        "  model         laminate (one curve carries both layers",
        "  dimension     2 (all stays in the plane y = 0)\n",
        "  integrator    sdirk2 (second order, L-stable; ",
        "  stepping      adaptive, error per step at most 0.0001 of the longest rod (neither `dt` nor `tolerance` is",
        "  time          2 s, the first step 1 ms long, none longer than 20 ms\n",
        "  accuracy      the tolerance bounds the error per step; that of a run is larger: `bilayer run",
        "  active        stretching, bending, eigenstrain, inertia, damping\n",
        "  skipped       twisting: nothing twists in a plane\n",
        "gravity: gravity is zero\n",
        "drag, added mass: no fluid\n",
        "contact pairs\n  none\n",
        "  within        rods.strip: length/width 10 (at least 5)\n",
    ):
        assert line in text
    assert "/bilayer_sim/markers" in text and "20 Hz" in text
    assert text.endswith("no faults, no warnings\n")


def test_help_of_run_says_that_the_tolerance_is_no_error_of_the_run(capsys):
    assert main(["run", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    for told in ("largest error per step", "The error of a whole run is larger; `--error-estimate` tells it."):
        assert told in text


def test_check_says_what_is_set(capsys):
    solver = "solver={model: two_rod, dimension: 3, integrator: implicit_euler, dt: 1 ms}"
    assert main(["check", "bending", "--set", solver]) == 0
    text = capsys.readouterr().out
    assert "error per step" not in text
    for line in (
        "  model         two_rod (set by `solver.model`)\n",
        "  stepping      fixed, 1 ms (set by `solver.dt`)\n",
        "  time          2 s in 2000 steps of 1 ms\n",
        "  active        stretching, bending, twisting, bond, eigenstrain, inertia, damping, gyroscopic\n",
    ):
        assert line in text


def test_check_wraps_what_is_long_and_counts_the_warnings(capsys):
    assert main(["check", "crawling_dual_leg"]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 120
    assert text.endswith(f"no faults, {text.count('  WARNING  ')} warnings\n")


def test_check_as_json_holds_the_same(capsys):
    assert main(["check", "gripping", "--json", "--set", "output.rate=10"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["terms"]["friction"] == "active"
    assert report["terms"]["damping"] == "skipped: damping.mass is zero"
    assert "rods – ball (points all over ribbons against sphere)" in report["contact_pairs"]
    assert {stream["rate"] for stream in report["outputs"]} == {10.0}
    assert report["nodes"] == 4 * 50 + 1 and report["dof"] > 3 * report["nodes"]
    assert report["stepping"].startswith("adaptive") and set(report["reasons"]) == {
        "model",
        "dimension",
        "integrator",
        "stepping",
    }


def test_a_scene_that_starts_in_penetration_is_refused_with_the_node_and_the_depth(scene_file):
    content = everything()
    content["bodies"][1]["position"] = [content["rods"][0]["path"]["start"][0], 0, 0.0218]
    message = refusal(bilayer("check", scene_file(content)))
    assert "the scene starts in penetration: node 0 of arm_0/passive at " in message
    assert "is 0.3 mm behind the surface of body ball" in message


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "griping"], "bilayer: griping: neither a scene file nor a bundled scene, did you mean gripping?"),
        (["run", "gripping.yaml"], "No such file or directory; `gripping` without .yaml is a bundled scene"),
        (["run", "absent.yaml"], "bilayer: absent.yaml: cannot be read: No such file or directory"),
        (["run", "cantilever", "--dt", "1 kg"], 'solver.dt: found "1 kg", a quantity in kg; must be a time [s]'),
        (["run", "cantilever", "--dt", "nan"], 'solver.dt: found "nan", not a number with a unit; must be a time [s]'),
        (["run", "cantilever", "--model", "beam"], "found \"beam\"; must be 'auto', 'two_rod' or 'laminate'"),
        (["run", "cantilever", "--dimension", "4"], "solver.dimension: found 4; must be 'auto', 2 or 3"),
        (["run", "helix", "--dimension", "2"], "solver.dimension: found 2, but rods.strip.layers.helical"),
        (["run", "cantilever", "--integrator", "euler"], "solver.integrator: found \"euler\"; must be 'auto', "),
        (
            ["run", "cantilever", "--set", "solver.newton_tolerance=0"],
            "solver.newton_tolerance: found 0; must be a speed [m/s] above 0",
        ),
        (["run", "cantilever", "--log-rate", "-1"], "found '-1'; must be a rate [Hz] above 0, such as 50"),
        (["run", "cantilever", "--duration", "1 kg"], "found '1 kg', a quantity in kg; must be a time [s] above 0"),
        (["run", "cantilever", "--set", "rods.strip.station=9"], "no station of rods.strip, did you mean stations?"),
        (["run", "cantilever", "--from-state", "absent.npz"], "absent.npz: cannot be read: No such file or directory"),
        (["run", "cantilever", "--lgo", "x"], "No such option '--lgo'"),
        (["run"], "Missing argument 'SCENE'"),
        (["simulate"], "No such command 'simulate'"),
        (["check", "cantilever", "--set", "duration"], "override duration: must be PATH=VALUE"),
        (["info", "absent.mcap"], "absent.mcap: cannot be read: No such file or directory"),
        (["view", "absent.mcap", "--screenshot", "absent/x.png"], "absent/x.png: cannot be written: there is no"),
        (["view", "x.rrd", "--save", "y.rrd"], "--save: x.rrd is a rerun recording already"),
        (["view", "x.rrd", "--at", "1"], "--at: is the time of a picture; give --screenshot"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_with_exit_code_2_and_a_message(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert "Traceback" not in printed.err and printed.out == ""


def test_the_process_ends_with_the_exit_code_and_one_message():
    assert refusal(bilayer("check", "griping")).count("\n") == 0


def test_a_text_file_is_no_log(tmp_path, capsys):
    path = tmp_path / "notes.mcap"
    path.write_text("no log\n")
    assert main(["info", str(path)]) == 2
    assert "notes.mcap: is not an MCAP log" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["--debug", "check", "griping"], ["check", "griping", "--debug"]])
def test_debug_adds_the_traceback_and_keeps_the_exit_code(arguments, capsys):
    assert main(arguments) == 2
    assert "Traceback" in capsys.readouterr().err


@pytest.fixture
def broken(monkeypatch):
    """A fault in the program itself."""

    def fail(name):
        raise ZeroDivisionError("the program\nis wrong")

    monkeypatch.setattr("bilayer_core.scene.loader.bundled_scene", fail)


def test_a_fault_of_the_program_is_one_message_that_says_how_to_report_it(broken, capsys):
    assert main(["check", "gripping"]) == bilayer_core.cli.program.INTERNAL_ERROR
    error = capsys.readouterr().err
    assert error.startswith("bilayer: internal error: ZeroDivisionError: the program is wrong\n")
    assert "--debug" in error and "Traceback" not in error


def test_a_fault_of_the_program_is_traced_with_debug(broken, capsys):
    assert main(["check", "gripping", "--debug"]) == bilayer_core.cli.program.INTERNAL_ERROR
    assert "Traceback" in capsys.readouterr().err


def test_a_reader_that_goes_away_is_no_fault():
    read, write = os.pipe()
    os.close(read)
    run = subprocess.run(
        command("scenes"), env=environment(), stdout=write, stderr=subprocess.PIPE, text=True, timeout=60
    )
    os.close(write)
    assert (run.returncode, run.stderr) == (0, "")


def test_the_version_is_that_of_the_package(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"bilayer_sim_ros {bilayer_core.__version__}\n"

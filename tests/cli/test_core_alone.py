"""Every command in an environment that has what the package requires, and no extra."""

import json
import re
import subprocess
import venv
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pytest
from support import synthetic_run
from support.processes import TIMEOUT, environment

from bilayer_core import DISTRIBUTION
from bilayer_core.cli.program import program
from bilayer_core.log.file.mcap_log import McapRecorder

NAME = re.compile(r"[\w.-]+")
SWEEP = "schema: 1\nscene: cantilever\nparameters:\n  gravity: {path: gravity.2, values: [-1, -2]}\n"
FIT = ["fit", "cantilever", "--data", "data.csv", "--parameter", "damping.mass=0:20"]
WORKS = {
    "scenes": [],
    "new": ["robot.yaml"],
    "schema": [],
    "check": ["cantilever"],
    "run": ["cantilever", "--duration", "2 ms", "--log", "simulated.mcap", "--summary", "run.json", "--quiet"],
    "converge": ["cantilever", "--duration", "2 ms", "--workers", "1"],
    "validate": ["--only", "laminate/two*", "--quick"],
    "design": ["cantilever", "--target", "curve.csv", "--vary", "gravity.2=-20:-1", "--quiet"],
    "info": ["run.mcap"],
    "repair": ["run.mcap", "repaired.mcap"],
    "compare": ["run.mcap", "run.mcap"],
    "replay": ["simulated.mcap", "--verify"],
    "export": ["run.mcap", "--csv", "table.csv", "--npz", "run.npz"],
}
"""What needs no extra."""
NEEDS = [
    (["bench"], "matplotlib", "plot"),
    (["stress", "--quick"], "matplotlib", "plot"),
    (["sweep", "sweep.yaml"], "dask", "sweep"),
    (["optimise", "sweep.yaml", "--maximise", "x"], "dask", "sweep"),
    (
        ["fit", "cantilever", "--data", "data.csv", "--parameter", "damping.mass=0:20", "--out", "fit"],
        "matplotlib",
        "plot",
    ),
    (
        ["design", "cantilever", "--target", "curve.csv", "--vary", "gravity.2=-20:-1", "--out", "designed"],
        "matplotlib",
        "plot",
    ),
    (["validate", "--out", "out"], "matplotlib", "plot"),
    (["plot", "run.mcap", "com.z", "--out", "com.png"], "matplotlib", "plot"),
    (["export", "run.mcap", "--parquet", "run.parquet"], "pyarrow", "export"),
    (["render", "run.mcap", "--png", "run.png"], "vtk", "film"),
    (["render", "run.mcap", "--mp4", "run.mp4", "--background", "#ffffff"], "vtk", "film"),
    (["view", "run.mcap"], "rerun-sdk", "viewer"),
    (["view", "run.mcap", "--save", "run.rrd"], "rerun-sdk", "viewer"),
    (["view", "run.mcap", "--screenshot", "run.png"], "rerun-sdk", "viewer"),
    (["view", "run.mcap", "--follow"], "rerun-sdk", "viewer"),
    (["run", "cantilever", "--rrd", "run.rrd"], "rerun-sdk", "viewer"),
    (["replay", "simulated.mcap", "--from", "0", "--rrd", "replay.rrd"], "rerun-sdk", "viewer"),
]
"""What needs an extra, the library that is missed first, and the extra."""


def required():
    """The distributions that pip installs with this one."""
    found, waiting = set(), [DISTRIBUTION]
    while waiting:
        of = distribution(waiting.pop())
        if of.name not in found:
            found.add(of.name)
            waiting += [NAME.match(text)[0] for text in of.requires or () if ";" not in text]
    return found


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """The interpreter of an environment with these distributions alone."""
    directory = tmp_path_factory.mktemp("core") / "venv"
    venv.create(directory, symlinks=True)
    (site,) = directory.glob("lib/python*/site-packages")
    for name in required():
        of = distribution(name)
        for top in {file.parts[0] for file in of.files} - {"..", "__pycache__"}:
            if not (site / top).exists():
                (site / top).symlink_to(Path(of.locate_file(top)).resolve())
    return directory / "bin" / "python"


RUN_ALL = """
import contextlib, io, json, sys
from bilayer_core.cli import main
if __name__ == "__main__":
    ended = []
    for arguments in json.load(sys.stdin):
        told = io.StringIO()
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(told):
            code = main(arguments)
        ended.append([code, told.getvalue()])
    print("ENDED", json.dumps(ended))
"""


@pytest.fixture(scope="module")
def ended(tmp_path_factory, python):
    """Exit code and messages of all commands, run one after the other beside logs, a sweep and data."""
    here = tmp_path_factory.mktemp("work")
    synthetic_run.run(McapRecorder(here / "run.mcap"), np.arange(3) * 0.02)
    (here / "sweep.yaml").write_text(SWEEP)
    (here / "data.csv").write_text("time,com.z [m]\n0,0\n0.001,0\n0.002,0\n")
    (here / "curve.csv").write_text("x,y,z\n0,0,0\n0.03,0,0\n0.06,0,0\n0.1,0,0\n")
    (here / "run_all.py").write_text(RUN_ALL)
    commands = [[verb, *more] for verb, more in WORKS.items()] + [arguments for arguments, _, _ in NEEDS]
    done = subprocess.run(
        [python, "run_all.py"],
        cwd=here,
        env=environment(),
        input=json.dumps(commands),
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    found = json.loads(done.stdout.rpartition("ENDED")[2] or "[]")
    assert len(found) == len(commands), done.stderr
    return {tuple(command): tuple(ending) for command, ending in zip(commands, found, strict=True)}


def test_no_library_of_an_extra_is_in_the_environment(python):
    extras = ["rerun", "PIL", "matplotlib", "pyarrow", "vtkmodules", "dask", "optuna", "pandas", "rclpy"]
    looking = f"import importlib.util as u; print([m for m in {extras} if u.find_spec(m)])"
    done = subprocess.run([python, "-c", looking], env=environment(), capture_output=True, text=True)
    assert done.stdout.strip() == "[]"


def test_every_command_is_tried():
    assert {*WORKS, *(words[0] for words, _, _ in NEEDS)} == set(program.commands)


@pytest.mark.parametrize("verb", WORKS)
def test_a_command_that_needs_no_extra_works(ended, verb):
    code, told = ended[verb, *WORKS[verb]]
    assert code == 0, told


@pytest.mark.parametrize(
    ("arguments", "library", "extra"), NEEDS, ids=lambda value: value[0] if isinstance(value, list) else ""
)
def test_a_command_says_which_extra_to_install(ended, arguments, library, extra):
    code, told = ended[tuple(arguments)]
    assert code == 2
    assert told.endswith(f"{library} is not installed; install it with: pip install 'bilayer_sim_ros[{extra}]'\n")
    assert told.count("\n") == 1

"""Every command of the core on a system that has only what Windows has, too."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from support import synthetic_run
from support.processes import TESTS, TIMEOUT, environment

from bilayer_core.cli.program import program
from bilayer_core.log.file.mcap_log import McapRecorder

SWEEP = """
schema: 1
scene: cantilever
set: {duration: 2 ms}
parameters:
  gravity: {path: gravity.2, from: -2, to: -1, count: 2}
metrics: {curvature: max_curvature}
"""
CASE = "restitution/0.5/ball/laminate"
SHORT = ["cantilever", "--duration", "2 ms"]
COMMANDS = [
    (["scenes"], 0),
    (["new", "robot.yaml"], 0),
    (["schema"], 0),
    (["check", "cantilever"], 0),
    (["run", *SHORT, "--error-estimate", "--log", "simulated.mcap", "--rrd", "simulated.rrd", "--quiet"], 0),
    (["replay", "simulated.mcap", "--verify"], 0),
    (["converge", *SHORT, "--workers", "2"], 0),
    (["validate", "--only", "laminate/two*", "--quick", "--out", "cases"], 0),
    (["info", "run.mcap"], 0),
    (["repair", "run.mcap", "repaired.mcap"], 0),
    (["compare", "run.mcap", "run.mcap"], 0),
    (["export", "run.mcap", "--csv", "table.csv"], 0),
    (["plot", "run.mcap", "com.z", "--out", "com.png"], 0),
    (["render", "run.mcap", "--png", "picture.png"], 0),
    (["view", "run.mcap", "--save", "run.rrd"], 0),
    (["view", "run.mcap", "--screenshot", "viewer.png"], 0),
    (["sweep", "sweep.yaml", "--out", "sweep", "--workers", "2"], 0),
    (["optimise", "sweep.yaml", "--maximise", "curvature", "--trials", "1", "--out", "best", "--workers", "1"], 0),
    (["fit", "cantilever", "--data", "data.csv", "--parameter", "gravity.2=-20:-1", "--out", "fit"], 0),
    (["stress", "--only", CASE, "--out", "stress", "--workers", "1", "--no-shrink"], 0),
    (["bench", "--quick", "--only", "scaling", "--out", "bench"], 0),
]
"""Arguments and exit codes."""
RUN_ALL = """
import contextlib, io, json, sys, traceback
from bilayer_core.cli import main
if __name__ == "__main__":
    ended = []
    for arguments in json.load(sys.stdin):
        told = io.StringIO()
        with contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
            code = main(arguments)
        ended.append([code, told.getvalue()])
    print("ENDED", json.dumps(ended))
"""
LOOK = """
from bilayer_core.log.file import lock
from bilayer_core.cli import signals
print(lock.fcntl, hasattr(signals.signal, "SIGALRM"), hasattr(signals.os, "fork"))
"""
SERVE = """
from bilayer_core.view.server import ViewServer
with ViewServer() as server:
    server.check()
print(server.address)
"""


def elsewhere(*arguments, **options) -> subprocess.CompletedProcess:
    """Run Python where the core finds what Windows has."""
    found = environment()
    found["PYTHONPATH"] = f"{TESTS / 'another_system'}{os.pathsep}{found['PYTHONPATH']}"
    run = [sys.executable, *arguments]
    return subprocess.run(run, env=found, capture_output=True, text=True, timeout=TIMEOUT, **options)


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """Exit code and messages of all commands, run one after the other beside a log, a sweep and data."""
    here = tmp_path_factory.mktemp("work")
    synthetic_run.run(McapRecorder(here / "run.mcap"), np.arange(3) * 0.02)
    (here / "sweep.yaml").write_text(SWEEP)
    (here / "data.csv").write_text("time,com.z [m]\n0,0\n0.001,-2.5e-6\n0.002,-1e-5\n")
    (here / "run_all.py").write_text(RUN_ALL)
    done = elsewhere("run_all.py", cwd=here, input=json.dumps([arguments for arguments, _ in COMMANDS]))
    found = json.loads(done.stdout.rpartition("ENDED")[2] or "[]")
    assert len(found) == len(COMMANDS), done.stderr
    return {tuple(arguments): ending for (arguments, _), ending in zip(COMMANDS, found, strict=True)}


def test_every_command_is_tried():
    assert {arguments[0] for arguments, _ in COMMANDS} == set(program.commands)


def test_the_core_finds_none_of_the_names_that_windows_lacks():
    assert elsewhere("-c", LOOK).stdout == "None False False\n"


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "code"), COMMANDS, ids=lambda value: value[0] if isinstance(value, list) else "")
def test_a_command_works_without_the_names_that_windows_lacks(ended, arguments, code):
    found, told = ended[tuple(arguments)]
    assert found == code, told
    assert "internal error" not in told


def test_the_server_of_viewers_starts_without_the_names_that_windows_lacks():
    done = elsewhere("-c", SERVE)
    assert done.stdout.startswith("rerun rerun+http://127.0.0.1:"), done.stderr

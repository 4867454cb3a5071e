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
    (["run", *SHORT, "--log", "simulated.mcap", "--rrd", "simulated.rrd", "--quiet"], 0),
    (["replay", "simulated.mcap", "--verify"], 0),
    (["converge", *SHORT, "--workers", "1"], 0),
    (["info", "run.mcap"], 0),
    (["repair", "run.mcap", "repaired.mcap"], 0),
    (["compare", "run.mcap", "run.mcap"], 0),
    (["export", "run.mcap", "--csv", "table.csv"], 0),
    (["plot", "run.mcap", "com.z", "--out", "com.png"], 0),
    (["render", "run.mcap", "--png", "picture.png"], 0),
    (["view", "run.mcap", "--save", "run.rrd"], 0),
    (["sweep", "sweep.yaml", "--out", "sweep", "--workers", "1"], 0),
    (["fit", "cantilever", "--data", "data.csv", "--parameter", "gravity.2=-20:-1", "--out", "fit"], 0),
    (["design", "cantilever", "--target", "curve.csv", "--vary", "gravity.2=-20:-1", "--out", "designed"], 0),
]
"""Arguments and exit codes."""
DEAR = [
    (["run", *SHORT, "--error-estimate", "--quiet"], 0),
    (["validate", "--only", "laminate/two*", "--quick", "--out", "cases"], 0),
    (["optimise", "sweep.yaml", "--maximise", "curvature", "--trials", "1", "--out", "best", "--workers", "1"], 0),
    (["stress", "--only", CASE, "--out", "stress", "--workers", "1", "--no-shrink"], 0),
    (["bench", "--quick", "--only", "scaling", "--out", "bench"], 0),
    (["view", "run.mcap", "--screenshot", "viewer.png"], 0),
]
"""Likewise, of commands that take seconds and call no other parts of the system."""
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


def test_every_command_is_tried():
    assert {arguments[0] for arguments, _ in COMMANDS + DEAR} == set(program.commands)


def test_the_core_finds_none_of_the_names_that_windows_lacks():
    assert elsewhere("-c", LOOK).stdout == "None False False\n"


@pytest.mark.slow
@pytest.mark.parametrize("commands", [COMMANDS, pytest.param(DEAR, marks=pytest.mark.verify)], ids=["cheap", "dear"])
def test_commands_work_without_the_names_that_windows_lacks(tmp_path, commands):
    synthetic_run.run(McapRecorder(tmp_path / "run.mcap"), np.arange(3) * 0.02)
    (tmp_path / "sweep.yaml").write_text(SWEEP)
    (tmp_path / "data.csv").write_text("time,com.z [m]\n0,0\n0.001,-2.5e-6\n0.002,-1e-5\n")
    (tmp_path / "curve.csv").write_text("x,y,z\n0,0,0\n0.03,0,0\n0.06,0,0\n0.1,0,0\n")
    (tmp_path / "run_all.py").write_text(RUN_ALL)
    done = elsewhere("run_all.py", cwd=tmp_path, input=json.dumps([arguments for arguments, _ in commands]))
    found = json.loads(done.stdout.rpartition("ENDED")[2] or "[]")
    assert len(found) == len(commands), done.stderr
    for (arguments, expected), (code, told) in zip(commands, found, strict=True):
        assert code == expected and "internal error" not in told, f"{arguments}: {told}"


def test_the_server_of_viewers_starts_without_the_names_that_windows_lacks():
    done = elsewhere("-c", SERVE)
    assert done.stdout.startswith("rerun rerun+http://127.0.0.1:"), done.stderr

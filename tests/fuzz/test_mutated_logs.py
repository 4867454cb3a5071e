"""Logs and saved states with random damage are read, or refused in one line that names the file, by every command.

40 logs and 100 states by default, the same ones every time. More, and others:

    FUZZ_LOGS=2000 FUZZ_STATES=1000 FUZZ_SEED=7 pytest -m "" tests/fuzz/test_mutated_logs.py

The files that fail are kept in `.pytest_cache/fuzz/` (another folder: `FUZZ_FAILURES`).
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import shutil
import time
import warnings
from collections import Counter
from pathlib import Path

import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.state_file import write_state
from fuzz.log_mutations import write_mutated_log, write_mutated_state

LOGS = int(os.environ.get("FUZZ_LOGS", "40"))
STATES = int(os.environ.get("FUZZ_STATES", "100"))
SEED = int(os.environ.get("FUZZ_SEED", "1"))
FAILURES = Path(os.environ.get("FUZZ_FAILURES") or Path(__file__).resolve().parents[2] / ".pytest_cache" / "fuzz")
DONE, DIFFERS, REFUSED, STOPPED = range(4)
"""Exit codes."""
LONGEST = 20.0
"""CPU time of a command [s]."""
LONGEST_LINE = 2_100
"""Of a message [characters]."""
LONGEST_RUN = 7200
"""Of all files [s]."""
SCENE = "bending", ("rods.strip.stations=8",)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A log and a saved state to be damaged."""
    folder = tmp_path_factory.mktemp("whole")
    simulator = Simulator(load_scene(*SCENE))
    simulator.set_stimulus("swelling", 0.5)
    simulator.run(0.02, observers=[McapRecorder(folder / "run.mcap", rate=500.0, marker_rate=250.0)])
    write_state(folder / "state.npz", simulator.save_state(), simulator.description)
    return folder


def fault_of(arguments: list[str], path: Path) -> tuple[int, str]:
    """The exit code of a command, and what is wrong with its answer about a file; empty if nothing is."""
    out, err = io.StringIO(), io.StringIO()
    start = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        code = main(arguments)
    seconds, said = time.process_time() - start, err.getvalue()
    shown = [line for line in (*out.getvalue().splitlines(), *said.splitlines()) if not line.isprintable()]
    if seconds > LONGEST:
        return code, f"took {seconds:.1f} s"
    if shown:
        return code, f"shows what a terminal obeys: {shown[0][:200]!r}"
    if code in (DONE, STOPPED) or (code == DIFFERS and arguments[0] in ("replay", "compare")):
        return code, "internal error" if "internal error" in said else ""
    lines = said.splitlines()
    if code != REFUSED or not lines or not lines[0].startswith("bilayer: "):
        return code, f"exit code {code}: {said[-2000:]}"
    if any(path.name not in line or len(line) > LONGEST_LINE for line in lines):
        return code, f"says not which file is meant, or too much: {said[-2000:]}"
    return code, ""


def keep(path: Path) -> Path:
    """Keep a file that fails."""
    FAILURES.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copy(path, FAILURES / path.name))


def commands(path: Path, folder: Path, whole: Path) -> list[list[str]]:
    """The commands that read a log."""
    return [
        ["info", str(path)],
        ["export", str(path), "--npz", str(folder / "out.npz"), "--force"],
        ["plot", str(path), "energy/*", "--out", str(folder / "out.svg"), "--force"],
        ["view", str(path), "--save", str(folder / "out.rrd"), "--force"],
        ["replay", str(path), "--verify", "--quiet"],
        ["repair", str(path), str(folder / "out.mcap"), "--force"],
        ["compare", str(path), str(whole / "run.mcap")],
    ]


@pytest.mark.slow
@pytest.mark.timeout(LONGEST_RUN)
def test_damaged_logs_are_read_or_refused_by_every_command(whole, tmp_path):
    codes, faults = Counter(), []
    for number in range(LOGS):
        path = tmp_path / f"log-{SEED}-{number}.mcap"
        write_mutated_log(random.Random(f"{SEED} {number}"), whole / "run.mcap", path)
        for arguments in commands(path, tmp_path, whole):
            code, fault = fault_of(arguments, path)
            codes[arguments[0], code] += 1
            if fault:
                faults.append(f"{arguments[0]} {keep(path)}: {fault}")
        path.unlink()
    print(f"\n{LOGS} logs, seed {SEED}: {dict(codes)}")
    assert not faults, f"{len(faults)} faults:\n" + "\n".join(faults[:20])


@pytest.mark.slow
@pytest.mark.timeout(LONGEST_RUN)
def test_damaged_states_are_gone_on_from_or_refused(whole, tmp_path):
    codes, faults = Counter(), []
    for number in range(STATES):
        path = tmp_path / f"state-{SEED}-{number}.npz"
        write_mutated_state(random.Random(f"{SEED} {number}"), whole / "state.npz", path)
        scene, overrides = SCENE
        changes = [part for change in overrides for part in ("--set", change)]
        code, fault = fault_of(
            ["run", scene, *changes, "--from-state", str(path), "--duration", "1e-3", "--quiet"], path
        )
        codes[code] += 1
        if fault:
            faults.append(f"{keep(path)}: {fault}")
        path.unlink()
    print(f"\n{STATES} states, seed {SEED}: {dict(codes)}")
    assert not faults, f"{len(faults)} faults:\n" + "\n".join(faults[:20])

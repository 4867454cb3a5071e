"""Files made to fill the memory of their reader are read, or refused, within the memory that is documented."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from support import hostile_logs, synthetic_run

from bilayer_core import Simulator, load_scene
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.state_file import write_state
from bilayer_core.observed.frame import Description

MORE_OF_INFO = 300e6
"""Peak memory of ``bilayer info`` above that for a log of no frame [bytes]."""
MORE_OF_OTHERS = 1.5e9
"""Likewise of the other commands, which hold arrays of at most a gigabyte [bytes]."""
MORE_OF_STATES = 50e6
"""Likewise of going on from a state, above that of a whole one [bytes]."""
FRAMES, NODES = 200, 100_000
"""Of a log whose frames take 1.8 GB, and which has a few megabytes as they are all the same."""


def described() -> Description:
    """A description of few nodes."""
    return synthetic_run.description()


RUNNER = """
import json, os, subprocess, sys
with open(sys.argv[2], "w") as said:
    for words in json.load(open(sys.argv[1])):
        process = subprocess.Popen([sys.executable, "-m", "bilayer_core", *words], stdout=said, stderr=said)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        print(process.returncode, 1024 * used.ru_maxrss, used.ru_utime + used.ru_stime)
"""
"""Run commands; a small process, as a child's peak memory counts from that of the process that starts it."""


def measured(folder: Path, commands: list[list[object]]) -> tuple[list[tuple[int, float, float]], str]:
    """Exit code, peak memory [bytes] and CPU time [s] of commands, each in a process of its own, and what they said."""
    (folder / "commands").write_text(json.dumps([list(map(str, command)) for command in commands]))
    words = [sys.executable, "-c", RUNNER, str(folder / "commands"), str(folder / "said")]
    figures = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
    found = [(int(code), float(peak), float(seconds)) for code, peak, seconds in map(str.split, figures)]
    return found, (folder / "said").read_text()


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """A log of no frame, and hostile ones."""
    folder = tmp_path_factory.mktemp("hostile")
    recorder = McapRecorder(folder / "empty.mcap")
    recorder.start(described())
    recorder.close(False)
    for number, (name, data) in enumerate(hostile_logs.logs(described()).items()):
        (folder / f"{number:02} {name}.mcap").write_bytes(data)
    return folder


@pytest.mark.slow
def test_info_takes_no_more_memory_for_a_hostile_log_than_documented(hostile, tmp_path):
    paths = [hostile / "empty.mcap", *sorted(hostile.glob("[0-9]*.mcap"))]
    ((_, empty, _), *found), said = measured(tmp_path, [["info", path] for path in paths])
    for path, (code, peak, seconds) in zip(paths[1:], found, strict=True):
        print(f"{path.name:60} {code} {(peak - empty) / 1e6:6.0f} MB {seconds:5.1f} s")
    assert all(code in (0, 2) for code, _, _ in found) and "internal error" not in said
    assert max(peak for _, peak, _ in found) - empty < MORE_OF_INFO


@pytest.mark.slow
def test_commands_take_no_more_memory_for_a_log_that_unpacks_to_more_than_documented(tmp_path):
    log = tmp_path / "run.mcap"
    hostile_logs.write_repeated(log, described(), FRAMES, NODES)
    commands = [
        ["info", log],
        ["export", log, "rod/*/strain", "--npz", tmp_path / "out.npz"],
        ["plot", log, "com", "--out", tmp_path / "out.svg"],
        ["view", log, "--save", tmp_path / "out.rrd"],
        ["replay", log, "--verify"],
        ["repair", log, tmp_path / "out.mcap"],
        ["compare", log, log],
    ]
    ((_, least, _), *found), said = measured(tmp_path, commands)
    for command, (code, peak, seconds) in zip(commands[1:], found, strict=True):
        print(f"{command[0]:10} {code} {(peak - least) / 1e6:6.0f} MB {seconds:5.1f} s")
    assert "unpacks to more than 1 GB in memory" in said and "internal error" not in said
    assert all(code in (0, 2) for code, _, _ in found)
    assert max(peak for _, peak, _ in found) - least < MORE_OF_OTHERS


@pytest.mark.slow
def test_a_saved_state_that_unpacks_to_gigabytes_is_refused_in_little_memory(tmp_path):
    simulator = Simulator(load_scene("bending"))
    whole = tmp_path / "whole.npz"
    write_state(whole, simulator.save_state(), simulator.description)
    states = hostile_logs.write_states(tmp_path, json.dumps(simulator.description.state_layout))
    commands = [["run", "bending", "--from-state", path, "--duration", "1e-3", "--quiet"] for path in (whole, *states)]
    ((code, least, _), *found), said = measured(tmp_path, commands)
    for path, (_, peak, seconds) in zip(states, found, strict=True):
        print(f"{path.name:30} {(peak - least) / 1e6:6.0f} MB {seconds:5.1f} s")
    assert code == 0 and all(code == 2 for code, _, _ in found), said[-3000:]
    assert max(peak for _, peak, _ in found) - least < MORE_OF_STATES

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
import json, os, sys
from bilayer_core.cli import main

commands, figures = json.load(open(sys.argv[1])), open(os.dup(1), "w")
said = os.open(sys.argv[2], os.O_WRONLY | os.O_CREAT)
os.dup2(said, 1), os.dup2(said, 2)
main(commands[0])  # which imports what all need
for words in commands:
    child = os.fork()
    if not child:
        code = main(words)
        sys.stdout.flush()
        os._exit(code)
    _, status, used = os.wait4(child, 0)
    print(os.waitstatus_to_exitcode(status), 1024 * used.ru_maxrss, used.ru_utime + used.ru_stime, file=figures)
"""
"""Run commands, each in a copy of a process that has done the first; a copy's peak memory counts from what that has."""


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


MANY_MESSAGES = "06 many messages"
"""Takes a quarter of a minute to be refused."""


@pytest.mark.slow
@pytest.mark.parametrize("names", ["[0-9]*", pytest.param(MANY_MESSAGES, marks=pytest.mark.verify)])
def test_info_takes_no_more_memory_for_a_hostile_log_than_documented(hostile, tmp_path, names):
    logs = [path for path in sorted(hostile.glob(f"{names}.mcap")) if names == path.stem or path.stem != MANY_MESSAGES]
    paths = [hostile / "empty.mcap", *logs]
    ((_, empty, _), *found), said = measured(tmp_path, [["info", path] for path in paths])
    for path, (code, peak, seconds) in zip(paths[1:], found, strict=True):
        print(f"{path.name:60} {code} {(peak - empty) / 1e6:6.0f} MB {seconds:5.1f} s")
    assert found and all(code in (0, 2) for code, _, _ in found) and "internal error" not in said
    assert max(peak for _, peak, _ in found) - empty < MORE_OF_INFO


REFUSING = ["view log.mcap --save out.rrd", "replay log.mcap --verify"]
BY_BLOCKS = [
    "export log.mcap rod/*/strain --npz out.npz",
    "plot log.mcap com --out out.svg",
    "repair log.mcap out.mcap",
    "compare log.mcap log.mcap",
]


@pytest.mark.slow
@pytest.mark.parametrize("commands", [REFUSING, pytest.param(BY_BLOCKS, marks=pytest.mark.verify)])
def test_commands_take_no_more_memory_for_a_log_that_unpacks_to_more_than_documented(tmp_path, monkeypatch, commands):
    monkeypatch.chdir(tmp_path)
    hostile_logs.write_repeated(tmp_path / "log.mcap", described(), FRAMES, NODES)
    ((_, least, _), *found), said = measured(tmp_path, [command.split() for command in ("info log.mcap", *commands)])
    for command, (code, peak, seconds) in zip(commands, found, strict=True):
        print(f"{command:10} {code} {(peak - least) / 1e6:6.0f} MB {seconds:5.1f} s")
    assert ("unpacks to more than 1 GB in memory" in said) == (commands == REFUSING) and "internal error" not in said
    assert {code for code, _, _ in found} == {2 if commands == REFUSING else 0}, said[-3000:]
    assert max(peak for _, peak, _ in found) - least < MORE_OF_OTHERS


@pytest.mark.slow
def test_a_saved_state_that_unpacks_to_far_more_is_refused_in_little_memory(tmp_path):
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

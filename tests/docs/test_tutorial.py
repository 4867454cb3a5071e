"""The tutorial, step by step as a newcomer pastes it: commands, programs, edits, and what they print."""

import importlib.util
import os
import sys
from pathlib import Path

import pytest
from support.documents import Block, blocks, is_told, pasted
from support.processes import claimed_domain, environment

MODULES = {
    "sim_node": "bilayer_sim_ros.sim_node",
    "ramp_controller": "bilayer_sim_ros.controllers.ramp_controller",
}
RUN = ("sh", "sh ros", "python")
EDITED = "my_robot.yaml"
ROS_IS_THERE = importlib.util.find_spec("rclpy") is not None


@pytest.fixture
def commands(tmp_path):
    """Environment in which the nodes of an installation are those of this checkout."""
    directory = tmp_path / "bin"
    directory.mkdir()
    for name, module in MODULES.items():
        path = directory / name
        path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {module} "$@"\n')
        path.chmod(0o755)
    with claimed_domain() as domain:
        yield environment() | {"PATH": f"{directory}{os.pathsep}{os.environ['PATH']}", "ROS_DOMAIN_ID": str(domain)}


def edit(block: Block, path: Path) -> None:
    """Replace the lines marked − by those marked +; they must be there."""
    old, new = ("".join(f"{line[1:]}\n" for line in block.text.splitlines() if line[0] == mark) for mark in "-+")
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"line {block.line}: the scene does not have these lines:\n{old}"
    path.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_every_step_of_the_tutorial_does_what_it_says(root, tmp_path, monkeypatch, commands):
    monkeypatch.chdir(tmp_path)
    steps = [block for block in blocks(root / "docs/tutorial.md") if block.info != "console"]
    done = 0
    for step, after in zip(steps, [*steps[1:], Block("", "", 0)], strict=True):
        if step.info == "diff":
            edit(step, tmp_path / EDITED)
        elif step.info in RUN and (ROS_IS_THERE or step.info != "sh ros"):
            expected = after.text if after.info == "text" else ""
            code, output = pasted(step, {}, commands)
            assert code == (2 if expected.startswith("bilayer:") else 0), f"line {step.line}:\n{output}"
            missing = is_told(expected, output)
            assert missing is None, f"line {step.line}: {missing!r} is not in order in:\n{output}"
            done += 1
    assert done >= (9 if ROS_IS_THERE else 7)


def test_what_a_page_expects_is_looked_for_in_order():
    output = "one 1.25 mm long\ntwo\nthree"
    assert is_told("one ... long\nthree", output) is None
    assert is_told("three\none", output) == "one"
    assert is_told("one 1.3", output) == "one 1.3"

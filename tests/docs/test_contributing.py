"""The recipe for a new force in docs/contributing.md, followed to the letter in a copy of the sources."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest

NEW_FILE = re.compile(r"New file `([^`]+)`:\n\n```python\n(.*?)```", re.S)
INSERTED = re.compile(r"In `([^`]+)`, after the line `([^`]+)`:\n\n```python\n(.*?)```", re.S)
MOST_FILES = 5
SCENE = """
from support.sample_scenes import layer, rod, scene

from bilayer_core import load_scene

strip = rod([layer(thickness=2e-3)], length=0.05, stations=6)
springs = [
    {"rod": "rod", "station": 0, "anchor": [0, 0, 0], "stiffness": 5.0},
    {"rod": "rod", "station": 5, "anchor": [0.05, 0, 0], "stiffness": 5.0},
]
loaded = load_scene(scene([strip], gravity=[0, 0, -9.81], springs=springs))
"""
KNOWN = """
from bilayer_core.forces.force_register import TERMS
print(len(loaded.springs), *[name for term in TERMS for name in term.names])
"""
PROGRAM = """
import json

import numpy as np

from bilayer_core import Simulator
from bilayer_core.engine.evaluator import Evaluator

simulator = Simulator(loaded)
simulator.solve_static()
ends = simulator.positions[[0, 5]]
model, state = simulator.model, simulator._state
evaluator = Evaluator(model)
at, moved = evaluator.new(), evaluator.new()
evaluator.take_state(state, at)
nothing = np.zeros((len(model.rods.joint_a), 3))
evaluator.stand_still(state, at, 1.0, np.zeros(model.rods.edge_count), nothing, np.zeros(0))
evaluator.start_stage(at)


def energy(step):
    evaluator.move(at, step, np.zeros((0, 6)), moved)
    return evaluator.evaluate(moved, ["springs"])["springs"], evaluator.sums.gradient.copy()


unknowns = [model.layout.node[node] + axis for node in (0, 5) for axis in (0, 2)]
h, errors = 1e-5, []
gradient = energy(np.zeros(model.layout.size))[1]
for unknown in unknowns:
    step = np.zeros(model.layout.size)
    step[unknown] = h
    errors.append((energy(step)[0] - energy(-step)[0]) / (2 * h) - gradient[unknown])
print(json.dumps({
    "terms": simulator.summary()["terms"],
    "energy": simulator.energy(),
    "weight": 9.81 * float(model.rods.node_mass.sum()),
    "ends": ends.tolist(),
    "stable": simulator.solve_static().stable,
    "gradient": gradient[unknowns].tolist(),
    "errors": errors,
}))
"""


@pytest.fixture
def python_with_force(root, tmp_path):
    """Runs a program where the sources are a copy that has the force of the recipe."""
    page = (root / "docs/contributing.md").read_text(encoding="utf-8")
    page = page[page.index("## Add a force") : page.index("## Add an integrator")]
    tree = tmp_path / "tree"
    for part in ("bilayer_core", "config"):
        shutil.copytree(root / part, tree / part, ignore=shutil.ignore_patterns("__pycache__"))
    touched = set()
    for name, text in NEW_FILE.findall(page):
        assert not (tree / name).exists()
        (tree / name).write_text(text, encoding="utf-8")
        touched.add(name)
    for name, line, text in INSERTED.findall(page):
        source = (tree / name).read_text(encoding="utf-8")
        assert source.count(line + "\n") == 1, f"{name}: {line}"
        (tree / name).write_text(source.replace(line + "\n", f"{line}\n{text}"), encoding="utf-8")
        touched.add(name)
    assert 0 < len(touched) <= MOST_FILES
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(tree), str(root / "tests")]),
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "BILAYER_JIT_AHEAD": "0",
    }

    def run(program):
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=tree)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_a_force_added_by_the_recipe_is_registered_and_in_scenes(python_with_force):
    assert python_with_force(SCENE + KNOWN).split()[:2] == ["2", "springs"]


@pytest.mark.verify
def test_a_force_added_by_the_recipe_acts_with_tested_derivatives_and_a_listed_energy(python_with_force):
    found = json.loads(python_with_force(SCENE + PROGRAM))
    left, right = (-end[2] for end in found["ends"])
    assert found["terms"]["springs"] == "active" and found["stable"]
    assert 5.0 * left == pytest.approx(0.5 * found["weight"], rel=1e-6)  # each bears half of the weight
    assert 5.0 * right == pytest.approx(0.5 * found["weight"], rel=1e-6)
    sides = [0.5 * k * (x - a) ** 2 for k, x, a in ((5.0, found["ends"][0][0], 0.0), (5.0, found["ends"][1][0], 0.05))]
    assert found["energy"]["springs"] == pytest.approx(2.5 * left**2 + 2.5 * right**2 + sum(sides), rel=1e-9)
    largest = max(map(abs, found["gradient"]))
    assert largest > 0.0 and max(map(abs, found["errors"])) < 1e-7 * largest

"""Each kernel is compiled for one set of types: a second one costs seconds at every first start."""

import json
import os
import subprocess
import sys
from pathlib import Path

# In an interpreter of its own: other tests call kernels with arrays that the simulator never makes.
SURVEY = """
import importlib, json, pkgutil
from numba.core.registry import CPUDispatcher
from planar_scenes import AHEAD, everything_in_plane
from sample_scenes import contact, everything, layer, rod, scene
from bilayer_core import Simulator, load_scene

ribbons = [rod([layer()], name="a"), rod([layer(), layer("top")], name="b", start=(0, 0, 2.3e-3))]
touching = scene(ribbons, contact=contact(coefficient=0.5), gravity=[0, 0, -10])
for description in (everything(), everything(stations=7), scene([rod([layer()])]), touching):
    for model in ("two_rod", "laminate"):
        simulator = Simulator(load_scene(description), model=model, budget=True)
        simulator.run(0.005)
        simulator.frame()
        Simulator(load_scene(description), model=model, tolerance=1e-3).run(0.005)
for description in (everything_in_plane(AHEAD["oblique"]), scene([rod([layer()])]), touching):
    for model in ("two_rod", "laminate"):
        Simulator(load_scene(description), model=model, dimension=2, budget=True).run(0.005)
Simulator(load_scene(scene([rod([layer(), layer("top")])]))).solve_static()

used = {}
for part in ("kinematics", "contact", "forces", "solve", "integrate"):
    package = importlib.import_module(f"bilayer_core.{part}")
    for info in pkgutil.iter_modules(package.__path__):
        for name, value in vars(importlib.import_module(f"bilayer_core.{part}.{info.name}")).items():
            # small functions whose names begin with _ are inlined
            if isinstance(value, CPUDispatcher) and not name.startswith("_") and value.signatures:
                used[f"{value.py_func.__module__}.{name}"] = len(value.signatures)
print(json.dumps(used))
"""


def test_scenes_of_all_kinds_use_one_specialisation_of_each_kernel():
    tests = Path(__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tests.parent), str(tests)])}
    found = subprocess.run([sys.executable, "-c", SURVEY], env=environment, capture_output=True, text=True, check=True)
    used = json.loads(found.stdout)
    assert len(used) > 15
    assert {name: count for name, count in used.items() if count > 1} == {}

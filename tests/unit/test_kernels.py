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
from bilayer_core.jit.inner_compiler import InnerFunction
from planar_scenes import AHEAD, everything_in_plane
from sample_scenes import contact, everything, layer, rod, scene
from bilayer_core import Simulator, load_scene

ribbons = [rod([layer()], name="a"), rod([layer(), layer("top")], name="b", start=(0, 0, 2.3e-3))]
touching = scene(ribbons, contact=contact(coefficient=0.5), gravity=[0, 0, -10])
def run(description, **settings):
    simulator = Simulator(load_scene(description), **settings)
    simulator.run(0.005)
    return simulator

for description in (everything(), everything(stations=7), scene([rod([layer()])]), touching):
    for model in ("two_rod", "laminate"):
        run(description, model=model, budget=True).frame()
        run(description, model=model, tolerance=1e-3)
for description in (everything_in_plane(AHEAD["oblique"]), scene([rod([layer()])]), touching):
    for model in ("two_rod", "laminate"):
        run(description, model=model, dimension=2, budget=True)
run(scene([rod([layer(), layer("top")])])).solve_static()

used = {}
for part in ("kinematics", "contact", "forces", "solve", "integrate"):
    package = importlib.import_module(f"bilayer_core.{part}")
    for info in pkgutil.iter_modules(package.__path__):
        for name, value in vars(importlib.import_module(f"bilayer_core.{part}.{info.name}")).items():
            # what only kernels call is compiled within them
            if isinstance(value, CPUDispatcher) and not isinstance(value, InnerFunction) and value.signatures:
                if value.py_func.__module__.endswith(".band"):  # one for each half-bandwidth
                    continue
                used[f"{value.py_func.__module__}.{name}"] = len(value.signatures)
print(json.dumps(used))
"""

PLAIN_RUN = """
import importlib, json, pkgutil
from bilayer_core.jit import KernelFunction
from sample_scenes import everything
from bilayer_core import Simulator, load_scene

simulator = Simulator(load_scene(everything()), dt=1e-3)
simulator.run(0.003)
simulator.contact_forces, simulator.curvatures
entries = []
for part in ("forces", "solve", "march"):
    package = importlib.import_module(f"bilayer_core.{part}")
    for info in pkgutil.iter_modules(package.__path__):
        for name, value in vars(importlib.import_module(f"bilayer_core.{part}.{info.name}")).items():
            if isinstance(value, KernelFunction) and value.signatures:
                entries.append(name)
print(json.dumps(entries))
"""


def _printed_by(program):
    tests = Path(__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tests.parent), str(tests)])}
    found = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return json.loads(found.stdout)


def test_a_run_in_a_loop_enters_no_other_kernels():
    assert set(_printed_by(PLAIN_RUN)) == {"take_steps"}


def test_scenes_of_all_kinds_use_one_specialisation_of_each_kernel():
    used = _printed_by(SURVEY)
    assert len(used) > 15
    assert {name: count for name, count in used.items() if count > 1} == {}

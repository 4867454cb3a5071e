"""Each kernel is compiled for one set of types: a second one costs seconds at every first start."""

import importlib
import pkgutil

from numba.core.registry import CPUDispatcher
from sample_scenes import everything, layer, rod, scene

import bilayer_core
from bilayer_core import Simulator, load_scene

PARTS = ("kinematics", "contact", "forces", "solve", "integrate")


def kernels():
    """All kernels of the core by name, without the small functions that they inline (whose names begin with _)."""
    found = {}
    for part in PARTS:
        package = importlib.import_module(f"bilayer_core.{part}")
        for info in pkgutil.iter_modules(package.__path__):
            module = importlib.import_module(f"bilayer_core.{part}.{info.name}")
            for name, value in vars(module).items():
                if isinstance(value, CPUDispatcher) and not name.startswith("_"):
                    found[f"{value.py_func.__module__}.{name}"] = value
    return found


def test_scenes_of_all_kinds_use_one_specialisation_of_each_kernel():
    assert bilayer_core.__name__ in next(iter(kernels()))
    for description in (everything(), everything(stations=7), scene([rod([layer()])])):
        simulator = Simulator(load_scene(description))
        simulator.run(0.005)
        simulator.frame()
    used = {name: len(kernel.signatures) for name, kernel in kernels().items() if kernel.signatures}
    assert len(used) > 15
    assert {name: count for name, count in used.items() if count > 1} == {}

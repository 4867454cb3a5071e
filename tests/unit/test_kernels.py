"""What the interpreter enters: pieces of the engine alone."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import gc, json
from support.sample_scenes import everything
from bilayer_core import Simulator, load_scene
from bilayer_core.jit.kernel import Kernel
from bilayer_core.jit.piece import PIECES

simulator = Simulator(load_scene(everything()), dt=1e-3, budget=True)
simulator.run(0.003)
simulator.contact_forces, simulator.curvatures
compiled = [of.__name__ for of in gc.get_objects() if type(of) is Kernel and "compiled" in vars(of)]
print(json.dumps([sorted(compiled), sorted(name for name, of in PIECES.items() if of.seconds)]))
"""


NEEDED = """
import json, sys
from bilayer_core import Simulator, load_scene
from bilayer_core.engine.needed_pieces import needed_pieces
from bilayer_core.jit.piece import PIECES

simulator = Simulator(load_scene(sys.argv[1]))
needed = needed_pieces(simulator.model)
simulator.run(0.1)
curvature = [rod.section_curvature for rod in simulator.rods.values()]
slow = sorted({"numba", "scipy.linalg", "scipy.special", "pint", "rich", "matplotlib"} & set(sys.modules))
print(json.dumps([sorted(needed), sorted(name for name, of in PIECES.items() if of.seconds), slow]))
"""

DECLARED = """
import json
from importlib import import_module
from bilayer_core.jit.compile_all import ENGINE
from bilayer_core.jit.piece import PIECES

import_module(ENGINE)
before = set(PIECES)
import_module("bilayer_core.simulation.gradients.run_response")
print(json.dumps(sorted(set(PIECES) - before)))
"""


def _printed_by(program, *arguments):
    tests = Path(__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tests.parent), str(tests)])}
    found = subprocess.run(
        [sys.executable, "-c", program, *arguments], env=environment, capture_output=True, text=True, check=True
    )
    return json.loads(found.stdout)


def test_a_warm_run_compiles_nothing_and_loads_only_the_pieces_it_needs():
    compiled, loaded = _printed_by(PROGRAM)
    if compiled:  # what was not in the cache
        compiled, loaded = _printed_by(PROGRAM)
    assert not compiled
    assert "assemble_in_space" in loaded and "make_step" in loaded
    assert not {"assemble_in_plane", "add_elasticity_in_plane", "adapt", "factor_5"} & set(loaded)


@pytest.mark.parametrize("scene", ["gripping", "films"])
def test_a_run_knows_its_pieces_and_loads_no_library_in_vain(scene):
    *pieces, slow = _printed_by(NEEDED, scene)
    if slow:  # of what was not in the cache
        *pieces, slow = _printed_by(NEEDED, scene)
    needed, loaded = map(set, pieces)
    assert slow == []
    assert loaded <= needed and len(needed) < 90
    assert not {"factor_5", "begin_light", "add_drag"} & needed


def test_pieces_of_derivatives_are_declared_with_the_engine_where_workers_look_for_them():
    assert _printed_by(DECLARED) == []

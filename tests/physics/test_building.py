"""What is built of a scene depends on the scene alone, and copies built at once are those built one by one."""

import dataclasses
import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.sample_scenes import contact, everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.jit import Record
from bilayer_core.model.build_model import build_model

CHANGES = {
    "modulus": {"materials.gel.youngs_modulus": 1.1e6},
    "density": {"materials.gel.density": 1010.0},
    "viscosity": {"materials.gel.retardation_time": 2e-3},
    "width": {"rods.arm.width": 0.0051},
    "thickness": {"rods.arm.layers.active.thickness": 1.01e-3},
    "gain": {"rods.arm.layers.active.eigenstrain.gain": 0.061},
    "stations": {"rods.arm.stations": 7},
    "copies": {"rods.arm.pattern.count": 3},
    "place": {"bodies.ball.position": [0.0, 0.0, 0.0208]},
    "mass": {"bodies.ball.motion.mass": 0.011},
    "barrier": {"contact.barrier_distance": 2.1e-4},
    "friction": {"contact.friction.forward": 0.31},
    "gravity": {"gravity": [0.3, 0.2, -10.1]},
    "drag": {"fluid.drag_across": 1.21},
    "load": {"loads.tug.position": 3.4e-3},
}
"""One number of `everything` each."""


def parts(found, name=""):
    """Arrays and numbers of a dataclass or a record by name, those of its parts among them."""
    names = found.names if isinstance(found, Record) else [field.name for field in dataclasses.fields(found)]
    for field in names:
        value, key = getattr(found, field), f"{name}.{field}"
        for place, own in enumerate(value) if isinstance(value, tuple) else [(0, value)]:
            if dataclasses.is_dataclass(own) or isinstance(own, Record):
                yield from parts(own, f"{key}[{place}]")
            elif isinstance(own, (np.ndarray, int, float, str)):
                yield f"{key}[{place}]", np.asarray(own)


def digest(change, model):
    """Of all arrays of a model, and of the energies that are found with its records."""
    simulator = Simulator(load_scene(everything(), CHANGES.get(change, {})), model=model)
    found = hashlib.sha256()
    for name, array in parts(simulator.model):
        found.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
    found.update(repr(simulator.energy()).encode() + simulator.save_state().tobytes())
    return found.hexdigest()


def digests(names):
    """Of scenes one after the other, every other one of two rods."""
    models = dict(zip(["nothing", *CHANGES], ["laminate", "two_rod"] * len(CHANGES), strict=False))
    return {name: digest(name, models[name]) for name in names}


def test_what_is_built_does_not_depend_on_what_was_built_before():
    names = ["nothing", *CHANGES]
    program = f"import json, test_building; print(json.dumps(test_building.digests({names[::-1]})))"
    path = [str(Path(__file__).parent), *sys.path]
    backward = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {path}; {program}"], capture_output=True, text=True
    )
    forward = digests(names)
    assert json.loads(backward.stdout.splitlines()[-1]) == forward, backward.stderr
    assert len(set(forward.values())) == len(forward)


def turned(count):
    """Places that are no multiples of each other."""
    return [{"rotation": [0.1 * k, 0.2, 0.3 * k], "position": [0.0, 0.05 * k, 0.01 * k]} for k in range(count)]


PATTERNS = {
    "list": {"type": "list", "placements": turned(3)},
    "mirror": {"type": "mirror", "axis": [0.0, 0.8, 0.6], "center": [0, 0.03, 0]},
}


def varied(pattern):
    """A rod with all that copies have."""
    whole = {"stimulus": "heat", "gain": 0.02}
    middle = {"stimulus": "heat", "gain": 0.01, "interval": [0.002, 0.014]}
    strip = rod(
        [
            layer("lower", eigenstrain=[whole, middle], natural_twist=3.0),
            layer("upper", eigenstrain=middle, natural_curvature=5.0, interval=[0.0, 0.015]),
        ],
        length=0.02,
        stations=11,
        clamp_start="wall",
        clamp_end="hand",
        friction_axis="across",
        imperfection={"shape": "bow", "size": 1e-4},
        pattern=pattern,
    )
    return scene(
        [strip],
        stimuli={"heat": {"schedule": {"type": "hold", "value": 0.5}}},
        bodies=[fixed("wall"), fixed("hand", (0.02, 0.01, 0))],
        contact=contact(coefficient=0.5, speed_threshold=1e-2),
        fluid={"drag_along": 0.3, "drag_across": 1.2, "added_mass": True},
    )


@pytest.mark.parametrize("kind", PATTERNS)
@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_copies_built_at_once_are_those_built_one_by_one_bit_for_bit(model, kind):
    count, built = (2 if kind == "mirror" else 3), []
    for gains in ([1.0] * count, [1.0 + 0.1 * k for k in range(count)]):
        loaded = load_scene(varied({**PATTERNS[kind], "gains": gains}))
        assert len({id(copy.rod) for copy in loaded.rods[0].copies}) == len(set(gains))
        built.append(dict(parts(build_model(loaded, model, 3))))
    at_once, one_by_one = built
    assert at_once.keys() == one_by_one.keys() and len(at_once[".drives[0].driven_edge[0]"]) > 0
    differing = {name for name in at_once if at_once[name].tobytes() != one_by_one[name].tobytes()}
    assert ".drives[0].law_gain[0]" in differing
    of_laws = tuple(f".drives[0].{name}" for name in ("law_", "field_", "mode_", "driven_law", "driven_joint_law"))
    assert {name for name in differing if not name.startswith(of_laws)} == set()

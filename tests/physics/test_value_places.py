"""Values of profiles that are changed together, against a model for each."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.simulation.at_rest import equilibrium_of
from bilayer_core.simulation.gradients import equilibrium_response, value_places
from bilayer_core.simulation.gradients.parameters import SMALL

ANGLE, THICKNESS = "rods.ribbon.layers.lower.fibres.angle", "rods.strip.layers.active.thickness"
HANGING = {"gravity": [0, 0, -9.81], "rods.strip.stations": 61}
POST = {"name": "post", "type": "sphere", "radius": 0.005, "position": [0.03, 0, -0.0068]}
ON_A_POST = HANGING | {"obstacles": [POST], "contact": {"barrier_distance": 2e-4, "stiffness": "1 MPa"}}
ROW = {"rods.strip.pattern": {"type": "translation", "step": [0, 0.05, 0], "count": 2}}
WALL = {"name": "wall", "position": [0, 0, 0], "motion": {"type": "prescribed"}}
BLOCK = {
    "name": "block",
    "position": [0.1, 0, 0],
    "motion": {"type": "free", "mass": "2 g", "inertia": [1e-8, 1e-8, 1e-8]},
}
WEIGHT = {"bodies": [WALL, BLOCK], "rods.strip.clamp_end": "block"}
LEFT_OUT = 100.0
"""Of one-sided differences, over their steps: a model for each value moves the curve and the rest at once."""
SCENES = {
    "a beam": ("bending", HANGING, THICKNESS, {"swelling": 0.6}, 1e-3),
    "two rods": ("bending", HANGING | {"solver.model": "two_rod"}, THICKNESS, {"swelling": 0.6}, 1e-3),
    "in space": ("bending", HANGING | {"solver.dimension": 3}, THICKNESS, {"swelling": 0.6}, 1e-3),
    "a strip": ("bending", HANGING | {"rods.strip.section": "strip"}, THICKNESS, {"swelling": 0.6}, 1e-3),
    "on a post": ("bending", ON_A_POST, THICKNESS, {"swelling": 0.6}, 1e-3),
    "copies": ("bending", HANGING | ROW, THICKNESS, {"swelling": 0.6}, 1e-3),
    "width": ("bending", HANGING, "rods.strip.width", {"swelling": 0.6}, 5e-3),
    "angle": (
        "helical_ribbon",
        {"rods.ribbon.width": 2e-3},
        "rods.ribbon.layers.lower.fibres.angle",
        {"humidity": 0.4},
        -0.7,
    ),
    "a free body": ("bending", HANGING | WEIGHT, THICKNESS, {"swelling": 0.6}, 1e-3),
}


def columns(scene, overrides, path, stimuli, value, count=16, inner=slice(None)):
    """Derivatives by values of a profile together and alone, and how many models they took."""
    length = next(rod.path.length for rod in load_scene(scene, overrides).rods if rod.name == path.split(".")[1])
    values = value * (1.0 + 0.2 * np.random.default_rng(0).random(count))
    values[-1] = values[0]  # as those of a ring have to be
    profile = {"at": np.linspace(0.0, length, count).tolist(), "value": values.tolist()}
    simulator = Simulator(load_scene(scene, overrides | {path: profile}))
    for channel, of in stimuli.items():
        simulator.set_stimulus(channel, of)
    simulator.solve_static(1e-14)
    here, models = equilibrium_of(simulator), []
    made = here._builders.model_of
    here._builders = replace(here._builders, model_of=lambda scene: models.append(scene) or made(scene))
    parameters = here.parameters([f"{path}.value"])[f"{path}.value"][inner]
    alone = np.concatenate([here.velocities([parameter])[0] for parameter in parameters], axis=-1)
    models.clear()
    together = here.velocities(parameters)[0]
    return together - together[:1], alone - alone[:1], len(models)


@pytest.mark.parametrize("case", SCENES)
def test_values_that_are_changed_together_give_the_derivatives_of_a_model_each(case):
    together, alone, models = columns(*SCENES[case])
    assert models <= 9
    assert np.abs(together - alone).max() < LEFT_OUT * SMALL * np.abs(alone).max()


def test_what_does_not_depend_on_the_height_of_the_curve_is_told_apart_to_rounding():
    together, alone, _ = columns(*SCENES["two rods"])
    assert np.abs(together - alone).max() < 1e-12 * np.abs(alone).max()


def test_values_that_act_further_than_their_places_get_a_model_each(monkeypatch):
    monkeypatch.setattr(value_places, "REACH", -3)
    together, alone, models = columns(*SCENES["a beam"])
    assert models > 16
    assert np.array_equal(together, alone)


def test_the_ends_of_a_ring_are_neighbours(monkeypatch):
    for module in (equilibrium_response, value_places):  # as nothing holds a ring, rounding moves it
        monkeypatch.setattr(module, "SMALL", 10.0 * SMALL)
    circle = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.1 / (2.0 * math.pi)}
    alone = {"rods.strip.clamp_start": None, "bodies": [], "rods.strip.stations": 61}
    ring = alone | {"rods.strip.path": circle | {"angle": "360 deg", "closed": True}, "rods.strip.section": "beam"}
    together, alone, models = columns("bending", ring, THICKNESS, {"swelling": 0.1}, 1e-3, inner=slice(1, -1))
    assert models < 14
    assert np.abs(together - alone).max() < LEFT_OUT * 10.0 * SMALL * np.abs(alone).max()

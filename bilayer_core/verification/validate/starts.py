"""Starts: robots in motion, inside a barrier, and settled on the ground."""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import GROUND, contact, layer, rod, scene
from bilayer_core.verification.validate.validation_case import cases

SPEED, SPIN, FLIGHT = 1.0, 2.0, 0.1
"""Of what is thrown [m/s], of what spins [rad/s], and how long either flies [s]."""
GRAVITY, GAP, BARRIER, SOFT = 9.81, 5e-5, 5e-4, 1e4
"""Of a strip that starts inside a barrier: [m/s²], gap and barrier distance [m], stiffness [Pa]."""


def _free(dimension: int) -> dict:
    """Return settings of the solver for adaptive steps."""
    return {"dimension": dimension, "dt": None, "integrator": "auto", "model": "laminate"}


@cache
def thrown(dimension: int, model: str) -> float:
    """Return the mean speed of the mass centre of a strip that hangs on a thrown hub of its own mass [m/s]."""
    motion = {"type": "free", "mass": 2e-3, "inertia": [1e-7] * 3, "velocity": [0, 0, SPEED]}
    strip = rod([layer(thickness=1e-3), layer("upper")], clamp_start="hub")
    hub = {"name": "hub", "position": [0, 0, 0], "motion": motion}
    solver = _free(dimension) | {"model": model}
    simulator = Simulator(load_scene(scene([strip], solver, bodies=[hub])))
    start = simulator.com
    simulator.run(FLIGHT)
    return float((simulator.com - start)[2]) / FLIGHT


@cache
def spun(dimension: int, model: str) -> float:
    """Return the angle by which a free strip has turned that starts with a spin about y [rad]."""
    strip = rod([layer(thickness=1e-3), layer("upper")])
    solver = _free(dimension) | {"model": model, "tolerance": 1e-6}
    simulator = Simulator(load_scene(scene([strip], solver, angular_velocity=[0, SPIN, 0])))
    simulator.run(FLIGHT)
    along = simulator.positions[20] - simulator.positions[0]
    return math.atan2(-along[2], along[0])


def lying(start: str, dimension: int, height: float, barrier: float, stiffness: float, thickness: float) -> Simulator:
    """Return a simulator of a strip over the ground, `height` from it to the strip's middle [m]."""
    strip = rod([layer(thickness=thickness)], start=(0, 0, height))
    touching = contact(barrier) | {"stiffness": stiffness}
    content = scene([strip], _free(dimension), start=start, obstacles=[GROUND], contact=touching)
    return Simulator(load_scene(content | {"gravity": [0, 0, -GRAVITY]}))


@cache
def rise(dimension: int) -> float:
    """Return the height to which a barrier throws a strip that starts inside it [m]."""
    simulator = lying("placed", dimension, 0.5e-3 + GAP, BARRIER, SOFT, 1e-3)
    simulator.run(FLIGHT + 0.05)
    return simulator.statistics.com_max_height - (0.5e-3 + GAP)


def _stored_height() -> float:
    """Return the height at which a strip has the energy that the barrier stores at its gap [m]."""
    stored = SOFT * (GAP - BARRIER) ** 2 * math.log(BARRIER / GAP)  # of each metre [J/m]
    return stored / (1000.0 * 0.01 * 1e-3 * GRAVITY)


@cache
def resting_gap(dimension: int) -> float:
    """Return the gap at which a strip of 10 × 2 mm starts that settles, from inside the barrier [mm]."""
    simulator = lying("settle", dimension, 1e-3 + 3e-4, 1e-3, 1e7, 2e-3)
    return 1e3 * (float(np.mean(simulator.positions[:, 2])) - 1e-3)


CASES = [
    *cases(
        "starts/thrown hub with a strip/{}-D {}",
        "the hub's speed: nothing is strained",
        1e-10,
        lambda dimension, model: (thrown(dimension, model), SPEED),
        product((2, 3), ("laminate", "two_rod")),
        unit="m/s",
    ),
    *cases(
        "starts/spinning strip/{}-D {}",
        "spin × time",
        1e-4,
        lambda dimension, model: (spun(dimension, model), SPIN * FLIGHT),
        product((2, 3), ("laminate", "two_rod")),
        unit="rad",
    ),
    *cases(
        "starts/inside the barrier/{}-D rise",
        "K b(d)/(ρ w h g): the height with the energy that the barrier stores",
        0.01,
        lambda dimension: (1e3 * rise(dimension), 1e3 * _stored_height()),
        (2, 3),
        unit="mm",
    ),
    *cases(
        "starts/settled/{}-D gap",
        "force of the barrier = weight, by bisection",
        1e-6,
        lambda dimension: (resting_gap(dimension), 0.9974448),
        (2, 3),
        unit="mm",
    ),
]

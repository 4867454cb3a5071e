"""Force and moment that clamps bear: weight of a cantilever, and a bilayer that two clamps block."""

from __future__ import annotations

from functools import cache

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

SOFT = {"youngs_modulus": 3e5, "poisson_ratio": 0.5, "density": 1000.0}
GRAVITY = np.array([0.4, 0.0, -9.81])
THICK, THIN, WIDTH, STRAIN = 1.5e-3, 1e-3, 5e-3, 0.03
SIZES = [(model, dimension) for model in ("laminate", "two_rod") for dimension in (2, 3)]


def cantilever(model: str, dimension: int, retardation_time: float = 0.0, **steps) -> Simulator:
    """Return a simulator of a soft bilayer 60 mm long, which falls from its clamp."""
    strip = rod(
        [layer("bottom"), layer("top", thickness=0.5e-3)], 0.06, 21, start=(0, 0, 0.02), name="arm", clamp_start="wall"
    )
    wall = fixed(position=(-0.01, 0, 0.02))
    content = scene([strip], bodies=[wall], gravity=GRAVITY.tolist(), materials={"gel": SOFT})
    content["materials"]["gel"] |= {"retardation_time": retardation_time}
    return Simulator(load_scene(content), model=model, dimension=dimension, **steps)


def load_of_nodes(simulator: Simulator, acceleration: np.ndarray) -> np.ndarray:
    """Return the weight [N] of all nodes less their inertia, and its moment about the clamp [N m], shape (6,)."""
    force = simulator.model.rods.node_mass[:, None] * (GRAVITY - acceleration)
    arms = simulator.positions - simulator.clamps["arm.start"].position
    return np.concatenate([force.sum(axis=0), np.cross(arms, force).sum(axis=0)])


@cache
def _hanging(model: str, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    simulator = cantilever(model, dimension)
    simulator.solve_static()
    return simulator.clamps["arm.start"].wrench, load_of_nodes(simulator, np.zeros(3))


@cache
def _blocked(model: str, dimension: int) -> np.ndarray:
    """Return the force and moment on the second of two clamps."""
    layers = [layer("bottom", THICK), layer("top", THIN, eigenstrain={"stimulus": "humidity", "gain": STRAIN})]
    strip = rod(layers, 0.03, 13, width=WIDTH, clamp_start="left", clamp_end="right")
    content = scene(
        [strip],
        bodies=[fixed("left"), fixed("right", (0.03, 0, 0))],
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 1.0}}},
        materials={"gel": SOFT},
    )
    simulator = Simulator(load_scene(content), model=model, dimension=dimension)
    simulator.solve_static()
    return simulator.bodies["right"].clamp_wrench


@cache
def _held_tip(model: str, dimension: int, stations: int) -> float:
    """Return the force across [N] on a joint that slides along the strip and turns, at the tip of a bilayer that would
    bend.
    """
    layers = [layer("bottom", THICK), layer("top", THIN, eigenstrain={"stimulus": "humidity", "gain": SMALL})]
    strip = rod(layers, LENGTH, stations, width=WIDTH, clamp_start="wall", clamp_end="tip")
    tip = {"type": "guided", "axis": [1, 0, 0], "hinge": [0, 1, 0]}
    content = scene(
        [strip],
        bodies=[fixed("wall"), {"name": "tip", "position": [LENGTH, 0, 0], "motion": tip}],
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 1.0}}},
        materials={"gel": SOFT},
    )
    simulator = Simulator(load_scene(content), model=model, dimension=dimension)
    simulator.solve_static()
    return -float(simulator.bodies["tip"].clamp_wrench[2])


SMALL, LENGTH = 1e-4, 0.06
CURVATURE = (
    6.0
    * SMALL
    * THICK
    * THIN
    * (THICK + THIN)
    / (THICK**4 + THIN**4 + 4.0 * THICK**3 * THIN + 4.0 * THICK * THIN**3 + 6.0 * THICK**2 * THIN**2)
)
"""Of the free bilayer, of one modulus (Timoshenko 1925) [1/m]."""
BENDING_STIFFNESS = SOFT["youngs_modulus"] * WIDTH * (THICK + THIN) ** 3 / 12.0
FORCE = SOFT["youngs_modulus"] * WIDTH * THIN * STRAIN
CASES = [
    *(
        Case(
            f"reactions/cantilever/{dimension}-D {model}/{what}",
            "weight of all nodes, and its moment about the clamp",
            1e-9,
            lambda model=model, dimension=dimension, k=k, sign=sign: tuple(
                sign * 1e3 * wrench[k] for wrench in _hanging(model, dimension)
            ),
            unit=unit,
        )
        for model, dimension in SIZES
        for what, k, sign, unit in (("weight", 2, -1.0, "mN"), ("pull", 0, 1.0, "mN"), ("moment", 4, 1.0, "mN m"))
    ),
    *(
        Case(
            f"reactions/blocked bilayer/{dimension}-D {model}/{what}",
            f"{formula}: straight between two clamps, only the upper layer is strained",
            1e-9,
            lambda model=model, dimension=dimension, k=k, answer=answer: (
                1e3 * _blocked(model, dimension)[k],
                1e3 * answer,
            ),
            unit=unit,
        )
        for model, dimension in SIZES
        for what, k, answer, unit, formula in (
            ("force", 0, FORCE, "mN", "E w h₂ η"),
            ("moment", 4, 0.5 * THIN * FORCE, "mN m", "E w h₂ η h₂/2 about the interface"),
        )
    ),
    *cases(
        "reactions/blocked tip/{1}-D {0}",
        "3 EI κ/2L: a clamped bilayer that would bend by κ, its tip kept in line by a joint",
        1e-3,
        lambda model, dimension: (
            1e3 * _held_tip(model, dimension, 61),
            1e3 * 1.5 * BENDING_STIFFNESS * CURVATURE / LENGTH,
        ),
        SIZES,
        unit="mN",
    ),
]

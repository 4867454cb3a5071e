"""Jumps of a free strip that curls up against the ground, as one curve and as two rods.

The judge is a planar chain of its own, whose nodes carry mass, integrated by LSODA. With the turn φ between edges of
rest length l, an edge's length n and the directions of edges, which turn at the rate ω,

    T = EA (n/l − 1 − η/2 + τ ṅ/l),    M = EI [φ/l − κ + τ (ω₊ − ω₋)/l],    κ = −3η/2H (Timoshenko)

with the eigenstrain η of the upper of two alike layers and the retardation time τ of the material. The barrier of the
ground pushes a node with the force −K l b′(d).

Only a material that damps has such an answer. Without it (τ = 0) the vibrations of a strip that leaves the ground
decide how high it rises: from 21 to 161 stations by 14.66 to 14.80 mm as one curve, 14.62 to 14.71 mm as two rods.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from bilayer_core.observed.frame import Frame
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import GROUND, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

Array = np.ndarray
LENGTH, WIDTH, THICKNESS = 0.1, 0.01, 2e-3
STATIONS, NODES = 81, 41
"""Of the strip, and of the judge's chain."""
MODULUS, DENSITY, RETARDATION = 1e6, 1000.0, 3e-4
STRAIN, LAG = -0.05, 5e-3
"""Eigenstrain of the upper layer, and its time constant [s]."""
BARRIER, CONTACT, GRAVITY = 2e-4, 1e7, 9.81
UNTIL, RATE = 0.09, 2000.0
START = 0.5 * THICKNESS + 0.95 * BARRIER
"""Height of the strip at rest [m]."""


class _Rise:
    """Observer of the height of the mass centre [m]."""

    rate = RATE

    def start(self, description) -> None:
        self.heights: list[float] = []

    def observe(self, frame: Frame) -> None:
        self.heights.append(float(frame.com[2]))

    def close(self, complete: bool, termination) -> None:
        pass


def rise(model: str, retardation: float = RETARDATION, stations: int = STATIONS) -> float:
    """Return how far the mass centre rises [mm], by a model."""
    law = {"stimulus": "heat", "gain": STRAIN, "time_constant": LAG}
    half, gel = 0.5 * THICKNESS, {"youngs_modulus": MODULUS, "poisson_ratio": 0.5, "density": DENSITY}
    layers = [layer("lower", half), layer("upper", half, eigenstrain=law)]
    content = scene(
        [rod(layers, LENGTH, stations, start=(-0.5 * LENGTH, 0, START), width=WIDTH)],
        gravity=[0, 0, -GRAVITY],
        duration=UNTIL,
        materials={"gel": gel | {"retardation_time": retardation}},
        stimuli={"heat": {"schedule": {"type": "table", "times": [0, 1e-6], "values": [0, 1]}}},
        obstacles=[GROUND],
        contact={"barrier_distance": BARRIER, "stiffness": CONTACT, "friction": None},
    )
    content["solver"] = {"model": model, "tolerance": 1e-6}
    seen = _Rise()
    Simulator(load_scene(content)).run(observers=[seen])
    return 1e3 * (max(seen.heights) - seen.heights[0])


def _shares(nodes: int) -> Array:
    """Return the rest length for which each node stands [m], shape (n_node,)."""
    share = np.full(nodes, LENGTH / (nodes - 1))
    share[[0, -1]] *= 0.5
    return share


def _acceleration(time: float, x: Array, v: Array) -> Array:
    """Return the acceleration of the nodes of the chain [m/s²], like positions and velocities of shape (n_node, 2)."""
    rest, section = LENGTH / (len(x) - 1), WIDTH * THICKNESS
    strain = STRAIN * -np.expm1(-time / LAG)
    edge, change = np.diff(x, axis=0), np.diff(v, axis=0)
    length = np.hypot(*edge.T)
    along = edge / length[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    stretch = length / rest - 1.0 - 0.5 * strain + RETARDATION * (along * change).sum(axis=1) / rest
    spin = (across * change).sum(axis=1) / length
    turn = np.arctan2((across[:-1] * along[1:]).sum(axis=1), (along[:-1] * along[1:]).sum(axis=1))
    curvature = turn / rest + 1.5 * strain / THICKNESS + RETARDATION * np.diff(spin) / rest
    moment = np.diff(np.pad(MODULUS * section * THICKNESS**2 / 12.0 * curvature, 1))
    pull = MODULUS * section * stretch[:, None] * along - (moment / length)[:, None] * across
    force = np.diff(np.pad(pull, ((1, 1), (0, 0))), axis=0)
    gap = np.clip(x[:, 1] - 0.5 * THICKNESS, 1e-9, BARRIER)
    inside = gap - BARRIER
    force[:, 1] += CONTACT * _shares(len(x)) * (2.0 * inside * np.log(gap / BARRIER) + inside**2 / gap)
    return force / (DENSITY * section * _shares(len(x)))[:, None] - [0.0, GRAVITY]


@cache
def rise_of_chain() -> float:
    """Return how far the mass centre of the judge's chain rises [mm]."""
    start = np.zeros((NODES, 4))  # x, z and their velocities of each node: so its Jacobian is a band
    start[:, 0], start[:, 1] = np.linspace(0.0, LENGTH, NODES), START

    def slope(time: float, values: Array) -> Array:
        nodes = values.reshape(-1, 4)
        return np.hstack([nodes[:, 2:], _acceleration(time, nodes[:, :2], nodes[:, 2:])]).ravel()

    times = np.linspace(0.0, UNTIL, round(UNTIL * RATE) + 1)
    found = solve_ivp(slope, (0.0, UNTIL), start.ravel(), "LSODA", times, rtol=1e-5, atol=1e-8, lband=11, uband=11)
    heights = _shares(NODES) @ found.y[1::4] / LENGTH
    return 1e3 * float(heights.max() - heights[0])


CASES = [
    Case(
        f"jump/{name}",
        "chain of nodes, by LSODA",
        1e-3,
        lambda model=model: (rise(model), rise_of_chain()),
        "mm",
        long=True,
    )
    for name, model in (("one curve", "laminate"), ("two rods", "two_rod"))
]

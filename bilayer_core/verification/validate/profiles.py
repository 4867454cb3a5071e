"""Sections, moduli and natural shapes that vary along the path."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.integrate import quad

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import timoshenko
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

Array = np.ndarray
LENGTH, MODULUS, EDGES = 0.1, GEL["youngs_modulus"], 80


def linear(first: float, last: float) -> dict:
    """Return a profile that is linear from one end of the path to the other."""
    return {"at": [0, LENGTH], "value": [first, last]}


def between(first: float, last: float, s: float | Array) -> float | Array:
    """Return the value of such a profile at s [m]."""
    return first + (last - first) * s / LENGTH


def settled(layers: list[dict], edges: int = EDGES, of_rod: dict | None = None, **more) -> Simulator:
    """Return a simulator of a clamped strip in equilibrium."""
    strip = rod(layers, length=LENGTH, stations=edges + 1, clamp_start="wall", **(of_rod or {}))
    simulator = Simulator(load_scene(scene([strip], bodies=[fixed()], **more)))
    simulator.solve_static()
    return simulator


TAPERS: dict[str, tuple[dict, dict, Callable]] = {
    "width": ({"width": linear(10e-3, 2e-3)}, {}, lambda s: between(10e-3, 2e-3, s) * 2e-3**3),
    "thickness": ({}, {"thickness": linear(2e-3, 1e-3)}, lambda s: 10e-3 * between(2e-3, 1e-3, s) ** 3),
    "stiffness": ({}, {"stiffness": linear(1.0, 0.2)}, lambda s: between(1.0, 0.2, s) * 10e-3 * 2e-3**3),
}
"""What varies, of the rod and of its layer, and 12 EI/E along the path [m⁴]."""


def taper(name: str) -> tuple[float, float]:
    """Return the deflection of the tip of a tapered cantilever under a force there [µm]."""
    of_rod, of_layer, cube = TAPERS[name]
    force = 1e-4
    pull = [{"name": "pull", "rod": "rod", "position": LENGTH, "force": [0, 0, force]}]
    simulator = settled([layer(**{"thickness": 2e-3, **of_layer})], of_rod=of_rod, loads=pull)
    expected = quad(lambda s: force * (LENGTH - s) ** 2 / (MODULUS * cube(s) / 12.0), 0.0, LENGTH)[0]
    return 1e6 * simulator.positions[-1, 2], 1e6 * expected


@cache
def _spiral(edges: int) -> tuple[Array, Array]:
    def angle(s):
        return 5.0 * s + 0.5 * 40.0 / LENGTH * s**2

    expected = np.array([quad(lambda s, f=f: f(angle(s)), 0.0, LENGTH)[0] for f in (np.cos, np.sin)])
    return settled([layer(natural_curvature=linear(5.0, 45.0))], edges).positions[-1, [0, 2]], expected


def spiral(axis: int) -> tuple[float, float]:
    """Return the tip [mm] of a strip whose natural curvature grows linearly."""
    found, expected = _spiral(EDGES)
    return 1e3 * found[axis], 1e3 * expected[axis]


def order_of_spiral() -> tuple[float, float]:
    """Return the order at which the distance of that tip from its place falls; 2."""
    coarse, fine = (np.linalg.norm(np.subtract(*_spiral(edges))) for edges in (EDGES // 2, EDGES))
    return float(np.log2(coarse / fine)), 2.0


def twist() -> tuple[float, float]:
    """Return the turn of the end [rad] of a strip with natural twist on a part; a free end has no element, for half an
    edge.
    """
    simulator = settled([layer(natural_twist={"at": [0.02, 0.06], "value": [0.0, 30.0]})])
    m1 = simulator.frame().directors[-1]
    return float(np.arctan2(-m1[1], m1[2])), 30.0 * (0.5 * 0.04 + 0.04 - 0.5 * LENGTH / EDGES)


BILAYERS = {
    "stiffness": ((0.2, 5.0), (1e-3, 1e-3)),
    "thickness": ((1.0, 1.0), (0.5e-3, 1.5e-3)),
    "both": ((4.0, 1.0), (1.5e-3, 0.8e-3)),
}
"""Modulus ratio and thickness [m] of the bottom layer from end to end."""


def local_curvature(name: str) -> tuple[float, float]:
    """Return κH/η of a bilayer that varies along its path, at the node where it is furthest from Timoshenko's of the
    section there.
    """
    moduli, thicknesses = BILAYERS[name]
    layers = [
        layer("bottom", thickness=linear(*thicknesses), stiffness=linear(*moduli)),
        layer("top", eigenstrain={"stimulus": "heat", "gain": 0.01}),
    ]
    simulator = settled(layers, stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}})
    inner = np.arange(EDGES // 10, EDGES - EDGES // 10)
    along = inner * LENGTH / EDGES
    bottom = between(*thicknesses, along)
    expected = timoshenko(between(*moduli, along), bottom / 1e-3)
    found = -simulator.curvatures[inner] * (bottom + 1e-3) / 0.01
    worst = int(np.argmax(np.abs(found / expected - 1.0)))
    return found[worst], expected[worst]


CASES = [
    *cases("profiles/taper of {}", "integral of the flexibility", 1e-3, taper, TAPERS, unit="µm"),
    *cases(
        "profiles/Euler spiral/tip {1}",
        "Fresnel's integrals, by quadrature",
        2e-4,
        lambda k, _axis: spiral(k),
        enumerate("xz"),
        unit="mm",
        scale=1e3 * LENGTH,
    ),
    Case("profiles/Euler spiral/order in space", "order 2 of the bending elements", 0.1, order_of_spiral, scale=1.0),
    Case("profiles/natural twist", "its integral", 2e-3, twist, "rad"),
    *cases("profiles/bilayer, {} varying", "Timoshenko's curvature of each section", 0.01, local_curvature, BILAYERS),
]

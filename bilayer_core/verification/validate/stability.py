"""Loads at which equilibria lose their stability."""

from __future__ import annotations

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

LENGTH, WIDTH, THICKNESS, MODULUS = 0.2, 0.01, 2e-3, GEL["youngs_modulus"]
UNIT = MODULUS * WIDTH * THICKNESS**3 / 12.0 / LENGTH**2
"""EI/L² [N]"""
BECK = 20.0509
"""Of a cantilever under a force along its tip (Beck 1952)."""
EULER = 2.4674
"""π²/4, of a cantilever under a force of fixed direction."""


def column(load: float, stations: int = 41, dimension: int | str = "auto", **material) -> dict:
    """Return a cantilever under a force of `load` EI/L² that follows its tip."""
    strip = rod([layer(thickness=THICKNESS)], LENGTH, stations, width=WIDTH, clamp_start="wall")
    press = {"name": "press", "rod": "rod", "position": LENGTH, "force": [-load * UNIT, 0, 0], "frame": "material"}
    return scene(
        [strip],
        bodies=[fixed("wall")],
        loads=[press],
        materials={"gel": {**GEL, **material}},
        solver={"dimension": dimension},
    )


def critical_load(near: float, dimension: int, stations: int, **load) -> float:
    """Return the least load at which a column loses its stability, by bisection between 0.9 and 1.1 of a guess."""
    low, high = 0.9 * near, 1.1 * near
    while high - low > 1e-4 * near:
        middle = 0.5 * (low + high)
        content = column(middle, stations, dimension)
        content["loads"][0] |= load
        stable = Simulator(load_scene(content)).solve_static().stable
        low, high = (middle, high) if stable else (low, middle)
    return 0.5 * (low + high)


CASES = [
    Case(
        "stability/Beck's column",
        "20.05 EI/L², flutter under a force that follows the tip (Beck 1952)",
        0.005,
        lambda: (critical_load(BECK, 2, 41), BECK),
        unit="EI/L²",
    ),
    Case(
        "stability/Euler's column",
        "π²/4 EI/L², divergence under a force of fixed direction",
        0.005,
        lambda: (critical_load(EULER, 2, 41, frame="world"), EULER),
        unit="EI/L²",
    ),
]

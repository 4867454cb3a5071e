"""Hinges, pins and junctions: Euler's columns, a swinging strip, a strip in two parts."""

from __future__ import annotations

import math
from functools import cache

from ..scene.loader import load_scene
from ..simulation.simulator import Simulator
from .case import Case
from .parts import GEL, fixed, layer, rod, scene

LENGTH, WIDTH, THICKNESS, EDGES = 0.1, 0.01, 1e-3, 40
BENDING = GEL["youngs_modulus"] * WIDTH * THICKNESS**3 / 12.0
SIZES = [(model, dimension) for model in ("laminate", "two_rod") for dimension in (2, 3)]
PINNED, CLAMPED = math.pi**2, 20.190729
"""P L²/EI of a hinged column, and of one that is clamped at its other end: tan √x = √x."""


def layers_of(model: str) -> list[dict]:
    """One layer, or two of the same thickness together."""
    if model == "laminate":
        return [layer(thickness=THICKNESS)]
    return [layer("bottom", thickness=0.5 * THICKNESS), layer("top", thickness=0.5 * THICKNESS)]


def _is_stable(model: str, dimension: int, first: dict, load: float) -> bool:
    strip = rod(layers_of(model), LENGTH, EDGES + 1, width=WIDTH, clamp_start="left", clamp_end="right")
    ends = [
        {"name": "left", "position": [0, 0, 0], "motion": first},
        {
            "name": "right",
            "position": [LENGTH, 0, 0],
            "motion": {"type": "guided", "axis": [1, 0, 0], "hinge": [0, 1, 0]},
        },
    ]
    push = {"name": "push", "body": "right", "force": [-load, 0, 0]}
    simulator = Simulator(load_scene(scene([strip], bodies=ends, loads=[push])), model=model, dimension=dimension)
    return simulator.solve_static().stable


def critical_load(model: str, dimension: int, first: dict, expected: float) -> tuple[float, float]:
    """P L²/EI at which a column begins to buckle, found by halving."""
    low, high = 0.98 * expected, 1.02 * expected
    for _ in range(9):
        middle = 0.5 * (low + high)
        stable = _is_stable(model, dimension, first, middle * BENDING / LENGTH**2)
        low, high = (middle, high) if stable else (low, middle)
    return 0.5 * (low + high), expected


def swinging(model: str, dimension: int, **steps) -> Simulator:
    """A stiff strip on a hinge at its start, released at an angle of 2°."""
    angle = math.radians(2.0)
    strip = rod(layers_of(model), LENGTH, EDGES + 1, width=WIDTH, clamp_start="pin", name="arm")
    strip["path"]["direction"] = [math.sin(angle), 0.0, -math.cos(angle)]
    strip["normal"] = [math.cos(angle), 0.0, math.sin(angle)]
    pin = {"name": "pin", "position": [0, 0, 0], "motion": {"type": "guided", "hinge": [0, 1, 0]}}
    stiff = {"gel": GEL | {"youngs_modulus": 1e11}}
    content = scene([strip], bodies=[pin], gravity=[0, 0, -9.81], materials=stiff)
    return Simulator(load_scene(content), model=model, dimension=dimension, **steps)


def period(model: str, dimension: int) -> tuple[float, float]:
    """Of a strip that swings on a hinge [ms]."""
    simulator, angle = swinging(model, dimension, integrator="sdirk2", dt=5e-4), math.radians(2.0)
    times, last = [], simulator.positions[-1, 0]
    while len(times) < 3:
        before = simulator.time
        simulator.step()
        now = simulator.positions[-1, 0]
        if last * now < 0.0:
            times.append(before + (simulator.time - before) * last / (last - now))
        last = now
    radius = 2.0 * LENGTH / 3.0 * (1.0 + (THICKNESS / LENGTH) ** 2 / 4.0)
    return 1e3 * (times[2] - times[0]), 2e3 * math.pi * math.sqrt(radius / 9.81) * (1.0 + angle**2 / 16.0)


@cache
def _sinking(model: str, dimension: int, junction: bool) -> float:
    """Of the tip of a heavy strip [m]; with a junction in its middle it is two."""
    half, soft = 0.5 * LENGTH, {"gel": GEL | {"youngs_modulus": 1e7}}
    if junction:
        strips = [
            rod(layers_of(model), half, EDGES // 2 + 1, name="first", clamp_start="wall", clamp_end="junction"),
            rod(layers_of(model), half, EDGES // 2 + 1, start=(half, 0, 0), name="second", clamp_start="junction"),
        ]
        bodies = [fixed(), {"name": "junction", "position": [half, 0, 0], "motion": {"type": "free"}}]
    else:
        strips, bodies = [rod(layers_of(model), LENGTH, EDGES + 1, clamp_start="wall")], [fixed()]
    content = scene(strips, bodies=bodies, gravity=[0, 0, -9.81], materials=soft)
    simulator = Simulator(load_scene(content), model=model, dimension=dimension)
    simulator.solve_static()
    return 1e3 * (simulator.model.start_position[-1, 2] - simulator.positions[-1, 2])


CASES = [
    *(
        Case(
            f"joints/{name} column/{dimension}-D {model}",
            "Euler's load over EI/L²",
            2e-3,
            lambda model=model, dimension=dimension, first=first, answer=answer: critical_load(
                model, dimension, first, answer
            ),
        )
        for name, first, answer in (
            ("hinged", {"type": "guided", "hinge": [0, 1, 0]}, PINNED),
            ("clamped and hinged", {"type": "prescribed"}, CLAMPED),
        )
        for model, dimension in SIZES
    ),
    *(
        Case(
            f"joints/swinging strip/{dimension}-D {model}",
            "period of a rigid strip on a hinge, 2π √(2L/3g) to second order in thickness and angle",
            5e-4,
            lambda model=model, dimension=dimension: period(model, dimension),
            unit="ms",
        )
        for model, dimension in SIZES
    ),
    *(
        Case(
            f"joints/junction/{dimension}-D {model}",
            "sinking of a strip in one part",
            1e-5,
            lambda model=model, dimension=dimension: (
                _sinking(model, dimension, True),
                _sinking(model, dimension, False),
            ),
            unit="mm",
        )
        for model, dimension in SIZES
    ),
]

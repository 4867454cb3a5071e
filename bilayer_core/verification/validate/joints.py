"""Hinges, pins and junctions: Euler's columns, a swinging strip, a strip in two parts."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

LENGTH, WIDTH, THICKNESS, EDGES = 0.1, 0.01, 1e-3, 40
BENDING = GEL["youngs_modulus"] * WIDTH * THICKNESS**3 / 12.0
SIZES = [(model, dimension) for model in ("laminate", "two_rod") for dimension in (2, 3)]
QUICK = [("laminate", 3), ("two_rod", 2)]
"""Those with which halving of loads is no long case."""
PINNED, CLAMPED = math.pi**2, 20.190729
"""P L²/EI of a hinged column, and of one that is clamped at its other end: tan √x = √x."""


def layers_of(model: str) -> list[dict]:
    """Return one layer, or two of the same thickness together."""
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
    """Return P L²/EI at which a column begins to buckle, found by halving."""
    low, high = 0.98 * expected, 1.02 * expected
    for _ in range(9):
        middle = 0.5 * (low + high)
        stable = _is_stable(model, dimension, first, middle * BENDING / LENGTH**2)
        low, high = (middle, high) if stable else (low, middle)
    return 0.5 * (low + high), expected


SPAN, RISE = 2.0 * LENGTH, 1.2 * THICKNESS
"""Of the arch; up to a rise of 1.35 times the thickness it snaps without a wave to one side."""


def _arch_stands(model: str, dimension: int, load: float) -> bool:
    """Return whether a shallow arch between two hinges, half a sine in shape, bears a load [N/m] of the same shape."""
    wave = math.pi / SPAN
    points = [[x, 0.0, RISE * math.sin(wave * x)] for x in np.linspace(0.0, SPAN, 201).tolist()]
    arch = rod(layers_of(model), SPAN, EDGES + 1, width=WIDTH, name="arch", clamp_start="left", clamp_end="right")
    arch |= {"path": {"shape": "spline", "points": points}, "normal": [-RISE * wave, 0.0, 1.0]}
    content = scene([arch], bodies=[_on_hinge("left", (0.0, 0.0, 0.0)), _on_hinge("right", (SPAN, 0.0, 0.0))])
    edge = load_scene(content).rods[0].edge_length
    content["loads"] = [
        {
            "name": f"push_{i}",
            "rod": "arch",
            "position": i * edge,
            "force": [0.0, 0.0, -load * math.sin(math.pi * i / EDGES) * edge],
        }
        for i in range(1, EDGES)
    ]
    simulator = Simulator(load_scene(content), model=model, dimension=dimension)
    simulator.solve_static()
    return bool(simulator.positions[EDGES // 2, 2] > 0.0)


def snapping_load(model: str, dimension: int) -> tuple[float, float]:
    """Return the load at the middle [N/m] under which a shallow arch snaps through, found by halving.

    With a rise y left of a, thrust EA k²/4 (a² − y²) and k = π/L, the arch bears EI k⁴ (a − y + A/(4I) (a² − y²) y),
    most at y² = (a² − 4I/A)/3 (Timoshenko and Gere, Theory of Elastic Stability).
    """
    wave, slender = math.pi / SPAN, 3.0 / THICKNESS**2  # k and A/(4I)
    left = math.sqrt((RISE**2 - 1.0 / slender) / 3.0)
    most = BENDING * wave**4 * (RISE - left + slender * (RISE**2 - left**2) * left)
    low, high = 0.96 * most, 1.04 * most
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _arch_stands(model, dimension, middle) else (low, middle)
    return 0.5 * (low + high), most


def swinging(model: str, dimension: int, **steps) -> Simulator:
    """Return a simulator of a stiff strip on a hinge at its start, released at an angle of 2°."""
    angle = math.radians(2.0)
    strip = rod(layers_of(model), LENGTH, EDGES + 1, width=WIDTH, clamp_start="pin", name="arm")
    strip["path"]["direction"] = [math.sin(angle), 0.0, -math.cos(angle)]
    strip["normal"] = [math.cos(angle), 0.0, math.sin(angle)]
    pin = {"name": "pin", "position": [0, 0, 0], "motion": {"type": "guided", "hinge": [0, 1, 0]}}
    stiff = {"gel": GEL | {"youngs_modulus": 1e11}}
    content = scene([strip], bodies=[pin], gravity=[0, 0, -9.81], materials=stiff)
    return Simulator(load_scene(content), model=model, dimension=dimension, **steps)


def period(model: str, dimension: int) -> tuple[float, float]:
    """Return the period of a strip that swings on a hinge [ms], measured and expected."""
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


def hinged_link(model: str, start: tuple, angle: float, name: str, first: str, last: str | None = None) -> dict:
    """Return a stiff strip that hangs at an angle from the vertical, or lies at 90°."""
    link = rod(layers_of(model), LENGTH, 21, start=start, width=WIDTH, name=name, clamp_start=first, clamp_end=last)
    link["path"]["direction"] = [math.sin(angle), 0.0, -math.cos(angle)]
    return link | {"normal": [math.cos(angle), 0.0, math.sin(angle)]}


def _end_of(start: tuple, angle: float) -> tuple[float, float, float]:
    return start[0] + LENGTH * math.sin(angle), 0.0, start[2] - LENGTH * math.cos(angle)


def _on_hinge(name: str, position: tuple) -> dict:
    return {"name": name, "position": position, "motion": {"type": "guided", "hinge": [0, 1, 0]}}


def _light(name: str, position: tuple) -> dict:
    return {"name": name, "position": position, "motion": {"type": "free"}}


def _hinge(name: str, first: str, second: str, point: tuple) -> dict:
    return {"name": name, "type": "hinge", "bodies": [first, second], "point": point, "axis": [0, 1, 0]}


def _swings(content: dict, model: str, dimension: int) -> float:
    """Return the time of a whole swing of the last node [s]."""
    simulator = Simulator(load_scene(content), model=model, dimension=dimension, integrator="sdirk2", dt=5e-4)
    rest = 0.0 if content["name"] == "sample" else LENGTH
    times, last = [], simulator.positions[-1, 0] - rest
    while len(times) < 3:
        before = simulator.time
        simulator.step()
        now = simulator.positions[-1, 0] - rest
        if last * now < 0.0:
            times.append(before + (simulator.time - before) * last / (last - now))
        last = now
    return times[2] - times[0]


def double_pendulum(model: str, dimension: int) -> tuple[float, float]:
    """Return the period of the slow mode of two equal strips, one hinged to the other [ms]: ω² = 3 (1 − 2/√7) g/L."""
    first, ratio = math.radians(0.5), 1.4303
    knee = _end_of((0, 0, 0), first)
    strips = [
        hinged_link(model, (0, 0, 0), first, "upper", "pin", "above"),
        hinged_link(model, knee, ratio * first, "lower", "below"),
    ]
    bodies = [_on_hinge("pin", (0, 0, 0)), _light("above", knee), _light("below", knee)]
    stiff = {"gel": GEL | {"youngs_modulus": 1e11}}
    joints = [_hinge("knee", "above", "below", knee)]
    content = scene(strips, bodies=bodies, joints=joints, gravity=[0, 0, -9.81], materials=stiff)
    return 1e3 * _swings(content, model, dimension), 2e3 * math.pi / math.sqrt(
        3 * (1 - 2 / math.sqrt(7)) * 9.81 / LENGTH
    )


def four_bar(model: str, dimension: int) -> tuple[float, float]:
    """Return the period of a parallelogram of three equal strips on two hinges in the world [ms]: ω² = 6/5 g/L."""
    angle, apart = math.radians(1.0), LENGTH
    left, right = (0.0, 0.0, 0.0), (apart, 0.0, 0.0)
    ends = _end_of(left, angle), _end_of(right, angle)
    strips = [
        hinged_link(model, left, angle, "left", "pin_left", "left_end"),
        hinged_link(model, ends[0], math.pi / 2, "coupler", "coupler_start", "coupler_end"),
        hinged_link(model, right, angle, "right", "pin_right", "right_end"),
    ]
    bodies = [
        _on_hinge("pin_left", left),
        _on_hinge("pin_right", right),
        *(_light(name, ends[0]) for name in ("left_end", "coupler_start")),
        *(_light(name, ends[1]) for name in ("right_end", "coupler_end")),
    ]
    stiff = {"gel": GEL | {"youngs_modulus": 1e11}}
    joints = [
        _hinge("left_knee", "left_end", "coupler_start", ends[0]),
        _hinge("right_knee", "right_end", "coupler_end", ends[1]),
    ]
    content = scene(strips, bodies=bodies, joints=joints, gravity=[0, 0, -9.81], materials=stiff, name="four_bars")
    return 1e3 * _swings(content, model, dimension), 2e3 * math.pi / math.sqrt(1.2 * 9.81 / LENGTH)


@cache
def _sinking(model: str, dimension: int, joined_by: str = "") -> float:
    """Return how far the tip of a heavy strip sinks [mm]; if joined in its middle, the strip is two."""
    half, soft = 0.5 * LENGTH, {"gel": GEL | {"youngs_modulus": 1e7}}
    if joined_by:
        second = "junction" if joined_by == "junction" else "other"
        strips = [
            rod(layers_of(model), half, EDGES // 2 + 1, name="first", clamp_start="wall", clamp_end="junction"),
            rod(layers_of(model), half, EDGES // 2 + 1, start=(half, 0, 0), name="second", clamp_start=second),
        ]
        bodies = [fixed(), *(_light(name, (half, 0, 0)) for name in dict.fromkeys(("junction", second)))]
    else:
        strips, bodies = [rod(layers_of(model), LENGTH, EDGES + 1, clamp_start="wall")], [fixed()]
    weld = {"name": "weld", "type": "weld", "bodies": ["junction", "other"], "point": (half, 0, 0)}
    joints = [weld] if joined_by == "weld" else []
    content = scene(strips, bodies=bodies, joints=joints, gravity=[0, 0, -9.81], materials=soft)
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
            long=(model, dimension) not in QUICK,
        )
        for name, first, answer in (
            ("hinged", {"type": "guided", "hinge": [0, 1, 0]}, PINNED),
            ("clamped and hinged", {"type": "prescribed"}, CLAMPED),
        )
        for model, dimension in SIZES
    ),
    *(
        Case(
            f"joints/snap of an arch/{dimension}-D {model}",
            "largest load of a shallow arch between two hinges",
            3e-3,
            lambda model=model, dimension=dimension: snapping_load(model, dimension),
            unit="N/m",
            long=(model, dimension) not in QUICK,
        )
        for model, dimension in SIZES
    ),
    *cases(
        "joints/swinging strip/{1}-D {0}",
        "period of a rigid strip on a hinge, 2π √(2L/3g) to second order in thickness and angle",
        5e-4,
        period,
        SIZES,
        unit="ms",
    ),
    *(
        Case(
            f"joints/{name}/{dimension}-D {model}",
            against,
            1e-3,
            lambda model=model, dimension=dimension, measure=measure: measure(model, dimension),
            unit="ms",
        )
        for name, measure, against in (
            ("double pendulum", double_pendulum, "slow mode of two rigid strips, ω² = 3 (1 − 2/√7) g/L"),
            ("four-bar linkage", four_bar, "swing of a parallelogram of three rigid strips, ω² = 6/5 g/L"),
        )
        for model, dimension in SIZES
    ),
    *cases(
        "joints/{0}/{2}-D {1}",
        "sinking of a strip in one part",
        1e-5,
        lambda name, model, dimension: (
            _sinking(model, dimension, name),
            _sinking(model, dimension),
        ),
        [(name, model, dimension) for name in ("junction", "weld") for model, dimension in SIZES],
        unit="mm",
    ),
]

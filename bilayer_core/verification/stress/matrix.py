"""The cases of the matrix: every axis alone, a seeded sample of all together, and a few long ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

from scipy.stats import qmc

from bilayer_core.verification.stress.parameters import ADAPTIVE, CHOICES, RANGES, ROBOTS, Parameters

SEED = 20261123
"""Of the sample, and of the choice of cases that are compared with finer runs or are quick."""
SAMPLE = 1536
MOST_STEPS = 2000
FEWEST_EDGES = 2.01
"""That an upper layer covers."""
MODELS_ALONE = (("laminate", 2), ("laminate", 3), ("two_rod", 2), ("two_rod", 3))


@dataclass(frozen=True)
class MatrixCase:
    """One case: its name, what it sets, and how many steps it may take at most."""

    name: str
    """``axis/dt/1e-05/drop``, ``all/0123``, ``long/…``: names do not change as long as the matrix does not."""
    parameters: Parameters
    most_steps: int = MOST_STEPS  # Accepted steps after which the case ends
    axis: str = ""  # The axis, where it is one alone


def matrix() -> list[MatrixCase]:
    """Return all cases, in a fixed order."""
    return [*_axes(), *_choices(), *_sample(), *_long()]


def _set(robot: str, **changes) -> Parameters:
    """Return easy parameters of a robot, with changes."""
    base = {"robot": robot}
    if robot == "swimmer":
        base |= {"fluid_ratio": 0.8, "added_mass": True}
    if robot == "coil":
        base |= {"turns": 1.0, "eigenstrain": 0.0}
    if robot in ("ball", "box"):
        base |= {"contact_stiffness": 1e8}
    return Parameters(**(base | changes))


def _axes() -> Iterator[MatrixCase]:
    """Yield each axis alone, on the robots that it concerns, by the default model and by two rods."""
    for axis, allowed in RANGES.items():
        for robot in allowed.robots:
            for value in allowed.values:
                for model in ("laminate", "two_rod"):
                    value = int(value) if axis == "stations" else value
                    most = MOST_STEPS if axis != "stations" or value < 1000 else 60
                    name = f"{axis}/{value:g}/{robot}/{model}"
                    yield MatrixCase(name, _set(robot, model=model, **{axis: value}), most, axis)


def _choices() -> Iterator[MatrixCase]:
    """Yield every robot by every integrator, model and dimension, and with every stimulus."""
    for robot in ROBOTS:
        for integrator in CHOICES["integrator"]:
            for model, dimension in MODELS_ALONE:
                step = {"dt": 1e-4} if integrator not in ADAPTIVE else {}
                changes = {"integrator": integrator, "model": model, "dimension": dimension} | step
                yield MatrixCase(f"integrator/{integrator}/{robot}/{model}/{dimension}", _set(robot, **changes))
        for stimulus in CHOICES["stimulus"]:
            for damped in CHOICES["damped"]:
                name = f"stimulus/{stimulus}/{robot}/{'damped' if damped else 'undamped'}"
                yield MatrixCase(name, _set(robot, stimulus=stimulus, damped=damped), axis="stimulus")


def _sample() -> Iterator[MatrixCase]:
    """Yield samples of all axes at once: a Latin hypercube, one dimension an axis.

    Every second point stays near the defaults on all axes: with twenty of them from one extreme to the other hardly
    any point would lie in the region in which anything can be accurate.
    """
    names = ["robot", "fixed", *CHOICES, *RANGES]
    points = qmc.LatinHypercube(len(names), seed=SEED).random(SAMPLE)
    for number, point in enumerate(points):
        at = dict(zip(names, point.tolist(), strict=True))
        robot = ROBOTS[int(at["robot"] * len(ROBOTS))]
        mild = number % 2 == 1
        changes = {name: choices[int(at[name] * len(choices))] for name, choices in CHOICES.items()}
        for axis, allowed in RANGES.items():
            changes[axis] = allowed.at(_near_default(axis, at[axis]) if mild else at[axis])
        changes["stations"] = round(changes["stations"])
        changes["covered"] = min(1.0, max(changes["covered"], FEWEST_EDGES / (changes["stations"] - 1)))
        fixed = at["fixed"] < (0.2 if mild else 0.5) or changes["integrator"] not in ADAPTIVE
        if not fixed:
            changes["dt"] = None
        if robot not in ("ball", "box"):
            changes["restitution"] = None
        if robot != "swimmer":
            changes |= {"fluid_ratio": 0.0, "added_mass": False}
        if robot != "coil":
            changes["turns"] = round(0.02 * changes["turns"], 4) if mild else changes["turns"]
        yield MatrixCase(f"all/{number:04d}", Parameters(robot=robot, **changes))


MILD = 0.15
"""Part of each range, about its default, from which mild points of the sample come."""


def _near_default(axis: str, part: float) -> float:
    """Return a part of an axis' range near the default of the parameters."""
    center = CENTERS[axis]
    low = min(max(center - 0.5 * MILD, 0.0), 1.0 - MILD)
    return low + MILD * part


def _part_of(axis: str, value: float) -> float:
    """Return where a value lies on an axis, 0 … 1, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if RANGES[axis].at(middle) < value else (low, middle)
    return low


DEFAULTS = {f.name: f.default for f in dataclasses.fields(Parameters)} | {
    "dt": 1e-4,
    "restitution": 0.5,
    "fluid_ratio": 0.8,
}
CENTERS = {axis: _part_of(axis, DEFAULTS[axis]) for axis in RANGES}


def _long() -> Iterator[MatrixCase]:
    """Yield the named cases that have more steps than the rest."""
    yield MatrixCase("long/ball in a box, 100 bounces", _set("box", speed=3.0), 60_000)
    yield MatrixCase("long/ball in a box with restitution", _set("box", speed=3.0, restitution=0.95), 60_000)
    yield MatrixCase("long/a million steps at rest", _set("crawler", eigenstrain=0.0, dt=1e-3), 1_000_000)
    yield MatrixCase("long/ten turns into contact", _set("coil", turns=10.0, stations=121), 20_000)
    yield MatrixCase("long/undamped beam, 1000 periods", _set("beam", damped=False, stimulus="step"), 200_000)

"""How long steps are: all the same, or as long as their error allows."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bilayer_core.engine.step_size import LONG_STEP
from bilayer_core.errors import InputError
from bilayer_core.integrators.method import Method
from bilayer_core.scene.config import DEFAULT_DT, DEFAULT_TOLERANCE, LARGEST_TOLERANCE, SceneConfig

WORTH_OF_DEFAULT = "this one keeps the bundled robots' figures within 1 %, the jump's within 4 %"


@dataclass(frozen=True)
class Steps:
    """Lengths of the steps of a run, and why they are these.

    Attributes
    ----------
    dt : float
        Length of a fixed step, or of the first adaptive one [s].
    tolerance : float or None
        Largest error of one adaptive step: displacement over the length of the longest rod; errors of steps add up
        over a run. None: steps are fixed.
    longest : float
        Length of the longest adaptive step [s].
    shortest : float
        Length of the shortest adaptive step, or part of a fixed one [s].
    least_travel : float
        What the fastest point covers in the shortest adaptive step, where it is so fast that this makes it shorter [m].
    newton_tolerance : float
        Speed of a material point below which Newton's correction is the last [m/s].
    reason : str
    """

    dt: float
    tolerance: float | None
    longest: float
    shortest: float
    least_travel: float
    newton_tolerance: float
    reason: str

    @property
    def adaptive(self) -> bool:
        """True if steps are as long as their error allows."""
        return self.tolerance is not None

    def __str__(self) -> str:
        if self.tolerance is None:
            return f"fixed, {1e3 * self.dt:g} ms"
        return f"adaptive, error per step at most {self.tolerance:g} of the longest rod"


def choose_steps(scene: SceneConfig, method: Method, dt: float | None = None, tolerance: float | None = None) -> Steps:
    """Return the steps that a caller and a scene ask for; by default adaptive ones.

    A `tolerance` asks for adaptive steps, `dt` alone for fixed ones; what the caller asks for comes before what the
    scene says.

    Parameters
    ----------
    scene : SceneConfig
    method : Method
    dt, tolerance : float, optional
        Of the caller [s; part of the longest rod].

    Raises
    ------
    InputError
        If one of them is not a length of a step or a tolerance.
    """
    if dt is not None and not (math.isfinite(dt) and dt > 0.0):
        raise InputError(f"dt: {dt} is not a time step; allowed is a positive number of seconds")
    if tolerance is not None and not 0.0 < tolerance <= LARGEST_TOLERANCE:
        allowed = f"a part of the longest rod above 0 and at most {LARGEST_TOLERANCE:g}"
        raise InputError(f"tolerance: {tolerance} is not allowed; it must be {allowed}")
    solver, reason = scene.solver, "asked for"
    if dt is None and tolerance is None:
        dt, tolerance = solver.dt, solver.tolerance
        reason = f"set by `solver.{'dt' if tolerance is None else 'tolerance'}`"
    elif dt is None:
        dt = solver.dt
    if dt is None and tolerance is None:
        if method.estimate is None:
            reason = f"{method.name} has no estimate of its error, and no `dt` is given"
        else:
            tolerance = DEFAULT_TOLERANCE
            reason = f"neither `dt` nor `tolerance` is given; {WORTH_OF_DEFAULT}"
    length = max(rod.path.length for rod in scene.rods)
    longest = _longest(scene.duration) if solver.max_step is None else solver.max_step
    newton = solver.newton_tolerance
    if newton is None:
        newton = usual = usual_newton_tolerance(scene, tolerance)
        if scene.friction is not None:
            newton = min(usual, max(RUBBING_PART * scene.friction.speed_threshold, FINEST_PART * usual))
    dt, halvings = dt or DEFAULT_DT, solver.max_halvings
    first = dt if tolerance is None else min(dt, longest)
    shortest, least_travel = first / 2 ** (DEFAULT_HALVINGS if halvings is None else halvings), math.inf
    if halvings is None and tolerance is not None:
        shortest = min(shortest, SHORTEST_PART * _time_of_sound(scene))
        least_travel = SHORTEST_PART * tolerance * length
    return Steps(dt, tolerance, longest, shortest, least_travel, newton, reason)


def usual_newton_tolerance(scene: SceneConfig, tolerance: float | None) -> float:
    """Return what Newton's last correction may come to where nothing rubs [m/s]."""
    length = max(rod.path.length for rod in scene.rods)
    return NEWTON_PART * (tolerance or DEFAULT_TOLERANCE) * length / min(scene.duration, LONG_STEP)


def _longest(duration: float) -> float:
    """Return how long an adaptive step may be where nothing else ends it, in a scene of a duration [s]."""
    return max(SLOWEST_PART * duration, min(LONG_STEP, FASTEST_PART * duration))


def _time_of_sound(scene: SceneConfig) -> float:
    """Return the least time in which a stretching wave passes an edge [s]."""
    return min(
        rod.path.length / (rod.stations - 1) * math.sqrt(material.density / material.youngs_modulus)
        for rod in scene.rods
        for material in (scene.materials[layer.material] for layer in rod.layers)
    )


FASTEST_PART, SLOWEST_PART = 1.0 / 100.0, 1.0 / 250.0
"""Of the duration of the scene: what the longest adaptive step may be of a short one, and of a long one.

The error of a step does not see growth from almost nothing, such as buckling and swings that a drive pumps up: both are
below the tolerance for long, and methods that damp what is fast suppress them in steps that are too long for them. The
time that somebody gives a scene tells which motions matter. A long scene has 250 steps at least; a short one, which has
less to rest in, a hundred of at most `LONG_STEP`.
"""
DEFAULT_HALVINGS = 10
SHORTEST_PART = 1e-3
"""Of two times: in the first sound passes an edge, in the second the fastest point covers what a step may be wrong by.

In a step shorter than the first even the stiffest spring of a rod is soft, and an impact at speed u has an error of
about u h (`engine.error_norm`). Where steps of a thousandth of both do not help, none do. Barriers need no time of
their own: what rests on a stiff one has no speed, and what meets it has its error."""


NEWTON_PART = 1e-2
"""What Newton's last correction may come to, as a part of the error that a step may have.

A correction at speed u moves a point by at most u h in a step of length h. With u = part × tolerance × L/h₀, L the
longest rod, that is at most this part of the error allowed in a step of length h₀, and of a smaller one in proportion.
h₀ is `LONG_STEP`, or the scene's duration if that is shorter; in longer steps u falls with their length.
The correction is taken, so what is left is less by another factor: below `engine.newton.KEEP_FACTOR_BELOW` where
the matrix is an old one, by the correction itself where it is new. The scales are the scene's own, so u fits
robots of a micrometre, which move in microseconds, as it fits one of a kilometre; for a rod of 50 mm it is
2.5e-6 m/s. Where this is less than positions can express, the last digit of a position counts (`engine.newton`).
"""
RUBBING_PART, FINEST_PART = 0.1, 0.01
"""Likewise as a part of friction's speed threshold, down to a part of the usual one.

What rests on friction moves at less than the threshold, by which alone friction balances what pushes it. With half of
it, and ten times that for the correction after contacts were frozen anew, the strides of a strip that extends from a
box onto the ground scattered by 3.7 % with integrator and step; with a tenth they agree within 0.03 %.
"""

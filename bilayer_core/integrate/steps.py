"""How long steps are: all the same, or as long as their error allows."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError
from ..scene.config import DEFAULT_DT, DEFAULT_TOLERANCE, LARGEST_TOLERANCE, SceneConfig
from .method import Method


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
    reason : str
    """

    dt: float
    tolerance: float | None
    longest: float
    reason: str

    @property
    def adaptive(self) -> bool:
        """Whether steps are as long as their error allows."""
        return self.tolerance is not None

    def __str__(self) -> str:
        if self.tolerance is None:
            return f"fixed, {1e3 * self.dt:g} ms"
        return f"adaptive, error per step at most {self.tolerance:g} of the longest rod"


def choose_steps(scene: SceneConfig, method: Method, dt: float | None = None, tolerance: float | None = None) -> Steps:
    """The steps that a caller and a scene ask for; by default adaptive ones.

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
            reason = "neither `dt` nor `tolerance` is given; this one keeps the bundled robots' figures within 1 %"
    longest = 1.0 / scene.output.rate if solver.max_step is None else solver.max_step
    return Steps(dt or DEFAULT_DT, tolerance, longest, reason)

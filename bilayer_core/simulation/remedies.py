"""Remedies where steps cannot go on: changes that a user can make."""

from __future__ import annotations

import numpy as np

from bilayer_core.contact.barrier import barrier
from bilayer_core.engine.newton import LAST_DIGITS
from bilayer_core.engine.step_outcome import IntegrationReport
from bilayer_core.errors import Remedy
from bilayer_core.integrators.method import Method
from bilayer_core.model.impacts import HELD, heaviest, rounded_up, stiffness_that_holds
from bilayer_core.model.model import Model
from bilayer_core.model.records.status import (
    BEYOND,
    BLOCKED,
    CROSSED,
    GAINS_ENERGY,
    LINE_SEARCH,
    MAX_ITERATIONS,
    TOO_INACCURATE,
    UNSETTLED,
)
from bilayer_core.scene.config import DEFAULT_TOLERANCE, LARGEST_TOLERANCE, Solver
from bilayer_core.simulation.collapse import damp_materials
from bilayer_core.simulation.crossing_remedy import more_stations
from bilayer_core.simulation.step_choice import Steps, usual_newton_tolerance

NEARLY = 1e3
"""Times Newton's tolerance: a last correction that is no larger may well be good enough."""
MARGIN = 2.0
"""By which a tolerance should exceed what a step could reach."""
MUCH_SHORTER, MUCH_FASTER = 0.1, 10.0
SPENT = 1e-3
"""Part of the barrier distance: what comes so near is more than the barrier holds, 1e5 times stiffer than half way."""


def remedy(
    found: IntegrationReport, steps: Steps, method: Method, model: Model, gap: float, speed: float, folded: bool = False
) -> Remedy:
    """Return the setting to change, and its new value, for a run to get past the step that failed.

    Parameters
    ----------
    found : IntegrationReport
        Of which the last attempt failed.
    steps : Steps
    method : Method
    model : Model
    gap : float
        The smallest in the last attempt [m].
    speed : float
        Of the fastest node or body before it, or by the largest energy of the run [m/s].
    folded : bool
        Whether a rod has collapsed (`simulation.collapse`).
    """
    scene = model.scene
    solver, usual = scene.solver, Solver.model_fields["max_newton_iterations"].default
    if found.status == BLOCKED:
        if not _holds(model, speed):
            return _stiffer(model, speed)
        return Remedy("a prescribed body must stop before nothing can give way: change its `motion`")
    if found.status == CROSSED:
        return more_stations(model, found.pair)
    farthest, length = float(np.abs(model.start_position).max()), max(rod.path.length for rod in scene.rods)
    if LAST_DIGITS * farthest > (steps.tolerance or DEFAULT_TOLERANCE) * length:
        known = f"{farthest:.1g} m from it positions are known to {LAST_DIGITS * farthest:.1g} m"
        return Remedy(f"move the robot nearer to the origin: {known}")
    if found.status == MAX_ITERATIONS and solver.max_newton_iterations < usual:
        return Remedy(
            f"set `solver.max_newton_iterations` to {usual}, or leave it out", {"solver.max_newton_iterations": usual}
        )
    if solver.max_halvings is not None:
        return _without("solver.max_halvings", f", or set it above {solver.max_halvings}")
    if found.status == GAINS_ENERGY and solver.newton_tolerance is not None:
        return _without("solver.newton_tolerance", ": what it leaves undone is energy")
    if folded:
        return _with_adaptive_steps(damp_materials(model), steps, method)
    if found.status == BEYOND:
        text = "set `solver.integrator` to sdirk2, which ends where it has looked"
        return Remedy(text, {"solver.integrator": "sdirk2"})
    touches = scene.contact is not None and gap < SPENT * scene.contact.barrier_distance
    if touches and not _holds(model, speed):
        return _with_adaptive_steps(_stiffer(model, speed), steps, method)
    stuck = found.status in (MAX_ITERATIONS, LINE_SEARCH)
    if stuck and solver.newton_tolerance is None and found.residual <= NEARLY * steps.newton_tolerance:
        return _set("solver.newton_tolerance", f"{rounded_up(MARGIN * found.residual):.1g}", "m/s")
    if not steps.adaptive:
        return _adaptive(steps, method)
    if touches:
        return _stiffer(model, speed)
    if found.status == TOO_INACCURATE:
        needed = rounded_up(MARGIN * found.error * steps.tolerance)
        if needed <= LARGEST_TOLERANCE:
            return _set("solver.tolerance", f"{needed:.1g}")
        return Remedy("let what acts on the robot grow over a time instead of at once")
    friction = scene.friction
    needed = MUCH_FASTER * max(steps.newton_tolerance, usual_newton_tolerance(scene, steps.tolerance))
    if friction is not None and friction.speed_threshold < needed:
        needed = rounded_up(needed)
        return _set("contact.friction.speed_threshold", f"{needed:.1g}", "m/s")
    if stuck and solver.newton_tolerance is not None:
        return _without("solver.newton_tolerance")
    if found.status == UNSETTLED:
        return _set("contact.friction.speed_threshold", f"{MUCH_FASTER * friction.speed_threshold:.1g}", "m/s")
    return _set("solver.tolerance", f"{MUCH_SHORTER * steps.tolerance:.1g}")


def _set(key: str, value: str, unit: str = "") -> Remedy:
    return Remedy(f"set `{key}` to {value} {unit}".rstrip(), {key: value})


def _without(key: str, more: str = "") -> Remedy:
    return Remedy(f"leave `{key}` out{more}", {key: None})


def _adaptive(steps: Steps, method: Method) -> Remedy:
    text = f"leave `solver.dt` out for adaptive steps, or set it to {MUCH_SHORTER * steps.dt:.1g} s"
    if method.estimate is not None:
        return Remedy(text, {"solver.dt": None})
    text = f"{text}; {method.name} has none, set `solver.integrator` to sdirk2 for them"
    return Remedy(text, {"solver.dt": None, "solver.integrator": "sdirk2"})


def _with_adaptive_steps(first: Remedy, steps: Steps, method: Method) -> Remedy:
    """Return a change combined with adaptive steps, unless steps are adaptive already."""
    if steps.adaptive:
        return first
    second = _adaptive(steps, method)
    return Remedy(f"{first}, and {second}", first.changes | second.changes)


def _stiffer(model: Model, speed: float) -> Remedy:
    return _set("contact.stiffness", f"{_stiffness_that_holds(model, speed):.0e}", "Pa")


def _holds(model: Model, speed: float) -> bool:
    """Return whether the barrier takes up the motion of the heaviest node or free body at a speed [m/s]."""
    distance = model.scene.contact.barrier_distance
    return 0.5 * heaviest(model) * speed**2 <= model.contact_stiffness * barrier(HELD * distance, distance)


def _stiffness_that_holds(model: Model, speed: float) -> float:
    """Return K_c [Pa] with which the barrier takes up the motion of what is heaviest."""
    contact = model.scene.contact
    needed = stiffness_that_holds(0.5 * heaviest(model) * speed**2, contact.barrier_distance)
    return max(needed, MUCH_FASTER * model.contact_stiffness)

"""Starts at rest: a scene with `start: settle` begins at its static equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from bilayer_core.errors import Remedy, SimulationError
from bilayer_core.model.start_motion import set_in_motion
from bilayer_core.model.state import LAST_STEP, State, turn_directors
from bilayer_core.simulation.equilibrium import StaticReport, solve_static
from bilayer_core.simulation.stepper import Stepper

SETTLE = "settle"
"""Of `start`."""


def settle(stepper: Stepper, state: State, in_space: Callable[[], Stepper] | None) -> StaticReport:
    """Bring the first state of a scene to equilibrium, and set it in motion there as the scene says.

    Stimuli and loads are those from before time 0: what jumps there acts from the first step on.

    Parameters
    ----------
    stepper : Stepper
    state : State
        At time 0; changed in place.
    in_space : callable or None
        As for `solve_static`.

    Raises
    ------
    SimulationError
        If there is no equilibrium.
    """
    try:
        report = solve_static(stepper, state, in_space=in_space, ended=LAST_STEP)
    except SimulationError as failure:
        remedy = Remedy("hold the robot or lay it on something, or leave out `start: settle`", {"start": "placed"})
        raise SimulationError(f"start: settle: {failure.reason}", failure.time, remedy) from failure
    set_in_motion(stepper.model, state)
    turn_directors(stepper.model, state)
    return report


def unstable_start(settled: StaticReport | None) -> Iterator[str]:
    """Yield a warning if a scene settled at an equilibrium from which small disturbances grow."""
    if settled is not None and not settled.stable:
        ways = settled.unstable_directions
        yield (
            f"start: settled at an unstable equilibrium ({ways} direction{'' if ways == 1 else 's'} in which small "
            "disturbances grow): an `imperfection` or a small load chooses the way it goes"
        )

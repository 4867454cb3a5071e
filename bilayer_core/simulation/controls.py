"""Inputs to a simulation from outside: stimuli, loads, friction and poses that a program sets."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from bilayer_core.errors import InputError
from bilayer_core.model.override import acts, jump_to, ramp_to
from bilayer_core.model.state import State
from bilayer_core.observed.inputs import (
    FRICTION,
    LINEAR,
    LOAD,
    POSE,
    SHAPES,
    SMOOTH,
    STIMULUS,
    UNTIL,
    Input,
    values_of_pose,
    values_of_ramp,
)
from bilayer_core.scene.channel_range import value_in_range
from bilayer_core.simulation.friction_changes import change_friction
from bilayer_core.simulation.poses import LEAST_TIME, new_goal
from bilayer_core.simulation.stepper import Stepper


class Controls:
    """Inputs that a program sets from outside, and the listeners that are told of them.

    Parameters
    ----------
    stepper : Stepper
    state : State
        Keeps what is set.

    Attributes
    ----------
    listeners : list of callable
    """

    def __init__(self, stepper: Stepper, state: State) -> None:
        self._stepper, self._state = stepper, state
        self.listeners: list[Callable[[Input], None]] = []
        self._until = math.nan  # the last end of steps that listeners were told of [s]

    def set_stimulus(self, channel: str, value: float | None, *, over: float = 0.0, shape: str = LINEAR) -> None:
        """Set a channel from the next step on; see `Simulator.set_stimulus`."""
        scene = self._stepper.model.scene
        if channel not in scene.stimuli:
            known = ", ".join(scene.stimuli) or "none"
            raise InputError(f"stimulus {channel!r}: no such channel; the scene {scene.name!r} has: {known}")
        allowed = scene.stimuli[channel]
        accepted = None if value is None else value_in_range(value, allowed.minimum, allowed.maximum)
        if value is not None and accepted is None:
            raise InputError(
                f"stimulus {channel!r}: {value} is not allowed; it must be from {allowed.minimum:g} "
                f"to {allowed.maximum:g} (unit {allowed.unit})"
            )
        self._override(list(scene.stimuli).index(channel), ("stimulus", channel), accepted, over, shape)
        self.note(STIMULUS, channel, math.nan if accepted is None else accepted, *values_of_ramp(over, shape))

    def set_load(self, name: str, factor: float | None, *, over: float = 0.0, shape: str = LINEAR) -> None:
        """Multiply a load by a factor from the next step on; see `Simulator.set_load`."""
        scene = self._stepper.model.scene
        names = [load.name for load in scene.loads]
        if name not in names:
            known = ", ".join(names) or "none"
            raise InputError(f"load {name!r}: no such load; the scene {scene.name!r} has: {known}")
        if factor is not None and not math.isfinite(factor):
            raise InputError(f"load {name!r}: a factor of {factor} is not allowed; it must be finite")
        if self._override(len(scene.stimuli) + names.index(name), ("load", name), factor, over, shape):
            self._state.has_history.fill(0.0)  # accelerations jump with a load
        self.note(LOAD, name, math.nan if factor is None else float(factor), *values_of_ramp(over, shape))

    def set_friction(self, value: float | None, key: str = "coefficient") -> None:
        """Let a coefficient of friction jump from the next step on; see `Simulator.set_friction`."""
        if change_friction(self._stepper.model, self._state, value, key):
            self._stepper.restart(self._state)
            self._state.has_history.fill(0.0)  # accelerations jump
        self.note(FRICTION, key, math.nan if value is None else float(value))

    def set_pose(
        self,
        name: str,
        position: Sequence[float] | None = None,
        quaternion: Sequence[float] | None = None,
        *,
        over: float = LEAST_TIME,
    ) -> None:
        """Let a prescribed body go to a pose from the next step on; see `Simulator.set_pose`."""
        goal = new_goal(self._stepper.model, self._state, name, position, quaternion, over)
        if goal is not None:
            self._state.pose_goal[goal[0]] = goal[1]
            self._state.has_history.fill(0.0)  # accelerations jump
        self.note(POSE, name, *values_of_pose(position, quaternion, over))

    def _override(self, index: int, what: tuple[str, str], value: float | None, over: float, shape: str) -> bool:
        """Set a row of `State.override` for a kind and a name of input; whether anything jumps."""
        fault = ""
        if not (math.isfinite(over) and over >= 0.0):
            fault = f"over = {over} is not allowed; it must be a number of seconds from 0 up"
        elif shape not in SHAPES:
            fault = f"shape = {shape!r} is not allowed; it must be one of {', '.join(SHAPES)}"
        elif over > 0.0 and value is None:
            fault = f"over = {over:g} s needs a value to get to; a schedule acts at once"
        if fault:
            raise InputError(f"{what[0]} {what[1]!r}: {fault}")
        row, present = self._state.override[index], self._stepper.surroundings.present(self._state, index)
        if value is not None and over > self._stepper.same_time:
            row[:] = ramp_to(value, present, float(self._state.time[0]), over, shape == SMOOTH)
            return False
        jumps = acts(row) if value is None else value != present
        if jumps:
            self._stepper.restart(self._state)
        row[:] = jump_to(value)
        return jumps

    def listen(self, note: Callable[[Input], None]) -> Callable[[], None]:
        """Report all inputs from outside to a listener from now on.

        `note`: called with each `observed.inputs.Input`, before the step from which on it acts. Returns a
        function that ends the reports.
        """
        self.listeners.append(note)
        self._until = math.nan  # who begins to listen hears where steps end
        return lambda: self.listeners.remove(note)

    def note_end(self, until: float) -> None:
        """Tell listeners where adaptive steps end at the latest [s], if that is new."""
        if self.listeners and until != self._until:
            self._until = until
            self.note(UNTIL, "", until)

    def note(self, kind: str, name: str, *values: float) -> None:
        """Tell listeners of an input."""
        if self.listeners:
            told = Input(int(self._state.step[0]), float(self._state.time[0]), kind, name, values)
            for listener in self.listeners:
                listener(told)

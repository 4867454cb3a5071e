"""Inputs to a simulation from outside: stimuli, loads, friction and poses that a program sets."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from bilayer_core.errors import InputError
from bilayer_core.model.override import acts, jump_to, ramp_to
from bilayer_core.observed.inputs import FRICTION, LOAD, POSE, STIMULUS, Input, values_of_pose
from bilayer_core.scene.channel_range import value_in_range
from bilayer_core.simulation.friction_changes import change_friction
from bilayer_core.simulation.poses import LEAST_TIME, new_goal
from bilayer_core.simulation.readings import Readings


class Controls(Readings):
    """Inputs that a program sets from outside, and the listeners that are notified of them."""

    _listeners: list[Callable[[Input], None]]
    _until: float  # the last end of steps that listeners were told of [s]

    def set_stimulus(self, channel: str, value: float | None, *, over: float = 0.0) -> None:
        """Set a channel from the next step on, in its unit.

        Parameters
        ----------
        channel : str
        value : float or None
            None gives it back to the scene's schedule. A value that passes the range by rounding only, such as
            1.0000000000000002, is the end of the range.
        over : float
            Simulated time in which it gets there, linearly, from what it is now [s]; 0 is a jump. Steps follow a ramp
            without beginning again, also one that is replaced by another on its way: what comes often is cheaper so.

        Raises
        ------
        InputError
            If there is no such channel, the value is not finite or out of the channel's range, or `over` is no time, or
            given without a value; nothing is changed then.
        """
        if channel not in self.scene.stimuli:
            known = ", ".join(self.scene.stimuli) or "none"
            raise InputError(f"stimulus {channel!r}: no such channel; the scene {self.scene.name!r} has: {known}")
        allowed = self.scene.stimuli[channel]
        accepted = None if value is None else value_in_range(value, allowed.minimum, allowed.maximum)
        if value is not None and accepted is None:
            raise InputError(
                f"stimulus {channel!r}: {value} is not allowed; it must be from {allowed.minimum:g} "
                f"to {allowed.maximum:g} (unit {allowed.unit})"
            )
        self._override(list(self.scene.stimuli).index(channel), f"stimulus {channel!r}", accepted, over)
        self._note(STIMULUS, channel, math.nan if accepted is None else accepted, float(over))

    def set_load(self, name: str, factor: float | None, *, over: float = 0.0) -> None:
        """Multiply force and moment of a load by a factor from the next step on.

        Parameters
        ----------
        name : str
        factor : float or None
            None gives it back to its schedule.
        over : float
            As in `set_stimulus`.

        Raises
        ------
        InputError
            If there is no such load, the factor is not finite, or `over` is no time, or given without a factor; nothing
            is changed then.
        """
        names = [load.name for load in self.scene.loads]
        if name not in names:
            known = ", ".join(names) or "none"
            raise InputError(f"load {name!r}: no such load; the scene {self.scene.name!r} has: {known}")
        if factor is not None and not math.isfinite(factor):
            raise InputError(f"load {name!r}: a factor of {factor} is not allowed; it must be finite")
        if self._override(len(self.scene.stimuli) + names.index(name), f"load {name!r}", factor, over):
            self._state.has_history.fill(0.0)  # accelerations jump with a load
        self._note(LOAD, name, math.nan if factor is None else float(factor), float(over))

    def set_friction(self, value: float | None, key: str = "coefficient") -> None:
        """Have a coefficient of friction jump to a value, from the next step on.

        Parameters
        ----------
        value : float or None
            None gives it back to the scene.
        key : str
            Of `contact.friction`: ``coefficient``, ``forward``, ``backward`` or ``sideways``. Those that the scene does
            not give, and that are not set, go with ``coefficient``.

        Raises
        ------
        InputError
            If nothing slides against friction in the scene, there is no such coefficient, or the value is not finite or
            below 0; nothing is changed then.
        """
        if change_friction(self.model, self._state, value, key):
            self._stepper.restart(self._state)
            self._state.has_history.fill(0.0)  # accelerations jump
        self._note(FRICTION, key, math.nan if value is None else float(value))

    def set_pose(
        self,
        name: str,
        position: Sequence[float] | None = None,
        quaternion: Sequence[float] | None = None,
        *,
        over: float = LEAST_TIME,
    ) -> None:
        """Have a prescribed body go to a pose from the next step on, and rest there; see `simulation.poses`.

        It gets there in the time `over`, or in the time that its `top_speed` and `top_angular_speed` demand if that is
        longer, with a continuous velocity from where and however fast it moves now. Its schedule acts no more, until
        `reset`.

        Parameters
        ----------
        name : str
            A prescribed body with a `top_speed` or a `top_angular_speed`.
        position : sequence of float, optional
            Of its mass centre, in the world [m]; without one that of its present goal, or the present one.
        quaternion : sequence of float, optional
            Orientation x y z w, of any length above 0, likewise; reached by at most half a turn.
        over : float
            The least time until it is there [s].

        Raises
        ------
        InputError
            If there is no such body, or it may not move or turn, or not in this way; nothing is changed then.
        """
        goal = new_goal(self.model, self._state, name, position, quaternion, over)
        if goal is not None:
            self._state.pose_goal[goal[0]] = goal[1]
            self._state.has_history.fill(0.0)  # accelerations jump
        self._note(POSE, name, *values_of_pose(position, quaternion, over))

    def _override(self, index: int, what: str, value: float | None, over: float) -> bool:
        """Set a row of `State.override`; whether anything jumps."""
        if not (math.isfinite(over) and over >= 0.0):
            raise InputError(f"{what}: over = {over} is not allowed; it must be a number of seconds from 0 up")
        if over > 0.0 and value is None:
            raise InputError(f"{what}: over = {over:g} s needs a value to get to; a schedule acts at once")
        row, present = self._state.override[index], self._stepper.surroundings.present(self._state, index)
        if value is not None and over > self._stepper.same_time:
            row[:] = ramp_to(value, present, self.time, over)
            return False
        jumps = acts(row) if value is None else value != present
        if jumps:
            self._stepper.restart(self._state)
        row[:] = jump_to(value)
        return jumps

    def listen(self, note: Callable[[Input], None]) -> Callable[[], None]:
        """Report all inputs from outside to a listener from now on.

        Parameters
        ----------
        note : callable
            Called with each `observed.inputs.Input`, before the step from which on it acts.

        Returns
        -------
        callable
            Ends the reports.
        """
        self._listeners.append(note)
        self._until = math.nan  # who begins to listen hears where steps end
        return lambda: self._listeners.remove(note)

    def _note(self, kind: str, name: str, *values: float) -> None:
        if self._listeners:
            told = Input(int(self._state.step[0]), self.time, kind, name, values)
            for listener in self._listeners:
                listener(told)

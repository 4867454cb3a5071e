"""Commands of controllers, applied to the simulator at ticks, the multiples of the control period.

Whoever advances time, freely, step by step while paused or in lockstep, comes by here at each step: at the first that
begins at a tick or after it, what has come since the tick before is set on the simulator, the last message of each
channel and load. By ``linear`` each is reached one control period later, as a ramp that ends at the next tick, so that
commands which come often are one broken line, and steps never begin again; by ``smooth`` likewise, by a ramp that rests
at each tick. By ``hold`` it jumps. The simulator tells the log: what acts is what is logged.
"""

from __future__ import annotations

import math

from bilayer_core.errors import InputError
from bilayer_core.observed.inputs import LINEAR, SHAPES
from bilayer_core.simulation.observers import TIME_ROUNDING
from bilayer_core.simulation.simulator import Simulator
from bilayer_sim_ros.control.lockstep import Lockstep
from bilayer_sim_ros.control.pending_changes import Commands, Ramp
from bilayer_sim_ros.control.periods import Periods
from bilayer_sim_ros.control.stimulus import StimulusInputs

SHORTEST_PERIOD = 1e-6
"""Shortest control period where steps are adaptive [s]; /clock counts nanoseconds."""
HOLD = "hold"
INTERPOLATIONS = (*SHAPES, HOLD)


class Control:
    """Sets what acts on a simulator; in the thread that simulates.

    Parameters
    ----------
    inputs : StimulusInputs
        Stimuli from outside.
    commands : Commands
        Poses and loads from outside.
    rate : float
        Ticks per simulated second [Hz].
    interpolation : str
        One of `INTERPOLATIONS`.
    lockstep : Lockstep, optional
        Waits at ticks; without one nobody does, and steps end at ticks from the first command on.
    """

    def __init__(
        self,
        inputs: StimulusInputs,
        commands: Commands,
        rate: float,
        interpolation: str = LINEAR,
        lockstep: Lockstep | None = None,
    ):
        self._inputs, self._commands = inputs, commands
        self._ticks = Periods(rate)
        self._interpolation = interpolation
        self._lockstep = lockstep
        self._count = 0
        self._open = self._commanded = self._stands = False

    @property
    def waiting(self) -> bool:
        """True if simulated time must not go on."""
        return self._open and self._lockstep is not None and self._lockstep.waiting

    @property
    def wait_ends_at(self) -> float:
        """When `waiting` ends though nobody answers, on the monotonic clock [s]."""
        return math.inf if self._lockstep is None else self._lockstep.wait_ends_at

    def wait_anew(self) -> None:
        """Begin again to wait: time has stood still for another reason."""
        if self._lockstep is not None:
            self._lockstep.wait_anew()

    def start(self, time: float) -> None:
        """Start a run at `time` [s], which is the first tick."""
        self._ticks.start(time)
        self._count = 0
        self._open_tick(time)
        self._stands = False

    def reset(self) -> None:
        """Give up the run and forget its messages.

        Keep the answer to its start if controllers have seen no later time: they do not notice that time goes back, and
        so will not send it again.
        """
        self._stands = self._lockstep is not None and self._count == 0
        self._inputs.reset(keep_first=self._stands)
        self._commands.reset(keep_first=self._stands)
        self._open = self._commanded = False

    def act(self, simulator: Simulator) -> None:
        """Let what was asked for act from the next step on, if that is the first from a tick on."""
        if not self._open:
            return
        self._open = False
        time = simulator.time
        ramp: Ramp = {}
        if self._interpolation != HOLD:
            ramp = {"over": self._ticks.time_to_nearest_end(time), "shape": self._interpolation}
        for name, value in self._inputs.changes(time).items():
            ramps = value is not None and name in self._inputs.heard
            simulator.set_stimulus(name, value, **(ramp if ramps else {}))
        applied = self._commands.apply(simulator, ramp)
        self._commanded = self._commanded or applied or bool(self._inputs.heard)

    def next_stop(self, time: float) -> float:
        """Return where adaptive steps from `time` [s] on end at the latest [s]."""
        return self._ticks.next_end(time) if self._commanded or self._lockstep is not None else math.inf

    def opens_tick(self, time: float) -> bool:
        """Return whether `advance_to(time)` opens a tick for which time waits: controllers need the frame of `time`."""
        return self._lockstep is not None and self._ticks.complete(time) > self._count

    def advance_to(self, time: float) -> None:
        """Note that a step has ended at `time` [s]; open a tick if it has reached one."""
        count = self._ticks.complete(time)
        if count > self._count:
            self._count = count
            self._open_tick(time)

    def _open_tick(self, time: float) -> None:
        self._open = True
        if self._lockstep is not None:
            self._lockstep.open(time, self._stands)

    def repeat(self, time: float) -> None:
        """Tell those who came late that time stands still at `time` [s], if it is that of an open tick."""
        if self._open and self._lockstep is not None:
            self._lockstep.publish(time)


def tick_rate(control_period: float, rate: float, shortest: float) -> float:
    """Return the ticks per simulated second [Hz].

    `control_period`: wished distance of ticks [s]; 0 = that of frames. `rate`: of frames [Hz]. `shortest`: least
    distance of ticks [s]. Raises InputError if ticks are closer together than steps.
    """
    if control_period == 0.0:
        return rate
    if control_period < shortest * (1.0 - TIME_ROUNDING):
        raise InputError(
            f"parameter 'control_period' is {control_period:g}; allowed is a finite number >= {shortest:g}, the "
            "shortest time between two steps [s], or 0, the period of frames"
        )
    return 1.0 / control_period

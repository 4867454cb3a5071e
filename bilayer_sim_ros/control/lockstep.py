"""Waiting for controllers at ticks."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence

from bilayer_core.errors import InputError
from bilayer_core.printable import shortened
from bilayer_sim_ros.control.stimulus import StimulusInputs
from bilayer_sim_ros.control.tick_answers import mount
from bilayer_sim_ros.publishing.conversions import to_nanoseconds


class Lockstep:
    """Time goes on only when controllers have answered.

    At every tick the time is published, and the step from there waits for messages that come after that. A controller
    that answers each distinct time once thus acts at the same simulated times however long it takes.

    `publish`: publishes a time [s]. `timeout`: longest wait for the answers to a tick [s of real time]; 0 = as long as
    it takes.
    """

    def __init__(self, inputs: StimulusInputs, publish: Callable[[float], None], timeout: float = 0.0):
        self._inputs = inputs
        self.publish = publish
        self._timeout = timeout
        self.wait_anew()

    def open(self, time: float, stand: bool = False) -> None:
        """Publish a tick [s], and wait for its answers; those that were given to the same one before may `stand`."""
        self._inputs.ask(to_nanoseconds(time), stand)
        self.wait_anew()
        self.publish(time)

    @property
    def waiting(self) -> bool:
        """True if the tick lacks an answer for which there is still time; the first query starts that time."""
        if self._inputs.answered:
            return False
        if self._timeout and math.isinf(self.wait_ends_at):
            self.wait_ends_at = clock.monotonic() + self._timeout
        return clock.monotonic() < self.wait_ends_at

    def wait_anew(self) -> None:
        """Let the longest wait begin when it is asked for again."""
        self.wait_ends_at = math.inf


def channels_that_answer(names: Sequence[str], channels: Sequence[str], bodies: Sequence[str] = ()) -> list[str]:
    """Return `names` of the parameter ``lockstep_answers``, without empty ones; InputError if one is no channel and no
    pose of a body that controllers may move, or twice.
    """
    allowed = [*channels, *map(mount, bodies)]
    needed = [name for name in names if name]
    for name in needed:
        if name not in allowed or needed.count(name) > 1:
            fault = "is there twice" if name in allowed else "is no channel of the scene"
            raise InputError(
                f"parameter 'lockstep_answers' is {shortened(str(needed))}: '{shortened(name)}' {fault}; allowed are, "
                f"each once, {shortened(', '.join(allowed)) or 'none, as the scene has no channel'}"
            )
    return needed


def refuse_without_clock(publish_clock: bool) -> None:
    """Raise InputError if controllers could not hear the time."""
    if not publish_clock:
        raise InputError(
            "parameter 'publish_clock' is False; with 'lockstep' allowed is True: controllers answer the time on /clock"
        )

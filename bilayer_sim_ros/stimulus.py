"""Stimuli from topics: which are accepted, and what acts while the topics are silent."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from bilayer_core.errors import InputError

# Simulated times are multiples of the step, up to rounding [s].
TIME_ROUNDING = 1e-9


class Schedule(Protocol):
    """Stimulus over time as a scene prescribes it."""

    def value(self, t: float) -> float:
        """Value at time `t` [s]."""


@dataclass(frozen=True)
class Channel:
    """One stimulus channel: its range in its unit, and the scene's own schedule."""

    name: str
    minimum: float
    maximum: float
    schedule: Schedule

    def accept(self, value: float) -> float:
        """`value` as a float; InputError when it is not finite or out of range."""
        if not (math.isfinite(value) and self.minimum <= value <= self.maximum):
            raise InputError(f"stimulus '{self.name}' is {value:g}; allowed is {self.minimum:g} to {self.maximum:g}")
        return float(value)


class StimulusInputs:
    """Collects what messages ask for (any thread) until the next step begins (the stepping thread).

    Parameters
    ----------
    channels : sequence of Channel
        In the scene's order.
    timeout : float
        Simulated time without a message after which the fallback acts [s]; 0 means never.
    fallback : str
        What acts before a channel's first message and after the timeout: ``hold`` (the last value, at first that of
        the schedule's start), ``zero`` (or the value of the range nearest to it), ``schedule``.

    Attributes
    ----------
    answered : bool
        Whether a message has come since `ask`.
    notify : callable
        Called after each message, in the thread that received it.
    late : callable
        Called in the stepping thread with the simulated time [s] and a channel whose messages stay away for longer than
        the timeout; once until the next message.
    """

    def __init__(self, channels: Sequence[Channel], timeout: float, fallback: str):
        self._channels = {channel.name: channel for channel in channels}
        self._timeout = timeout
        self._fallback = fallback
        self._lock = threading.Lock()
        self.answered = False
        self.notify: Callable[[], None] = lambda: None
        self.late: Callable[[float, str], None] = lambda time, name: None
        self.reset()

    def reset(self) -> None:
        """Forget all messages, as at the start of a run."""
        with self._lock:
            self._received: dict[str, float] = {}
        self._heard: dict[str, float] = {}
        self._acting: dict[str, float | None] = {}
        self._late: set[str] = set()

    def ask(self) -> None:
        """Let `answered` say from now on whether a message has come."""
        self.answered = False

    def receive(self, name: str, value: float) -> None:
        """Take the value of one channel; InputError leaves the last good one in force."""
        self._keep({name: self._channels[name].accept(value)})

    def receive_all(self, values: Sequence[float]) -> None:
        """Take one value a channel in the scene's order; InputError leaves all last good values in force."""
        if len(values) != len(self._channels):
            raise InputError(
                f"a stimulus message has {len(values)} values; expected are {len(self._channels)}: "
                + ", ".join(self._channels)
            )
        pairs = zip(self._channels.values(), values, strict=True)
        self._keep({channel.name: channel.accept(value) for channel, value in pairs})

    def _keep(self, values: Mapping[str, float]) -> None:
        with self._lock:
            self._received.update(values)
            self.answered = True
        self.notify()

    def changes(self, time: float) -> dict[str, float | None]:
        """What to set for the step that begins at `time` [s]: channels that a message or the fallback changes.

        None gives a channel back to the scene's schedule.
        """
        with self._lock:
            received, self._received = self._received, {}
        self._heard.update(dict.fromkeys(received, time))
        changes: dict[str, float | None] = dict(received)
        for name, channel in self._channels.items():
            if self._is_silent(name, time):
                value = self._fallback_value(channel, self._acting.get(name))
                if value != self._acting.get(name):
                    changes[name] = value
                if name in self._heard and name not in self._late:
                    self._late.add(name)
                    self.late(time, name)
            else:
                self._late.discard(name)
        self._acting.update(changes)
        return changes

    def _is_silent(self, name: str, time: float) -> bool:
        """Whether the fallback acts: before the first message, and after the timeout."""
        if name not in self._heard:
            return True
        return self._timeout > 0.0 and time - self._heard[name] >= self._timeout - TIME_ROUNDING

    def _fallback_value(self, channel: Channel, acting: float | None) -> float | None:
        match self._fallback:
            case "zero":
                return min(max(0.0, channel.minimum), channel.maximum)
            case "hold":
                return channel.schedule.value(0.0) if acting is None else acting
            case _:
                return None

"""Stimuli from topics: which are accepted, and what acts while the topics are silent."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from bilayer_core.errors import InputError
from bilayer_core.printable import shortened
from bilayer_core.scene.channel_range import value_in_range
from bilayer_sim_ros.control.tick_answers import Answers

# Simulated times are multiples of the step, up to rounding [s].
TIME_ROUNDING = 1e-9
FEW_NAMES = 5
"""Of a message that is refused, that a warning quotes."""


class Schedule(Protocol):
    """Stimulus over time as a scene prescribes it."""

    def value(self, t: float) -> float:
        """Return the value at time `t` [s]."""


@dataclass(frozen=True)
class Channel:
    """One stimulus channel: its range in its unit, and the scene's own schedule."""

    name: str
    minimum: float
    maximum: float
    schedule: Schedule

    def accept(self, value: float) -> float:
        """Return `value`, or the end of the range that it passes by rounding; InputError when there is no such."""
        accepted = value_in_range(value, self.minimum, self.maximum)
        if accepted is None:
            raise InputError(f"stimulus '{self.name}' is {value:.10g}; allowed is {self.minimum:g} to {self.maximum:g}")
        return accepted


class StimulusInputs:
    """Collects what messages ask for (any thread) until a tick begins (the stepping thread).

    Parameters
    ----------
    channels : sequence of Channel
        In the scene's order.
    timeout : float
        Simulated time without a message after which the fallback acts [s]; 0 means never.
    fallback : str
        What acts before a channel's first message and after the timeout: ``hold`` (the last value, at first that of
        the schedule's start), ``zero`` (or the value of the range nearest to it), ``schedule``.
    answers : Answers, optional
        In lockstep: what judges them. Without it ticks that messages say they answer are not looked at.

    Attributes
    ----------
    ticks : int
        How many have begun; counted by the stepping thread.
    notify : callable
        Called after each message, in the thread that received it.
    late : callable
        Called in the stepping thread with the simulated time [s] and a channel whose messages stay away for longer than
        the timeout; once until the next message.
    missed : callable
        Called in the stepping thread with the simulated time [s] and the channels, newly so, that did not answer a tick
        for which nobody waits any longer.
    """

    def __init__(self, channels: Sequence[Channel], timeout: float, fallback: str, answers: Answers | None = None):
        self._channels = {channel.name: channel for channel in channels}
        self._timeout = timeout
        self._fallback = fallback
        self._lock = threading.Lock()
        self._answers = answers
        self.notify: Callable[[], None] = lambda: None
        self.late: Callable[[float, str], None] = lambda time, name: None
        self.missed: Callable[[float, Sequence[str]], None] = lambda time, names: None
        self._first: dict[str, float] = {}
        self.ticks = 0
        self.reset()

    def reset(self, keep_first: bool = False) -> None:
        """Forget all messages, as at the start of a run, but those that acted at its start if they are to again."""
        with self._lock:
            self._received: dict[str, float] = self._first | self._received if keep_first else {}
        self._first = {}
        self._begun = False
        self._heard: dict[str, float] = {}
        self._acting: dict[str, float | None] = {}
        self._late: set[str] = set()
        self._missing: frozenset[str] = frozenset()

    @property
    def channels(self) -> list[Channel]:
        """All channels, in the scene's order."""
        return list(self._channels.values())

    @property
    def heard(self) -> Collection[str]:
        """Channels that a message has set."""
        return self._heard.keys()

    @property
    def answered(self) -> bool:
        """True if the open tick is complete."""
        return self._answers is None or self._answers.complete

    @property
    def ignored(self) -> Mapping[str, int]:
        """How many stamped answers were ignored, by the reason."""
        return {} if self._answers is None else self._answers.ignored

    def ask(self, tick: int, stand: bool = False) -> None:
        """Wait for answers to a tick in lockstep, a time [ns]; those to it that were given before may `stand`."""
        with self._lock:
            self._answers.open(tick, stand)

    def receive(self, name: str, value: float) -> None:
        """Take the value of one channel; InputError leaves the last good one in force."""
        self._keep({name: self._channels[name].accept(value)})

    def receive_all(self, values: Sequence[float]) -> None:
        """Take one value a channel in the scene's order; InputError leaves all last good values in force."""
        if len(values) != len(self._channels):
            raise InputError(
                f"a stimulus message has {len(values)} values; expected are {len(self._channels)}: "
                + shortened(", ".join(self._channels))
            )
        pairs = zip(self._channels.values(), values, strict=True)
        self._keep({channel.name: channel.accept(value) for channel, value in pairs})

    def receive_stamped(self, tick: int, names: Sequence[str], values: Sequence[float]) -> str:
        """Take values of channels as an answer to a tick [ns].

        Returns why it is ignored (see `Answers.take`); empty if it counts, as it always does outside lockstep. Raises
        InputError if names and values are not one each, or one of them is refused; all last good values stay in force.
        """
        if not names or len(names) != len(values) or len(set(names)) != len(names):
            few = shortened(", ".join(map(shortened, names[:FEW_NAMES])) + (", ..." if len(names) > FEW_NAMES else ""))
            raise InputError(
                f"a stamped stimulus has {len(names)} names ({few}) and {len(values)} positions; "
                "expected is one position for each name, and each name once"
            )
        for name in names:
            if name not in self._channels:
                known = shortened(", ".join(self._channels)) or "none"
                raise InputError(f"there is no stimulus '{shortened(name)}'; allowed is {known}")
        pairs = zip(names, values, strict=True)
        return self._keep({name: self._channels[name].accept(value) for name, value in pairs}, tick)

    def answer(self, name: str, tick: int | None, take: Callable[[], None]) -> str:
        """Take something else than a stimulus, and where ticks wait for it, as an answer to one.

        `name`: as in `Answers`. `tick`: the one that it answers [ns]; None for the open one. `take`: called if it
        counts; `changes`, which comes first at a tick, waits until it has been. Returns what `receive_stamped` does.
        """
        if self._answers is None or not self._answers.waits_for(name):
            take()
            return ""
        with self._lock:
            fault = self._answers.take([name], tick)
            if not fault:
                take()
        self.notify()
        return fault

    def _keep(self, values: Mapping[str, float], tick: int | None = None) -> str:
        with self._lock:
            fault = self._answers.take(values.keys(), tick) if self._answers is not None else ""
            if not fault:
                self._received.update(values)
        self.notify()
        return fault

    def changes(self, time: float) -> dict[str, float | None]:
        """Return the values to set for the step that begins at `time` [s], a tick: those of channels that a message or
        the fallback changes, in the scene's order, whichever message came first.

        None gives a channel back to the scene's schedule.
        """
        self.ticks += 1
        with self._lock:
            received, self._received = self._received, {}
            missing = frozenset() if self._answers is None else self._answers.close()
        if not self._begun:
            self._begun, self._first = True, received
        self._heard.update(dict.fromkeys(received, time))
        changes: dict[str, float | None] = {}
        for name, channel in self._channels.items():
            if name in received:
                changes[name] = received[name]
            silent = self._is_silent(name, time)
            if silent or name in missing - received.keys():
                value = self._fallback_value(channel, self._acting.get(name))
                if value != self._acting.get(name):
                    changes[name] = value
            if not silent:
                self._late.discard(name)
            elif name in self._heard and name not in self._late:
                self._late.add(name)
                self.late(time, name)
        if missing - self._missing:
            self.missed(time, sorted(missing - self._missing))
        self._missing = missing
        self._acting.update(changes)
        return changes

    def _is_silent(self, name: str, time: float) -> bool:
        """Return whether the fallback acts on a channel: before the first message, and after the timeout."""
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

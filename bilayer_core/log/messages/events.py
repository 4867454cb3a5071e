"""Events of a run in words: contact made and lost, steps rejected, take-off and landing, limits of the model passed.

Events are found by comparing a frame with the one before, so that a run is the same whether or not anybody looks, and
costs nothing where nobody does. Their time is that of the frame: contact is made or lost at some time after the frame
before, and what begins and ends between two frames is not seen. Nothing is smoothed: what chatters is told each time.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from bilayer_core.observed.frame import Description, Frame

DEBUG, INFO, WARN = 10, 20, 30
"""Levels of ``rcl_interfaces/msg/Log``."""
LEVEL_NAMES = {DEBUG: "DEBUG", INFO: "INFO", WARN: "WARN"}
CONTACT, STEPS, FLIGHT, STIMULUS, SETTING, END = "contact", "steps", "flight", "stimulus", "setting", "end"
VALIDITY = "validity"
"""Names of events."""
REJECTED_FRAMES = 50
"""Frames between two messages about rejected steps, which sum up those between; the first comes at once."""


@dataclass(frozen=True)
class Event:
    """Something that happened.

    Attributes
    ----------
    time : float
        Of the frame in which it was seen [s].
    level : int
        `DEBUG`, `INFO` or `WARN`.
    name : str
        Its kind: ``contact``, ``steps``, ``flight``, ``validity``, ``stimulus``, ``setting`` or ``end``.
    text : str
    """

    time: float
    level: int
    name: str
    text: str


class EventDetector:
    """Finds events in frames that come one after the other."""

    def __init__(self, description: Description):
        rods = {strand.rod for strand in description.strands}
        held = {body.name for body in description.bodies if body.holds_rods}
        self._robot = rods | held
        # What a prescribed body holds does not take off by itself.
        self._may_fly = not any(body.holds_rods and body.prescribed for body in description.bodies)
        self._pairs: frozenset[tuple[str, str]] | None = None
        self._stood = False
        self._rejected = (0, 0, 0)
        self._told, self._left = (0, 0, 0), 0
        self._beyond: tuple[str, ...] = ()

    def see(self, frame: Frame) -> list[Event]:
        """Return the events since the frame before; at the first frame, the contacts that it has."""
        pairs = frozenset(frame.contacts)
        if self._pairs is None:
            self._pairs, self._stood = pairs, self._stands(pairs)
            return _contacts(frame.time, pairs, "in contact") + self._limits(frame) + self._rejections(frame)
        events = _contacts(frame.time, self._pairs - pairs, "contact lost")
        events += _contacts(frame.time, pairs - self._pairs, "contact made")
        self._pairs = pairs
        stands = self._stands(pairs)
        if self._may_fly and stands != self._stood:
            text = "landing: the robot touches something again" if stands else "take-off: the robot touches nothing"
            events.append(Event(frame.time, INFO, FLIGHT, text))
        self._stood = stands
        return events + self._limits(frame) + self._rejections(frame)

    def end(self, time: float) -> list[Event]:
        """Return the events that are still to be reported at the end of a run."""
        return self._tell_rejections(time)

    def _stands(self, pairs: Iterable[tuple[str, str]]) -> bool:
        """Return whether the robot touches anything else."""
        return any((a in self._robot) != (b in self._robot) for a, b in pairs)

    def _limits(self, frame: Frame) -> list[Event]:
        """Return a warning for each limit of the model that the run has passed since the frame before."""
        new = [text for text in frame.beyond_limits if text not in self._beyond]
        self._beyond = frame.beyond_limits
        return [Event(frame.time, WARN, VALIDITY, text) for text in new]

    def _rejections(self, frame: Frame) -> list[Event]:
        if any(now < before for now, before in zip(frame.rejected, self._told, strict=True)):
            self._told = (0, 0, 0)  # a reset
        self._rejected = frame.rejected
        self._left = max(self._left - 1, 0)
        return [] if self._left else self._tell_rejections(frame.time)

    def _tell_rejections(self, time: float) -> list[Event]:
        total, inaccurate, gaining = (now - told for now, told in zip(self._rejected, self._told, strict=True))
        if total <= 0:
            return []
        self._told, self._left = self._rejected, REJECTED_FRAMES
        other = total - inaccurate - gaining
        causes = (
            (inaccurate, "with too large an error"),
            (gaining, "that made energy"),
            (other, "in which Newton did not converge"),
        )
        text = ", ".join(f"{count} {cause}" for count, cause in causes if count)
        steps = "step" if total == 1 else "steps"
        level = WARN if other or gaining else DEBUG
        return [Event(time, level, STEPS, f"{total} {steps} rejected and made again, shorter: {text}")]


def late_stimulus(time: float, missing: str, acting: str) -> Event:
    """Return the event that a controller is late: what is missing, and what acts instead."""
    return Event(time, WARN, STIMULUS, f"stimulus late: {missing}; {acting}")


def changed_setting(time: float, text: str) -> Event:
    """Return the event that a node continues with another setting."""
    return Event(time, INFO, SETTING, text)


def ended_run(time: float, reason: str) -> Event:
    """Return the event that a run was ended from outside."""
    return Event(time, INFO, END, f"run {reason}")


def _contacts(time: float, pairs: Iterable[tuple[str, str]], what: str) -> list[Event]:
    """Return one event for each thing that several others touch."""
    partners: dict[str, list[str]] = {}
    for first, second in sorted(pairs):
        partners.setdefault(second, []).append(first)
    return [
        Event(time, INFO, CONTACT, f"{what}: {', '.join(names)} with {'itself' if names == [other] else other}")
        for other, names in partners.items()
    ]

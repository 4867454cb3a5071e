"""Which channels have answered a tick of a lockstep, and which answers are none."""

from __future__ import annotations

from collections.abc import Collection, Iterable

LATE, DUPLICATE, FOREIGN = "late", "duplicate", "foreign"
"""Why a stamped answer is ignored: its tick has been left, its channel has answered, or there is no such tick."""


def mount(body: str) -> str:
    """Return the name of a body's pose among the answers to a tick: its topic."""
    return f"mount_pose/{body}"


class Answers:
    """Judges answers to the tick that is open, if one is; `StimulusInputs` guards it against other threads.

    Parameters
    ----------
    channels : iterable of str
        All that there are.
    needed : collection of str
        Those that complete a tick, and names of `mount`; empty means that any answer does.

    Attributes
    ----------
    ignored : dict
        How many answers were `LATE`, `DUPLICATE` or `FOREIGN`.
    """

    def __init__(self, channels: Iterable[str], needed: Collection[str] = ()):
        self._channels, self._needed = frozenset(channels), frozenset(needed)
        self._tick: int | None = None
        self._open = False
        self._given: set[str] = set()
        self.ignored = dict.fromkeys((LATE, DUPLICATE, FOREIGN), 0)

    def open(self, tick: int, stand: bool = False) -> None:
        """Wait for answers to a tick, a time [ns]; those to it that were given before may `stand`."""
        self._tick, self._open = tick, True
        if not stand:
            self._given = set()

    def close(self) -> frozenset[str]:
        """Wait no more; the channels from which an answer is missing."""
        missing = frozenset() if self.complete else (self._needed or self._channels) - self._given
        self._open = False
        return missing

    @property
    def complete(self) -> bool:
        """True if no further answer is awaited, as always where there is no channel."""
        if not self._open or not (self._channels or self._needed):
            return True
        return self._needed <= self._given if self._needed else bool(self._given)

    def waits_for(self, name: str) -> bool:
        """Return whether every tick needs an answer of that name to be complete."""
        return name in self._needed

    def take(self, channels: Collection[str], stamp: int | None) -> str:
        """Note an answer of some channels.

        `stamp`: the tick that it answers [ns]; without one it answers the open tick. Returns why it is ignored: `LATE`,
        `DUPLICATE` or `FOREIGN`; empty if it counts.
        """
        fault = "" if stamp is None else self._fault(channels, stamp)
        if fault:
            self.ignored[fault] += 1
        elif self._open:
            self._given.update(channels)
        return fault

    def _fault(self, channels: Collection[str], stamp: int) -> str:
        if self._tick is None or stamp > self._tick:
            return FOREIGN
        if stamp == self._tick and not self._given.isdisjoint(channels):
            return DUPLICATE
        return "" if stamp == self._tick and self._open else LATE

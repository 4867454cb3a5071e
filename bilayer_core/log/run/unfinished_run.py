"""A run that still goes on: its messages as they come, and the frames that are whole."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bilayer_core.log.file.log_head import Head
from bilayer_core.log.messages.topics import EVENTS, LOG_NAMESPACE, Rate, output_topics
from bilayer_core.log.run.log_source import LogSource
from bilayer_core.log.run.logged_run import LoggedRun
from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import Description

UNREAD = ("/clock", "state", "markers")
"""Topics of which a run's arrays are not made."""
MOST_WAITING = 1000
"""Frames of a topic that wait for those of others, at most: of one that never comes, the others are forgotten."""


class Messages:
    """Messages in the order in which they came: what `LogSource` asks of a file."""

    namespace = LOG_NAMESPACE

    def __init__(self, topics: dict[str, str], taken: list[tuple[str, int, bytes]]):
        self.topics = topics
        self._taken = taken

    def times(self, topic: str) -> np.ndarray:
        """Return when each message of a topic was sent [ns]."""
        return np.array([stamp for name, stamp, _ in self._taken if name == topic], np.uint64)

    def count(self, topic: str) -> int:
        """Return how many messages of a topic there are."""
        return sum(name == topic for name, _, _ in self._taken)

    def messages(self, topics: set[str] | None = None, begin: int = 0) -> Iterator[tuple[str, int, bytes]]:
        """Return the topic, time [ns] and data of each message of some topics, from a time on."""
        return (of for of in self._taken if (topics is None or of[0] in topics) and of[1] >= begin)


class ArrivingRun:
    """Takes the messages of a run one by one, and gives what has become whole since it was asked last.

    A frame is whole when all topics of its rate have come with its time. What comes without the others, as of a
    transport that loses some, is left out; so is what comes again, and what is older than what was given already.
    """

    def __init__(self, description: Description):
        self.description = description
        specs = [spec for spec in output_topics(description) if spec.name not in UNREAD]
        self._groups = [
            [spec.full_name() for spec in specs if (spec.rate is Rate.DISPLAY) == display] for display in (False, True)
        ]
        self._events = EVENTS.full_name()
        self._topics = {spec.full_name(): spec.type for spec in (*specs, EVENTS)}
        self._waiting: dict[str, dict[int, bytes]] = {name: {} for name in self._topics if name != self._events}
        self._told: list[tuple[int, bytes]] = []
        self._last = [-1, -1]
        self._head = Head(description, {}, {}, {})

    def add(self, topic: str, stamp: int, data: bytes) -> None:
        """Take a message of the topic with this full name in a log, sent at a time [ns]; others are not needed."""
        if topic == self._events:
            self._told.append((stamp, data))
        elif topic in self._waiting:
            waiting = self._waiting[topic]
            waiting[stamp] = data
            if len(waiting) > MOST_WAITING:
                del waiting[next(iter(waiting))]

    def take(self) -> RunData | None:
        """Return the frames that have become complete, or None. Events wait until there are frames."""
        taken: list[tuple[str, int, bytes]] = []
        for number, names in enumerate(self._groups):
            whole = set.intersection(*(set(self._waiting[name]) for name in names))
            stamps = sorted(stamp for stamp in whole if stamp > self._last[number])
            if not stamps:
                continue
            self._last[number] = stamps[-1]
            for name in names:
                waiting = self._waiting[name]
                taken += [(name, stamp, waiting[stamp]) for stamp in stamps]
                self._waiting[name] = {stamp: data for stamp, data in waiting.items() if stamp > stamps[-1]}
        if not taken:
            return None
        taken += [(self._events, stamp, data) for stamp, data in self._told]
        self._told = []
        messages = Messages(self._topics, taken)
        return LoggedRun(LogSource(Path(LOG_NAMESPACE), self._head, messages))

"""Bounded queue of items that wait for the writer of a log, from the stepping thread to the writer's."""

from __future__ import annotations

import threading
import time as clock
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Backlog(Generic[Item]):
    """Items on their way from one thread to another, which takes many at a time.

    To hand one over costs the first thread some microseconds, whatever the other one does: that is woken for the first
    item alone, and again when the queue is half full. `capacity`: number of items. `gathering`: wall time for which the
    taker waits for more after the first one [s].
    """

    def __init__(self, capacity: int, gathering: float):
        self._capacity, self._gathering = capacity, gathering
        self._items: deque[Item] = deque()
        self._changed = threading.Condition(threading.Lock())
        self._urgent = self._closed = False

    def __len__(self) -> int:
        """Return the items that wait."""
        return len(self._items)

    def put(self, item: Item, patience: float | None = None) -> bool:
        """Put an item into the queue when there is room for it.

        `patience`: longest wait for room [s]; without one as long as it takes. Returns whether it was handed over:
        there was room in time, and the queue is not closed.
        """
        with self._changed:
            if len(self._items) >= self._capacity and patience != 0.0:
                self._changed.wait_for(lambda: self._closed or len(self._items) < self._capacity, patience)
            if self._closed or len(self._items) >= self._capacity:
                return False
            self._append(item)
            return True

    def add(self, item: Item, urgent: bool = False) -> None:
        """Put an item into the queue whether there is room or not; an urgent one is taken at once. Never waits."""
        with self._changed:
            self._urgent = self._urgent or urgent
            self._append(item)

    def take(self, timeout: float | None) -> list[Item]:
        """Return all items there are, once there is one and more have gathered; none after a time [s] without any."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._items, timeout):
                return []
            end = clock.monotonic() + (self._gathering if timeout is None else min(self._gathering, timeout))
            while not self._is_pressing and (left := end - clock.monotonic()) > 0.0:
                self._changed.wait(left)
            items = list(self._items)
            self._items.clear()
            self._changed.notify_all()
            return items

    def close(self) -> None:
        """Take no more: who waits for room need not."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def _is_pressing(self) -> bool:
        return self._urgent or 2 * len(self._items) >= self._capacity

    def _append(self, item: Item) -> None:
        self._items.append(item)
        if len(self._items) == 1 or self._is_pressing:
            self._changed.notify_all()

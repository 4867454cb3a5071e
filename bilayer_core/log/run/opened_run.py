"""Runs by their name: a log, or a run in a bag of ``ros2 bag record``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from bilayer_core.log.file.log_chunks import LogFile
from bilayer_core.log.file.log_head import Head, is_log, read_head
from bilayer_core.log.messages.topics import LOG_NAMESPACE
from bilayer_core.log.run.bag import Bag, choose_run, split_address


class MessageSource(Protocol):
    """Messages of a run: a log, a part of a bag, or what has come of a run so far."""

    namespace: str
    topics: dict[str, str]

    def times(self, topic: str) -> np.ndarray: ...

    def count(self, topic: str) -> int: ...

    def messages(self, topics: set[str] | None = None) -> Iterator[tuple[str, int, bytes]]: ...


def names_log(path: Path, node: str, number: int) -> bool:
    """Return whether a name that `split_address` has split is that of a log, whose only run is of `LOG_NAMESPACE`."""
    return node in ("", LOG_NAMESPACE) and number in (0, 1) and not path.is_dir() and is_log(path)


def open_run(name: str | Path) -> tuple[Head, MessageSource]:
    """Return what a run is, and its messages.

    Parameters
    ----------
    name : str or Path
        Of a log; of a bag, a file or a directory, that holds one run; or of one of its runs, such as
        ``bag:/lab/robot1``, or ``bag:/lab/robot1@2`` after a reset.

    Raises
    ------
    InputError
        If there is no such file or run, or the name does not say which one.
    """
    path, node, number = split_address(name)
    if names_log(path, node, number):
        return read_head(path), LogFile(path)
    bag = Bag(path, node)
    return bag.opened(choose_run(bag, number))

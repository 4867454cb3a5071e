"""Runs by their name: a log, or a run in a bag of ``ros2 bag record``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from bilayer_core.record.bag import Bag, choose_run, split_address
from bilayer_core.record.log_chunks import LogFile
from bilayer_core.record.log_head import Head, is_log, read_head


class MessageSource(Protocol):
    """Messages of a run: a log, a part of a bag, or what has come of a run so far."""

    namespace: str
    topics: dict[str, str]

    def times(self, topic: str) -> np.ndarray: ...

    def messages(self, topics: set[str] | None = None) -> Iterator[tuple[str, int, bytes]]: ...


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
    if not (node or number or path.is_dir()) and is_log(path):
        return read_head(path), LogFile(path)
    bag = Bag(path, node)
    return bag.opened(choose_run(bag, number))

"""Processes beside the program."""

import threading
import time
from multiprocessing import active_children

import pytest

from bilayer_core.converge.processes import side_by_side


class Stop(Exception):
    """What ends a block."""


def test_a_block_that_ends_leaves_neither_process_nor_thread():
    before = set(threading.enumerate()), set(active_children())
    with pytest.raises(Stop), side_by_side(1) as pool:
        pool.submit(time.sleep, 100.0)
        waiting = pool.submit(time.sleep, 100.0)
        raise Stop
    assert (set(threading.enumerate()), set(active_children())) == before  # Python's own end would race with a thread
    assert waiting.done()

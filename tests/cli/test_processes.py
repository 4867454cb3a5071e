"""Processes beside the program."""

import os
import threading
import time
from multiprocessing import active_children

import pytest
from support.processes import python

from bilayer_core.processes import side_by_side, usable_cores

ON_ONE_CORE = """
import os
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
from bilayer_core.processes import usable_cores
print(usable_cores())
"""


class Stop(Exception):
    """What ends a block."""


def test_a_block_that_ends_leaves_neither_process_nor_thread():
    before = set(threading.enumerate()), set(active_children())
    with pytest.raises(Stop), side_by_side(1) as schedule:
        schedule(time.sleep, 100.0)
        waiting = schedule(time.sleep, 100.0)
        raise Stop
    assert (set(threading.enumerate()), set(active_children())) == before  # Python's own end would race with a thread
    assert waiting.done()


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="says not which cores a process may use")
def test_cores_that_this_process_may_not_use_are_not_counted():
    assert python(ON_ONE_CORE) == "1"


def test_where_the_system_does_not_say_which_cores_may_be_used_all_are(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "process_cpu_count", os.cpu_count, raising=False)
    assert usable_cores() == os.cpu_count()

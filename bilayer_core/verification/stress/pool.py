"""Worker processes that run cases: they stay, as kernels take time to load, and are killed at the limits of a case."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from pathlib import Path

from bilayer_core.processes import side_by_side
from bilayer_core.verification.stress.stress_case import Outcome, Record, StressCase

MEMORY = 3 * 2**30
"""Address space that a worker may take beyond what it has when it begins, on Linux [bytes]."""
MEMORY_FILE = Path("/proc/self/statm")
"""Linux says there what a process has; other systems do not, and most of them heed no such limit."""
CASES_A_WORKER = 100
"""Then another takes its place: memory that cases gave back is not always of use to the next one."""
GRACE, LEAST_TIME = 12.0, 120.0
"""Wall time after which a worker is killed, over the case's limit of CPU time (a run, a finer one, and a remedy), and
the least [s].
"""


def run_cases(cases: Iterable[StressCase], workers: int, done: Callable[[Record], None]) -> None:
    """Run cases, and hand on what comes of each as soon as it has.

    `workers`: number of processes. `done`: called with each record.
    """
    left = list(reversed(list(cases)))
    with _started(workers) as begin:
        waiting = {}
        while left or waiting:
            while left and len(waiting) < 2 * workers:
                case = left.pop()
                waiting[begin(case)] = case
            finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for job in finished:
                done(_record_of(job, waiting.pop(job)))


@contextmanager
def one_by_one() -> Iterator[Callable[[StressCase], Record]]:
    """Start a process for cases of which each depends on what came of the one before; yield what runs one."""
    with _started(1) as begin:
        yield lambda case: _record_of(begin(case), case)


@contextmanager
def _started(workers: int) -> Iterator[Callable[[StressCase], Future]]:
    with side_by_side(workers, CASES_A_WORKER, _limit_memory) as schedule:
        yield lambda case: schedule(_run, case, timeout=_time_of(case))


def _record_of(job: Future, case: StressCase) -> Record:
    from pebble import ProcessExpired

    try:
        return Record.from_line(job.result())
    except TimeoutError:
        return _lost(case, f"took longer than {_time_of(case):g} s, and was killed")
    except ProcessExpired as death:
        return _lost(case, f"its process died with exit code {death.exitcode}")
    except Exception as fault:  # of the worker, such as no memory while it tells what came
        return _lost(case, f"{type(fault).__name__}: {fault}")


def _time_of(case: StressCase) -> float:
    return max(LEAST_TIME, GRACE * case.cpu_limit)


def _lost(case: StressCase, why: str) -> Record:
    return Record(case.name, case.axis, not case.outside, list(case.outside), Outcome.FAILED, why)


def _limit_memory() -> None:
    """Prepare a worker: load numpy and scipy, and then limit its address space."""
    from bilayer_core.verification.stress import execute_case  # noqa: F401 (loads all that cases need)

    try:
        import resource
    except ImportError:
        return
    if not MEMORY_FILE.exists():
        return
    present = int(MEMORY_FILE.read_text(encoding="ascii").split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (present + MEMORY, present + MEMORY))


def _run(case: StressCase) -> str:
    from bilayer_core.verification.stress.execute_case import execute

    return execute(case).line()

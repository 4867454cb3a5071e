"""Dask's processes: those of this machine, or of a cluster that exists, and the runs that they are given.

As many pieces of work as there are threads are on their way, so a process that dies costs the piece it is at and no
other. A piece is one run, or several short ones: Dask takes 2 to 4 ms for each piece.
"""

from __future__ import annotations

import os
import socket
import threading
import time as clock
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

from bilayer_core.errors import EngineError, InputError, OutputError
from bilayer_core.studies.sweeps.execute_runs import execute, present_versions, row_of
from bilayer_core.studies.sweeps.job import Job, Outcome, Point, Row

PIECE_TIME = 0.25
"""Wall time that a piece of short runs should take [s]."""
LARGEST_PIECE = 64
"""Runs."""
MOST_DEATHS = 2
"""Of the process of one run alone; then the run is killed, in the words of its row."""
LOOK_TIME, LONELY_TIME = 2.0, 60.0
"""Between two looks whether anybody works at all, and how long nobody may [s]."""
COUNT_TIME = 5.0
"""Between two counts of the threads of a cluster [s]."""
KILL_FACTOR, KILL_EXTRA = 2.0, 10.0
"""A run is killed at this multiple of the time it may take, and so many seconds more: it could not stop by itself."""
TOPIC = "bilayer-sweep"


def work(job: Job, points: Sequence[Point]) -> list[Row]:
    """Do a piece of work in the process that calls this.

    Raises
    ------
    InputError
        If the process has other versions; a process that joined after the first run has not been checked yet.
    """
    from distributed import get_worker

    refuse_other_versions(job, present_versions(), f"worker {get_worker().address} on {socket.gethostname()}")
    rows: list[Row] = []
    for point in points:
        with _killed_when_late(job, point):
            rows += execute(job, [point])
    return rows


@contextmanager
def _killed_when_late(job: Job, point: Point) -> Iterator[None]:
    if job.wall_time is None:
        yield
        return
    from distributed import get_worker

    worker, most = get_worker(), KILL_FACTOR * job.wall_time + KILL_EXTRA

    def kill() -> None:
        worker.log_event(TOPIC, {"key": point.key, "reason": f"it did not stop within {most:g} s, and was killed"})
        threading.Event().wait(0.5)  # until that is sent
        os._exit(1)

    timer = threading.Timer(most, kill)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@dataclass
class _Piece:
    job: Job
    points: list[Point]
    future: Any


class Engine:
    """Processes that take runs.

    Parameters
    ----------
    client : distributed.Client
    job : Job
    memory : float or None
        At which a process is killed [bytes], for messages.

    Attributes
    ----------
    client : distributed.Client
    threads : int
        Runs side by side.
    where : str
        For the user.
    dashboard : str
        Address of a cluster's dashboard; empty if there is none.
    notices : list of str
        Lines that the user has to see: who else can reach or read something.
    """

    def __init__(self, client: Any, job: Job, memory: float | None):
        self.client, self._job, self._memory = client, job, memory
        self._name = uuid4().hex[:8]
        self._done: SimpleQueue[int] = SimpleQueue()
        self._pieces: dict[int, _Piece] = {}
        self._again: deque[tuple[Job, Point]] = deque()
        self._deaths: dict[str, int] = {}
        self._reasons: dict[str, str] = {}
        self._count = 0
        self._mean: float | None = None
        self.threads, self._counted = 1, clock.monotonic()
        self.where = self.dashboard = ""
        self.notices: list[str] = []
        client.subscribe_topic(TOPIC, self._hear)

    def _hear(self, event: tuple[float, Any]) -> None:
        if isinstance(event[1], dict) and "key" in event[1]:
            self._reasons[event[1]["key"]] = str(event[1].get("reason", ""))

    @property
    def free(self) -> int:
        """Pieces of work that can be given now."""
        return self.threads - len(self._pieces)

    @property
    def _capacity(self) -> int:
        """Pieces that `run` may give, one ahead for each process, which then need not wait for it. None of long runs,
        for which that makes no difference, nor while runs are made again alone because their process has died.
        """
        ahead = self.threads if self.piece_size > 1 and not self._again else 0
        return self.free + ahead

    @property
    def busy(self) -> int:
        """Runs that are on their way."""
        return sum(len(piece.points) for piece in self._pieces.values()) + len(self._again)

    @property
    def piece_size(self) -> int:
        """Runs for the next piece."""
        if self._mean is None:
            return 1
        return max(1, min(LARGEST_PIECE, int(PIECE_TIME / max(self._mean, 1e-6))))

    def run(self, points: Iterator[Point]) -> Iterator[list[Row]]:
        """Make runs; the rows of each piece come when it is done, in any order."""
        left = True
        while left or self.busy:
            while self._capacity > 0 and left:
                piece = [point for _, point in zip(range(self.piece_size), points, strict=False)]
                left = bool(piece)
                if piece:
                    self.submit(piece)
            if self.busy:
                yield self.wait()

    def submit(self, points: Sequence[Point], job: Job | None = None) -> None:
        """Give away a piece of work; with another `job` the runs are of that."""
        job = job or self._job
        self._count += 1
        number = self._count
        key = f"bilayer-run-{self._name}-{number}"
        future = self.client.submit(work, job, list(points), key=key, pure=False)
        self._pieces[number] = _Piece(job, list(points), future)
        future.add_done_callback(lambda _: self._done.put(number))

    def wait(self) -> list[Row]:
        """Return the rows of the next piece that is done; none if its process died and the piece is submitted again.

        Raises
        ------
        EngineError
            If no processes are left.
        OutputError
            If a log could not be written.
        """
        while self._again and self.free > 0:
            job, point = self._again.popleft()
            self.submit([point], job)
        if clock.monotonic() - self._counted > COUNT_TIME:
            self.count_threads()
        lonely = 0.0
        while True:
            try:
                number = self._done.get(timeout=LOOK_TIME)
                break
            except Empty:
                lonely = 0.0 if self.count_threads() else lonely + LOOK_TIME
                if lonely >= LONELY_TIME:
                    raise EngineError(f"{self.where}: no process has been there for {lonely:g} s") from None
        return self._collect(self._pieces.pop(number))

    def count_threads(self) -> int:
        """Look how many threads there are now: workers of a cluster may come and go."""
        if self.client.status != "running":
            raise EngineError(f"{self.where}: the scheduler has gone")
        present = self.client.scheduler_info(n_workers=-1)["workers"].values()
        threads = sum(worker["nthreads"] for worker in present)
        self.threads, self._counted = threads or self.threads, clock.monotonic()
        return threads

    def _collect(self, piece: _Piece) -> list[Row]:
        from distributed import KilledWorker

        try:
            rows: list[Row] = piece.future.result()
        except KilledWorker:
            return self._of_dead(piece.job, piece.points)
        except (OutputError, InputError):
            raise
        except Exception as error:
            if piece.future.status in ("cancelled", "lost"):
                raise EngineError(f"{self.where}: the scheduler has gone") from None
            told = " ".join(f"{type(error).__name__}: {error}".split())
            raise EngineError(f"{self.where}: a process cannot do its work: {told}") from error
        finally:
            piece.future.release()
        time = sum(row.wall_time for row in rows) / len(rows)
        self._mean = time if self._mean is None else 0.8 * self._mean + 0.2 * time
        return rows

    def _of_dead(self, job: Job, points: list[Point]) -> list[Row]:
        """Try each run of a process that died once more by itself; return the row of one that is at fault."""
        if len(points) > 1:
            self._again.extend((job, point) for point in points)
            return []
        (point,) = points
        self._deaths[point.key] = self._deaths.get(point.key, 0) + 1
        reason = self._reasons.get(point.key, "")
        if self._deaths[point.key] < MOST_DEATHS and not reason:
            self._again.append((job, point))
            return []
        limit = f"; processes are killed beyond {self._memory / 1e9:.3g} GB" if self._memory else ""
        reason = reason or f"its process died {MOST_DEATHS} times{limit}"
        row = row_of(job, point)
        row.outcome, row.reason = Outcome.KILLED, reason
        return [row]


def refuse_other_versions(job: Job, found: dict[str, str], who: str) -> None:
    """Raise InputError if a process has other versions than this program."""
    here = job.expected
    if found != here:
        others = [f"{name} {found.get(name)} (here {here[name]})" for name in here if found.get(name) != here[name]]
        raise InputError(
            f"{who} has other versions: {', '.join(others)}; results would differ in their last digits or more; "
            "install the same on both sides"
        )

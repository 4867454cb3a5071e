"""Processes that are ready to run: of this machine, or of a cluster that exists."""

from __future__ import annotations

import logging
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.request import urlopen

from bilayer_core.errors import EngineError, InputError, OutputError
from bilayer_core.extras import require
from bilayer_core.log.file.private_directory import private_directory
from bilayer_core.processes import usable_cores
from bilayer_core.studies.sweeps.certificates import check_certificates, is_encrypted, security_of
from bilayer_core.studies.sweeps.dask_processes import Engine, refuse_other_versions
from bilayer_core.studies.sweeps.execute_runs import LOGS, prepare
from bilayer_core.studies.sweeps.job import Job

if TYPE_CHECKING:
    from distributed import Security

DASHBOARD_TIME = 2.0
"""For the dashboard to answer [s]."""
CONNECT_TIME = 8.0
"""To reach a scheduler [s]."""
PREPARE_TIME = 600.0
"""For a process to start, and to compile kernels [s]."""
OPEN_CLUSTER = (
    "warning: whoever reaches the port of this scheduler can run programs as the users of scheduler and workers; "
    "docs/sweeps.md says how certificates prevent that"
)
CONFIG = {
    "distributed.scheduler.allowed-failures": 0,  # who dies is counted here
    "distributed.deploy.lost-worker-timeout": 1e9,  # [s] a process that dies is replaced, however long that takes
    "distributed.worker.memory.target": False,  # of what runs, nothing can be put to disk
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.gil.enabled": False,
}
"""Of processes of this machine."""


@dataclass(frozen=True)
class Processes:
    """The processes that a user asks for.

    Attributes
    ----------
    workers : int or None
        Processes of this machine; by default one a core.
    scheduler : str or None
        Address of a Dask scheduler whose workers run instead: ``tls://host:8786``.
    security : distributed.Security or None
        Certificates for that scheduler; by default those that Dask's configuration names.
    dashboard : bool
        Whether the processes of this machine serve Dask's dashboard.
    """

    workers: int | None = None
    scheduler: str | None = None
    security: Security | None = None
    dashboard: bool = False


@contextmanager
def open_engine(job: Job, processes: Processes, memory: float | None = None) -> Iterator[Engine]:
    """Yield processes that are ready to run.

    Parameters
    ----------
    job : Job
    processes : Processes
    memory : float, optional
        At which a process of this machine is killed [bytes]; by default its share of the memory.

    Raises
    ------
    InputError
        If a package is not installed, the scheduler cannot be reached with these certificates, or its workers have
        other versions or do not see the directory of logs.
    EngineError
        If no process starts.
    """
    require("sweep", "dask", "distributed", "cryptography")
    import dask
    import distributed  # noqa: F401 (fills the configuration; from an empty one, `set` would remove it all at its end)

    with ExitStack() as stack:
        if processes.scheduler is None:
            workers = processes.workers or usable_cores()
            stack.enter_context(dask.config.set(CONFIG))
            engine = _embedded(stack, job, workers, memory, processes.dashboard)
            _get_ready(engine, job, workers)
        else:
            engine = _joined(stack, job, processes.scheduler, processes.security)
            _get_ready(engine, job, None)
        yield engine


def _embedded(stack: ExitStack, job: Job, workers: int, memory: float | None, dashboard: bool) -> Engine:
    from distributed import Client

    from bilayer_core.studies.sweeps.local_cluster import start_cluster

    folder = stack.enter_context(private_directory())
    try:
        cluster = stack.enter_context(start_cluster(workers, memory, str(folder), dashboard))
    except RuntimeError as error:
        hint = "in a program, call it below `if __name__ == '__main__':`, since processes read the program again"
        raise EngineError(f"sweep: no process starts on this machine ({error}); {hint}") from error
    client = stack.enter_context(Client(cluster, set_as_default=False))
    engine = Engine(client, job, memory)
    engine.where = f"{workers} processes of this machine" if workers > 1 else "one process of this machine"
    if dashboard:
        engine.notices.append(f"dashboard {client.dashboard_link}: any user of this machine can read it")
    return engine


def _joined(stack: ExitStack, job: Job, address: str, security: Security | None) -> Engine:
    from distributed import Client

    security = security or security_of(None, None, None)
    check_certificates(address, security)
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    stack.callback(logger.setLevel, before)
    try:
        client = stack.enter_context(Client(address, timeout=CONNECT_TIME, set_as_default=False, security=security))
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"--scheduler: {address}: no Dask scheduler can be reached there within {CONNECT_TIME:g} s ({reason}); "
            "`dask scheduler` prints its address when it starts, such as tls://192.0.2.1:8786"
        ) from None
    engine = Engine(client, job, None)
    engine.where, engine.dashboard = f"cluster {address}", _dashboard(client)
    if not is_encrypted(address):
        engine.notices.append(OPEN_CLUSTER)
    return engine


def _dashboard(client: Any) -> str:
    """Return the address of a scheduler's dashboard; empty if nothing answers there."""
    try:
        link = str(client.dashboard_link)
        with urlopen(link, timeout=DASHBOARD_TIME):
            return link
    except (KeyError, OSError, ValueError):
        return ""


def _get_ready(engine: Engine, job: Job, workers: int | None) -> None:
    """Wait for processes, and have them say their versions, compile, and look for the directory of logs."""
    client, joined = engine.client, workers is None
    try:
        client.wait_for_workers(1 if joined else workers, timeout=CONNECT_TIME if joined else PREPARE_TIME)
    except TimeoutError:
        what = "start some with `dask worker ADDRESS`" if joined else "is there enough memory?"
        error = InputError if joined else EngineError
        raise error(f"{engine.where}: has no workers; {what}") from None
    engine.count_threads()
    present = client.scheduler_info(n_workers=-1)["workers"]
    with _token(job) as token:
        by_host: dict[str, list[str]] = {}
        for address, worker in present.items():
            by_host.setdefault(worker["host"], []).append(address)
        firsts = {addresses[0] for addresses in by_host.values()}
        for group in (firsts, present.keys() - firsts):  # one of a machine compiles, the others read what it kept
            asked = {
                address: client.submit(
                    prepare, job, token, workers=[address], allow_other_workers=False, pure=False, retries=1
                )
                for address in group
            }
            for address, future in asked.items():
                _check(engine, address, job, _answer(engine, address, future))


def _answer(engine: Engine, address: str, future: Any) -> dict[str, Any]:
    try:
        return future.result(timeout=PREPARE_TIME)
    except (InputError, OutputError):
        raise
    except Exception as error:
        told = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(
            f"{engine.where}: worker {address} cannot run: {told}; bilayer_sim_ros must be installed there, in the "
            "version that is here"
        ) from error


def _check(engine: Engine, address: str, job: Job, answer: dict[str, Any]) -> None:
    refuse_other_versions(job, answer["versions"], f"{engine.where}: worker {address} on {answer['host']}")
    if not answer["sees"] or not answer["writes"]:
        what = "cannot write there" if answer["sees"] else "does not see it"
        raise InputError(
            f"--out: {job.directory}: worker {address} on {answer['host']} {what}; logs need a directory that all "
            f"workers share, by the same name (this is {socket.gethostname()})"
        )


@contextmanager
def _token(job: Job) -> Iterator[str]:
    """Yield the name of something that is in the directory of logs meanwhile; empty if there are no logs."""
    if job.logs == "none":
        yield ""
        return
    folder = Path(job.directory, LOGS)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with private_directory(folder) as directory:
            yield directory.parent.name
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error

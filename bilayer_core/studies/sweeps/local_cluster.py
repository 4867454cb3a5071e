"""Processes of this machine for a sweep, which nobody else can reach.

Dask runs whatever code arrives at its ports. So scheduler, workers and client share a certificate that is made for
this one cluster and is kept in their memory; who does not have it is refused. Dask's nodes also serve HTTP, to any
user of the machine; they do not here, but for the dashboard if it is asked for.
"""

from __future__ import annotations

import logging
from typing import Any

from distributed import Nanny, Scheduler, Security, SpecCluster, Worker

from bilayer_core.extras import require
from bilayer_core.processes import keyboard_unheard

HOST = "127.0.0.1"


class WithoutHttp:
    """A node of Dask's that serves no HTTP."""

    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Start none."""


class QuietScheduler(WithoutHttp, Scheduler):
    """A scheduler that listens for workers and clients only."""


class QuietWorker(WithoutHttp, Worker):
    """A worker that listens for scheduler, workers and clients only."""


def start_cluster(workers: int, memory: float | None, folder: str, dashboard: bool) -> SpecCluster:
    """Start a scheduler in this process, and worker processes.

    Parameters
    ----------
    workers : int
    memory : float or None
        At which a worker is killed [bytes]; None for its share of the memory.
    folder : str
        For files of the workers.
    dashboard : bool
        Whether the scheduler serves Dask's dashboard, to all users of this machine.

    Raises
    ------
    InputError
        If a package is missing.
    RuntimeError
        If no process starts.
    """
    if dashboard:
        require("--dashboard", "bokeh")
    # The key and the certificate are made here, and are kept in memory.
    common = {"host": HOST, "protocol": "tls://", "security": Security.temporary()}
    served = {"dashboard": dashboard, "dashboard_address": f"{HOST}:0"}
    options = common | {
        "nthreads": 1,
        "memory_limit": memory or "auto",
        "local_directory": folder,
        "silence_logs": logging.CRITICAL,
        "worker_class": QuietWorker,
    }
    with keyboard_unheard():
        return SpecCluster(
            scheduler={"cls": Scheduler if dashboard else QuietScheduler, "options": common | served},
            workers={number: {"cls": Nanny, "options": options} for number in range(workers)},
            security=common["security"],
            silence_logs=logging.CRITICAL,
        )

"""A real scheduler and two worker processes on loopback, for all tests of this folder."""

import copy

import pytest
from support.sweep_programs import STRIP, address_in, dask, end, start_scheduler


@pytest.fixture
def strip():
    """Content of a sweep of eight short runs."""
    return copy.deepcopy(STRIP)


@pytest.fixture(scope="session")
def scheduler(tmp_path_factory):
    """Address of a scheduler that has no workers yet."""
    file = tmp_path_factory.mktemp("dask") / "scheduler.json"
    process = start_scheduler(file)
    yield address_in(file)
    end([process])


@pytest.fixture(scope="session")
def cluster(scheduler, tmp_path_factory):
    """Address of that scheduler, with two worker processes."""
    folder = str(tmp_path_factory.mktemp("workers"))
    options = "--nthreads", "1", "--no-dashboard", "--local-directory", folder, "--host", "127.0.0.1"
    workers = [dask("worker", scheduler, *options) for _ in range(2)]
    from distributed import Client

    with Client(scheduler, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
    yield scheduler
    end(workers)

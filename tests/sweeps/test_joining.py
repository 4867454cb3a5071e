"""Workers of a cluster that come during a sweep."""

import pytest
from support.sweep_programs import address_in, dask, end, start_scheduler

from bilayer_core.errors import InputError
from bilayer_core.studies.sweeps.run_sweep import sweep


@pytest.fixture
def small(tmp_path):
    """Address of a scheduler with one worker, and what starts another one."""
    file = tmp_path / "scheduler.json"
    processes = [start_scheduler(file)]
    options = "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)

    def start(**environment):
        processes.append(dask("worker", address_in(file), *options, **environment))

    start()
    yield address_in(file), start
    end(processes[::-1])


def many_runs(strip):
    strip["set"]["duration"] = "10 s"
    strip["parameters"]["gain"]["count"] = 5000
    return strip


class Enough(Exception):
    """Ends a sweep."""


@pytest.mark.slow
def test_a_worker_that_comes_later_takes_runs(strip, small, monkeypatch):
    monkeypatch.setattr("bilayer_core.studies.sweeps.dask_processes.COUNT_TIME", 0.5)
    address, start = small
    took = set()
    from distributed import Client

    with Client(address, set_as_default=False) as client:

        def look(row):
            if row.number == 0:
                start()
            took.update(worker for worker, runs in client.processing().items() if runs)
            if len(took) == 2:
                raise Enough

        with pytest.raises(Enough):
            sweep(many_runs(strip), scheduler=address, progress=look)


@pytest.mark.slow
def test_a_worker_with_another_version_that_comes_later_ends_the_sweep_by_name(strip, small, monkeypatch):
    monkeypatch.setattr("bilayer_core.studies.sweeps.dask_processes.COUNT_TIME", 0.5)
    address, start = small

    def look(row):
        if row.number == 0:
            start(BILAYER_JIT_PUBLIC="1")

    with pytest.raises(InputError, match=r"worker tcp://\S+ on \S+ has other versions: sources"):
        sweep(many_runs(strip), scheduler=address, progress=look)

"""Workers of a cluster that come during a sweep."""

import pytest
from support.sweep_programs import address_in, await_workers, end, start_scheduler, start_worker

from bilayer_core.errors import InputError
from bilayer_core.studies.sweeps.run_sweep import sweep


@pytest.fixture
def many_runs(strip, monkeypatch):
    """A sweep that takes longer than a worker to come."""
    monkeypatch.setattr("bilayer_core.studies.sweeps.dask_processes.COUNT_TIME", 0.5)
    strip["set"]["duration"] = "10 s"
    strip["parameters"]["gain"]["count"] = 5000
    return strip


class Enough(Exception):
    """Ends a sweep."""


def test_a_worker_that_comes_later_takes_runs(many_runs):
    from distributed import Client, LocalCluster

    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False}
    took = set()
    with (
        LocalCluster(protocol="tcp", host="127.0.0.1", dashboard_address=None, **options) as cluster,
        Client(cluster.scheduler_address, set_as_default=False) as client,
    ):

        def look(row):
            if row.number == 0:
                cluster.scale(2)
            took.update(worker for worker, runs in client.processing().items() if runs)
            if len(took) == 2:
                raise Enough

        with pytest.raises(Enough):
            sweep(many_runs, scheduler=cluster.scheduler_address, progress=look)


@pytest.mark.slow
def test_workers_with_another_version_are_refused_before_the_first_run_and_after_it(many_runs, tmp_path):
    processes = [start_scheduler(tmp_path / "scheduler.json")]
    try:
        address = address_in(tmp_path / "scheduler.json")
        with pytest.raises(InputError, match="has no workers; start some with `dask worker ADDRESS`"):
            sweep(many_runs, scheduler=address)
        processes.append(start_worker(address, tmp_path))
        await_workers(address)

        def look(row):
            if row.number == 0:
                processes.append(start_worker(address, tmp_path, BILAYER_JIT_PUBLIC="1"))  # other compiled code

        for told in (r"worker tcp://\S+ on \S+", rf"cluster {address}: worker tcp://\S+ on \S+"):
            with pytest.raises(InputError, match=rf"^{told} has other versions: sources \w+ \(here \w+\)"):
                sweep(many_runs, scheduler=address, progress=look)
    finally:
        end(processes[::-1])

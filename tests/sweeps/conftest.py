"""A cluster on loopback, for all tests of this folder."""

import copy

import pytest
from support.sweep_programs import STRIP


@pytest.fixture
def strip():
    """Content of a sweep of eight short runs."""
    return copy.deepcopy(STRIP)


@pytest.fixture(scope="module")
def cluster():
    """Address of a scheduler with two workers, which are threads of this process: those start at once."""
    from distributed import LocalCluster

    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False}
    with LocalCluster(protocol="tcp", host="127.0.0.1", dashboard_address=None, **options) as found:
        yield found.scheduler_address

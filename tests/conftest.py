"""Surroundings of all tests: a kernel cache that fits the sources, and ROS 2 on this machine alone."""

import os
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CACHES = ROOT / ".pytest_cache" / "kernels"


def _use_own_kernel_cache() -> None:
    """Kernels of the tests, in a folder of their own: those of other states of the sources are deleted."""
    CACHES.mkdir(parents=True, exist_ok=True)
    os.environ["NUMBA_CACHE_DIR"] = str(CACHES)
    if "PYTEST_XDIST_WORKER" not in os.environ:
        from bilayer_core.jit.cache import cache_folder

        for other in CACHES.glob("*"):
            if other != cache_folder():
                shutil.rmtree(other, ignore_errors=True)


CHECKS_BOUNDS = os.environ.get("NUMBA_BOUNDSCHECK", "0") != "0"


def pytest_configure(config):
    """Compile all kernels before tests run where they will need most of them: in several processes, and for `make
    bounds`.
    """
    several = getattr(config.option, "numprocesses", None) and "PYTEST_XDIST_WORKER" not in os.environ
    if several or CHECKS_BOUNDS:
        from bilayer_core.jit.compile_all import compile_all, is_complete

        if not is_complete():
            compile_all()


def pytest_sessionfinish(session):
    """Where the bounds of arrays are checked, no piece of the engine may be left out."""
    if CHECKS_BOUNDS and session.testscollected > 1:
        from bilayer_core.jit.piece import PIECES

        unused = sorted(name for name, piece in PIECES.items() if not piece.seconds and "test" not in name)
        print(f"\n{len(PIECES) - len(unused)} pieces ran with the bounds of arrays checked")
        if unused:
            print(f"no test here runs: {', '.join(unused)}")
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


# Before anything imports numba or rclpy.
if "NUMBA_CACHE_DIR" not in os.environ:
    _use_own_kernel_cache()
os.environ |= {
    "BILAYER_JIT_AHEAD": "0",  # programs that tests start compile what they need, if it is not there yet
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    "ROS_PYTHON_CHECK_FIELDS": "1",
}


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT

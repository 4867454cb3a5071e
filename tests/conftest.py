"""Surroundings of all tests: a kernel cache of their own, and ROS 2 on this machine alone."""

import ctypes
import gc
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parents[1]
CACHES = ROOT / ".pytest_cache" / "kernels"
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):  # else a thousand processes compile all sources anew
    os.environ.setdefault("PYTHONPYCACHEPREFIX", str(ROOT / ".pytest_cache" / "bytecode"))


def _use_own_kernel_cache() -> None:
    """Kernels of the tests, in a folder of their own."""
    os.environ["NUMBA_CACHE_DIR"] = str(CACHES)


# How long an example takes is no property of the code: the machine may be busy.
settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")

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


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect tests without looks for garbage, a quarter of the CPU time, and leave them out of later looks."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items):
    """Begin with the tests of nodes, which wait more than they compute: beside others they cost little time, after them
    processors stand still.
    """
    nodes = ROOT / "tests" / "ros"
    items.sort(key=lambda item: nodes not in item.path.parents)


ENTERED: set[str] = set()
"""Pieces that were called where the bounds of arrays are checked."""


def pytest_sessionstart(session):
    """Note which pieces are called, whoever calls them: a function of Python stands in front of each."""
    if CHECKS_BOUNDS:
        import bilayer_core.engine  # noqa: F401 (declares pieces)
        from bilayer_core.jit.piece import IN_C, PIECES, Piece
        from bilayer_core.jit.record import Record

        compiled, doors = Piece.address.fget, {}

        def door(piece) -> int:
            if piece.name not in doors:
                address, kinds = compiled(piece), piece._arguments
                if not all(kind in IN_C or isinstance(kind, type) and issubclass(kind, Record) for kind in kinds):
                    ENTERED.add(piece.name)  # takes arrays, which Python cannot hand on: asked for is as good
                    return address
                declared = ctypes.CFUNCTYPE(IN_C[piece._result], *(IN_C.get(kind, ctypes.c_void_p) for kind in kinds))
                inner = declared(address)

                def enter(*arguments, name=piece.name):
                    ENTERED.add(name)
                    return inner(*arguments)

                doors[piece.name] = declared(enter)
            return ctypes.cast(doors[piece.name], ctypes.c_void_p).value

        Piece.address = property(door)
        assert PIECES


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node, error):
    """Take over what a worker has entered: the process that started the workers runs no tests itself."""
    ENTERED.update(getattr(node, "workeroutput", {}).get("entered", ()))


def pytest_sessionfinish(session):
    """Where the bounds of arrays are checked, no piece of the engine may be left out."""
    if not CHECKS_BOUNDS:
        return
    if "PYTEST_XDIST_WORKER" in os.environ:
        session.config.workeroutput["entered"] = sorted(ENTERED)
    elif session.testscollected > 1 or getattr(session.config.option, "numprocesses", None):
        from bilayer_core.jit.piece import PIECES

        pieces = {name for name in PIECES if "test" not in name}
        left_out = sorted(pieces - ENTERED)
        print(f"\n{len(pieces) - len(left_out)} pieces were entered with the bounds of arrays checked")
        if left_out:
            print(f"no test here enters: {', '.join(left_out)}")
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

"""Surroundings of all tests: a kernel cache that fits the sources, and ROS 2 on this machine alone."""

import hashlib
import os
import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CACHES = ROOT / ".pytest_cache" / "kernels"


def _source_hash() -> str:
    """Fingerprint of everything that compiled kernels depend on."""
    digest = hashlib.sha256(sys.version.encode())
    for path in sorted((ROOT / "bilayer_core").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _use_fitting_kernel_cache() -> None:
    """numba does not notice edits in a file that a kernel's own file imports: each state of the sources has a cache."""
    cache = CACHES / _source_hash()
    if "PYTEST_XDIST_WORKER" not in os.environ:
        for other in CACHES.glob("*"):
            if other != cache:
                shutil.rmtree(other, ignore_errors=True)
    cache.mkdir(parents=True, exist_ok=True)
    os.environ["NUMBA_CACHE_DIR"] = str(cache)


# Before anything imports numba or rclpy.
if "NUMBA_CACHE_DIR" not in os.environ:
    _use_fitting_kernel_cache()
os.environ |= {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    "ROS_PYTHON_CHECK_FIELDS": "1",
}


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT

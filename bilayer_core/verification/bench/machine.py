"""Machine on which figures were measured: processor, cores, load, versions."""

from __future__ import annotations

import os
import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from bilayer_core.processes import usable_cores

LIBRARIES = ("bilayer_sim_ros", "numpy", "scipy", "numba", "llvmlite", "pyelastica", "mujoco")
CPU_FILE = Path("/proc/cpuinfo")


def record() -> dict[str, object]:
    """Return the machine and versions; a library that is not installed is None."""
    return {
        "cpu": cpu_model(),
        "cores": usable_cores(),
        "system": f"{platform.system()} {platform.release()}",
        "python": sys.version.split()[0],
        "versions": {name: installed_version(name) for name in LIBRARIES},
    }


def now() -> dict[str, object]:
    """Return the date, and the load averages."""
    return {"date": datetime.now(UTC).isoformat(timespec="seconds"), "load": load_averages()}


def load_averages() -> list[float]:
    """Return how much all programs were at work in the last 1, 5 and 15 minutes; empty on Windows, which has no such
    figures.
    """
    return [round(load, 2) for load in os.getloadavg()] if hasattr(os, "getloadavg") else []


def cpu_model() -> str:
    """Return the name of the processor."""
    if CPU_FILE.exists():
        for line in CPU_FILE.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def installed_version(name: str) -> str | None:
    """Return the version of a distribution, None if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None

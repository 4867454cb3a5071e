"""What figures were measured on: processor, cores, load, versions."""

from __future__ import annotations

import os
import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

LIBRARIES = ("bilayer_sim_ros", "numpy", "scipy", "numba", "llvmlite", "pyelastica", "mujoco")
CPU_FILE = Path("/proc/cpuinfo")


def record() -> dict[str, object]:
    """Machine and versions; a library that is not installed is None."""
    return {
        "cpu": cpu_model(),
        "cores": len(os.sched_getaffinity(0)),
        "system": f"{platform.system()} {platform.release()}",
        "python": sys.version.split()[0],
        "versions": {name: installed_version(name) for name in LIBRARIES},
    }


def now() -> dict[str, object]:
    """Date and load averages over 1, 5 and 15 minutes: how much others were at work."""
    return {"date": datetime.now(UTC).isoformat(timespec="seconds"), "load": [round(x, 2) for x in os.getloadavg()]}


def cpu_model() -> str:
    """Name of the processor."""
    if CPU_FILE.exists():
        for line in CPU_FILE.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def installed_version(name: str) -> str | None:
    """Version of a distribution, None if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None

"""Versions and the machine, on which results depend beside the scene."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import version

import numpy as np


def versions() -> dict[str, str]:
    """Return the versions of this package and of what its results depend on."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    from bilayer_core import __version__

    return {
        "bilayer_sim_ros": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": version("scipy"),
        "numba": version("numba"),
    }


def machine() -> dict[str, str]:
    """Return the traits of the machine on which results depend to the last bit, beside versions."""
    return {"system": platform.system(), "machine": platform.machine(), "processor": _processor()}


@cache
def _processor() -> str:
    """Return the name of the processor's model, as far as the system tells it."""
    from llvmlite import binding

    return str(binding.get_host_cpu_name())

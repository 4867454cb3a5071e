"""Fixtures for pytest: ``pytest_plugins = ["bilayer_core.testing.plugin"]`` in a ``conftest.py``."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_core.testing.robot_run import RobotRun, run_scene


@pytest.fixture(scope="session")
def run_robot() -> Callable[..., RobotRun]:
    """Return `bilayer_core.testing.run_scene`; kernels are compiled before the first test that asks for it."""
    ensure_compiled()
    return run_scene

"""Runs in the rerun viewer. rerun is imported when a function here is called, not before."""

from __future__ import annotations

from pathlib import Path

from bilayer_core.record.memory import MemoryRecorder
from bilayer_core.record.run_data import RunData


def write_rrd(run: RunData, rrd_path: str | Path) -> None:
    """Write a run as a rerun recording with its layout inside."""
    raise NotImplementedError


def convert_log(mcap_path: str | Path, rrd_path: str | Path) -> None:
    """Convert an MCAP log, whole or cut off, to a rerun recording."""
    raise NotImplementedError


class RrdRecorder(MemoryRecorder):
    """Observer that writes a rerun recording when the run ends (parameters as `McapRecorder`, path checked at once)."""

    def __init__(self, path: str | Path, rate: float = 50.0, force: bool = False):
        raise NotImplementedError


def open_viewer(path: str | Path, web: bool = False) -> None:
    """Show an ``.rrd`` or ``.mcap`` file in the rerun viewer (or a browser) and wait until it is closed."""
    raise NotImplementedError


def screenshot(path: str | Path, png_path: str | Path, time: float | None = None) -> None:
    """Picture of an ``.rrd`` or ``.mcap`` file at `time` [s] (default: the end), made without a screen.

    Raises InputError naming the missing Debian packages when there is no Vulkan driver.
    """
    raise NotImplementedError

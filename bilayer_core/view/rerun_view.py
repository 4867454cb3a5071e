"""Runs in the rerun viewer. rerun is imported when a function here is called, not before."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from bilayer_core.errors import InputError, naming
from bilayer_core.extras import require
from bilayer_core.log.file.output_paths import check_output_path, draft_of
from bilayer_core.log.file.private_directory import private_directory
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.log.run.run_data import RunData
from bilayer_core.view.colouring import STRAIN

if TYPE_CHECKING:
    from bilayer_core.view.branch_recording import Branch

RRD_SUFFIX = ".rrd"


def write_rrd(run: RunData, rrd_path: str | Path, force: bool = True, colour: str = STRAIN) -> None:
    """Write a run as a rerun recording with its layout inside; with `force` an existing file is replaced."""
    require_rerun()
    from bilayer_core.view.rrd_writer import write_recording

    with draft_of(check_output_path(rrd_path, force, RRD_SUFFIX), force) as draft:
        write_recording(run, draft, colour)


def convert_log(mcap_path: str | Path, rrd_path: str | Path, colour: str = STRAIN) -> None:
    """Convert an MCAP log, whole or cut off, to a rerun recording. An existing recording is replaced."""
    from bilayer_core.log.run.log_reader import read_log

    with naming(mcap_path):
        write_rrd(read_log(mcap_path), rrd_path, colour=colour)


def write_branches(branches: Sequence[Branch], name: str, rrd_path: str | Path, force: bool) -> None:
    """Write runs that differ by what has a name as one recording; see `view.branch_recording`."""
    require_rerun()
    from bilayer_core.view.branch_recording import write_branches as write

    with draft_of(check_output_path(rrd_path, force, RRD_SUFFIX), force) as draft:
        write(branches, name, draft)


class RrdRecorder(MemoryRecorder):
    """Observer that writes a rerun recording when the run ends; frames wait in memory until then.

    Parameters
    ----------
    path : str or Path
        File to write.
    rate : float
        Observations per simulated second [Hz].
    force : bool
        Replace an existing file.

    Raises
    ------
    InputError
        At once: the path cannot be written to, or rerun is not installed.
    """

    def __init__(self, path: str | Path, rate: float = 50.0, force: bool = False):
        super().__init__(rate)
        require_rerun()
        self.path = check_output_path(path, force, RRD_SUFFIX)
        self._force = force

    def close(self, complete: bool, termination: str = "") -> None:
        """Write the recording, also of a run that ended early."""
        super().close(complete, termination)
        if self.frames:
            write_rrd(self.run_data(), self.path, self._force)


def open_viewer(path: str | Path, colour: str = STRAIN) -> None:
    """Show an ``.rrd`` or ``.mcap`` file in the rerun viewer and wait until it is closed."""
    require_rerun()
    from bilayer_core.view.viewer_process import show

    with _as_recording(path, colour) as recording:
        show(recording)


def open_browser(path: str | Path, say: Callable[[str], None], colour: str = STRAIN) -> None:
    """Show an ``.rrd`` or ``.mcap`` file in a browser until a signal comes; `say` takes the line with the address."""
    require_rerun()
    from bilayer_core.view.server import serve

    with _as_recording(path, colour) as recording:
        serve(recording, str(path), say)


def screenshot(path: str | Path, png_path: str | Path, time: float | None = None, colour: str = STRAIN) -> None:
    """Write a picture of an ``.rrd`` or ``.mcap`` file at `time` [s] (default: the end), made without a screen.

    Raises InputError naming the missing Debian packages when there is no Vulkan driver.
    """
    require_rerun()
    from bilayer_core.view.viewer_process import take_picture

    check_output_path(png_path, force=True, suffix=".png")
    with _as_recording(path, colour) as recording:
        picture = take_picture(recording, time)
    with draft_of(png_path, force=True) as draft:
        draft.write_bytes(picture)


@contextmanager
def _as_recording(path: str | Path, colour: str) -> Iterator[Path]:
    """Yield the file itself, or a recording converted from a log, which is deleted afterwards."""
    path = Path(path)
    if path.suffix.lower() == RRD_SUFFIX:
        if not path.is_file():
            raise InputError(f"{path}: there is no such file")
        from bilayer_core.view.recording_check import refuse_markdown

        refuse_markdown(path)
        yield path.resolve()  # which rerun cannot take for an option or a URL
        return
    with private_directory() as directory:
        recording = directory / "run.rrd"
        convert_log(path, recording, colour)
        yield recording


def require_rerun() -> None:
    """Raise InputError, with the command that installs it, if rerun is missing."""
    require("the viewer", "rerun", "rerun_cli")

"""Files that the node writes: an MCAP log and a rerun recording."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from bilayer_core.errors import InputError
from bilayer_core.record.mcap_log import McapRecorder
from bilayer_core.simulation.frame import Description, Frame
from bilayer_core.simulation.inputs import Input
from bilayer_core.simulation.observers import first_failure

RRD_ENDING = ".rrd"


class Recording:
    """The files of one run, in which time only grows.

    Parameters
    ----------
    log_path, rrd_path : str
        MCAP file and rerun file to write; empty means none.
    rate, marker_rate : float
        Of all messages, and of the large ones made to be looked at [Hz].
    run : int
        Runs before this one, each ended by a reset; from the second run on the number is part of the file names:
        ``<name>_1.mcap``.

    Raises
    ------
    InputError
        At once: a file exists already or has another ending, or its directory cannot be written to.
    """

    def __init__(self, log_path: str, rrd_path: str, rate: float, marker_rate: float, run: int = 0):
        self._settings = (log_path, rrd_path, rate, marker_rate)
        self._run = run
        self._log = McapRecorder(self._new_file(log_path), rate, marker_rate) if log_path else None
        rrd = None
        if rrd_path:
            if not rrd_path.endswith(RRD_ENDING):
                raise InputError(f"{rrd_path}: the name of a rerun recording ends in {RRD_ENDING}")
            from bilayer_core.view.rerun_view import RrdRecorder

            rrd = RrdRecorder(self._new_file(rrd_path), rate)
        self._recorders = [recorder for recorder in (self._log, rrd) if recorder]

    def _new_file(self, name: str) -> Path:
        path = Path(name)
        if self._run:
            path = path.with_stem(f"{path.stem}_{self._run}")
        if path.exists():
            raise InputError(f"{path}: exists already; remove it, or choose another name")
        return path

    def of_next_run(self) -> Recording:
        """The files of the run that begins with a reset."""
        return Recording(*self._settings, run=self._run + 1)

    @property
    def wanted(self) -> bool:
        """Whether any file is written."""
        return bool(self._recorders)

    def start(self, description: Description) -> None:
        """Begin the files."""
        for recorder in self._recorders:
            recorder.start(description)

    def observe(self, frame: Frame) -> None:
        """Hand on a frame."""
        for recorder in self._recorders:
            recorder.observe(frame)

    def note(self, told: Input) -> None:
        """Log something that acts from outside."""
        if self._log:
            self._log.note(told)

    def close(self, complete: bool, termination: str) -> None:
        """Finish all files, each even if another cannot be."""
        first_failure(partial(recorder.close, complete, termination) for recorder in self._recorders)

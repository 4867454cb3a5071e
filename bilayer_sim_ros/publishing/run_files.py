"""Files that the node writes: an MCAP log and a rerun recording."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bilayer_core.errors import InputError, OutputError
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.events import Event
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.observed.inputs import Input
from bilayer_core.simulation.observers import first_failure

RRD_ENDING = ".rrd"


@dataclass(frozen=True)
class LogStatus:
    """How a log is doing."""

    dropped: int = 0  # Frames left out of it, as the disk was too slow
    failure: str = ""  # Why it is not written further; empty as long as it is
    waiting: int = 0  # Frames, inputs and events in its queue


class Recording:
    """The files of one run, in which time only grows.

    Parameters
    ----------
    log_path, rrd_path : str
        MCAP file and rerun file to write; empty means none.
    rate, marker_rate : float
        Of all messages, and of the large ones made to be looked at [Hz].
    patience : float
        Longest time for which a disk that is behind may hold the simulation up [s].
    tf : str
        What the names of frames on /tf begin with; empty: it is not logged.
    run : int
        Runs before this one, each ended by a reset; from the second run on the number is part of the file names:
        ``<name>_1.mcap``.

    Raises
    ------
    InputError
        At once: a file exists already or has another ending, or its directory cannot be written to.
    """

    def __init__(
        self,
        log_path: str,
        rrd_path: str,
        rate: float,
        marker_rate: float,
        patience: float,
        tf: str = "",
        run: int = 0,
    ):
        self._settings = (log_path, rrd_path, rate, marker_rate, patience, tf)
        self._run = run
        self._lost: OutputError | None = None
        self._log: McapRecorder | None = None
        if log_path:
            self._log = McapRecorder(self._new_file(log_path), rate, marker_rate, patience=patience, tf=tf)
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

    def set_rates(self, rate: float, marker_rate: float) -> None:
        """Go on with other rates [Hz], also in the next run."""
        log_path, rrd_path, _, _, patience, tf = self._settings
        self._settings = (log_path, rrd_path, rate, marker_rate, patience, tf)
        if self._log:
            self._log.set_rates(rate, marker_rate)

    def of_next_run(self) -> Recording:
        """Return the files of the run that begins with a reset."""
        return Recording(*self._settings, run=self._run + 1)

    @property
    def wanted(self) -> bool:
        """True if any file is written."""
        return bool(self._recorders)

    @property
    def log_status(self) -> LogStatus:
        """How the log is doing; one that is not written is well."""
        failure = str(self._lost or (self._log and self._log.failure) or "")
        return LogStatus(self._log.dropped, failure, self._log.waiting) if self._log else LogStatus(0, failure)

    def start(self, description: Description) -> None:
        """Begin the files. One that cannot be written is an error in the first run; in a later one `close` tells."""
        for recorder in list(self._recorders):
            try:
                recorder.start(description)
            except OutputError as error:
                if not self._run:
                    raise
                self._lost = error
                self._recorders.remove(recorder)
        if self._log not in self._recorders:
            self._log = None

    def observe(self, frame: Frame) -> None:
        """Give a frame to the files."""
        for recorder in self._recorders:
            recorder.observe(frame)

    def note(self, told: Input) -> None:
        """Log something that acts from outside."""
        if self._log:
            self._log.note(told)

    def tell(self, event: Event) -> None:
        """Log an event that frames do not show."""
        if self._log:
            self._log.tell(event)

    def close(self, complete: bool, termination: str) -> None:
        """Finish all files, each even if another cannot be. Raises OutputError if one could not be written."""
        first_failure((partial(recorder.close, complete, termination) for recorder in self._recorders), self._lost)
        if self._lost is not None:
            raise self._lost

"""The MCAP log: an observer that writes every frame in a thread of its own."""

from __future__ import annotations

from pathlib import Path

from bilayer_core.integrate.frame import Description, Frame


class McapRecorder:
    """Observer that writes an MCAP log; importing this module does not import mcap.

    Parameters
    ----------
    path : str or Path
        File to write.
    rate : float
        Observations per simulated second [Hz].
    marker_rate : float
        Rate of the large messages made to be looked at (`Rate.DISPLAY`) [Hz].
    force : bool
        Replace an existing file.

    Raises
    ------
    InputError
        At once, before any simulation: the directory is missing or not writable, or the file exists.
    """

    def __init__(self, path: str | Path, rate: float = 50.0, marker_rate: float = 20.0, force: bool = False):
        raise NotImplementedError

    def start(self, description: Description) -> None:
        """Open the file; write scene and settings, and flush them."""
        raise NotImplementedError

    def observe(self, frame: Frame) -> None:
        """Hand a frame to the writer; waits when the writer is behind. Raises SimulationError once writing failed."""
        raise NotImplementedError

    def log_stimulus(self, channel: str, value: float, time: float) -> None:
        """Log a stimulus set from outside at the time [s] from which it acts."""
        raise NotImplementedError

    def close(self, complete: bool, termination: str = "") -> None:
        """Write what is left and finish the file. Raises SimulationError if anything could not be written."""
        raise NotImplementedError

"""Observers of a run, and the simulator as they see it."""

from __future__ import annotations

from typing import Protocol

from bilayer_core.observed.frame import Description, Frame


class Observed(Protocol):
    """Simulator as observers see it.

    Attributes
    ----------
    time : float
        Simulated [s].
    description : Description
    """

    @property
    def time(self) -> float: ...

    @property
    def description(self) -> Description: ...

    def frame(self) -> Frame:
        """Return a snapshot."""


class Observer(Protocol):
    """Something that looks at a run `rate` times in each simulated second, at the multiples of its period. No step is
    another for it. One that has `due` as well looks at that time next instead [s], a whole number of nanoseconds.

    One that has a method ``note(input)`` is also told what acts from outside (`observed.inputs.Input`).
    """

    rate: float

    def start(self, description: Description) -> None:
        """Begin to observe a run. The simulator calls this once, before the first frame.

        Parameters
        ----------
        description : Description
            The constant part of the run.
        """

    def observe(self, frame: Frame) -> None:
        """Take a frame. The simulator calls this for every frame that is due, including the first and the last.

        Parameters
        ----------
        frame : Frame
        """

    def close(self, complete: bool, termination: str = "") -> None:
        """End the observation. The simulator calls this once.

        Parameters
        ----------
        complete : bool
            False if the run was cut short.
        termination : str
            Why it ended.
        """

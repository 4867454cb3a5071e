"""Result of a run: why and when it ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from bilayer_core.errors import InputError
from bilayer_core.printable import html_table

if TYPE_CHECKING:
    from bilayer_core.log.run.run_data import RunData


class Termination(Enum):
    """Why a run ended; the value is the message."""

    COMPLETED = "completed"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"
    FAILED = "failed"


@dataclass(frozen=True)
class RunResult:
    """How a run went.

    Attributes
    ----------
    termination : Termination
    time : float
        Simulated time at its end [s].
    simulated : float
        Simulated time of this run [s].
    steps : int
        Of this run.
    cpu_time, wall_time : float
        CPU seconds of the stepping thread and elapsed seconds, without compilation.
    log : str
        The file that the run was asked to write; empty for none.
    """

    termination: Termination
    time: float
    simulated: float
    steps: int
    cpu_time: float
    wall_time: float
    log: str = ""

    @property
    def data(self) -> RunData:
        """The run of the log, read on demand."""
        if not self.log:
            raise InputError("this run wrote no log, so its course is not known; give run(log=FILE), or use a Recorder")
        from bilayer_core.log.run.log_reader import read_log

        return read_log(self.log)

    def plot(self, *quantities: str, **settings: Any) -> Any:
        """Draw quantities of the log over time.

        Parameters
        ----------
        *quantities : str
        **settings
            As of `Recorded.plot`.

        Returns
        -------
        matplotlib.figure.Figure
        """
        return self.data.plot(*quantities, **settings)

    def film(self, seconds: float | None = None, **look: Any) -> Any:
        """Draw the run of the log as a film.

        Parameters
        ----------
        seconds : float, optional
        **look
            As of `RunData.film`.

        Returns
        -------
        Shown
        """
        return self.data.film(seconds, **look)

    def _repr_html_(self) -> str:
        """Return the result as a table for notebooks."""
        rows: dict[str, object] = {"time": f"{self.time:g} s, of which {self.simulated:g} s in this run"}
        rows |= {"steps": self.steps, "took": f"{self.wall_time:.3g} s"}
        return html_table(f"Run {self.termination.value}", rows | ({"log": self.log} if self.log else {}))

"""Result of a run: why and when it ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

from bilayer_core.errors import InputError
from bilayer_core.printable import html_table

if TYPE_CHECKING:
    import numpy as np

    from bilayer_core.log.run.run_data import RunData
    from bilayer_core.simulation.gradients.derivatives import DifferentiableRun, Gradient


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
    differentiable : DifferentiableRun or None
        Its steps, if they were kept for gradients.
    """

    termination: Termination
    time: float
    simulated: float
    steps: int
    cpu_time: float
    wall_time: float
    log: str = ""
    differentiable: DifferentiableRun | None = field(default=None, repr=False, compare=False)

    @property
    def data(self) -> RunData:
        """The run of the log, read on demand."""
        if not self.log:
            raise InputError("this run wrote no log, so its course is not known; give run(log=FILE), or use a Recorder")
        from bilayer_core.log.run.log_reader import read_log

        return read_log(self.log)

    def gradient(self, of: str | Sequence[str], to: str | Sequence[str]) -> Gradient:
        """Return derivatives of quantities at the end of the run, with the steps that were made.

        Parameters
        ----------
        of : str or sequence of str
            Quantities by the names that logs have: ``"com"``, ``"rod/strip/position"``.
        to : str or sequence of str
            Paths of numbers in the scene, or of lists of numbers: ``"stimuli.humidity.schedule.value"``. A run that did
            not begin at the start of its scene began where it did, whatever they are.

        Returns
        -------
        Gradient
            Arrays by quantity and parameter. `residual` is the largest distance from where Newton's method would have
            ended a step.

        Raises
        ------
        InputError
            If steps were not kept, there is no such name, a number acts on nothing, or the scene has something through
            which runs are not differentiated.
        """
        return self._kept.gradient(of, to)

    def pull_back(self, seeds: Mapping[str, np.ndarray], to: str | Sequence[str]) -> dict[str, np.ndarray]:
        """Return the derivatives of Σ seed · quantity at the end of the run by numbers: a vector–Jacobian product.

        It takes about as long for many numbers as for one, where these are gains or stimuli.

        Parameters
        ----------
        seeds : mapping of str to ndarray
            For ``"positions"`` and ``"velocities"`` of nodes, shape (n_node, 3), and for ``"body_positions"`` and
            ``"body_velocities"``, shape (n_body, 3), 0 for bodies that are not free; for ``"com"``, shape (3,).
        to : str or sequence of str
            As in `gradient`.

        Returns
        -------
        dict of str to ndarray
            By the names in `to`.

        Raises
        ------
        InputError
            As in `gradient`.
        """
        return self._kept.pull_back(seeds, to)

    @property
    def _kept(self) -> DifferentiableRun:
        if self.differentiable is None:
            raise InputError("gradient: steps of this run were not kept; give run(gradients=True)")
        return self.differentiable

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

"""How Newton's method and steps ended, for those who asked for them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from bilayer_core.model.records.status import (
    BEYOND,
    BLOCKED,
    COLLAPSED,
    CONVERGED,
    CROSSED,
    GAINS_ENERGY,
    INDEFINITE,
    LINE_SEARCH,
    MAX_ITERATIONS,
    NOT_FINITE,
    TOO_INACCURATE,
    UNSETTLED,
)

FAILURES = {
    MAX_ITERATIONS: "Newton did not converge within the allowed iterations",
    LINE_SEARCH: "no step along the Newton direction lowers the potential",
    INDEFINITE: "the Newton matrix cannot be made positive definite",
    NOT_FINITE: "the potential or its gradient is not finite",
    BLOCKED: "prescribed motion would push a surface through another one",
    BEYOND: "the end of the step, beyond its last stage, lies behind a surface",
    COLLAPSED: "an edge has hardly any of its length left",
    CROSSED: "an edge goes through a surface between its nodes",
    UNSETTLED: "normal forces and friction do not settle on each other",
    GAINS_ENERGY: "steps make energy however short they are",
    TOO_INACCURATE: "the error of the step stays above the tolerance",
}
"""Statuses of a step that failed, with the message."""


@dataclass(slots=True)
class IntegrationReport:
    """Account of some steps, with the reason why there were no more.

    Attributes
    ----------
    done : int
        Number of steps made; a part of a fixed one counts.
    status : int
        Why it ended, from `model.records.status`.
    pair : int
        Near pair that blocks prescribed motion, edge that has collapsed, or edge that crosses a surface
        (`contact.crossing`), −1 if none.
    iterations, factorisations, settlings : int
        Exact Hessians factorised and further corrections taken with a kept one; the former alone; how often friction
        was frozen anew. Failed attempts are included.
    residual, largest_residual : float
        Speed of Newton's last correction in the last step, or in the attempt that failed, and the largest of all
        steps made [m/s].
    shortest, longest, length : float
        Lengths of the steps made, and that of the last one, or of the attempt that failed [s].
    rejected, inaccurate, gaining : int
        Attempts that were made again, shorter, those of them whose error was too large, and those that made energy.
    unresolved : int
        Steps as short as allowed that do not resolve the energy of their contact.
    restarts : int
        Steps of the method that stands in for one with a history.
    error : float
        That of the attempt that failed, or what it made of energy, over what is allowed.
    regularised : int
        Factorised matrices to which masses were added, or from which what is negative in the contact of rods was left
        out, because the Hessian was not positive definite.
    """

    done: int
    status: int
    pair: int
    iterations: int
    factorisations: int
    settlings: int
    residual: float
    largest_residual: float = 0.0
    shortest: float = 0.0
    longest: float = 0.0
    length: float = 0.0
    rejected: int = 0
    inaccurate: int = 0
    gaining: int = 0
    unresolved: int = 0
    restarts: int = 0
    error: float = 0.0
    regularised: int = 0

    def followed_by(self, more: IntegrationReport) -> IntegrationReport:
        """Return both together; it ends as `more` does."""
        if not more.done:
            more = replace(more, shortest=self.shortest, longest=self.longest)
        return replace(
            more,
            largest_residual=max(self.largest_residual, more.largest_residual),
            shortest=min(self.shortest, more.shortest),
            longest=max(self.longest, more.longest),
            **{name: getattr(self, name) + getattr(more, name) for name in SUMS},
        )

    @property
    def converged(self) -> bool:
        """True if everything that was asked for was done."""
        return self.status == CONVERGED

    @property
    def failed(self) -> bool:
        """True if the step after those made failed."""
        return self.status in FAILURES


SUMS = (
    "done",
    "iterations",
    "factorisations",
    "settlings",
    "rejected",
    "inaccurate",
    "gaining",
    "unresolved",
    "restarts",
    "regularised",
)
"""Figures of which those of several reports add up."""

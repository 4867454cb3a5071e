"""How Newton's method ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ..model.records.status import BEYOND, BLOCKED, INDEFINITE, LINE_SEARCH, MAX_ITERATIONS, NOT_FINITE


class NewtonStatus(Enum):
    """How an attempt at a step ended; the value is the message."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "Newton did not converge within the allowed iterations"
    LINE_SEARCH = "no step along the Newton direction lowers the potential"
    INDEFINITE = "the Newton matrix cannot be made positive definite"
    NOT_FINITE = "the potential or its gradient is not finite"
    BEYOND = "the end of the step, beyond its last stage, lies behind a surface"
    BLOCKED = "prescribed motion would push a surface through another one"


FAILURES = {
    MAX_ITERATIONS: NewtonStatus.MAX_ITERATIONS,
    LINE_SEARCH: NewtonStatus.LINE_SEARCH,
    INDEFINITE: NewtonStatus.INDEFINITE,
    NOT_FINITE: NewtonStatus.NOT_FINITE,
    BLOCKED: NewtonStatus.BLOCKED,
    BEYOND: NewtonStatus.BEYOND,
}
"""Statuses of a step that failed."""


@dataclass(frozen=True)
class NewtonReport:
    """Result of one attempt at a step.

    Attributes
    ----------
    status : NewtonStatus
    iterations : int
        Exact Hessians factorised, and further corrections taken with a kept one.
    factorisations : int
        The former alone.
    residual : float
        Speed of the correction that was left [m/s].
    backtracks : int
        Halvings of the line search, all iterations together.
    detail : str
        What a message may add: the blocking node.
    """

    status: NewtonStatus
    iterations: int
    factorisations: int
    residual: float
    backtracks: int = 0
    detail: str = ""

    @property
    def converged(self) -> bool:
        """Whether the step may be accepted."""
        return self.status is NewtonStatus.CONVERGED

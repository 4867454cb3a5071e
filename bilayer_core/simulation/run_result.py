"""Result of a run: why and when it ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


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
    """

    termination: Termination
    time: float
    simulated: float
    steps: int
    cpu_time: float
    wall_time: float

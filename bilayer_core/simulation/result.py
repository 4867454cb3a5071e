"""What a run returns: why and when it ended, and where bodies are."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

Array = np.ndarray


class Termination(Enum):
    """Why a run ended; the value is the message."""

    COMPLETED = "completed"
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


@dataclass(frozen=True)
class BodyView:
    """Pose of a body: position [m], shape (3,), and quaternion x y z w, shape (4,)."""

    position: Array
    quaternion: Array

"""Reading logs, whole or cut off by a crash."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bilayer_core.integrate.frame import Description
from bilayer_core.record.run_data import RunData


@dataclass(frozen=True)
class LogInfo:
    """What a log holds: the content of `bilayer info` (`dataclasses.asdict` gives its JSON).

    Attributes
    ----------
    path, scene, title : str
    versions, settings : dict
    start_time, last_time, duration : float
        Simulated time of the first and last message, and between them [s].
    channels : tuple of str
        Stimulus channels.
    topics : dict
        Topic -> {"type": ROS type, "count": messages}.
    complete : bool
        Whether the run reached its end and the file was finished.
    termination : str
        Why it ended; ``"cut off"`` for a file without an end.
    size : int
        Of the file [bytes].
    """

    path: str
    scene: str
    title: str
    versions: dict[str, str]
    settings: dict[str, str]
    start_time: float
    last_time: float
    duration: float
    channels: tuple[str, ...]
    topics: dict[str, dict]
    complete: bool
    termination: str
    size: int


def read_info(path: str | Path) -> LogInfo:
    """What a log holds, from its index or, when it was cut off, by reading it through. InputError if it is no log."""
    raise NotImplementedError


def read_description(path: str | Path) -> Description:
    """The description that the log was written with."""
    raise NotImplementedError


def read_log(path: str | Path) -> RunData:
    """All quantities over time as arrays."""
    raise NotImplementedError


def read_state(path: str | Path, time: float | None = None) -> tuple[np.ndarray, float]:
    """Flat state and its time [s]: the last one logged, or the last one at or before `time`."""
    raise NotImplementedError


def scene_from_log(path: str | Path) -> str:
    """YAML text of the scene that was run, overrides included."""
    raise NotImplementedError

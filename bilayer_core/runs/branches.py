"""Many runs that go on from one instant of a log, each with another value of one thing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError, SimulationError
from bilayer_core.log.run.log_reader import read_state
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.inputs import Input
from bilayer_core.runs.replay import branch, set_from_outside
from bilayer_core.simulation.simulator import Simulator

STIMULUS, LOAD = "stimulus.", "load."
"""What the names of channels and of loads begin with; any other name is a key of the scene."""
MOST = 1000
"""Branches."""


@dataclass(frozen=True)
class Varied:
    """Quantity that differs from branch to branch.

    Attributes
    ----------
    name : str
        ``stimulus.CHANNEL``, ``load.NAME``, or a key of the scene.
    values : tuple of float
    """

    name: str
    values: tuple[float, ...]

    @classmethod
    def read(cls, text: str) -> Varied:
        """Read ``NAME=FROM:TO:COUNT``: values evenly from one to another. Raises InputError if it is none."""
        name, _, span = text.partition("=")
        parts = span.split(":")
        try:
            begin, end, count = float(parts[0]), float(parts[1]), int(parts[2])
        except (ValueError, IndexError):
            begin = end = count = 0
        if not (name and len(parts) == 3 and 1 <= count <= MOST and np.isfinite([begin, end]).all()):
            raise InputError(
                f"--vary: {text!r} is not allowed; it must be NAME=FROM:TO:COUNT with 1 to {MOST} values, "
                "such as stimulus.humidity=0.2:0.8:10"
            )
        return cls(name, tuple(np.linspace(begin, end, count).tolist()))


@dataclass(frozen=True)
class Branch:
    """One of the runs."""

    value: float  # Of what differs
    run: RunData  # From the instant on
    stopped: str  # Why it could not go on to the end; empty if it did


def run_branches(
    path: str | Path,
    time: float,
    varied: Varied,
    until: float,
    *,
    overrides: tuple[str, ...] = (),
    stimuli: Mapping[str, float | None] | None = None,
    loads: Mapping[str, float | None] | None = None,
    rate: float = 20.0,
) -> Iterator[Branch]:
    """Go on from an instant of a log with each value in turn.

    Parameters
    ----------
    path : str or Path
        MCAP log.
    time : float
        The last state at or before it [s] is gone on from.
    varied : Varied
    until : float
        Simulated time to which they go [s].
    overrides, stimuli, loads
        What all have in common; as for `runs.replay.branch`.
    rate : float
        Of the frames that are kept [Hz].

    Raises
    ------
    InputError
        If the log or a value cannot be taken. A branch that cannot go on is none: it says why and ends there.
    """
    common = dict(stimuli or {}), dict(loads or {})
    of_scene = not varied.name.startswith((STIMULUS, LOAD))
    simulator: Simulator | None = None
    inputs: list[Input] = []
    for value in varied.values:
        if of_scene:
            written = int(value) if value.is_integer() else value
            simulator, inputs = branch(path, time, (*overrides, f"{varied.name}={written!r}"), *common)
        elif simulator is None:
            simulator, inputs = branch(path, time, overrides, *_with(*common, varied.name, value))
        else:
            simulator.load_state(read_state(path, time)[0])
            set_from_outside(simulator, *_with(*common, varied.name, value))
        yield _run(simulator, inputs, value, until, rate)


def _with(
    stimuli: dict[str, float | None], loads: dict[str, float | None], name: str, value: float
) -> tuple[dict[str, float | None], dict[str, float | None]]:
    """Return the stimuli and loads with that of a name."""
    kind, _, own = name.partition(".")
    return (stimuli | {own: value}, loads) if f"{kind}." == STIMULUS else (stimuli, loads | {own: value})


def _run(simulator: Simulator, inputs: list[Input], value: float, until: float, rate: float) -> Branch:
    recorder, stopped = MemoryRecorder(rate), ""
    try:
        simulator.run(until=until, observers=[recorder], inputs=inputs)
    except SimulationError as failure:
        stopped = failure.reason
    return Branch(value, recorder.run_data(), stopped)

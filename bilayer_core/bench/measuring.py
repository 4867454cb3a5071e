"""One run of a problem: its CPU time without compilation, and what it found."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from ..errors import SceneError, SimulationError
from ..integrate.result import Termination
from ..integrate.simulator import Simulator
from .configurations import Configuration
from .problems import Problem
from .track import Track

Array = np.ndarray
SHORT = 0.25
"""Runs shorter than this [s of CPU] are repeated, and the fastest counts."""
REPEATS = 3
LONGEST = 40.0
"""A run that has taken this much CPU [s] is ended: it is not one that anybody would choose."""


@dataclass(frozen=True)
class Run:
    """What came of a run.

    Attributes
    ----------
    outcome : str
        ``"done"``, or why it has no result.
    values : Array or None
        As its problem's measure gives them.
    cost : dict
        CPU time [s], numbers of steps, Newton iterations, refused attempts, unknowns; 1-minute load average.
    """

    outcome: str
    values: Array | None
    cost: dict[str, float | int]


def run(problem: Problem, configuration: Configuration, longest: float = LONGEST) -> Run:
    """Run a problem, several times where it is short; what it finds is the same each time."""
    try:
        warm_up(problem, configuration)
        once = _run(problem, configuration, longest)
    except (SceneError, SimulationError) as error:
        return Run(str(error), None, {})
    if once.outcome == "done" and once.cost["cpu_time"] < SHORT:
        for _ in range(REPEATS - 1):
            again = _run(problem, configuration, longest)
            once.cost["cpu_time"] = min(once.cost["cpu_time"], again.cost["cpu_time"])
    return once


_warm: set[tuple[str, str, int]] = set()
"""Problem, model and dimension of what has run in this process."""


def warm_up(problem: Problem, configuration: Configuration) -> None:
    """Let everything that a run of this kind calls be compiled: not all of it is called in the first step."""
    kind = problem.name, configuration.family.model, configuration.family.dimension
    if kind not in _warm:
        _warm.add(kind)
        _run(problem, configuration, LONGEST)


def simulator_of(problem: Problem, configuration: Configuration) -> Simulator:
    """The simulator of a run, at its start."""
    family = configuration.family
    config = problem.config(configuration.stations)
    choice = {"model": family.model, "dimension": family.dimension, "integrator": family.integrator}
    return Simulator(config, dt=configuration.dt, tolerance=configuration.tolerance, **choice)


def _run(problem: Problem, configuration: Configuration, longest: float) -> Run:
    simulator = simulator_of(problem, configuration)
    simulator.compile()
    track, load = Track(simulator), os.getloadavg()[0]
    for end in sorted({*problem.measure.stops, problem.duration}):
        result = simulator.run(end - simulator.time, stop=lambda: simulator.cpu_time > longest, progress=track.look)
        if result.termination is Termination.INTERRUPTED:
            break
    statistics = simulator.statistics
    cost = {
        "cpu_time": simulator.cpu_time,
        "steps": statistics.substeps,
        "rejected": statistics.rejected,
        "newton_iterations": statistics.iterations,
        "dof": simulator.model.unknowns,
        "load": load,
    }
    if simulator.time < problem.duration * (1.0 - 1e-9):
        return Run(f"ended after {longest:g} s of CPU at t = {simulator.time:.3g} s", None, cost)
    return Run("done", problem.measure.values(track), cost)

"""One run of a problem: its CPU time without compilation, and what it found."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from bilayer_core.errors import SceneError, SimulationError
from bilayer_core.simulation.run_result import Termination
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.bench.configurations import Configuration
from bilayer_core.verification.bench.machine import load_averages
from bilayer_core.verification.bench.problems import Problem
from bilayer_core.verification.bench.track import Track

Array = np.ndarray
SHORT = 0.25
"""Runs shorter than this [s of CPU] are repeated, and the fastest counts."""
REPEATS = 3
LONGEST = 40.0
"""A run that has taken this much CPU [s] is ended: it is not one that anybody would choose."""


@dataclass(frozen=True)
class Run:
    """Result of a run."""

    outcome: str
    """``"done"``, or why it has no result."""
    values: Array | None  # As its problem's measure gives them
    cost: dict[str, float | int]
    """CPU time [s], numbers of steps, Newton iterations, refused attempts, unknowns; 1-minute load average, where
    the system has one.
    """


def run(problem: Problem, configuration: Configuration, longest: float = LONGEST, timed: bool = True) -> Run:
    """Run a problem: watched step by step for what it finds, then, if `timed`, as users run it, for what it costs.

    The first of them also compiles whatever a run of this kind calls. Short runs are timed several times.
    """
    try:
        found = _run(problem, configuration, longest, watched=True)
        if timed and found.outcome == "done":
            costs = [_run(problem, configuration, math.inf).cost]
            if costs[0]["cpu_time"] < SHORT:
                costs += [_run(problem, configuration, math.inf).cost for _ in range(REPEATS - 1)]
            return replace(found, cost=min(costs, key=itemgetter("cpu_time")))
    except (SceneError, SimulationError) as error:
        return Run(str(error), None, {})
    return found


def simulator_of(problem: Problem, configuration: Configuration) -> Simulator:
    """Return the simulator of a run, at its start."""
    family = configuration.family
    config = problem.config(configuration.stations)
    choice = {"model": family.model, "dimension": family.dimension, "integrator": family.integrator}
    return Simulator(config, dt=configuration.dt, tolerance=configuration.tolerance, **choice)


def _run(problem: Problem, configuration: Configuration, longest: float, watched: bool = False) -> Run:
    simulator = simulator_of(problem, configuration)
    simulator.compile()
    track, load = Track(simulator), load_averages()[:1]
    look, limit = (track.look, lambda: simulator.cpu_time > longest) if watched else (None, None)
    for end in sorted({*problem.measure.stops, problem.duration}):
        result = simulator.run(end - simulator.time, interrupted=limit, each_step=look)
        if result.termination is Termination.INTERRUPTED:
            return Run(f"ended after {longest:g} s of CPU at t = {simulator.time:.3g} s", None, {})
    statistics = simulator.statistics
    cost = {
        "cpu_time": simulator.cpu_time,
        "steps": statistics.substeps,
        "rejected": statistics.rejected,
        "newton_iterations": statistics.iterations,
        "dof": simulator.model.unknowns,
        "load": load[0] if load else None,
    }
    return Run("done", problem.measure.values(track) if watched else None, cost)

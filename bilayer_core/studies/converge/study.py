"""The runs of a convergence study: a scene as it is, at twice and half its time step, with half and twice its edges.

The first three of them tell the global error of a run: what the errors of its steps have grown to at its end.

Adaptive steps are halved and doubled by their tolerance: their length goes as its (p + 1)-th root at order p.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace

import numpy as np

from bilayer_core.errors import InputError, SimulationError
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.model.plan import make_plan
from bilayer_core.model.undamped_friction import unseen_vibrations
from bilayer_core.processes import side_by_side
from bilayer_core.scene.config import LARGEST_TOLERANCE, SceneConfig
from bilayer_core.scene.loader import load_scene, parse_scene, scene_content, scene_text
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.simulation.step_choice import choose_steps
from bilayer_core.studies.converge.order import Estimate, estimate
from bilayer_core.studies.converge.quantities import check_names, headline, is_event, measure

BASE = "the scene as it is"
COARSER_STEP, FINER_STEP, FINEST_STEP = "twice the step", "half the step", "a quarter of the step"
COARSER_MESH, FINER_MESH = "half the edges", "twice the edges"
NEEDED = (BASE, FINER_STEP, FINER_MESH, FINEST_STEP)
LEAST_EDGES = 2


@dataclass(frozen=True)
class Run:
    """One run of a study: its name, its overrides, its steps and its edges relative to the scene's own."""

    name: str
    overrides: tuple[str, ...]
    step: float
    edges: float


@dataclass(frozen=True)
class Row:
    """A quantity of a study.

    Attributes
    ----------
    name : str
    values : dict of str to float
        By the name of the run.
    time : Estimate
        What the time step does to the scene's own run.
    mesh : Estimate or None
        Likewise the mesh, if it was varied.
    """

    name: str
    values: dict[str, float]
    time: Estimate
    mesh: Estimate | None

    @property
    def bar(self) -> float:
        """Half width of the error bar of the scene's own run: time step and mesh together."""
        return self.time.bar + (self.mesh.bar if self.mesh else 0.0)


@dataclass(frozen=True)
class Study:
    """A finished study: integrator and steps of the scene, its rows, why a coarser run is missing, by its name, and
    what none of the runs can see.
    """

    integrator: str
    stepping: str
    rows: list[Row]
    missing: dict[str, str]
    unseen: tuple[str, ...] = ()


def runs_over_steps(scene: SceneConfig, quarter: bool = False) -> list[Run]:
    """Return the scene's own run, those at twice and half its time step, and one at a `quarter` on request."""
    others = ((COARSER_STEP, 2.0), (FINER_STEP, 0.5), *(((FINEST_STEP, 0.25),) if quarter else ()))
    return [Run(BASE, (), 1.0, 1.0), *(Run(name, _with_steps(scene, part), part, 1.0) for name, part in others)]


def planned_runs(scene: SceneConfig) -> list[Run]:
    """Return the five runs; two of them halve and double the edges of every rod."""
    edges = {rod.name: rod.stations - 1 for rod in scene.rods}
    halved = {name: max(LEAST_EDGES, round(count / 2)) for name, count in edges.items()}
    doubled = {name: 2 * count for name, count in edges.items()}
    total = sum(edges.values())
    runs = runs_over_steps(scene)
    for name, counts in ((COARSER_MESH, halved), (FINER_MESH, doubled)):
        overrides = tuple(f"rods.{rod}.stations={count + 1}" for rod, count in counts.items())
        runs.append(Run(name, overrides, 1.0, sum(counts.values()) / total))
    return runs


def _with_steps(scene: SceneConfig, part: float) -> tuple[str, ...]:
    """Return overrides that multiply the step by `part`."""
    method = INTEGRATORS[make_plan(scene).integrator]
    steps = choose_steps(scene, method)
    first = f"solver.dt={part * steps.dt!r}"
    if steps.tolerance is None:
        return (first,)
    tolerance = min(part ** (method.order + 1) * steps.tolerance, LARGEST_TOLERANCE)
    return first, f"solver.tolerance={tolerance!r}", f"solver.max_step={part * steps.longest!r}"


def converge(
    scene: SceneConfig,
    duration: float | None = None,
    quantities: Sequence[str] = (),
    workers: int = 1,
    progress: Callable[[str], None] | None = None,
) -> Study:
    """Run a study of time step and mesh.

    Parameters
    ----------
    scene : SceneConfig
    duration : float, optional
        Simulated time of every run [s]; default: the scene's.
    quantities : sequence of str
        Names from `bilayer_core.studies.converge.quantities`; default: the headline numbers of the scene.
    workers : int
        Processes that run side by side.
    progress : callable, optional
        Called with the name of every run that is done.

    Returns
    -------
    Study
        The error bar of each number, in SI units.

    Raises
    ------
    SimulationError
        If the scene's own run or a finer one cannot go on.
    InputError
        If a quantity does not exist, or the run has none: nothing took off, a body was not touched.
    """
    return _study(scene, planned_runs(scene), duration, quantities, workers, progress)


def estimate_error(
    scene: SceneConfig,
    duration: float | None = None,
    quantities: Sequence[str] = (),
    workers: int = 1,
    progress: Callable[[str], None] | None = None,
    *,
    own: dict[str, float] | None = None,
    start: np.ndarray | None = None,
    quarter: bool = False,
) -> Study:
    """Estimate the error of the headline numbers of a run due to its time steps, from runs at half and twice the step.

    Parameters
    ----------
    scene : SceneConfig
    duration : float, optional
        Simulated time of every run [s]; default: the scene's.
    quantities : sequence of str
        Names from `bilayer_core.studies.converge.quantities`; default: the headline numbers of the scene.
    workers : int
        Processes that run side by side.
    progress : callable, optional
        Called with the name of every run that is done.
    own : dict, optional
        Figures of the scene's own run (`quantities.Watch`), if it was made already.
    start : ndarray, optional
        Saved state from which every run starts; default: that of the scene.
    quarter : bool
        Whether to make a run at a quarter of the step as well: the order is then that of the three finest runs.

    Returns
    -------
    Study
        The error bar of each number, in SI units; its rows have no `mesh`.

    Raises
    ------
    SimulationError
        If the scene's own run or a finer one cannot go on.
    InputError
        If a quantity does not exist, or the run has none: nothing took off, a body was not touched.
    """
    return _study(scene, runs_over_steps(scene, quarter), duration, quantities, workers, progress, own, start)


def _study(
    scene: SceneConfig,
    runs: list[Run],
    duration: float | None,
    quantities: Sequence[str],
    workers: int,
    progress: Callable[[str], None] | None,
    own: dict[str, float] | None = None,
    start: np.ndarray | None = None,
) -> Study:
    time = scene.duration if duration is None else duration
    simulator = Simulator(scene)
    check_names(simulator, quantities)
    simulator.compile()  # once, before several processes would
    needed = [run.name for run in runs if run.name in NEEDED]
    found = {} if own is None else {BASE: own}
    missing = _make(scene, [run for run in runs if run.name not in found], time, workers, progress, start, found)
    prescribed = [body.name for body in scene.bodies if body.motion.type == "prescribed"]
    names = list(quantities) or headline(found[BASE], prescribed)
    for name in quantities:
        absent = [run for run in needed if name not in found[run]]
        if absent:
            raise InputError(f"--quantity {name}: did not happen in one of the runs: {absent[0]}")
    names = [name for name in names if all(name in found[run] for run in needed)]
    by_name = {run.name: run for run in runs}
    steps = simulator.steps
    resolution = steps.longest if steps.adaptive else steps.dt
    rows = [_row(name, found, by_name, resolution if is_event(name) else 0.0) for name in names]
    return Study(simulator.plan.integrator, str(simulator.steps), rows, missing, unseen_vibrations(scene))


def _make(
    scene: SceneConfig,
    runs: list[Run],
    duration: float,
    workers: int,
    progress: Callable[[str], None] | None,
    start: np.ndarray | None,
    found: dict[str, dict[str, float]],
) -> dict[str, str]:
    """Add what runs find to `found`, by their names; why one that is not needed is missing is returned."""
    text, missing = scene_text(scene), {}
    with side_by_side(workers) as schedule:
        jobs = {schedule(_run, text, run.overrides, duration, start): run for run in runs}
        for job in as_completed(jobs):
            name = jobs[job].name
            try:
                found[name] = job.result()
            except SimulationError as error:
                if name in NEEDED:
                    raise SimulationError(f"{name}: {error.reason}", error.time, error.remedy) from error
                missing[name] = str(error)
            if progress is not None:
                progress(name)
    return missing


def _run(text: str, overrides: Sequence[str], duration: float, start: np.ndarray | None) -> dict[str, float]:
    """Run the scene, in a process of its own."""
    base = parse_scene(text, "scene")
    scene = load_scene(scene_content(base), overrides) if overrides else base
    simulator = Simulator(scene)
    if start is not None:
        simulator.load_state(start)
    return measure(simulator, duration)


def _row(name: str, found: dict[str, dict[str, float]], runs: dict[str, Run], resolution: float) -> Row:
    """Return the row of a quantity from all runs, none of which alone knows it better than to its `resolution`."""
    values = {run: figures[name] for run, figures in found.items() if name in figures}

    def judge(coarser: str, finer: str, size: Callable[[Run], float]) -> Estimate:
        sizes = size(runs[coarser]) if coarser in values else None, size(runs[BASE]), size(runs[finer])
        return estimate(sizes, (values.get(coarser), values[BASE], values[finer]))

    over_steps = judge(COARSER_STEP, FINER_STEP, lambda run: run.step)
    if FINEST_STEP in values:  # what half the step is off by, and the run itself from that
        steps, figures = zip(*((runs[run].step, values[run]) for run in (BASE, FINER_STEP, FINEST_STEP)), strict=True)
        finer = estimate(steps, figures)
        over_steps = replace(over_steps, order=finer.order, bar=finer.bar + abs(figures[1] - figures[0]))
    return Row(
        name,
        values,
        replace(over_steps, bar=over_steps.bar + resolution),
        judge(COARSER_MESH, FINER_MESH, lambda run: 1.0 / run.edges) if FINER_MESH in runs else None,
    )

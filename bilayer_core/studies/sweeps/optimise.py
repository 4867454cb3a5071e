"""Search for the values with the best metric: Optuna asks for runs and is told what came, the engine makes them."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeGuard

from bilayer_core.errors import InputError
from bilayer_core.extras import require
from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_core.log.file.output_paths import write_text
from bilayer_core.scene.loader import load_content, scene_content, scene_text
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.sweeps.ascent import Ascent, refuse_unclimbable
from bilayer_core.studies.sweeps.dask_processes import Engine
from bilayer_core.studies.sweeps.design import Values
from bilayer_core.studies.sweeps.execute_runs import scene_of
from bilayer_core.studies.sweeps.job import Job, Outcome, Point, Row
from bilayer_core.studies.sweeps.journal import Journal
from bilayer_core.studies.sweeps.open_processes import Processes, open_engine
from bilayer_core.studies.sweeps.run_sweep import Sweep, read_sweep
from bilayer_core.studies.sweeps.spec import Parameter
from bilayer_core.studies.sweeps.sweep_result import write_table

TRIALS = 100
"""Runs, by default."""
CONFIRMED = 0.02
"""Largest relative difference to the run with finer steps by which a value is confirmed."""
FINER_TOLERANCE, FINER_LONGEST, FINER_STEP = 0.1, 0.5, 0.25
"""Of that run, over those of the others."""
SEED_STEP = 1_000_003
"""Between the seeds of searches that were continued after other numbers of runs."""
MOST_CANDIDATES = 5
"""The best runs that are tried to be confirmed, one after the other."""
BEST = "best.yaml"


@dataclass(frozen=True)
class Optimum:
    """Result of a search.

    Attributes
    ----------
    metric : str
    best : Row
        The best run whose value a run with finer steps confirms, or the best one if none is confirmed.
    confirmed : float or None
        Its metric by that run; None if it could not be made.
    start : float or None
        The metric of the values that the search began with; None if it had none.
    trials : int
        All runs of the search.
    units : dict
        Of parameters that have one.
    at_end : tuple of str
        Parameters whose value is within a hundredth of their range from an end of it.
    """

    metric: str
    best: Row
    confirmed: float | None
    start: float | None
    trials: int
    units: dict[str, str]
    at_end: tuple[str, ...] = ()

    @property
    def value(self) -> float:
        """The metric of the best run."""
        return float(self.best.metrics[self.metric])

    @property
    def difference(self) -> float | None:
        """Relative difference of the run with finer steps."""
        if self.confirmed is None:
            return None
        return (self.confirmed - self.value) / max(abs(self.value), abs(self.confirmed), 1e-300)

    @property
    def is_confirmed(self) -> bool:
        """True if the relative difference of the run with finer steps is known and small enough."""
        return self.difference is not None and abs(self.difference) <= CONFIRMED


class Search:
    """A study of Optuna over the parameters of a sweep.

    Parameters
    ----------
    sweep : Sweep
    metric : str
    largest : bool
    seed : int
        Of the sampler.
    known : sequence of Row
        Runs that were made before, as if they had been asked for.

    Raises
    ------
    InputError
        If Optuna is not installed.
    """

    def __init__(self, sweep: Sweep, metric: str, largest: bool, seed: int, known: Sequence[Row] = ()):
        optuna = _optuna()
        self.sweep, self.metric, self.largest = sweep, metric, largest
        with _quiet():
            own = (seed + SEED_STEP * len(known)) % 2**32  # one that goes on does not repeat its first choices
            sampler = optuna.samplers.TPESampler(seed=own, multivariate=True, constant_liar=True)
            self._study = optuna.create_study(direction="maximize" if largest else "minimize", sampler=sampler)
        self._space = {name: _distribution(optuna, of) for name, of in sweep.spec.parameters.items()}
        self._asked: dict[int, Any] = {}
        self.start = start_of(sweep)
        self.asked = 0
        for row in known:
            self._know(row)
        if self.start is not None and not known:
            self._study.enqueue_trial(self.start)

    def _know(self, row: Row) -> None:
        optuna = _optuna()
        value, state = row.metrics.get(self.metric), optuna.trial.TrialState
        told = {"value": value, "state": state.COMPLETE} if _is_value(value) else {"state": state.FAIL}
        try:
            trial = optuna.trial.create_trial(params=row.parameters, distributions=self._space, **told)
            self._study.add_trial(trial)
        except ValueError as error:
            raise InputError(f"--resume: run {row.number} in the results is none of this search: {error}") from None
        self.asked = max(self.asked, row.number + 1)

    def ask(self) -> Point:
        """Return the next run."""
        with _quiet():
            trial = self._study.ask(self._space)
        self._asked[self.asked] = trial
        values: Values = {name: trial.params[name] for name in self._space}
        self.asked += 1
        return self.sweep.point(self.asked - 1, values)

    def tell(self, number: int, row: Row) -> None:
        """Give the study the outcome of a run: its metric, or that it failed."""
        optuna = _optuna()
        value = row.metrics.get(self.metric)
        if row.outcome is Outcome.DONE and _is_value(value):
            self._study.tell(self._asked.pop(number), float(value))
        else:
            self._study.tell(self._asked.pop(number), state=optuna.trial.TrialState.FAIL)


def ranked(rows: list[Row], metric: str, largest: bool) -> list[Row]:
    """Return the runs that have a value, the best first."""
    known = [row for row in rows if row.outcome is Outcome.DONE and _is_value(row.metrics.get(metric))]
    return sorted(known, key=lambda row: float(row.metrics[metric]), reverse=largest)


def _is_value(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and value == value


METHODS = ("search", "gradients")
"""How values are chosen: by Optuna, or by derivatives."""


def start_of(sweep: Sweep) -> Values | None:
    """Return the values of `start`, of parameters that all have one; of a list of values the first one stands in for
    it.
    """
    found: Values = {}
    for name, parameter in sweep.spec.parameters.items():
        if parameter.start is not None:
            value = parameter.in_unit(parameter.start)
            found[name] = round(value) if parameter.whole else value
        elif parameter.levels is not None:
            found[name] = parameter.levels[0]
        else:
            return None
    return found


def _distribution(optuna: Any, parameter: Parameter) -> Any:
    if parameter.levels is not None:
        return optuna.distributions.CategoricalDistribution(parameter.levels)
    begin, end = parameter.ends
    log = parameter.spacing == "log"
    if parameter.whole:
        return optuna.distributions.IntDistribution(round(begin), round(end), log=log)
    return optuna.distributions.FloatDistribution(begin, end, log=log)


def _optuna() -> Any:
    require("optimise", "optuna")
    import optuna

    return optuna


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence Optuna, which tells of each study, and that parts of it are new."""
    verbosity = _optuna().logging.get_verbosity()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _optuna().logging.set_verbosity(_optuna().logging.ERROR)
        try:
            yield
        finally:
            _optuna().logging.set_verbosity(verbosity)


def optimise(
    spec: str | Path | Mapping[str, Any],
    metric: str,
    *,
    largest: bool = True,
    method: str = METHODS[0],
    trials: int = TRIALS,
    seed: int = 0,
    out: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    security: Any = None,
    dashboard: bool = False,
    resume: bool = False,
    force: bool = False,
    progress: Callable[[Row], None] | None = None,
    tell: Callable[[Engine], None] | None = None,
) -> Optimum:
    """Search for the values of a sweep's parameters with the largest, or least, metric.

    Parameters
    ----------
    spec : str, Path or mapping
        Sweep file, or its content; its design and `count` do not matter; `start` is where the search begins.
    metric : str
    largest : bool
    method : str
        ``search``: Optuna chooses the next values; ``gradients``: climbs along the derivatives of runs do, see
        docs/sweeps.md.
    trials : int
        Runs, those that are resumed included.
    seed : int
        Of the search. With one worker the same search is made again.
    out, workers, scheduler, security, dashboard, resume, force, progress
        As of `studies.sweeps.run_sweep.sweep`.
    tell : callable, optional
        Called with the engine before the first run.

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        If anything that is asked for cannot be, or no run has a value of the metric.
    """
    directory = None if out is None else Path(out)
    read = read_sweep(spec, directory, is_search=True)
    _refuse_unsearchable(read, metric)
    climbs = method == "gradients"
    if method not in METHODS:
        raise InputError(f"method {method!r}: must be one of {', '.join(METHODS)}")
    if climbs:
        refuse_unclimbable(read, metric)
        read = replace(read, job=replace(read.job, slope_of=metric))
    processes = Processes(workers, scheduler, security, dashboard)
    content = read.content | {"search": [metric, largest, seed, *([method] if climbs else [])]}
    with Journal(directory, content, resume=resume, force=force) as journal, ExitStack() as stack:
        rows = {row.key: row for row in journal.rows()}
        search = (
            Ascent(read, metric, largest, seed, start_of(read))
            if climbs
            else Search(read, metric, largest, seed, list(rows.values()))
        )
        ensure_compiled()
        engine = stack.enter_context(open_engine(read.job, processes, read.spec.limits.memory))
        if tell is not None:
            tell(engine)
        _run_trials(search, engine, journal, rows, trials, progress)
        if isinstance(search, Ascent) and search.is_lost:
            told = f"no run has derivatives of {metric!r}: {search.found_none}"
            raise InputError(f"the method gradients: {told}; choose the method search")
        optimum = _confirm(search, engine, list(rows.values()))
        if directory is not None:
            write_table(journal, set(rows), read.about, directory)
            write_best(read, optimum.best, directory)
        return optimum


def _refuse_unsearchable(sweep: Sweep, metric: str) -> None:
    if metric not in sweep.job.metrics:
        there = ", ".join(sweep.job.metrics) or "none"
        raise InputError(f"metric {metric!r}: {sweep.source} has no such metric; there are {there}")
    if sweep.spec.repeats:
        raise InputError(f"{sweep.source}: repeats: must be left out for a search: each run is made once")


def _run_trials(
    search: Search | Ascent,
    engine: Engine,
    journal: Journal,
    rows: dict[str, Row],
    trials: int,
    progress: Callable[[Row], None] | None,
) -> None:
    while search.asked < trials or engine.busy:
        while engine.free > 0 and search.asked < trials:
            point = search.ask()
            if point.key in rows:  # the same values once more: nothing else would come of it
                search.tell(point.number, rows[point.key])
                continue
            engine.submit([point])
        if not engine.busy:
            continue
        for row in engine.wait():
            journal.add([row])
            rows[row.key] = row
            search.tell(row.number, row)
            if progress is not None:
                progress(row)


def _confirm(search: Search | Ascent, engine: Engine, rows: list[Row]) -> Optimum:
    """Make the best runs again with finer steps, until one says the same."""
    best = ranked(rows, search.metric, search.largest)
    if not best:
        raise InputError(
            f"metric {search.metric!r}: no run has a value of it; {len(rows)} runs were made, the first ended: "
            f"{rows[0].outcome.value} {rows[0].reason}".rstrip()
        )
    start = None
    if search.start is not None:
        key = search.sweep.job.key_of(search.start)
        found = next((row.metrics[search.metric] for row in rows if row.key == key), None)
        start = float(found) if _is_value(found) else None
    optima = []
    for row in best[:MOST_CANDIDATES]:
        value = _finer(search, engine, row)
        ends = tuple(name for name, of in search.sweep.spec.parameters.items() if of.is_end(row.parameters[name]))
        optima.append(Optimum(search.metric, row, value, start, len(rows), search.sweep.job.units, ends))
        if optima[-1].is_confirmed:
            return optima[-1]
    return optima[0]


def _finer(search: Search | Ascent, engine: Engine, row: Row) -> float | None:
    point = Point(row.number, row.key, row.parameters)
    engine.submit([point], finer_job(search.sweep.job, row.parameters))
    while True:
        for found in engine.wait():
            value = found.metrics.get(search.metric)
            return float(value) if found.outcome is Outcome.DONE and _is_value(value) else None


def finer_job(job: Job, parameters: Values) -> Job:
    """Return the same runs with finer steps, without logs.

    Steps have a tenth of the tolerance and half the longest step, or a quarter of the fixed step.
    """
    simulator = Simulator(scene_of(job, parameters))
    content = json.loads(job.scene)
    if simulator.tolerance is not None:
        tolerance, longest = FINER_TOLERANCE * simulator.tolerance, FINER_LONGEST * simulator.steps.longest
        changes = {"solver.tolerance": tolerance, "solver.max_step": longest}
    else:
        changes = {"solver.dt": FINER_STEP * simulator.dt}
    return replace(job, scene=json.dumps(scene_content(load_content(content, changes))), logs="none", slope_of="")


def write_best(sweep: Sweep, row: Row, directory: Path) -> Path:
    """Write the scene of a run, which `bilayer run` takes."""
    path = directory / BEST
    write_text(path, scene_text(scene_of(sweep.job, row.parameters)), force=True)
    return path

"""Sweeps: from a file to rows of results."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

from bilayer_core.errors import BilayerError, InputError, SceneError
from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_core.scene.loader import load_scene, scene_content
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.sweeps.dask_processes import Engine
from bilayer_core.studies.sweeps.design import Values, count_of, runs_of
from bilayer_core.studies.sweeps.execute_runs import present_versions, recording_of, scene_of
from bilayer_core.studies.sweeps.job import Job, Point, Row, digest
from bilayer_core.studies.sweeps.journal import Journal
from bilayer_core.studies.sweeps.metrics import FinishedRun, MetricError, check_metrics
from bilayer_core.studies.sweeps.open_processes import Processes, open_engine
from bilayer_core.studies.sweeps.spec import OfFunction, SweepSpec, read_spec
from bilayer_core.studies.sweeps.sweep_functions import find_code, refuse_broken
from bilayer_core.studies.sweeps.sweep_result import Columns, SweepResult, rows_of, write_table

TRIED = 16
"""Scenes of a sweep that are loaded before it begins: if all are refused, none is run."""


@dataclass(frozen=True)
class Sweep:
    """A sweep that was read and checked.

    Attributes
    ----------
    spec : SweepSpec
    job : Job
        What all its runs have in common.
    source : str
        What begins messages about it.
    content : dict
        That of its file, and what it depends on beside that, by which changes are noticed.
    units : dict
        Of metrics that have one.
    """

    spec: SweepSpec
    job: Job
    source: str
    content: dict[str, Any]
    units: dict[str, str] = field(default_factory=dict)

    def points(self) -> Iterator[Point]:
        """Yield all runs of the sweep."""
        for number, values in enumerate(runs_of(self.spec)):
            yield self.point(number, values)

    def keys(self) -> set[str]:
        """Return the keys of all runs."""
        return {point.key for point in self.points()}

    @property
    def about(self) -> Columns:
        """Description of the columns of the sweep's results."""
        job, spec = self.job, self.spec
        logarithmic = tuple(name for name, parameter in spec.parameters.items() if parameter.spacing == "log")
        units = job.units | self.units
        return Columns(tuple(job.paths), tuple(job.metrics), units, dict(spec.objectives), logarithmic, spec.title)

    def result(self, journal: Journal) -> SweepResult:
        """Return the sweep's rows in a journal; those of other versions are left out."""
        return SweepResult(rows_of(journal, self.keys()), self.about)

    def point(self, number: int, values: Values) -> Point:
        """Return one run."""
        return Point(number, self.job.key_of(values), values)


def read_sweep(
    spec: str | Path | Mapping[str, Any],
    out: Path | None = None,
    functions: Any = None,
    run_code: bool = True,
    is_search: bool = False,
) -> Sweep:
    """Read and check a sweep: the scene, key paths, metrics, functions.

    Parameters
    ----------
    spec : str, Path or mapping
        Sweep file, or its content.
    out : Path, optional
        Directory of results, for logs.
    functions : mapping, optional
        Further metrics that are Python functions, by name.
    run_code : bool
        Whether the Python files that the sweep file names may run; if not, less is checked.
    is_search : bool
        Whether the ranges are searched, so that they need no count.

    Raises
    ------
    InputError, SceneError
        One line for each fault.
    """
    read, directory, source = read_spec(spec, is_search)
    functions = dict(functions or {})
    for name in functions:
        if name in read.parameters or name in read.metrics:
            raise InputError(f"functions: {name!r} is a parameter or a metric of the sweep already")
    if read.logs != "none" and out is None:
        raise InputError(f"{source}: logs: found {_shown(read.logs)}; a directory for results must be given too (out)")
    scene = load_scene(_scene_of(read, directory), _fixed(read))
    codes = _find_codes(read, directory, source, run_code)
    metrics = dict(read.metrics)
    for name, function in functions.items():
        metrics[name] = OfFunction(function=f"python:{name}")
        codes[f"python:{name}"] = function
    paths = {name: parameter.paths for name, parameter in read.parameters.items()}
    if read.repeats:
        paths["seed"] = (read.repeats.path,)
    job = Job(
        scene=json.dumps(scene_content(scene)),
        paths=paths,
        units={name: parameter.unit for name, parameter in read.parameters.items() if parameter.unit},
        metrics=metrics,
        codes=codes,
        change=read.change or "",
        quantities=tuple(read.record.quantities),
        rate=read.record.rate,
        logs=read.logs,
        directory=str(out.resolve()) if out is not None else "",
        wall_time=read.limits.wall_time,
        expected=present_versions(),
    )
    content = read.model_dump(mode="json", by_alias=True, exclude={"title"})
    content |= {"the scene": job.scene_hash, "functions": digest(repr(sorted(codes.items(), key=str)))}
    found = Sweep(read, job, source, content)
    if run_code or not read.change:
        _check(replace(found, spec=_tried(read)) if is_search else found)
    return found


def _tried(spec: SweepSpec) -> SweepSpec:
    """Return a sweep over the ranges of a search with no more runs than there may be."""
    try:
        count_of(spec)
        return spec
    except InputError:
        return spec.model_copy(update={"design": "latin_hypercube", "samples": TRIED})


def _find_codes(read: SweepSpec, directory: Path, source: str, run_code: bool) -> dict[str, Any]:
    """Return the code of all functions that a sweep file names, by how it names them."""
    named = {f"metrics.{name}": of.function for name, of in read.metrics.items() if isinstance(of, OfFunction)}
    if read.change:
        named["change"] = read.change
    codes: dict[str, Any] = {}
    for key, function in named.items():
        codes[function] = find_code(function, directory, f"{source}: {key}")
        if run_code:
            refuse_broken(codes[function], function, f"{source}: {key}")
    return codes


def _shown(logs: Any) -> str:
    return logs if isinstance(logs, str) else "conditions"


def _scene_of(spec: SweepSpec, directory: Path) -> str | Path:
    beside = directory / spec.scene
    return beside if beside.is_file() else spec.scene


def _fixed(spec: SweepSpec) -> dict[str, Any]:
    return dict(spec.set)


def _check(sweep: Sweep) -> None:
    """Try some runs' scenes, and the metrics on one of them at its start."""
    count = count_of(sweep.spec)
    tried = {round(k * (count - 1) / (TRIED - 1)) for k in range(TRIED)}
    first: Exception | None = None
    for number, values in enumerate(runs_of(sweep.spec)):
        if number in tried:
            try:
                scene = scene_of(sweep.job, values)
                ensure_compiled()
                simulator = Simulator(scene)
            except (SceneError, MetricError) as error:
                if "override" in str(error) and "there is no" in str(error):
                    raise InputError(f"{sweep.source}: parameters: {error}") from None
                first = first or error
                continue
            _check_metrics(sweep, simulator, values)
            return
    text = str(first)
    raise InputError(f"{sweep.source}: none of the runs that were tried has an acceptable scene; the first: {text}")


def _check_metrics(sweep: Sweep, simulator: Simulator, values: Values) -> None:
    simulator.compile()
    recording = None
    try:
        recording = recording_of(sweep.job, simulator)
        sweep.units.update(check_metrics(sweep.job, FinishedRun(simulator, simulator.summary(), values, recording)))
    except BilayerError as error:
        raise InputError(f"{sweep.source}: {error}") from None
    finally:
        if recording is not None:
            recording.stop()


def sweep(
    spec: str | Path | Mapping[str, Any],
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    security: Any = None,
    dashboard: bool = False,
    resume: bool = False,
    force: bool = False,
    functions: Mapping[str, Callable[[FinishedRun], Any]] | None = None,
    progress: Callable[[Row], None] | None = None,
) -> SweepResult:
    """Make many runs of a scene with other values.

    Parameters
    ----------
    spec : str, Path or mapping
        Sweep file, or its content; see docs/sweeps.md.
    out : str or Path, optional
        Directory for results, made if need be. Without one they are kept in memory.
    workers : int, optional
        Processes of this machine; by default one a core.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers run instead.
    security : distributed.Security, optional
        Certificates for a scheduler whose address begins with ``tls://``; by default those that Dask's configuration
        names.
    dashboard : bool
        Whether the processes of this machine serve Dask's dashboard, to any user of the machine.
    resume : bool
        Make the runs that are missing in `out`, and none twice.
    force : bool
        Replace results that are in `out`.
    functions : mapping, optional
        Further metrics, by name: functions of a `FinishedRun`.
    progress : callable, optional
        Called with each row.

    Returns
    -------
    SweepResult

    Raises
    ------
    InputError
        If anything that is asked for cannot be; before the first run.
    EngineError, OutputError
        If the processes have gone, or results cannot be written; rows that came before are kept.

    Examples
    --------
    >>> result = sweep({"schema": 1, "scene": "bending", "parameters": {"gain": {...}}})  # doctest: +SKIP
    >>> result.to_dataframe()  # doctest: +SKIP
    """
    directory = None if out is None else Path(out)
    read = read_sweep(spec, directory, functions)
    processes = Processes(workers, scheduler, security, dashboard)
    with Journal(directory, read.content, resume=resume, force=force) as journal:
        return run_missing(read, journal, directory, processes, progress)


def run_missing(
    sweep: Sweep,
    journal: Journal,
    directory: Path | None,
    processes: Processes,
    progress: Callable[[Row], None] | None = None,
    tell: Callable[[Engine], None] | None = None,
) -> SweepResult:
    """Make the runs of a sweep that a journal lacks, and write its table; what comes is in the journal when it is told.

    Parameters
    ----------
    directory : Path, optional
        Of the table.
    progress, tell : callable, optional
        Called with each row, and with the `Engine` before the first run.
    """
    there, told = journal.keys(), progress or (lambda row: None)
    missing = (point for point in sweep.points() if point.key not in there)
    first = next(missing, None)
    try:
        if first is not None:
            ensure_compiled()
            with open_engine(sweep.job, processes, sweep.spec.limits.memory) as engine:
                if tell is not None:
                    tell(engine)
                for rows in engine.run(chain([first], missing)):
                    journal.add(rows)
                    for row in rows:
                        told(row)
    finally:
        if directory is not None:
            write_table(journal, sweep.keys(), sweep.about, directory)
    return sweep.result(journal)

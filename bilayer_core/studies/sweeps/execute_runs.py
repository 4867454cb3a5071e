"""Execution of the runs that a process gets: load, build or reset, run, measure."""

from __future__ import annotations

import json
import math
import os
import socket
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bilayer_core.errors import InputError, OutputError, SceneError, SimulationError
from bilayer_core.jit.cache import fingerprint
from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_core.log.file.output_paths import unwritable
from bilayer_core.log.run.recorder import Recorder
from bilayer_core.observed.observer import Observer
from bilayer_core.observed.system import versions
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content
from bilayer_core.simulation.run_loop import wall_time
from bilayer_core.simulation.run_result import Termination
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.sweeps.job import Job, Outcome, Point, Row
from bilayer_core.studies.sweeps.metrics import FinishedRun, MetricError, measure, name_and_component, quantities_of
from bilayer_core.studies.sweeps.slopes import slopes_of
from bilayer_core.studies.sweeps.sweep_functions import load

LOGS = "logs"
"""Folder of logs below that of results."""
LEFT_OUT = ("terms", "reasons")
"""Keys of the summary that all runs of a sweep have alike."""
_local = threading.local()
_warmed = False


def present_versions() -> dict[str, str]:
    """Return versions and kernel sources (hashed), which with the machine fix results to the last digit."""
    return versions() | {"sources": fingerprint()}


def warm() -> None:
    """Compile and load all kernels, once in each process."""
    global _warmed
    if not _warmed:
        ensure_compiled()
        _warmed = True


def scene_of(job: Job, parameters: dict[str, Any]) -> SceneConfig:
    """Return the scene of a run.

    Raises
    ------
    SceneError
        If it is not acceptable with these values.
    MetricError
        If the function that changes it fails.
    """
    content = json.loads(job.scene)
    values = {name: _written(job, name, value) for name, value in parameters.items()}
    if job.change:
        try:
            content = load(job.codes[job.change])(content, job.in_si(parameters))
        except Exception as error:  # of the user's function
            raise MetricError(f"change ({job.change}): {type(error).__name__}: {error}") from error
        if not isinstance(content, dict):
            kind = type(content).__name__
            raise MetricError(f"change ({job.change}): must return the content of the scene; returned {kind}")
    overrides = {path: value for name, value in values.items() for path in job.paths.get(name, ())}
    return load_content(content, overrides)


def _written(job: Job, name: str, value: Any) -> Any:
    unit = job.units.get(name, "")
    return f"{value!r} {unit}" if unit and not isinstance(value, str) else value


def execute(job: Job, points: Sequence[Point]) -> list[Row]:
    """Make some runs, one after the other.

    Raises
    ------
    OutputError
        If a log cannot be written.
    """
    return [_run(job, point) for point in points]


def row_of(job: Job, point: Point) -> Row:
    """Return the row of a run without results yet."""
    version, metrics = job.expected["bilayer_sim_ros"], dict.fromkeys(job.metrics)
    return Row(point.number, point.key, point.parameters, job.scene_hash, version, metrics=metrics)


def _run(job: Job, point: Point) -> Row:
    begin = wall_time()
    row = row_of(job, point)
    log = None if job.logs == "none" else Path(job.directory, LOGS, f"{point.number:06d}.mcap")
    try:
        _simulate(job, point, row, begin, log)
    except SimulationError as failure:
        row.outcome, row.reason, row.remedy = Outcome.STOPPED, failure.reason, str(failure.remedy or "")
    except (SceneError, InputError) as refusal:
        row.outcome, row.reason = Outcome.REFUSED, str(refusal)
    except MetricError as fault:
        row.outcome, row.reason = Outcome.ERROR, str(fault)
    except OutputError:
        raise
    except Exception as fault:
        row.outcome, row.reason = Outcome.ERROR, f"internal error: {type(fault).__name__}: {fault}"
        _local.__dict__.clear()  # a simulator in an unknown state is not used again
    if log is not None and log.exists():
        _keep_or_drop(job, log, row)
    row.wall_time = wall_time() - begin
    return row


def _simulate(job: Job, point: Point, row: Row, begin: float, log: Path | None) -> None:
    simulator = simulator_of(scene_of(job, point.parameters))
    simulator.compile()
    deadline = begin + job.wall_time if job.wall_time else math.inf
    observers = [] if log is None else [_recorder(simulator, log)]
    recording = recording_of(job, simulator)
    try:
        over = {"observers": observers, "interrupted": lambda: wall_time() > deadline}
        ended = simulator.run(**over, gradients=bool(job.slope_of))
    finally:
        if recording is not None:
            recording.stop()
        row.cpu_time = simulator.cpu_time
        summary = simulator.summary()
        row.summary = {key: value for key, value in summary.items() if key not in LEFT_OUT}
    if ended.termination is Termination.COMPLETED:
        row.metrics = measure(job, FinishedRun(simulator, summary, job.in_si(point.parameters), recording))
        if job.slope_of:
            row.slopes, row.reason = slopes_of(job, ended)
    else:
        row.outcome = Outcome.OVER_TIME
        row.reason = f"took longer than {job.wall_time:g} s; it was at t = {simulator.time:g} s of the scene"


def simulator_of(scene: SceneConfig) -> Simulator:
    """Return a simulator at the start of a scene.

    It is the last one of this thread if that accepts the scene, otherwise a new one.
    """
    last: Simulator | None = getattr(_local, "simulator", None)
    if last is not None and last.same_model(scene):
        last.reset(scene)
        return last
    _local.simulator = None  # its memory is free while the next one is built
    _local.simulator = simulator = Simulator(scene)
    return simulator


def recording_of(job: Job, simulator: Simulator) -> Recorder | None:
    """Return a recorder of the quantities that a job and its metrics look at in a run; None if there are none."""
    names = list(dict.fromkeys((*job.quantities, *_names(job, simulator))))
    return Recorder(simulator, names, job.rate) if names else None


def _names(job: Job, simulator: Simulator) -> list[str]:
    """Return the names of the quantities that metrics look at."""
    return [name_and_component(quantity, ())[0] for quantity in quantities_of(job.metrics)]


def _recorder(simulator: Simulator, path: Path) -> Observer:
    from bilayer_core.log.file.mcap_log import McapRecorder

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path.parent, error) from error
    output = simulator.scene.output
    return McapRecorder(str(path), output.rate, output.marker_rate, True)


def _keep_or_drop(job: Job, path: Path, row: Row) -> None:
    columns = row.columns()
    if isinstance(job.logs, dict) and not all(of.holds(columns.get(name)) for name, of in job.logs.items()):
        path.unlink(missing_ok=True)
        return
    row.log = f"{LOGS}/{path.name}"


def prepare(job: Job, token: str) -> dict[str, Any]:
    """Return the report of a process before its first run: its versions, and whether it sees the directory of logs.

    Parameters
    ----------
    job : Job
    token : str
        Name of a file in that directory, which the process looks for.
    """
    found = present_versions()
    if found == job.expected:
        warm()
    sees = not token or Path(job.directory, LOGS, token).exists()
    writes = sees and (not token or os.access(Path(job.directory, LOGS), os.W_OK))
    return {"versions": found, "sees": sees, "writes": writes, "host": socket.gethostname()}

"""Work of a worker on one case: run it, judge it, compare it with a finer run, try the remedy that a refusal names."""

from __future__ import annotations

import math
import time as clock
import traceback
from collections.abc import Sequence

from bilayer_core.errors import BilayerError, Remedy, SimulationError
from bilayer_core.observed.frame import Frame
from bilayer_core.scene.config import DEFAULT_TOLERANCE
from bilayer_core.testing.judge import Verdict
from bilayer_core.testing.trial import Trial, distance_of
from bilayer_core.verification.stress.robots import LOOKS
from bilayer_core.verification.stress.stress_case import Decision, Outcome, Record, StressCase

ACCURATE = 0.01
"""Largest error of what is called accurate."""
FINER_TOLERANCE, FINER_STEP = 0.1, 0.25
"""Of the finer run, over that of the case."""
MOST_REMEDIES = 3
"""That are followed one after the other, as a user would."""
FINER_EFFORT = 6
"""Steps and CPU time that a finer run may take, over those of the case."""


def execute(case: StressCase) -> Record:
    """Run a case; every way in which it can end is an outcome."""
    begin = clock.process_time()
    record = Record(case.name, case.axis, not case.outside, list(case.outside), Outcome.STABLE)
    try:
        trial, decision = _run(case, record)
        _decide(case, record, trial, decision)
    except Verdict as verdict:
        record.outcome, record.reason = Outcome.FAILED, str(verdict)
    except BilayerError as refusal:
        record.outcome, record.reason = Outcome.REFUSED, str(refusal)
        _try_remedy(case, record, refusal.remedy if isinstance(refusal, SimulationError) else None)
    except MemoryError:
        record.outcome, record.reason = Outcome.FAILED, "out of memory"
    except Exception as fault:  # whatever it is, it is none of the errors that a user may see
        last = "".join(traceback.format_exception(fault)[-2:])
        record.outcome, record.reason = Outcome.FAILED, f"{type(fault).__name__}: {fault}\n{last}"
    record.cpu_time = clock.process_time() - begin
    return record


def _run(case: StressCase, record: Record, overrides: Sequence[str] = ()) -> tuple[Trial, Decision | None]:
    """Run a case under the judge; figures go into the record as they are then, whatever happens."""
    trial = _trial_of(case, overrides)
    try:
        decision = None
        if case.decide is not None:
            decision = case.decide(trial)
        else:
            trial.frames = trial.looks(trial.ends(LOOKS))
        record.figures |= trial.judge.end(record.inside)
        return trial, decision
    finally:
        record.figures |= _figures(trial)
        record.warnings = list(trial.simulator.summary()["warnings"])


def _trial_of(case: StressCase, overrides: Sequence[str] = (), effort: float = 1.0, judged: bool = True) -> Trial:
    return Trial(
        case.scene(),
        most_steps=round(effort * case.most_steps),
        cpu_limit=effort * case.cpu_limit,
        overrides=overrides,
        look_every=case.look_every,
        judged=judged,
        budget=judged and case.budget,
    )


def _figures(trial: Trial) -> dict[str, float | int | None]:
    statistics, judge, model = trial.simulator.statistics, trial.judge, trial.simulator.model
    contact = model.scene.contact
    return {
        "nodes": model.node_count,
        "steps": judge.steps,
        "substeps": statistics.substeps,
        "rejected": statistics.rejected,
        "inaccurate": statistics.inaccurate,
        "gaining": statistics.gaining,
        "unresolved": statistics.unresolved,
        "iterations": statistics.iterations,
        "factorisations": statistics.factorisations,
        "regularised": statistics.regularised,
        "min_gap": _finite(judge.min_gap),
        "gap_over_barrier": _finite(judge.min_gap / contact.barrier_distance) if contact else None,
        "max_strain": _finite(statistics.max_strain),
        "energy_gain": judge.energy_gain,
        "numerical": judge.numerical,
        "momentum": judge.momentum,
        "simulated": trial.simulator.time,
        "cut": int(trial.cut),
        "stepping_time": trial.simulator.cpu_time,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _decide(case: StressCase, record: Record, trial: Trial, decision: Decision | None) -> None:
    if decision is not None:
        record.decision = decision.text()
        if not decision.holds:
            record.outcome, record.reason = Outcome.FAILED, record.decision
            return
        middle = 0.5 * (decision.low + decision.high)
        if math.isfinite(middle) and middle != 0.0:
            record.error = abs(decision.computed - middle) / abs(middle)
        record.outcome = Outcome.ACCURATE
        return
    if not case.compared:
        record.reason = "not compared with a finer run"
        return
    if not trial.frames:
        record.reason = "no output time was reached within its steps"
        return
    record.error, record.reason = _error(case, trial)
    if record.error is not None and record.error < ACCURATE:
        record.outcome = Outcome.ACCURATE


def _error(case: StressCase, trial: Trial) -> tuple[float | None, str]:
    """Return the largest error at the output times that the case reached, and why it is unknown or what is wrong."""
    steps = trial.simulator.steps
    if steps.adaptive:
        overrides = [f"solver.tolerance={FINER_TOLERANCE * (steps.tolerance or DEFAULT_TOLERANCE):g}"]
    else:
        overrides = [f"solver.dt={FINER_STEP * steps.dt!r}"]
    try:
        finer = _trial_of(case, overrides, FINER_EFFORT, judged=False)
        frames = finer.looks([frame.time for frame in trial.frames])
    except SimulationError as refusal:
        return None, f"the finer run {refusal}"
    if len(frames) < len(trial.frames):
        return None, "the finer run took too long"
    return max(map(distance_of, trial.frames, frames)) / _size_of_motion(trial, frames), ""


def _size_of_motion(trial: Trial, frames: Sequence[Frame]) -> float:
    """Return the length that an error is relative to [m]: the longest strip, or the longest motion if that is more."""
    start = trial.start
    return max([trial.length, *(distance_of(start, frame) for frame in frames)])


def _try_remedy(case: StressCase, record: Record, remedy: Remedy | None) -> None:
    """Do what a refusal names, and what the next one names, and see whether the case comes through."""
    overrides: list[str] = []
    for _ in range(MOST_REMEDIES):
        if remedy is None:
            return
        record.remedy += f"{'; then ' if record.remedy else ''}{remedy}"
        record.remedy_works = False
        if not remedy.changes:
            return
        overrides += remedy.overrides()
        try:
            _run(case, Record(case.name, case.axis, record.inside, [], Outcome.STABLE), overrides)
            record.remedy_works = True
            return
        except SimulationError as refusal:
            remedy = refusal.remedy
        except BilayerError as failure:
            record.remedy += f" [{failure}]"
            return
        except Exception as fault:  # no memory, or an error that no user may see: the remedy is none
            record.remedy += f" [{type(fault).__name__}: {fault}]"
            return

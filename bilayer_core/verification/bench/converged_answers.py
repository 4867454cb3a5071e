"""Converged answers of the problems, each with an error bar and a check by a second method; stored in references.json.

Runs at edges doubled and steps halved give f₁, f₂, f₃ (arrays for trajectories). Their differences fall by 2ᵖ with the
lower of the orders in step and mesh, so that f = f₃ + (f₃ − f₂)/(2ᵖ − 1) and the bar is 1.25 |f − f₃|, as for single
numbers in `studies.converge.order`; where they do not fall so, p = 1 and the factor is 3. The bar is not less than
what the other integrator differs by. Each model has a reference of its own:
the error of a run is that of its discretisation, and how far models differ is said beside it.

The check is another integrator on the same levels, and where there is one an answer that does not come from this
simulator at all (`independent`).
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError, SimulationError
from bilayer_core.log.file.output_paths import write_text
from bilayer_core.model.strip_choice import section_of
from bilayer_core.scene.bundled import bundled_scene
from bilayer_core.scene.loader import read_scene_file
from bilayer_core.scene.text import read_yaml
from bilayer_core.studies.converge.order import LEAST_ORDER, SAFETY_WITH_ORDER, SAFETY_WITHOUT
from bilayer_core.verification.bench import independent
from bilayer_core.verification.bench.configurations import Configuration, Family, shapes
from bilayer_core.verification.bench.measuring import run
from bilayer_core.verification.bench.problems import Problem

Array = np.ndarray
FILE = Path(__file__).with_name("references.json")
FIRST = "sdirk2"
"""The integrator of references."""
ORDER, HIGHEST_ORDER = 2.0, 2.5
"""Order of meshes and steps, and the largest observed one that counts: beyond it the runs are on no power law."""
JUDGE = "two_rod"
"""Whose reference other programs are judged by, where the models have one layer and are one."""
BLURRED = 2e-2
"""A problem whose reference has a larger error bar does not count when families are compared."""
DIGITS = 9


@dataclass(frozen=True)
class Reference:
    """A converged answer."""

    values: Array  # As the problem's measure gives them
    bar: float  # Half width of its error bar, measured as errors of runs are
    check: str  # The second method
    difference: float  # How far the second method is from it, measured likewise


def stored(problem: Problem, model: str) -> Reference:
    """Return the reference of a problem in the stored file.

    Raises InputError if there is none, or the problem has changed since it was made.
    """
    entry = read_file().get(problem.name, {}).get(model)
    remedy = f"make it with: bilayer bench --references --only {problem.name}"
    if entry is None:
        raise InputError(f"{problem.name}: there is no reference for {model}; {remedy}")
    if entry["problem"] != fingerprint(problem):
        raise InputError(f"{problem.name}: has changed since its reference for {model} was made; {remedy}")
    return Reference(np.array(entry["values"]), entry["bar"], entry["check"], entry["difference"])


def sharp(problem: str, models: Iterable[str]) -> bool:
    """Return whether the references of a problem for these models are good enough to compare families."""
    entries = read_file()[problem]
    return all(entries[model]["bar"] <= BLURRED for model in models)


def fingerprint(problem: Problem) -> str:
    """Return a hash of everything that a reference depends on: the scene file without its title, description and solver
    settings, the changes, the duration and the measure. Rods have the section that they are computed with, which `auto`
    may choose; a beam goes without saying.
    """
    path = bundled_scene(problem.scene)
    scene = read_yaml(read_scene_file(path), str(path))
    for key in ("title", "description", "solver"):
        scene.pop(key, None)
    config = problem.config()
    for rod, computed in zip(scene["rods"], config.rods, strict=True):
        rod.pop("section", None)
        if (section := section_of(config, computed)) != "beam":
            rod["section"] = section
    changes = [change for change in problem.changes if ".section=" not in change]
    measure = {key: value for key, value in vars(problem.measure).items() if not callable(value)}
    measure.pop("stops", None)
    content = [scene, changes, problem.duration, measure]
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:16]


def read_file() -> dict:
    """Return all entries, by problem and model."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}


def make(problem: Problem, model: str, tell: Callable[[str], None]) -> dict:
    """Compute the reference of a problem and store it; return its entry.

    Raises SimulationError if one of its runs cannot be made.
    """
    dimension = min(dimension for name, dimension in shapes(problem.config()) if name == model)
    values, bar, order = _limit(problem, Family(model, dimension, FIRST), tell)
    other, _, _ = _limit(problem, Family(model, dimension, problem.second), tell)
    checks = {problem.second: problem.measure.error(other, values)}
    if problem.name in independent.ANSWERS:
        name, answer = independent.ANSWERS[problem.name]
        checks[name] = problem.measure.error(answer(), values)
    check = list(checks)[-1]
    entry = {
        "problem": fingerprint(problem),
        "levels": [list(level) for level in problem.reference_levels],
        "order": None if order is None else round(order, 2),
        "bar": float(f"{max(bar, checks[problem.second]):.2g}"),
        "check": check,
        "difference": float(f"{checks[check]:.2g}"),
        "checks": {name: float(f"{value:.2g}") for name, value in checks.items()},
        "values": [[float(f"{number:.{DIGITS}g}") for number in row] for row in values.tolist()],
    }
    content = read_file()
    content.setdefault(problem.name, {})[model] = entry
    _write(content)
    return entry


def _limit(problem: Problem, family: Family, tell: Callable[[str], None]) -> tuple[Array, float, float | None]:
    """Return the limit of the runs of a family, its error bar and the observed order."""
    found = []
    for stations, dt in problem.reference_levels[-3:]:
        tell(f"{problem.name}, {family.label}: {stations} stations, {1e3 * dt:g} ms")
        result = run(problem, Configuration(family, stations, dt), longest=math.inf, timed=False)
        if result.values is None:
            raise SimulationError(f"{problem.name}: no reference: {result.outcome}", 0.0)
        found.append(_thinned(problem, result.values))
    coarse, middle, fine = found
    first, second = problem.measure.error(coarse, middle), problem.measure.error(middle, fine)
    order = math.log2(first / second) if second > 0.0 else math.inf
    seen = LEAST_ORDER < order < HIGHEST_ORDER
    p, safety = (min(order, ORDER), SAFETY_WITH_ORDER) if seen else (1.0, SAFETY_WITHOUT)
    limit = fine + (fine - middle) / (2.0**p - 1.0)
    return limit, safety * problem.measure.error(fine, limit), order if seen else None


def _thinned(problem: Problem, values: Array) -> Array:
    """Return the values at the instants that a reference keeps: those of the coarsest of its runs."""
    spacing = getattr(problem.measure, "spacing", None)
    if spacing is None:
        return values
    at = np.abs(values[:, 0, None] - np.arange(0.0, problem.measure.until + 0.5 * spacing, spacing)).argmin(axis=0)
    return values[at]


def _write(content: dict) -> None:
    """Write values on one line and the rest indented; a line for each instant would make the file long."""
    problems = []
    for problem, models in sorted(content.items()):
        entries = []
        for model, entry in sorted(models.items()):
            lines = [
                f"   {json.dumps(key)}: {json.dumps(value, separators=(',', ':'))}" for key, value in entry.items()
            ]
            entries.append(f"  {json.dumps(model)}: {{\n" + ",\n".join(lines) + "\n  }")
        problems.append(f" {json.dumps(problem)}: {{\n" + ",\n".join(entries) + "\n }")
    write_text(FILE, "{\n" + ",\n".join(problems) + "\n}\n", force=True)

"""Torture cases: a scene, what must come out of it, and a ladder of changes under which it must still come out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from bilayer_core.scene.bundled import bundled_directory, bundled_scenes
from bilayer_core.scene.loader import load_scene, scene_text
from bilayer_core.scene.text import read_yaml
from bilayer_core.testing.trial import Trial
from bilayer_core.verification.stress.stress_case import Decision, StressCase

GROUP = "torture"
CPU_LIMIT, LONG_CPU_LIMIT = 60.0, 400.0
"""CPU time [s] of a rung, and of one whose name says that it is long."""
MOST_STEPS = 100_000
"""Accepted steps of a rung: more than any takes, since what decides it is at its end."""


@dataclass(frozen=True)
class Rung:
    """A case of a ladder."""

    name: str  # That of one which takes long begins with "long"
    overrides: tuple[str, ...] = ()  # Changes to the scene, ``KEY=VALUE``
    decide: Callable[[Trial], Decision] | None = None  # Instead of that of the ladder


@dataclass(frozen=True)
class Torture:
    """A torture case."""

    number: int  # In the list of the docs
    name: str
    scene: str  # Name of its file, without the ending: of a torture case or of a bundled scene
    source: str  # Where it comes from
    expected: str  # What must come out
    decided: str  # The reference or inequality that decides it
    decide: Callable[[Trial], Decision]
    """Runs a trial, and returns the decision. It reads from the scene what the rung has changed."""
    rungs: tuple[Rung, ...]

    def cases(self) -> Iterator[StressCase]:
        """Yield one case a rung."""
        for rung in self.rungs:
            yield StressCase(
                name=f"{GROUP}/{self.number:02d} {self.name}/{rung.name}",
                content=partial(content_of, self.scene, rung.overrides),
                most_steps=MOST_STEPS,
                cpu_limit=LONG_CPU_LIMIT if rung.name.startswith("long") else CPU_LIMIT,
                decide=partial(_whole, rung.decide or self.decide),
            )


def _whole(decide: Callable[[Trial], Decision], trial: Trial) -> Decision:
    """Return a decision, which does not hold if its run was cut."""
    decision = decide(trial)
    if not trial.cut:
        return decision
    return replace(decision, what=f"{decision.what} (its run was cut)", computed=math.nan)


def balanced(trial: Trial, parts: int = 10) -> None:
    """Go to the equilibrium under the whole of the first load, which is brought on in so many equal parts."""
    simulator = trial.simulator
    for part in range(1, parts + 1):
        simulator.set_load(simulator.scene.loads[0].name, part / parts)
        simulator.solve_static()
    trial.judge.look(simulator.time)


def torture_scenes() -> dict[str, Path]:
    """Return the file of the scene of each torture case by its name, in alphabetical order."""
    return {path.stem: path for path in sorted(bundled_directory("torture").glob("*.yaml"))}


def content_of(scene: str, overrides: tuple[str, ...] = ()) -> dict:
    """Return the content of a torture scene, or else of a bundled one, with changes."""
    path = (bundled_scenes() | torture_scenes())[scene]
    return read_yaml(scene_text(load_scene(path, overrides)), scene)


def first_broken(*decisions: Decision) -> Decision:
    """Return the first decision that does not hold, otherwise the first of all."""
    return next((decision for decision in decisions if not decision.holds), decisions[0])

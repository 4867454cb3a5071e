"""Failures made smaller: every setting goes back to its default if the case still fails without it."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import yaml

from bilayer_core.log.file.output_paths import write_text
from bilayer_core.verification.stress.parameters import Parameters
from bilayer_core.verification.stress.pool import one_by_one
from bilayer_core.verification.stress.robots import scene_of
from bilayer_core.verification.stress.stress_case import Outcome, Record, StressCase

FEWER_STATIONS = (11, 5)
ROUNDS = 2


def is_shrinkable(case: StressCase) -> bool:
    """Return whether a case is one of the matrix, whose settings can be taken back."""
    return isinstance(case.content, functools.partial) and case.content.func is scene_of


def shrink(case: StressCase, record: Record, directory: Path) -> Path:
    """Write the smallest scene found that fails as the case does.

    Greedy: in rounds, each setting is tried at its default, alone, on top of what was taken back before.
    """
    parameters: Parameters = case.content.args[0]
    kind, smallest = _kind(record), record
    with one_by_one() as run:
        for _ in range(ROUNDS):
            before = parameters
            for change in _taken_back(parameters):
                candidate = dataclasses.replace(parameters, **change)
                found = run(_with(case, candidate, compared=False))
                if found.outcome is Outcome.FAILED and _kind(found) == kind:
                    parameters, smallest = candidate, found
            if parameters == before:
                break
    return write_scene(_with(case, parameters), smallest, directory)


def _kind(record: Record) -> str:
    """Return the kind of a failure: the first words of its reason."""
    return " ".join(record.reason.split()[:3])


def _taken_back(parameters: Parameters) -> list[dict[str, object]]:
    """Return the settings with one of them reset, in the order in which to try them."""
    changes = [
        {setting.name: setting.default}
        for setting in dataclasses.fields(Parameters)
        if setting.name not in ("robot", "stations") and getattr(parameters, setting.name) != setting.default
    ]
    changes += [{"stations": number} for number in FEWER_STATIONS if number < parameters.stations]
    return changes


def _with(case: StressCase, parameters: Parameters, **changes: bool) -> StressCase:
    return dataclasses.replace(case, content=functools.partial(scene_of, parameters), **changes)


def write_scene(case: StressCase, record: Record, directory: Path, before: str = "") -> Path:
    """Write the scene of a case with what came of it, as a file that runs again."""
    directory.mkdir(parents=True, exist_ok=True)
    name = "".join(character if character.isalnum() or character in "-._" else "_" for character in case.name)
    path = directory / f"{before}{name}.yaml"
    notes = [case.name, f"{record.outcome}: {record.reason}".rstrip(": "), *record.outside]
    notes += [f"remedy: {record.remedy}"] if record.remedy else []
    head = "".join(f"# {line}\n" for note in notes for line in note.splitlines())
    head += f"# bilayer stress --scene {path.name}\n"
    write_text(path, head + yaml.safe_dump(case.content(), sort_keys=False), force=True)
    return path

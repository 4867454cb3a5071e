"""Which scenes have the same model, so that one simulator takes them in turn (`Simulator.reset`).

They may differ in what no array of a model holds: texts, duration, output, schedules of stimuli and loads, how steps
are chosen and solved, and numbers of friction that has the same axis and acts in both.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.friction import Friction
from bilayer_core.scene.part import Part

FREE = {"name", "title", "description", "duration", "output"}
"""Keys of a scene that may differ."""
CHOSEN = ("model", "dimension", "integrator")
"""Keys of `solver` that must not: they choose what is built."""


def differing(one: SceneConfig, other: SceneConfig) -> tuple[str, ...]:
    """Return the key paths of what differs between the models of two scenes, at most down to an item of a list; empty
    if they are the same.
    """
    return tuple(dict.fromkeys(_differing(one, other)))


def _differing(one: SceneConfig, other: SceneConfig) -> Iterator[str]:
    for key in SceneConfig.model_fields.keys() - FREE:
        mine, theirs = getattr(one, key), getattr(other, key)
        if mine == theirs and not (key == "stimuli" and list(mine) != list(theirs)):
            continue
        if key == "solver":
            yield from (f"solver.{choice}" for choice in CHOSEN if getattr(mine, choice) != getattr(theirs, choice))
        elif key == "stimuli":
            yield from _of_items(key, mine, theirs)
        elif key == "loads":
            yield from _of_items(key, {load.name: load for load in mine}, {load.name: load for load in theirs})
        elif key == "contact" and mine is not None and theirs is not None:
            yield from _of_parts(key, mine, theirs, {"friction"})
            if _pattern(mine.friction) != _pattern(theirs.friction):
                yield "contact.friction"
        else:
            yield key


def _of_items(key: str, mine: dict[str, Any], theirs: dict[str, Any]) -> Iterator[str]:
    """Yield key paths of parts by name that differ in more than their schedules; the order of names counts."""
    if list(mine) != list(theirs):
        yield key
        return
    for name in mine:
        yield from _of_parts(f"{key}.{name}", mine[name], theirs[name], {"schedule"})


def _of_parts(key: str, mine: Part, theirs: Part, free: set[str]) -> Iterator[str]:
    for name in type(mine).model_fields.keys() - free:
        if getattr(mine, name) != getattr(theirs, name):
            yield f"{key}.{name}"


def _pattern(law: Friction | None) -> Any:
    """Return the features of a law of friction on which the forces of a scene and its dimension depend."""
    return None if law is None else (law.axis, law.acts, law.coefficient > 0.0)

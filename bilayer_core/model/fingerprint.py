"""Which scene a state belongs to: one number for each part of a scene that its values have a meaning in.

What may differ, so that a state can be taken on under other conditions: schedules of stimuli, loads, gravity, contact
and friction, damping, drag, steps and accuracy, output, texts.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np

from bilayer_core.scene.config import SceneConfig

Array = np.ndarray
_encode = json.JSONEncoder(sort_keys=True, ensure_ascii=False).encode
DIGITS = 12
"""Hexadecimal digits of a number: 48 bits, which a float64 holds exactly."""
FIXED = {
    "model": "model",
    "history": "integrator, which keeps what the last step left",
    "materials": "materials",
    "stimuli": "channels of stimuli",
    "rods": "rods",
    "bodies": "bodies",
    "masses": "masses",
    "obstacles": "obstacles",
    "coupling": "coupling of two rods",
    "added_mass": "added mass of the fluid",
}
"""Parts of a fingerprint in order, and what each is called."""
FREE = "schedules of stimuli, loads, gravity, contact, friction, damping, drag, steps, tolerances, output and duration"
"""What may differ between the scene of a state and that which it is loaded into."""


def fingerprint_of(scene: SceneConfig, model: str, history: str) -> Array:
    """Return the fingerprint of the states of a scene, shape (n_part,).

    Parameters
    ----------
    scene : SceneConfig
    model : str
        ``"laminate"`` or ``"two_rod"``.
    history : str
        Name of the integrator if it keeps stage derivatives from step to step, else empty.
    """
    used = {layer.material for rod in scene.rods for layer in rod.layers}
    fluid = scene.fluid if scene.fluid is not None and scene.fluid.added_mass is not None else None
    whole = _content(scene)
    content: dict[str, Any] = {
        "model": model,
        "history": history,
        "materials": {name: whole["materials"][name] for name in used},
        "stimuli": [
            (name, c.unit, c.minimum, c.maximum, *(("light",) if c.light is not None else ()))
            for name, c in scene.stimuli.items()
        ],
        "rods": [_without("friction_axis", rod) for rod in whole["rods"]],
        "bodies": [
            _without("drag", body) | {"surface": _without("grain", body["surface"])} for body in whole["bodies"]
        ],
        "masses": whole["masses"],
        "obstacles": [_without("grain", obstacle) for obstacle in whole["obstacles"]],
        "coupling": whole["coupling"] if model == "two_rod" else None,
        "added_mass": fluid and (fluid.density, whole["fluid"]["added_mass"]),
    }
    return np.array([_number(content[part]) for part in FIXED], dtype=float)


def conditions_of(scene: SceneConfig) -> int:
    """Return a number for the variable conditions that forces depend on.

    It differs wherever a state's energy may differ.
    """
    others = {"name", "title", "description", "duration", "solver", "output", "start", "velocity", "angular_velocity"}
    return _number({name: part for name, part in _content(scene).items() if name not in others})


def _content(scene: SceneConfig) -> dict[str, Any]:
    """Return all of a scene, as JSON has it: made once, and never changed."""
    return scene.keep("content", (), lambda: scene.model_dump(mode="json"))


def _without(key: str, part: dict[str, Any] | None) -> dict[str, Any] | None:
    return part and {name: value for name, value in part.items() if name != key}


def _number(content: Any) -> int:
    return int(hashlib.sha256(_encode(content).encode("utf-8")).hexdigest()[:DIGITS], 16)


def difference(saved: Array, own: Array) -> str:
    """Return which parts are not the same, as text; empty if all are."""
    return ", ".join(name for name, a, b in zip(FIXED.values(), saved, own, strict=True) if a != b)

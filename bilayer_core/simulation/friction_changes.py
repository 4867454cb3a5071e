"""Coefficients of friction that are changed while a run goes on."""

from __future__ import annotations

import math

from bilayer_core.errors import InputError
from bilayer_core.model.friction_pairs import heeds
from bilayer_core.model.model import Model
from bilayer_core.model.set_friction import COEFFICIENTS, OF_SCENE, ROD_BARRIER, ROD_FRICTION, acts, friction_law
from bilayer_core.model.state import State


def change_friction(model: Model, state: State, value: float | None, key: str) -> bool:
    """Set a coefficient in a state, None for the scene's; whether that changes what acts.

    Raises
    ------
    InputError
        If nothing slides against friction in the scene, there is no such coefficient, or it cannot have that value;
        nothing is changed then.
    """
    refuse_friction(model, value, key)
    before, given = friction_law(model.scene, model.forces, state.friction), state.friction.copy()
    given[COEFFICIENTS.index(key)] = OF_SCENE if value is None else value
    state.friction[:] = given
    return friction_law(model.scene, model.forces, given) != before


def refuse_friction(model: Model, value: float | None, key: str) -> None:
    """Raise InputError if a coefficient cannot be set to a value, as `change_friction` says."""
    scene, what = model.scene, f"friction {key!r}"
    if key not in COEFFICIENTS:
        raise InputError(f"{what}: no such coefficient; there are: {', '.join(COEFFICIENTS)}")
    if not acts(model.forces):
        law = scene.friction
        why = "no contact.friction" if law is None else "no coefficient above zero" if not law.acts else "no contact"
        raise InputError(
            f"{what}: nothing slides against friction in the scene {scene.name!r}, which has {why}; allowed is a "
            "change where surfaces can meet and contact.friction has a coefficient above 0"
        )
    sliding, rods = model.sliding, ROD_FRICTION in model.forces
    if not heeds(scene, scene.friction, key, sliding.owner, sliding.surface_owner, rods):
        raise InputError(
            f"{what}: it holds between no two parts of the scene {scene.name!r}: they have friction of their own, or "
            "no such direction; allowed are coefficients of `contact.friction` that hold somewhere"
        )
    if value is None:
        return
    if isinstance(value, bool) or not (math.isfinite(value) and value >= 0.0):
        raise InputError(f"{what}: {value} is not allowed; it must be a finite number from 0 up, or None: the scene's")
    if value > 0.0 and key == COEFFICIENTS[0] and ROD_BARRIER in model.forces and ROD_FRICTION not in model.forces:
        raise InputError(
            f"{what}: the scene {scene.name!r} has 0, so that friction between its rods is not computed; allowed is a "
            "change from a value above 0"
        )


def coefficients(model: Model, state: State) -> dict[str, float]:
    """Return the coefficients that act in a state by key; empty if nothing slides with friction."""
    law = friction_law(model.scene, model.forces, state.friction) if acts(model.forces) else None
    return dict(zip(COEFFICIENTS, (law.coefficient, *law.each_way), strict=True)) if law is not None else {}

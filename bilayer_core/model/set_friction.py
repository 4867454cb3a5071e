"""Coefficients of friction that are set from outside, in place of those of the scene (`contact.friction`).

`State.friction` has one value for each of `COEFFICIENTS`, -1 where the scene's acts, as everywhere without friction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bilayer_core.scene.config import Friction, SceneConfig

Array = np.ndarray
OF_SCENE = -1.0
"""What stands for the scene's own."""
COEFFICIENTS = ("coefficient", "forward", "backward", "sideways")
"""Keys of `contact.friction` that may change while a run goes on."""
FRICTION, ROD_FRICTION, ROD_BARRIER = "friction", "rod friction", "rod barrier"
"""Forces of the list."""


def acts(forces: tuple[str, ...]) -> bool:
    """Return whether friction is among the forces of a model."""
    return FRICTION in forces or ROD_FRICTION in forces


def none_given() -> Array:
    """Return the coefficients of a state in which none is set from outside, shape (4,)."""
    return np.full(len(COEFFICIENTS), OF_SCENE)


def friction_law(scene: SceneConfig, forces: tuple[str, ...], given: Array) -> Friction | None:
    """Return the friction law of a scene with the coefficients set from outside, if friction is among its forces.

    Keys that the scene leaves out go with `coefficient`.
    """
    law = scene.contact.friction if scene.contact is not None else None
    if not acts(forces):
        return law
    from_outside = {key: value for key, value in zip(COEFFICIENTS, given.tolist(), strict=True) if value != OF_SCENE}
    return law.model_copy(update=from_outside) if law is not None and from_outside else law


def friction_values(law: Friction | None, of_bodies: Array, *grains: Array) -> dict[str, Any]:
    """Return the values of `Sliding` that a law sets, the scene's or one that differs from it in coefficients.

    Parameters
    ----------
    law : Friction or None
    of_bodies : ndarray
        Whether contact points are bodies', shape (n_contact_point,).
    *grains : ndarray
        Of surfaces and of contact points, as in `Sliding`.
    """
    axis = np.zeros(3) if law is None or law.axis is None else np.array(law.axis)
    return dict(
        acts=law is not None and law.acts,
        threshold=law.speed_threshold if law is not None else 0.0,
        coefficient=contact_point_friction(law, of_bodies),
        grained=any(bool(directions.any()) for directions in (axis, *grains)),
        along_grain=np.array(law.of_rods if law is not None else (0.0, 0.0, 0.0)),
        across_all=law.coefficient if law is not None else 0.0,
        world_axis=axis,
    )


def contact_point_friction(law: Friction | None, of_bodies: Array) -> Array:
    """Return the coefficients forward, backward and sideways of contact points, of which some are of bodies, shape (n,
    3).
    """
    coefficients = np.full((len(of_bodies), len(COEFFICIENTS) - 1), law.of_rods if law is not None else 0.0)
    coefficients[of_bodies] = law.coefficient if law is not None else 0.0
    return coefficients

"""Coefficients of friction that are set from outside, in place of those of the scene (`contact.friction`).

`State.friction` has one value for each of `COEFFICIENTS`, -1 where the scene's acts, as everywhere without friction.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.friction import Friction

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
    law = scene.friction
    if not acts(forces):
        return law
    from_outside = {key: value for key, value in zip(COEFFICIENTS, given.tolist(), strict=True) if value != OF_SCENE}
    return law.model_copy(update=from_outside) if law is not None and from_outside else law

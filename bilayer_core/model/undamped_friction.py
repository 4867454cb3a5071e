"""Vibrations that steps may leave out where friction acts on a material that damps nothing.

Friction excites vibrations: a foot that rocks on its sole changes its normal force, which changes the friction that
rocks it. Where the material has no `retardation_time`, nothing but the integrator takes their energy, and that only
where steps are too long to resolve them. A run computes the scene as it is, without a damping that nobody asked for:
so its figures have no limit in the step, and the user is told.
"""

from __future__ import annotations

from bilayer_core.model.friction_pairs import slides
from bilayer_core.scene.config import SceneConfig


def unseen_vibrations(scene: SceneConfig) -> tuple[str, ...]:
    """Return what all runs in steps of about the same length may miss, each with a remedy; none where nothing rubs."""
    used = dict.fromkeys(layer.material for rod in scene.rods for layer in rod.layers)
    undamped = [name for name in used if scene.materials[name].retardation_time == 0.0]
    if not slides(scene, scene.friction) or not undamped:
        return ()
    keys = ", ".join(f"materials.{name}.retardation_time" for name in undamped)
    return (
        "vibrations that friction excites, which no material damps: steps that resolve them may change strides by 10 % "
        f"or more. {keys} damps them; `bilayer run --error-estimate --quarter-step` tells by how much steps matter",
    )

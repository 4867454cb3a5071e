"""Coefficients of friction between two that touch, from those of the scene and those that each has of its own."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.friction import Coefficients, Friction

Array = np.ndarray


def friction_values(
    scene: SceneConfig, law: Friction | None, surface_owner: Array, surface_grain: Array, point_grain: Array
) -> dict[str, Any]:
    """Return the values of `Sliding` that a law sets, the scene's or one that differs from it in coefficients.

    Parameters
    ----------
    scene : SceneConfig
    law : Friction or None
    surface_owner, surface_grain, point_grain : ndarray
        Of surfaces and of contact points, as in `Sliding`.
    """
    axis = np.zeros(3) if law is None or law.axis is None else np.array(law.axis)
    coefficient, along_grain, across_grain = _of_pairs(scene, law, surface_owner.tolist())
    return dict(
        acts=slides(scene, law),
        threshold=law.speed_threshold if law is not None else 0.0,
        coefficient=coefficient,
        grained=any(bool(directions.any()) for directions in (axis, surface_grain, point_grain)),
        along_grain=along_grain,
        across_grain=across_grain,
        world_axis=axis,
    )


def slides(scene: SceneConfig, law: Friction | None) -> bool:
    """Return whether anything slides against friction by a law, or by coefficients of its own."""
    return law is not None and (law.acts or any(own is not None and own.acts for own in _own(scene)))


def friction_of_rods(scene: SceneConfig, law: Friction | None) -> Array:
    """Return the coefficients of rods that slide on each other, by their order in the scene, shape (n_rod, n_rod)."""
    own = [rod.friction.coefficient if rod.friction is not None else None for rod in scene.rods]
    if law is None:
        return np.zeros((len(own), len(own)))
    return np.array([[_between(law, one, other, law.coefficient) for other in own] for one in own])


def heeds(scene: SceneConfig, law: Friction, key: str, owner: Array, surface_owner: Array, rods: bool) -> bool:
    """Return whether a coefficient of `contact.friction` holds between any of what may touch: owners of contact points
    on those of surfaces, as in `Sliding`, and rods.
    """
    one, other = (law.model_copy(update={key: value}) for value in (1.0, 2.0))
    there, surfaces = np.unique(owner), surface_owner.tolist()
    tables = zip(_of_pairs(scene, one, surfaces), _of_pairs(scene, other, surfaces), strict=True)
    if any((first[there] != second[there]).any() for first, second in tables):
        return True
    return rods and bool((friction_of_rods(scene, one) != friction_of_rods(scene, other)).any())


def _own(scene: SceneConfig) -> list[Coefficients | None]:
    """Return coefficients of their own of rods, bodies and obstacles, in this order."""
    return [part.friction for parts in (scene.rods, scene.bodies, scene.obstacles) for part in parts]


def _of_pairs(scene: SceneConfig, law: Friction | None, surfaces: list[int]) -> tuple[Array, Array, Array]:
    """Return what things have on surfaces, given by their numbers in `_own`: forward, backward and sideways of the
    rod's axis, likewise of a grain, and without a direction; shapes (n_own, n_surface, 3) twice, (n_own, n_surface).
    """
    own, count = _own(scene), len(surfaces)
    coefficient, along, across = (
        np.zeros((len(own), count, 3)),
        np.zeros((len(own), count, 3)),
        np.zeros((len(own), count)),
    )
    if law is None:
        return coefficient, along, across
    undirected = [part.coefficient if part is not None else None for part in own]
    of_scene = law.each_way if law.directed else (None, None, None)
    directed = [part.each_way if part is not None else of_scene for part in own]
    grains = [obstacle.grain for obstacle in scene.obstacles]
    grained = {len(own) - len(grains) + k for k, grain in enumerate(grains) if grain is not None}
    grained |= {len(scene.rods) + k for k, body in enumerate(scene.bodies) if body.surface and body.surface.grain}
    for i in range(len(own)):
        for k, j in enumerate(surfaces):
            axis, other = (directed[j], undirected[i]) if j in grained else (directed[i], undirected[j])
            across[i, k] = _between(law, undirected[i], undirected[j], law.coefficient)
            along[i, k] = [_between(law, one, other, law.coefficient) for one in axis]
            mine = directed[i] if i < len(scene.rods) else 3 * (undirected[i],)
            coefficient[i, k] = [_between(law, one, undirected[j], law.coefficient) for one in mine]
    return coefficient, along, across


RULES: dict[str, Callable[[float, float], float]] = {
    "minimum": min,
    "geometric": lambda one, other: math.sqrt(one * other),
    "mean": lambda one, other: 0.5 * (one + other),
    "maximum": max,
}
"""Of `contact.friction.combine`."""


def _between(law: Friction, one: float | None, other: float | None, neither: float) -> float:
    """Return the coefficient between two of which each has its own or none."""
    if one is not None and other is not None:
        return RULES[law.combine](one, other)
    return one if one is not None else other if other is not None else neither

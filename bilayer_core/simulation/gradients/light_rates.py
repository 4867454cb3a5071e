"""Derivatives of what elements of layers see of light: at the start of a step, and a time later as it went before."""

from __future__ import annotations

import numpy as np

from bilayer_core.engine.light_differences import LightSlopes, differentiate_light
from bilayer_core.model.lit_elements import shine
from bilayer_core.model.records.step import Configuration
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain

Array = np.ndarray
CHANGE = 1e-4
"""Of an edge, and of an angle, for differences."""


def looked_at(again: StepAgain, at: Configuration) -> Array:
    """Return how elements face their lights, then what part of these nothing hides, shape (2 n_lit,)."""
    light, bodies = again.problem.light, len(again.problem.light.body_position) - 1
    light.node_position[:], light.director1[:] = at.position, at.director1[: len(light.director1)]
    light.body_position[:-1], light.body_rotation[:-1] = at.pose_position[:bodies], at.rotation[:bodies]
    shine(light, 1)
    return np.concatenate([light.facing[:, 1], light.visible[:, 1]])


def slopes_of_light(again: StepAgain, at: Configuration) -> Array:
    """Return how all that depends on unknowns, shape (2 n_lit, size)."""
    problem, elements = again.problem, len(again.problem.light.law)
    found = LightSlopes(by_place=np.zeros((2 * elements, again.size)), rotation=np.zeros((1, 3, 3)))
    looked_at(again, at)
    differentiate_light(problem, at, found, CHANGE * float(problem.strands.rest_length.min()), CHANGE)
    return found.by_place


def light_rates(again: StepAgain, step: KeptStep) -> Array:
    """Return the rates of all that which a step leaves, shape (2 n_lit,)."""
    light = again.problem.light
    if not light.exists:
        return np.zeros(0)
    before = np.concatenate([light.facing[:, 0], light.visible[:, 0]])
    return (looked_at(again, again.last) - before) / step.length


def slopes_of_parts(again: StepAgain, n: int, step: KeptStep) -> Array:
    """Return how the part that each element sees at the start of a step, and at its point n, depends on how it faces
    the light, on what nothing hides, and on the rates of both, shape (2, 4, n_lit).
    """
    light, rate, elapsed = again.problem.light, step.start.light_rate.T, float(again.inputs.elapsed[n])
    found = np.zeros((2, 4, len(light.law)))
    for k, time in enumerate((0.0, elapsed)):
        facing, visible = light.facing[:, 0] + time * rate[0], light.visible[:, 0] + time * rate[1]
        sign = np.where(light.side == 0.0, np.sign(facing), light.side * (light.side * facing > 0.0))
        inside = (visible >= 0.0) & (visible <= 1.0)
        found[k, 0], found[k, 1] = np.clip(visible, 0.0, 1.0) * sign, inside * sign * facing
        found[k, 2:] = time * found[k, :2]
    return found

"""Derivatives of what resists the motions of joints and guides: each is a strain with a viscosity of its own.

See `forces.mechanisms` for q and for its derivatives by free bodies.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.contact.friction_law import friction_slope
from bilayer_core.model.records.step import Configuration
from bilayer_core.simulation.gradients.entries import Entries
from bilayer_core.simulation.gradients.step_again import StepAgain

Array = np.ndarray


def slopes_of_motions(again: StepAgain, at: Configuration) -> Entries:
    """Return ∂q/∂(X, φ) of all mechanisms in their rows among strains, shape (n_strain, size)."""
    mechanisms, parts = again.problem.mechanisms, []
    for k, slides in enumerate(mechanisms.slides):
        a, b = mechanisms.body[2 * k], mechanisms.body[2 * k + 1]
        axis = at.rotation[a] @ mechanisms.axis[k]
        if slides:
            arm = at.rotation[b] @ mechanisms.arm[2 * k + 1]
            apart = at.pose_position[b] + arm - at.pose_position[a]
            found = [-axis, np.cross(axis, apart)], [axis, np.cross(arm, axis)]
        else:
            mark, other = at.rotation[a] @ mechanisms.mark[2 * k], at.rotation[b] @ mechanisms.mark[2 * k + 1]
            side = np.cross(axis, mark)
            x, y = other @ mark, other @ side
            turn = (x * np.cross(side, other) - y * np.cross(mark, other)) / (x * x + y * y)
            found = [0.0 * turn, turn], [0.0 * turn, -turn]
        for free, own in zip(mechanisms.free[2 * k : 2 * k + 2], found, strict=True):
            if free >= 0:
                parts.append((np.full(6, mechanisms.first + k), again.of_bodies[free], np.concatenate(own)))
    shape = (again.stage.origin_strain.size, again.size)
    row, column, value = (np.concatenate(of) for of in zip(*parts, strict=True))
    return Entries(row, column, value, shape)


def resistances(again: StepAgain) -> Array:
    """Return how the force of each mechanism grows with its rate where a stage ended, in rows of strains."""
    mechanisms, stage = again.problem.mechanisms, again.stage
    found = np.zeros(stage.origin_strain.size)
    for k, value in enumerate(mechanisms.value):
        row = mechanisms.first + k
        speed = abs(value - stage.origin_strain[row]) / stage.length
        slope = friction_slope.py_func(speed, mechanisms.threshold[k])
        found[row] = mechanisms.damping[k] + mechanisms.friction[k] * slope
    return found

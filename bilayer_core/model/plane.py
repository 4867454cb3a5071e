"""The plane in which a model of dimension 2 moves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.model.unknown_order import ReadOnlyArrays

Array = np.ndarray
COORDINATES = "xyz"


@dataclass(frozen=True)
class Plane(ReadOnlyArrays):
    """A plane in the world.

    Attributes
    ----------
    point : Array
        One of its points [m], shape (3,).
    axes : Array
        p and q, two orthonormal directions in it, shape (2, 3); axes of the world where it is parallel to two of them.
    """

    point: Array
    axes: Array

    @cached_property
    def normal(self) -> Array:
        """p × q, shape (3,)."""
        return cross(self.axes[:1], self.axes[1:])[0]

    @property
    def motions(self) -> Array:
        """Motions (X, φ) of a body that stay in it, one a column, orthonormal, shape (6, 3)."""
        motions = np.zeros((6, 3))
        motions[:3, :2], motions[3:, 2] = self.axes.T, self.normal
        return motions

    def __str__(self) -> str:
        axis = np.flatnonzero(np.abs(self.normal) == 1.0)
        if len(axis):
            offset = self.point[axis[0]]
            return f"the plane {COORDINATES[axis[0]]} = {offset:.6g}{' m' if offset else ''}"
        normal, point = (
            ", ".join(f"{value:.6g}" for value in np.round(vector, 9) + 0.0) for vector in (self.normal, self.point)
        )
        return f"the plane with normal ({normal}) through ({point}) m"

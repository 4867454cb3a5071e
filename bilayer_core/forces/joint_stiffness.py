"""Functions common to joints and mechanisms: second derivatives of two bodies, and default stiffnesses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bilayer_core.jit import kernel
from bilayer_core.model.model import Model

STIFFER = 100.0
"""Than the stiffest edge and the stiffest bend of a rod."""


@kernel
def scatter_pair(first, second, block, out):
    """Add a block by (X_A, φ_A, X_B, φ_B) to the second derivatives of free bodies."""
    for m in range(12):
        f = first if m < 6 else second
        if f < 0:
            continue
        row = 6 * f + m % 6
        for n in range(12):
            other = first if n < 6 else second
            if other >= 0:
                out[row, 6 * other + n % 6] += block[m, n]


def across(axis: Sequence[float]) -> np.ndarray:
    """Return a unit vector perpendicular to an axis, shape (3,)."""
    found = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    return found / np.linalg.norm(found)


def stiffness_of_joints(model: Model) -> tuple[float, float]:
    """Return the default stiffness of joints: force by distance [N/m], and moment by angle [N m]."""
    edge = float((model.rods.axial_stiffness / model.rods.rest_length).max())
    return STIFFER * edge, STIFFER * float(model.rods.joint_stiffness.max())

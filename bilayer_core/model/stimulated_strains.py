"""Stress-free strains of a robot, as stimuli set them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class RestStrains:
    """Strains without stress, as stimuli set them.

    Attributes
    ----------
    edge : Array
        η of each edge, shape (n_edge,).
    joint : Array
        κ̄₁ κ̄₂ ψ̄ of each joint [rad], shape (n_joint, 3), read-only; of joints of `Model.off_axis` κ̄₁ is that
        at ε = 0.
    """

    edge: Array
    joint: Array

    def halfway_to(self, other: RestStrains) -> RestStrains:
        """Return the mean of both."""
        joint = self.joint
        if other.joint is not joint:
            joint = 0.5 * (joint + other.joint)
            joint.flags.writeable = False
        return RestStrains(0.5 * (self.edge + other.edge), joint)

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
        κ̄₁ κ̄₂ ψ̄ of each joint [rad], shape (n_joint, 3); of joints of `Model.off_axis` κ̄₁ is that at ε = 0.
    law : Array
        η of each law, shape (n_law,).
    """

    edge: Array
    joint: Array
    law: Array

    def halfway_to(self, other: RestStrains) -> RestStrains:
        """Return the mean of both."""
        pairs = (self.edge, other.edge), (self.joint, other.joint), (self.law, other.law)
        return RestStrains(*(0.5 * (own + others) for own, others in pairs))

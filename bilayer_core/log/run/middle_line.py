"""Values in the middle line of a rod, midway between its faces, from those at its nodes.

A laminate has nodes on one curve, from which the middles of the section and of its layers have an offset along m1.
A rod of two strands has nodes in the middle of either layer, with the thicknesses h₁ and h₂. The middle of both is h₂/2
from that of the first, and the two are (h₁ + h₂)/2 apart. So what is linear through the thickness is there the mean
with the weights h₁ and h₂. Where a layer is alone, it is the value of that layer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bilayer_core.observed.frame import Strand

Array = np.ndarray


class LayerMiddle:
    """The middle of a layer, or of a section, off the nodes of its strand."""

    def __init__(self, part: Strand) -> None:
        self._part = part

    def positions(self, poses: Array) -> Array:
        """Return its positions [m], shape (..., nodes, 3), from poses x y z and quaternion, shape (..., nodes, 7)."""
        x, y, z, w = (poses[..., k] for k in range(3, 7))
        found, twice = poses[..., :3].astype(float), 2.0 * self._part.offset
        found[..., 0] += self._part.offset - twice * (y * y + z * z)
        found[..., 1] += twice * (x * y + z * w)
        found[..., 2] += twice * (x * z - y * w)
        return found

    def strain(self, values: Array) -> Array:
        """Return its strain, shape (..., nodes), from strain and curvature of the nodes, shape (..., nodes, 2)."""
        return self._part.strain_of(values[..., 0], values[..., 1])


class RodMiddle:
    """The middle of a rod of two strands, at each of its stations."""

    def __init__(self, strands: Sequence[Strand]) -> None:
        firsts = [strand.first_station or 0 for strand in strands]
        sizes = [len(strand.thickness) for strand in strands]
        count = max(first + size for first, size in zip(firsts, sizes, strict=True)) - min(firsts)
        self._own = [slice(f - min(firsts), f - min(firsts) + size) for f, size in zip(firsts, sizes, strict=True)]
        self._splits = np.cumsum(sizes)[:-1]
        thickness = np.zeros((len(strands), count))
        for row, own, strand in zip(thickness, self._own, strands, strict=True):
            row[own] = strand.thickness
        self._weights = thickness / thickness.sum(axis=0)

    def mean(self, values: Array) -> Array:
        """Return the weighted mean of values at the nodes of both, strand by strand.

        Parameters
        ----------
        values : ndarray
            Shape (rows, nodes) or (rows, nodes, n).

        Returns
        -------
        ndarray
            Shape (rows, stations) or (rows, stations, n).
        """
        return self._summed(values, self._weights)

    def total(self, values: Array) -> Array:
        """Return the sum of values of both, with shapes as of `mean`."""
        return self._summed(values, np.ones_like(self._weights))

    def frame(self, values: Array) -> Array:
        """Return the mean of unit quaternions of both, a unit quaternion; shapes as of `mean`."""
        first, second = self._spread(values)
        sign = np.where((first * second).sum(axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
        both = self._weights[0, :, None] * first + self._weights[1, :, None] * sign * second
        return both / np.linalg.norm(both, axis=-1, keepdims=True)

    def _spread(self, values: Array) -> list[Array]:
        """Return the values of each strand at the stations of the rod, 0 where it is not."""
        found = []
        for part, own in zip(np.split(values, self._splits, axis=1), self._own, strict=True):
            whole = np.zeros((len(values), self._weights.shape[1], *values.shape[2:]))
            whole[:, own] = part
            found.append(whole)
        return found

    def _summed(self, values: Array, weights: Array) -> Array:
        shape = (-1, *[1] * (values.ndim - 2))
        return sum(own.reshape(shape) * part for own, part in zip(weights, self._spread(values), strict=True))

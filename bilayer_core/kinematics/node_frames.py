"""Material frames at nodes, from the directors of edges."""

from __future__ import annotations

import numpy as np

from bilayer_core.jit import entry, kernel
from bilayer_core.kinematics.rotating import quaternion_of
from bilayer_core.kinematics.vector import combine, cross, dot, row, scaled


@entry
def frames_at_nodes(
    positions, directors, edge_before, edge_after, start_node, quaternions_out, normals_out, widths_out
):
    """Frame of each node: m3 the mean tangent of its edges, m1 their mean director made normal to it, m2 = m3 × m1.

    The quaternion x y z w is that of the matrix with columns m1, m2, m3, by the largest of its components.
    """
    for node in range(positions.shape[0]):
        before, after = edge_before[node], edge_after[node]
        m3 = _unit(combine(1.0, _tangent(positions, start_node[before]), 1.0, _tangent(positions, start_node[after])))
        m1 = combine(1.0, row(directors, before), 1.0, row(directors, after))
        m1 = _unit(combine(1.0, m1, -dot(m1, m3), m3))
        m2 = cross(m3, m1)
        (
            quaternions_out[node, 0],
            quaternions_out[node, 1],
            quaternions_out[node, 2],
            quaternions_out[node, 3],
        ) = quaternion_of(m1[0], m2[0], m3[0], m1[1], m2[1], m3[1], m1[2], m2[2], m3[2])
        normals_out[node, 0], normals_out[node, 1], normals_out[node, 2] = m1
        widths_out[node, 0], widths_out[node, 1], widths_out[node, 2] = m2


@kernel
def _unit(a):
    """a/|a|"""
    return scaled(1.0 / np.sqrt(dot(a, a)), a)


@kernel
def _tangent(positions, start):
    """Return the unit tangent of the edge from node `start` to the next."""
    return _unit(combine(1.0, row(positions, start + 1), -1.0, row(positions, start)))

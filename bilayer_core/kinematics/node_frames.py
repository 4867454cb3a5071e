"""Material frames at nodes, from the directors of edges."""

from __future__ import annotations

import numpy as np

from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Indices, Matrix
from bilayer_core.kinematics.rotating import quaternion_of
from bilayer_core.kinematics.vector import combine, cross, dot, row, scaled


@record
class NodeFrameArrays:
    """Nodes of strands, and their frames."""

    position: Matrix  # [m], shape (nodes, 3)
    director: Matrix  # m1 of each edge, shape (edges, 3)
    edge_before: Indices  # of each node, shape (nodes,)
    edge_after: Indices
    start_node: Indices  # of each edge, shape (edges,)
    quaternion: Matrix  # x y z w of the frame, shape (nodes, 4)
    normal: Matrix  # its axis m1, shape (nodes, 3)
    width: Matrix  # its axis m2, shape (nodes, 3)


@piece(int, NodeFrameArrays)
def frames_at_nodes(of):
    """Write the frame of each node.

    m3 is the mean tangent of its edges, m1 their mean director made normal to it, m2 = m3 × m1. The quaternion x y z w
    is that of the matrix with columns m1, m2, m3, by the largest of its components.
    """
    positions, directors, quaternions, start_node = of.position, of.director, of.quaternion, of.start_node
    for node in range(positions.shape[0]):
        before, after = of.edge_before[node], of.edge_after[node]
        m3 = _unit(combine(1.0, _tangent(positions, start_node[before]), 1.0, _tangent(positions, start_node[after])))
        m1 = combine(1.0, row(directors, before), 1.0, row(directors, after))
        m1 = _unit(combine(1.0, m1, -dot(m1, m3), m3))
        m2 = cross(m3, m1)
        (
            quaternions[node, 0],
            quaternions[node, 1],
            quaternions[node, 2],
            quaternions[node, 3],
        ) = quaternion_of(m1[0], m2[0], m3[0], m1[1], m2[1], m3[1], m1[2], m2[2], m3[2])
        of.normal[node, 0], of.normal[node, 1], of.normal[node, 2] = m1
        of.width[node, 0], of.width[node, 1], of.width[node, 2] = m2
    return 0


@kernel
def _unit(a):
    """Return a/|a|"""
    return scaled(1.0 / np.sqrt(dot(a, a)), a)


@kernel
def _tangent(positions, start):
    """Return the unit tangent of the edge from node `start` to the next."""
    return _unit(combine(1.0, row(positions, start + 1), -1.0, row(positions, start)))

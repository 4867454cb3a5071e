"""Elastic energies of a discrete rod, written as in the paper, with a reference frame and angles."""

import numpy as np


def parallel_transport(vector, start, end):
    """Turn `vector` by the smallest rotation from unit `start` to unit `end` (Rodrigues' formula)."""
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis), start @ end
    if sine < 1e-300:
        return vector
    axis = axis / sine
    return vector * cosine + np.cross(axis, vector) * sine + axis * (axis @ vector) * (1.0 - cosine)


def curvatures(edge_a, edge_b, frame_a, frame_b):
    """Integrated curvatures χΔl and ξΔl by the curvature binormal (paper, eqs. 10 and 11); frames are (m1, m2)."""
    binormal = 2.0 * np.cross(edge_a, edge_b)
    binormal /= np.linalg.norm(edge_a) * np.linalg.norm(edge_b) + edge_a @ edge_b
    chi = 0.5 * (frame_a[1] + frame_b[1]) @ binormal
    xi = -0.5 * (frame_a[0] + frame_b[0]) @ binormal
    return chi, xi


def twist(edge_a, edge_b, m1_a, m1_b):
    """Angle about b from the transported m1_a to m1_b."""
    tangent_a, tangent_b = edge_a / np.linalg.norm(edge_a), edge_b / np.linalg.norm(edge_b)
    carried = parallel_transport(m1_a, tangent_a, tangent_b)
    return np.arctan2(np.cross(carried, m1_b) @ tangent_b, carried @ m1_b)


def moved_frame(edge, m1, increment, angle):
    """Frame (m1, m2) of an edge after its vector changed by `increment` and its frame turned by `angle`."""
    old = edge / np.linalg.norm(edge)
    new = edge + increment
    tangent = new / np.linalg.norm(new)
    carried = parallel_transport(m1, old, tangent)
    m1 = np.cos(angle) * carried + np.sin(angle) * np.cross(tangent, carried)
    return m1, np.cross(tangent, m1)

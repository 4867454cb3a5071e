"""Rotations of rigid bodies: rotation vectors, matrices, quaternions (x y z w)."""

from __future__ import annotations

import math

import numpy as np


def skew(vector: np.ndarray) -> np.ndarray:
    """Return the matrix [v]× with [v]× u = v × u, shape (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(vector: np.ndarray) -> np.ndarray:
    """Return exp([v]×) of a rotation vector [rad] by Rodrigues' formula, shape (3, 3)."""
    angle2 = float(vector @ vector)
    matrix = skew(vector)
    if angle2 < 1e-8:  # series to the rounding limit: the next terms are below 1e-17
        a, b = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        angle = np.sqrt(angle2)
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle2
    return np.eye(3) + a * matrix + b * (matrix @ matrix)


def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation vector [rad] of a rotation matrix by less than half a turn, the inverse of `rotation_matrix`,
    shape (3,).
    """
    axis = 0.5 * np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    sine, cosine = np.sqrt(axis @ axis), 0.5 * (np.trace(matrix) - 1.0)
    if sine < 1e-8:
        return axis
    return np.arctan2(sine, cosine) / sine * axis


def matrix_from_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a unit quaternion x y z w, shape (3, 3)."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(m00, m01, m02, m10, m11, m12, m20, m21, m22):
    """Return the unit quaternion x y z w of a rotation matrix by its largest component (Shepperd 1978), as a tuple."""
    trace = m00 + m11 + m22
    if trace >= max(m00, m11, m22):
        x, y, z, w = m21 - m12, m02 - m20, m10 - m01, 1.0 + trace
    elif m00 >= max(m11, m22):
        x, y, z, w = 1.0 + m00 - m11 - m22, m10 + m01, m20 + m02, m21 - m12
    elif m11 >= m22:
        x, y, z, w = m10 + m01, 1.0 + m11 - m22 - m00, m21 + m12, m02 - m20
    else:
        x, y, z, w = m20 + m02, m21 + m12, 1.0 + m22 - m00 - m11, m10 - m01
    scale = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    return scale * x, scale * y, scale * z, scale * w


def quaternion_from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return the unit quaternion x y z w (w ≥ 0) of a rotation matrix, shape (4,)."""
    quaternion = np.array(quaternion_of(*(entry for row in matrix.tolist() for entry in row)))
    return quaternion if quaternion[3] >= 0.0 else -quaternion


def quaternion_product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the quaternion x y z w of the rotation by `second` followed by that by `first`, shape (..., 4)."""
    x, y, z, w = np.moveaxis(np.asarray(first, dtype=float), -1, 0)
    a, b, c, d = np.moveaxis(np.asarray(second, dtype=float), -1, 0)
    return np.stack(
        [
            w * a + x * d + y * c - z * b,
            w * b - x * c + y * d + z * a,
            w * c + x * b - y * a + z * d,
            w * d - x * a - y * b - z * c,
        ],
        axis=-1,
    )

"""Each fast kernel against a slow and obvious version."""

import math

import numpy as np
import pytest
from oracles import discrete_rod
from support.evaluations import undriven
from support.sample_scenes import layer, rod, scene

from bilayer_core.contact.barrier import barrier, barrier_gradient, barrier_hessian
from bilayer_core.contact.friction_law import friction_over_speed, friction_potential, friction_slope
from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.engine.linear.band import backward_band, factor_band, forward_band, width
from bilayer_core.engine.linear.border import column_times, eliminate_border, subtract_column
from bilayer_core.kinematics.frames import transport_directors
from bilayer_core.kinematics.rotation import matrix_from_quaternion, quaternion_from_matrix, rotation_matrix
from bilayer_core.kinematics.vector import angle
from bilayer_core.model.build_model import build_model
from bilayer_core.model.sizes import ROWS_OF_BLOCK
from bilayer_core.model.state import initial_state
from bilayer_core.scene.loader import load_scene


def random_frames(rng, count):
    edges = np.array([1.0, 0, 0]) + 0.4 * rng.standard_normal((count, 3))
    tangents = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    m1 = np.cross(tangents, rng.standard_normal((count, 3)))
    m1 /= np.linalg.norm(m1, axis=1, keepdims=True)
    return edges, tangents, m1, np.cross(tangents, m1)


def bent_rod(rng, joints):
    """An evaluator of a rod with random directions, turns and natural strains, and its configuration."""
    model = build_model(load_scene(scene([rod([layer()], stations=joints + 2)])))
    evaluator, (rest, load_factor), state = Evaluator(model), undriven(model), initial_state(model)
    straight, bent = evaluator.new(), evaluator.new()
    evaluator.take_state(state, straight)
    bent.position[1:] = bent.position[0] + np.cumsum(random_frames(rng, model.rods.edge_count)[0], axis=0)
    evaluator.transport_frames(straight, rng.standard_normal(model.rods.edge_count), bent)
    rest_joint = rng.standard_normal(rest.joint.shape)
    evaluator.stand_still(state, straight, 1.0, rest.edge, rest_joint, load_factor)
    return evaluator, bent, rest_joint


def test_bending_and_twist_strains_are_those_of_the_curvature_binormal():
    evaluator, at, rest = bent_rod(np.random.default_rng(0), 20)
    energies = evaluator.forces(at, ("bending", "twisting"))
    edges, m1, m2 = np.diff(at.position, axis=0), at.director1, at.director2
    expected = np.array(
        [
            (
                *discrete_rod.curvatures(edges[i], edges[i + 1], (m1[i], m2[i]), (m1[i + 1], m2[i + 1])),
                discrete_rod.twist(edges[i], edges[i + 1], m1[i], m1[i + 1]),
            )
            for i in range(20)
        ]
    )
    assert at.joint_strain == pytest.approx(expected, abs=1e-13)
    parts = 0.5 * evaluator.model.rods.joint_stiffness * np.square(expected - rest)
    assert energies["bending"] == pytest.approx(parts[:, :2].sum())
    assert energies["twisting"] == pytest.approx(parts[:, 2].sum())


def test_twist_is_unwrapped_from_its_value_before():
    evaluator, at, _ = bent_rod(np.random.default_rng(1), 1)
    found = []
    for before in (0.0, 4 * math.pi, -6 * math.pi):
        evaluator.stage.twist[:] = before
        evaluator.forces(at, ("twisting",))
        found.append(at.joint_strain[0, 2])
    assert found[1] - found[0] == pytest.approx(4 * math.pi)
    assert found[2] - found[0] == pytest.approx(-6 * math.pi)


def test_directors_follow_parallel_transport_and_turn():
    rng = np.random.default_rng(2)
    edges, tangents, m1, m2 = random_frames(rng, 10)
    increments, angles = 0.3 * rng.standard_normal((10, 3)), rng.standard_normal(10)
    moved = edges + increments
    new = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    out1, out2 = np.empty((10, 3)), np.empty((10, 3))
    transport_directors(10, tangents, m1, m2, angles, new, out1, out2)
    for k in range(10):
        expected = discrete_rod.moved_frame(edges[k], m1[k], increments[k], angles[k])
        assert out1[k] == pytest.approx(expected[0], abs=1e-14)
        assert out2[k] == pytest.approx(expected[1], abs=1e-14)


@pytest.mark.parametrize("half_bandwidth", [10, 18])
def test_band_solver_agrees_with_a_dense_one(half_bandwidth):
    rng = np.random.default_rng(3)
    n, b = 70, half_bandwidth
    dense = np.zeros((n, n))
    for j in range(n):
        for r in range(min(b, n - 1 - j) + 1):
            dense[j + r, j] = dense[j, j + r] = rng.standard_normal()
    dense += (1.0 - np.linalg.eigvalsh(dense)[0]) * np.eye(n)
    band = np.zeros((n + b, b + 1))
    for j in range(n):
        for r in range(min(b, n - 1 - j) + 1):
            band[j, r] = dense[j + r, j]
    indefinite = band.copy()
    indefinite[41, 0] = -5.0
    assert factor_band(band, n, b, False) == -1
    right = np.zeros((n + b, 6))
    right[:n] = rng.standard_normal((n, 6))
    expected = np.linalg.solve(dense, right[:n])
    one = right[:, 2].copy()
    forward_band(band, n, width(b), one)
    backward_band(band, n, width(b), one)
    assert one[:n] == pytest.approx(expected[:, 2], rel=1e-10, abs=1e-12)
    right[:25] = 0.0  # where columns of a border begin
    expected = np.linalg.solve(dense, right[:n])
    columns, scaled, corner = right.T.copy(), np.ones((6, n + b)), np.eye(6)
    filled = blocks_with_values(columns)
    eliminate_border(band, n, b, 6, columns, scaled, corner, np.zeros(6, dtype=np.int64), filled)
    assert corner == pytest.approx(np.eye(6) - right[:n].T @ expected, rel=1e-10, abs=1e-12)
    assert scaled[:, :n] == pytest.approx(columns[:, :n] / band[:n, 0], rel=1e-10, abs=1e-12)
    backward_band(band, n, width(b), columns[2])
    assert columns[2, :n] == pytest.approx(expected[:, 2], rel=1e-10, abs=1e-12)
    assert factor_band(indefinite, n, b, False) == 41


def blocks_with_values(columns):
    """Return in which blocks of rows columns have values, shape (column, block)."""
    return np.add.reduceat(columns != 0.0, np.arange(0, columns.shape[1], ROWS_OF_BLOCK), axis=1) > 0


@pytest.mark.parametrize("gap", [0, 1, 7, 8, 9, 30, 56, 70])
def test_a_border_whose_columns_have_gaps_is_eliminated_like_a_dense_one(gap):
    rng = np.random.default_rng(5)
    b, strand = 4, 6
    n, m = 3 * strand + 2 * gap, 7  # strands, and between them unknowns that nothing couples
    blocks = [range(first, first + strand) for first in (0, strand + gap, 2 * (strand + gap))]
    dense = 3.0 * np.eye(n)
    for block in blocks:
        dense[np.ix_(block, block)] += np.diag(rng.standard_normal(strand - 1), 1)
    dense = 0.5 * (dense + dense.T)
    band = np.zeros((n + b, b + 1))
    for j in range(n):
        for r in range(min(b, n - 1 - j) + 1):
            band[j, r] = dense[j + r, j]
    columns = np.zeros((m, n + b))
    for a in range(m - 1):  # the last is zero
        for block in (blocks[a % 3], blocks[a // 2]):
            columns[a, block[a % strand]] = rng.standard_normal()
    right, corner = columns[:, :n].copy(), np.eye(m)
    assert factor_band(band, n, b, False) == -1
    scaled, filled = np.ones((m, n + b)), blocks_with_values(columns)
    eliminate_border(band, n, b, m, columns, scaled, corner, np.zeros(m, dtype=np.int64), filled)
    expected = np.eye(m) - right @ np.linalg.solve(dense, right.T)
    assert corner == pytest.approx(expected, rel=1e-12, abs=1e-14)
    vector = rng.standard_normal(n)
    for a in range(m):
        expected = columns[a, :n] / band[:n, 0] @ vector
        assert column_times(scaled, filled, a, n, vector) == pytest.approx(expected, abs=1e-14)
        left = vector.copy()
        subtract_column(columns, filled, a, n, 0.5, left)
        assert left == pytest.approx(vector - 0.5 * columns[a, :n], abs=1e-14)


@pytest.mark.parametrize("shift", [0.5, -2.0, -7.0])
def test_the_signed_factor_counts_negative_eigenvalues(shift):
    rng = np.random.default_rng(4)
    n, b = 60, 10
    dense = np.zeros((n, n))
    for j in range(n):
        for r in range(min(b, n - 1 - j) + 1):
            dense[j + r, j] = dense[j, j + r] = rng.standard_normal()
    dense += shift * np.eye(n)
    band = np.zeros((n + b, b + 1))
    for j in range(n):
        for r in range(min(b, n - 1 - j) + 1):
            band[j, r] = dense[j + r, j]
    expected = np.count_nonzero(np.linalg.eigvalsh(dense) < 0.0)
    assert 0 < expected < n
    assert factor_band(band, n, b, True) == expected


def test_barrier_derivatives_agree_with_differences_and_vanish_at_its_distance():
    d_hat = 1e-3
    for d in (1e-6, 1e-4, 5e-4, 9.9e-4):
        h = 1e-5 * d
        slope = (barrier(d + h, d_hat) - barrier(d - h, d_hat)) / (2 * h)
        curve = (barrier_gradient(d + h, d_hat) - barrier_gradient(d - h, d_hat)) / (2 * h)
        assert barrier_gradient(d, d_hat) == pytest.approx(slope, rel=1e-6) and slope < 0
        assert barrier_hessian(d, d_hat) == pytest.approx(curve, rel=1e-6) and curve > 0
    for law in (barrier, barrier_gradient, barrier_hessian):
        assert law(d_hat, d_hat) == 0.0


def test_friction_reaches_coulombs_value_and_is_the_derivative_of_its_potential():
    threshold = 1e-4
    for v in (1e-7, 3e-5, 9.99e-5, 1.01e-4, 1.0):
        h = 1e-4 * v
        force = (friction_potential(v + h, threshold) - friction_potential(v - h, threshold)) / (2 * h)
        assert friction_over_speed(v, threshold) * v == pytest.approx(force, rel=1e-6)
        difference = friction_over_speed(v + h, threshold) * (v + h) - friction_over_speed(v - h, threshold) * (v - h)
        assert friction_slope(v, threshold) == pytest.approx(difference / (2 * h), rel=1e-5, abs=1e-9)
    assert friction_over_speed(threshold, threshold) * threshold == pytest.approx(1.0)
    assert friction_over_speed(0.5 * threshold, threshold) * 0.5 * threshold == pytest.approx(0.75)


def test_quaternions_and_rotation_vectors_describe_the_same_rotation():
    rng = np.random.default_rng(5)
    for vector in [*rng.standard_normal((20, 3)), np.array([math.pi, 0, 0]), np.array([1e-6, 2e-6, 0]), np.zeros(3)]:
        matrix = rotation_matrix(vector)
        assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-14)
        assert matrix_from_quaternion(quaternion_from_matrix(matrix)) == pytest.approx(matrix, abs=1e-14)
        if 0 < np.linalg.norm(vector) < math.pi:
            axis = vector / np.linalg.norm(vector)
            expected = math.sin(np.linalg.norm(vector) / 2) * axis
            quaternion = quaternion_from_matrix(matrix)
            assert quaternion[:3] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("expected", [0.0, 1e-9, -0.049, 0.0499, 0.0501, 1.0, -2.0, 3.1, -3.1])
def test_the_angle_of_a_direction_is_the_inverse_tangent_to_rounding(expected):
    assert angle(2.0 * np.cos(expected), 2.0 * np.sin(expected)) == pytest.approx(expected, rel=4e-16, abs=1e-300)

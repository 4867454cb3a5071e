"""Shapes by themselves: signed distances and their derivatives, inertia, points on edges and rims."""

import math

import numpy as np
import pytest
from support.sample_scenes import HALF_SIZES

from bilayer_core.contact.shapes import shape_curvature, shape_distance
from bilayer_core.model.shape_numbers import NUMBER, Shape, axis_frame, signed_distance


def surface_cloud(kind, rng, count=200_000):
    """Points on the surface of a shape, dense and at random, with no other knowledge of it than its inequalities."""
    a, b, c = HALF_SIZES[kind]
    if kind == "plane":
        return np.column_stack([rng.uniform(-1, 1, (count, 2)), np.zeros(count)])
    if kind == "sphere":
        return np.zeros((1, 3))
    if kind == "box":
        points = rng.uniform(-1, 1, (count, 3))
        axis = rng.integers(0, 3, count)
        points[np.arange(count), axis] = rng.choice([-1, 1], count)
        return points * (a, b, c)
    angle, height = rng.uniform(0, 2 * np.pi, count), rng.uniform(-c, c, count)
    side = np.column_stack([a * np.cos(angle), a * np.sin(angle), height])
    radius = a * np.sqrt(rng.uniform(0, 1, count))
    ends = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rng.choice([-c, c], count)])
    return np.concatenate([side, ends])


def inside(kind, points):
    a, b, c = HALF_SIZES[kind]
    if kind == "plane":
        return points[:, 2] <= 0
    if kind == "sphere":
        return np.zeros(len(points), dtype=bool)
    if kind == "box":
        return (np.abs(points) <= (a, b, c)).all(axis=1)
    return (np.hypot(points[:, 0], points[:, 1]) <= a) & (np.abs(points[:, 2]) <= c)


@pytest.mark.parametrize("kind", HALF_SIZES)
def test_a_signed_distance_is_that_of_the_nearest_point_of_the_surface(kind):
    rng = np.random.default_rng(1)
    cloud, points = surface_cloud(kind, rng), rng.uniform(-0.7, 0.7, (50, 3))
    nearest = np.array([np.linalg.norm(cloud - point, axis=1).min() for point in points])
    signed = np.where(inside(kind, points), -nearest, nearest)
    found = np.array([shape_distance(NUMBER[kind], *HALF_SIZES[kind], *point)[0] for point in points])
    # the nearest of n random points is about the square root of the area of each away, sideways
    assert np.all(np.abs(found - signed) < 4e-3) and np.all(np.abs(found) <= nearest + 1e-12)
    assert signed_distance(Shape(kind, np.array(HALF_SIZES[kind]), 0.0, np.eye(3)), points) == pytest.approx(
        found, abs=1e-15
    )


@pytest.mark.parametrize("kind", HALF_SIZES)
def test_a_signed_distance_has_a_unit_gradient_and_matching_second_derivatives(kind):
    rng = np.random.default_rng(2)
    number, half, h, found = NUMBER[kind], HALF_SIZES[kind], 1e-6, 0
    for point in rng.uniform(-0.7, 0.7, (150, 3)):
        distance, *gradient = shape_distance(number, *half, *point)
        assert np.linalg.norm(gradient) == pytest.approx(1.0, abs=1e-14)
        if distance < 0.01:
            continue
        found += 1
        ends = [[shape_distance(number, *half, *(point + sign * h * unit)) for sign in (1, -1)] for unit in np.eye(3)]
        slope = np.array([(plus[0] - minus[0]) / (2 * h) for plus, minus in ends])
        curve = np.array([(np.array(plus[1:]) - minus[1:]) / (2 * h) for plus, minus in ends])
        assert gradient == pytest.approx(slope, abs=1e-8)
        upper = shape_curvature(number, *half, *point)
        hessian = np.array([upper[:3], [upper[1], *upper[3:5]], [upper[2], upper[4], upper[5]]])
        assert hessian == pytest.approx(curve, abs=1e-6)
        assert np.linalg.eigvalsh(hessian).min() > -1e-12  # convex
        assert hessian @ gradient == pytest.approx(np.zeros(3), abs=1e-12)
    assert found > 50


@pytest.mark.parametrize("kind", ["sphere", "box", "cylinder"])
def test_inertia_of_solid_shapes_is_that_of_their_points(kind):
    half = {"sphere": (0.2, 0.2, 0.2), "box": (0.3, 0.2, 0.1), "cylinder": (0.2, 0.2, 0.35)}[kind]
    turn = axis_frame(np.array([0.6, 0.0, 0.8]))
    shape = Shape(kind, np.array(half), 0.2 if kind == "sphere" else 0.0, turn)
    line = np.linspace(-0.5, 0.5, 81)
    points = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    points = points[signed_distance(shape, points) < 0.0]
    squares = np.einsum("ki,kj->ij", points, points) / len(points)
    expected = 2.5 * (np.trace(squares) * np.eye(3) - squares)
    assert shape.inertia(2.5) == pytest.approx(expected, abs=0.015 * expected.max())


@pytest.mark.parametrize(
    ("shape", "count", "length"),
    [
        (Shape("box", np.array([0.3, 0.2, 0.1]), 0.02, np.eye(3)), 8, 0.6),
        (Shape("box", np.array([0.3, 0.2, 0.1]), 0.1, np.eye(3)), 4, 1.2),
        (Shape("cylinder", np.array([0.2, 0.2, 0.3]), 0.05, axis_frame(np.array([0, 1.0, 0])), 12), 24, None),
        (Shape("cylinder", np.array([0.2, 0.2, 0.3]), 0.2, axis_frame(np.array([0, 1.0, 0])), 12), 2, None),
    ],
)
def test_points_of_a_shape_lie_below_its_surface_and_share_its_edges_lengths(shape, count, length):
    points, radius, weight = shape.points()
    assert len(points) == count
    assert signed_distance(shape, points) == pytest.approx(np.full(count, -radius), abs=1e-12)
    assert np.linalg.norm(points, axis=1).max() + radius == pytest.approx(shape.bound)
    total = 8 * 0.6 if length else 2 * 2 * math.pi * 0.2
    assert weight * count == pytest.approx(total)


def test_a_frame_takes_z_to_its_axis():
    for axis in (*np.random.default_rng(7).standard_normal((5, 3)), np.array([0, 0, 1.0]), np.array([0, 0, -1.0])):
        axis = axis / np.linalg.norm(axis)
        frame = axis_frame(axis)
        assert frame[:, 2] == pytest.approx(axis, abs=1e-15)
        assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-15)
        assert np.linalg.det(frame) == pytest.approx(1.0)

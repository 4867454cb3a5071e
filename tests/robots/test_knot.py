"""The bundled overhand knot: it stays one, and its tension is that of the theory of loose knots.

Without friction the tension tends to F = B/(2 R²) for a radius h of the thread far below R, that of the loop: to
shorten a round loop by 2π dR costs its bending energy, d(π B/R). Friction of the coefficient μ adds μ P, P the sum of
the contact forces between the two strands of the braid, which slide on each other by as much as the ends move apart;
for h ≪ R P tends to 0.492 (B/R²) √(R/h) (Audoly, Clauvelin, Neukirch 2007; `loose_braid` finds the constant anew).
"""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import nnls

from bilayer_core import Simulator, load_scene

YOUNGS_MODULUS = 1e8
"""Of a thread of 1 mm [Pa]."""
SMOOTH = "contact.friction.coefficient=0"


def determinant(points):
    """|Alexander polynomial at −1| of an open curve whose ends are as good as at infinity: 1 unknotted, 3 a trefoil.

    From the crossings of a projection: each passes over one arc, between two others, 2 over − one − other = 0.
    """
    axes = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0] * 0.15 + np.eye(3)[[0, 2, 1]]
    flat = points @ axes.T
    start, edge = flat[:-1, :2], np.diff(flat[:, :2], axis=0)
    between = start[None] - start[:, None]
    cross = edge[:, None, 0] * edge[None, :, 1] - edge[:, None, 1] * edge[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (between[..., 0] * edge[None, :, 1] - between[..., 1] * edge[None, :, 0]) / cross
        other = (between[..., 0] * edge[:, None, 1] - between[..., 1] * edge[:, None, 0]) / cross
    first, second = np.nonzero(np.triu((along > 0) & (along < 1) & (other > 0) & (other < 1), 2))
    depth = flat[:, 2]
    crossings = []  # place of the lower strand, place of the upper one
    for i, j in zip(first, second, strict=True):
        places = i + along[i, j], j + other[i, j]
        heights = [np.interp(place, np.arange(len(depth)), depth) for place in places]
        crossings.append(places if heights[0] < heights[1] else places[::-1])
    unders = np.sort([under for under, _ in crossings])
    colours = np.zeros((len(crossings), len(crossings) + 1))
    for row, (under, over) in zip(colours, crossings, strict=True):
        arc = int(np.searchsorted(unders, under))
        row[np.searchsorted(unders, over)] += 2.0
        row[arc] -= 1.0
        row[arc + 1] -= 1.0
    colours[:, 0] += colours[:, -1]  # both ends are one arc
    return round(abs(np.linalg.det(colours[1:, 1:-1])))


def hands(shift):
    """The scene with another way of its hands [m], each."""
    moved = (("left", -shift), ("right", shift))
    return [f"bodies.{hand}.motion.displacements=[[0, 0, 0], [{way}, 0, 0]]" for hand, way in moved]


def curvatures(simulator):
    """At inner nodes [1/m]."""
    edges = np.diff(simulator.positions, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    dots, crosses = (edges[:-1] * edges[1:]).sum(axis=1), np.linalg.norm(np.cross(edges[:-1], edges[1:]), axis=1)
    return 2.0 * crosses / (lengths[:-1] * lengths[1:] + dots) / lengths.mean()


def loop_radius(simulator):
    """Of the circle that the middle of the loop follows [m]: two radians of it."""
    points, curvature = simulator.positions, curvatures(simulator)
    top = int(np.argmax(np.linalg.norm(points[:, 1:] - points[0, 1:], axis=1)))
    radius, edge = 50e-3, simulator.scene.rods[0].path.length / (len(points) - 1)
    for _ in range(20):
        reach = int(radius / edge)
        radius = 1.0 / curvature[top - 1 - reach : top + reach].mean()
    return radius


def tension(simulator):
    """Mean of the forces on the two hands [N]."""
    left, right = (simulator.clamps[f"thread.{end}"].wrench[0] for end in ("start", "end"))
    return 0.5 * (left - right)


def pressed(simulator):
    """Sum of the contact forces between the strands [N]."""
    return 0.5 * np.linalg.norm(simulator.contact_forces, axis=1).sum()


def thinner(width):
    """A thread of another width [m], as stiff against the same damping, that passes itself as closely."""
    points = [[x, y / 1.8e-3 * 0.75 * width, z] for x, y, z in load_scene("knot").rods[0].path.points]
    return (
        f"rods.thread.path.points={points}",
        f"rods.thread.width={width}",
        f"rods.thread.layers.thread.thickness={width}",
        f"rods.thread.imperfection.size={width / 100.0}",
        f"materials.rubber.youngs_modulus={YOUNGS_MODULUS * 1e-6 / width**2}",
        f"contact.barrier_distance={width / 10.0}",
    )


def loose_braid(half=4.0, pieces=160):
    """P √(h/R) R²/B of a loose knot, h ≪ R: two strands of a small slope, wound round each other by three half turns.

    Half the way between them over h is U, along x over √(2 h R), with |U| ≥ 1. Contact forces p are its fourth
    derivative, along U; the curvature U″ is −1 at one end and 1 at the other, in the plane of the loop. So P is
    ∫p / 2^(3/2).
    |U| ≥ 1 is made linear about the last U, until it stays; the forces are the solution of the dual problem.
    """
    x, step = np.linspace(-half, half, pieces + 1, retstep=True)
    count = len(x)
    bending = np.diff(np.eye(count), 2, axis=0) / step**2
    stiffness = bending.T @ bending * step + 1e-4 * step * np.eye(count)  # held in place, just
    moment = np.zeros(count)
    moment[[0, 1, -2, -1]] = np.array([-1.0, 1.0, -1.0, 1.0]) / step
    root = np.linalg.cholesky(np.linalg.inv(stiffness))
    free = np.linalg.solve(stiffness, moment)
    angle = np.clip((x + 2.0) / 4.0, 0.0, 1.0) * 3.0 * np.pi
    z, y, force = -np.cos(angle), np.sin(angle), 0.0
    for _ in range(40):
        along = np.arctan2(y, z)
        matrix = np.hstack([np.cos(along)[:, None] * root, np.sin(along)[:, None] * root])
        wanted = np.linalg.lstsq(matrix, 1.0 - np.cos(along) * free, rcond=None)[0]
        forces, _ = nnls(matrix.T, wanted, maxiter=20000)
        z, y = free + root @ (root.T @ (np.cos(along) * forces)), root @ (root.T @ (np.sin(along) * forces))
        if abs(forces.sum() - force) < 1e-6 * force:
            break
        force = forces.sum()
    return force / 2.0**1.5


def knot(*changes, seconds=None, **options):
    simulator = Simulator(load_scene("knot", list(changes)), **options)
    simulator.run(seconds)
    assert simulator.summary()["converged"] is True
    return simulator


@cache
def usual():
    """The bundled scene after nine seconds, for tests that do not go on from there."""
    return knot(seconds=9.0)


def test_it_is_an_overhand_knot_all_the_time_and_the_thread_never_meets_itself():
    simulator = knot(seconds=0.02)
    determinants, radii = [], []
    while simulator.time < 10.0 - 1e-9:
        simulator.run(0.998)
        determinants.append(determinant(simulator.positions))
        radii.append(loop_radius(simulator))
    assert determinants == [3] * len(determinants)
    assert simulator.statistics.min_gap > 0.05e-3
    assert (np.diff(radii[1:]) < 0.0).all() and radii[-1] < 30e-3


def test_with_one_crossing_the_other_way_it_is_no_knot_and_comes_undone():
    points = [list(point) for point in load_scene("knot").rods[0].path.points]
    middle = [point for point in points if point[0] == 0.0 and point[2] == 0.0]
    assert len(middle) == 2
    for point in middle:
        point[1] *= -1.0
    simulator = Simulator(load_scene("knot", [f"rods.thread.path.points={points}", *hands(0.32)]))
    assert determinant(simulator.positions) == 1
    simulator.run()
    assert curvatures(simulator).max() < 25.0  # of a loop as long as what is left, 400 1/m
    assert not simulator.contact_forces.any()


def test_both_hands_pull_as_hard():
    simulator = usual()
    left, right = (simulator.clamps[f"thread.{end}"].wrench[0] for end in ("start", "end"))
    assert left == pytest.approx(-right, rel=0.02)


@pytest.mark.verify
def test_friction_adds_its_coefficient_times_the_force_between_the_strands():
    rough, smooth = (knot(*thinner(1e-3), *changes, seconds=9.0) for changes in ((), (SMOOTH,)))
    radii = loop_radius(rough), loop_radius(smooth)
    assert radii[1] == pytest.approx(radii[0], rel=0.01)
    added = tension(rough) - tension(smooth) * (radii[1] / radii[0]) ** 2
    assert added == pytest.approx(0.1 * pressed(rough), rel=0.04)


@pytest.mark.verify
def test_tension_and_contact_forces_tend_to_those_of_a_loose_knot():
    """At a loop of 40 mm: a thread of a fifth of the thickness is nearer to both limits."""
    limits, far = np.array([0.5, loose_braid()]), []
    assert limits[1] == pytest.approx(0.492, abs=0.01)
    for width, stations in ((1e-3, 401), (2e-4, 601)):
        changes = (*thinner(width), *hands(0.2), SMOOTH, f"rods.thread.stations={stations}")
        simulator = knot(*changes, tolerance=1e-3)
        assert simulator.solve_static().stable
        radius, stiffness = loop_radius(simulator), YOUNGS_MODULUS * 1e-6 / width**2 * width**4 / 12.0
        root = np.sqrt(radius / (0.545 * width))  # half the distance of the strands: half the width and of the gap
        figures = np.array([tension(simulator), pressed(simulator) / root]) * radius**2 / stiffness
        far.append(figures / limits - 1.0)
    assert (far[0] > far[1]).all() and (far[1] > 0.0).all()
    assert far[1][0] < 0.15 and far[1][1] < 0.3


@pytest.mark.parametrize(
    "method",
    [
        {"model": "two_rod"},
        pytest.param({"tolerance": 1e-3}, marks=pytest.mark.verify),
        pytest.param({"integrator": "sdirk2"}, marks=pytest.mark.verify),
        pytest.param({"integrator": "generalised_alpha"}, marks=pytest.mark.verify),
        pytest.param({"integrator": "implicit_euler", "dt": 5e-3}, marks=pytest.mark.verify),
    ],
    ids=str,
)
def test_no_model_tolerance_or_integrator_changes_loop_or_tension(method):
    simulator, other = usual(), knot(seconds=9.0, **method)
    assert loop_radius(other) == pytest.approx(loop_radius(simulator), rel=0.02)
    assert tension(other) == pytest.approx(tension(simulator), rel=0.05)

"""Surfaces that are not flat meet ribbons between stations and across the width."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from support.sample_scenes import contact, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.contact.between_stations import SAG
from bilayer_core.errors import PenetrationError
from bilayer_core.model.points_between import points_between

WIDE = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.4, "density": 1000.0, "retardation_time": 0.01}}
D_HAT, THICK, WIDTH, LENGTH = 2e-4, 2e-3, 0.02, 0.1


def wide_strip(surface, path, stations=41, offset=0.0, **more):
    """A strip between two walls, and a body with a surface that moves along a path in a second."""
    walls = [
        {"name": name, "position": [x, 0, 0], "motion": {"type": "prescribed"}}
        for name, x in (("a", -0.5 * LENGTH), ("b", 0.5 * LENGTH))
    ]
    moves = {"type": "prescribed", "times": [0, 1], "displacements": [[0, 0, 0], list(path[1])]}
    body = {"name": "peg", "position": list(path[0]), "motion": moves, "surface": surface}
    ends = {"clamp_start": "a", "clamp_end": "b"}
    strip = rod([layer(thickness=THICK)], LENGTH, stations=stations, start=(-0.5 * LENGTH, 0, 0), width=WIDTH, **ends)
    more = {"gravity": [0, 0, 0], "damping": {"mass": 20.0}, **more}
    return scene([strip], bodies=[*walls, body], contact=contact(D_HAT), materials=WIDE, **more)


def true_gap(simulator, ball, radius):
    """Least distance of a ball from the strip, by splines through stations and borders that are sampled finely."""
    frame, arc = simulator.frame(), np.linspace(0.0, 1.0, 41)
    tangent = np.gradient(frame.positions[:41], axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    m1 = frame.directors[np.stack([np.maximum(np.arange(41) - 1, 0), np.minimum(np.arange(41), 39)], axis=1)].mean(
        axis=1
    )
    across, fine = np.cross(tangent, m1), np.linspace(0.0, 1.0, 2001)
    middle, side = CubicSpline(arc, frame.positions[:41])(fine), CubicSpline(arc, across)(fine)
    offsets = np.linspace(-0.5, 0.5, 401)[:, None, None] * (WIDTH - THICK)
    return float(np.linalg.norm(middle + offsets * side - ball, axis=2).min()) - radius - 0.5 * THICK


@pytest.mark.parametrize("radius", [1e-3, 2e-2])
def test_a_ball_pressed_between_points_stays_within_the_barrier(radius):
    start = np.array([0.0131, 0.0041, radius + 0.5 * THICK + 1.5 * D_HAT])
    content = wide_strip({"shape": "sphere", "radius": radius}, (start, [0, 0, -3e-3]))
    simulator = Simulator(load_scene(content))
    for _ in range(4):
        simulator.run(0.25)
        ball = simulator.bodies["peg"].position
        assert (1.0 - SAG) * simulator.frame().min_gap - SAG * D_HAT < true_gap(simulator, ball, radius) < D_HAT
    assert simulator.frame().positions[:41, 2].min() < -1.5e-3


def test_a_peg_beside_the_middle_lifts_a_strip():
    peg = {"shape": "cylinder", "axis": [0, 0, 1], "length": 0.02, "radius": 3e-3, "rounding": 5e-4}
    content = wide_strip(peg, ([0.0, 4.5e-3, -12.2e-3], [0, 0, 6e-3]))
    simulator = Simulator(load_scene(content))
    simulator.run(1.0)
    assert simulator.frame().positions[:, 2].max() > 3e-3
    assert 0.0 < simulator.frame().min_gap < D_HAT


@pytest.mark.parametrize("stations", [3, 41])
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_points_that_kernels_make_are_those_of_the_pattern(stations, dimension):
    sphere, place = {"shape": "sphere", "radius": 2e-3}, (0.0461, 0.0, 2e-3 + 0.5 * THICK + 1e-5)
    content = wide_strip(sphere, (place, [0, 0, 0]), stations)
    for end in ("clamp_start", "clamp_end"):
        content["rods"][0].pop(end)
    simulator = Simulator(load_scene(content), dimension=dimension, dt=1e-7)
    simulator.run(1e-7)
    listed = simulator._stepper.engine._storage.problem.surfaces
    own = slice(int(listed.near_count[0]))
    node, weight, gap = listed.near_node[own], listed.near_weight[own], listed.near_gap[own]
    cells = list(points_between(simulator.model, 0, np.array(place), 1.0))
    total = sum(cell.weight.sum() for cell in cells)
    patch = np.sqrt(2.0 * 3e-3 * D_HAT)
    half = 0.5 * (WIDTH - THICK) if dimension == 3 else 0.0
    assert total == pytest.approx(LENGTH * max(1.0, half / patch), rel=1e-12)
    expected = []
    for cell in cells:
        gaps = np.linalg.norm(cell.place - np.array(place), axis=1) - 2e-3 - cell.radius
        expected += [(d, w, cell.node) for d, w in zip(gaps, cell.weight, strict=True) if d < D_HAT]
    near = (gap < D_HAT) & (weight > 0.0)
    found = sorted(zip(gap[near], weight[near], node[near], strict=True))
    assert len(found) == len(expected) > 3
    assert np.array(found) == pytest.approx(np.array(sorted(expected)), rel=1e-6, abs=1e-8)  # one step has moved it


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_plane_meets_a_bent_rod_between_stations_and_a_straight_one_at_them(dimension):
    ring = rod([layer(thickness=THICK)], stations=33, width=WIDTH)
    path = {"shape": "arc", "start": [0, 0, 0.5 * THICK + 0.5 * D_HAT], "direction": [1, 0, 0], "closed": True}
    ring |= {"name": "ring", "path": path | {"radius": 0.05, "angle": "360 deg"}, "normal": [0, 0, 1]}
    straight = rod([layer(thickness=THICK)], stations=33, width=WIDTH, start=(0.2, 0, 0.5 * THICK + 0.5 * D_HAT))
    ground = {"obstacles": [{"name": "ground", "type": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}]}
    content = scene([ring, straight], contact=contact(D_HAT), materials=WIDE, **ground)
    simulator = Simulator(load_scene(content), dimension=dimension, dt=1e-7)
    simulator.run(1e-7)
    listed = simulator._stepper.engine._storage.problem.surfaces
    own, of_ring = slice(int(listed.near_count[0])), simulator.model.strands[0].node_count
    pressed = (listed.near_gap[own] < D_HAT) & (listed.near_weight[own] > 0.0)
    bent = pressed & (listed.near_node[own] < of_ring)
    found = sorted(zip(listed.near_gap[own][bent], listed.near_weight[own][bent], strict=True))
    cells = list(points_between(simulator.model, 0, np.zeros(3), 1.0))
    places = [(cell.place[:, 2] - cell.radius, cell.weight) for cell in cells]
    expected = [(d, w) for gaps, weights in places for d, w in zip(gaps, weights, strict=True) if d < D_HAT]
    assert sum(cell.weight.sum() for cell in cells) == pytest.approx(listed.edge_length[:32].sum(), rel=1e-12)
    assert len(found) > 3 and np.array(found) == pytest.approx(np.array(sorted(expected)), rel=1e-6, abs=1e-8)
    at_stations = pressed & ~bent
    assert not listed.near_mix[own][at_stations, :2].any()
    assert listed.near_weight[own][at_stations].sum() == pytest.approx(LENGTH, rel=1e-12)


def test_a_ball_that_starts_inside_a_strip_beside_its_borders_and_middle_is_refused():
    place = (0.0012, 0.0045, 0.5e-3 + 0.5 * THICK - 1e-5)
    content = wide_strip({"shape": "sphere", "radius": 0.5e-3}, (place, [0, 0, 0]))
    with pytest.raises(PenetrationError, match=r"node 2\d of rod/only at .* mm behind the surface of body peg"):
        Simulator(load_scene(content))

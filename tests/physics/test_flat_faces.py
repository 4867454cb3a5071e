"""Boxes and cylinders meet rods as planes do on their faces, and at many points close to edges and corners."""

import numpy as np
import pytest
from support.sample_scenes import contact, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.contact.between_stations import SAG
from bilayer_core.model.build_model import build_model
from bilayer_core.testing.gaps import GapCheck
from bilayer_core.verification.validate.friction import box_on_ground, stride, two_boxes

D_HAT, THICK, WIDTH, LENGTH, STATIONS = 2e-4, 1e-3, 0.02, 0.1, 41
SOFT = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.4, "density": 1000.0, "retardation_time": 0.01}}
REST = 0.5 * THICK + 0.6 * D_HAT


def box(name, centre, size):
    return {"name": name, "type": "box", "position": list(centre), "size": list(size)}


def strip_on(*obstacles, height=REST, direction=(1, 0, 0), **more):
    """A strip whose middle is above the origin; its weight presses it to 0.06 mm where all of it rests."""
    start = -0.5 * LENGTH * np.array(direction) / np.linalg.norm(direction) + [0, 0, height]
    strip = rod([layer(thickness=THICK)], LENGTH, STATIONS, start.tolist(), width=WIDTH)
    strip["path"]["direction"] = list(direction)
    settings = {"contact": contact(D_HAT) | {"stiffness": 1e5}, "materials": SOFT, "damping": {"mass": 20.0}}
    return scene([strip], obstacles=list(obstacles), **settings | more) | {"gravity": [0, 0, -9.81], "solver": {}}


PLANE = {"name": "ground", "type": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}
FACES = {
    "plane": PLANE,
    "box": box("ground", (0, 0, -0.01), (0.12, 0.03, 0.02)),
    "flush box": box("ground", (0, 0, -0.01), (LENGTH, WIDTH, 0.02)),
    "thin plate": box("ground", (0, 0, -0.25e-3), (0.12, 0.03, 0.5e-3)),
    "cylinder": {"name": "ground", "type": "cylinder", "position": [0, 0, -0.01], "axis": [0, 0, 1], "radius": 0.06}
    | {"length": 0.02},
}


def pressing(simulator):
    """The gaps and weights of pairs that press."""
    listed = simulator._stepper.engine._storage.problem.surfaces
    own = np.arange(int(listed.near_count[0]))
    own = own[listed.near_gap[own] < D_HAT]
    return listed.near_gap[own], listed.near_weight[own]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("face", FACES)
def test_a_strip_presses_a_flat_face_with_the_points_and_the_gap_that_a_plane_has(face, dimension):
    simulator = Simulator(load_scene(strip_on(FACES[face])), dimension=dimension)
    simulator.run(0.5)
    gap, weight = pressing(simulator)
    assert len(gap) == STATIONS * (3 if dimension == 3 else 1)
    assert weight.sum() == pytest.approx(LENGTH, rel=1e-12)
    pressure = 1000.0 * 9.81 * WIDTH * THICK
    t = gap / D_HAT
    of_barrier = 1e5 * D_HAT * (1.0 - t) * (2.0 * np.log(1.0 / t) + (1.0 - t) / t)
    assert of_barrier == pytest.approx(np.full(len(t), pressure), rel=1e-3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_friction_of_a_box_is_integrated_along_edges(dimension):
    assert stride(0.4, 0.5, 21, (box("ground", (0.05, 0, -0.01), (0.3, 0.05, 0.02)),), dimension)[0] == pytest.approx(
        stride(0.4, 0.5, 21, dimension=dimension)[0], rel=1e-6
    )


@pytest.mark.parametrize("meet", [0.0411, 0.0427, 0.0447])
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_friction_of_boxes_is_integrated_along_edges_where_they_meet(dimension, meet):
    way, expected = stride(0.4, 0.5, 21, two_boxes(meet), dimension)
    assert way == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("end", [0.044, 0.0446])
def test_the_stride_where_a_strip_rests_on_a_boxs_edge_is_that_of_all_integrators(end):
    euler = [{"integrator": "implicit_euler", "dt": dt} for dt in (4e-3, 1e-3)]
    ways = [stride(0.4, 0.5, 41, box_on_ground(end), solver=solver)[0] for solver in ({}, *euler)]
    assert ways == pytest.approx(3 * [ways[0]], rel=1e-3)


EDGES = {
    "an edge across": (box("ground", (-0.085, 0, -0.01), (0.2, 0.05, 0.02)), (1, 0, 0), 0.065),
    "an edge along": (box("ground", (0, 0.0465, -0.01), (0.12, 0.1, 0.02)), (1, 0, 0), LENGTH * 13 / 19),
    "an edge askew": (
        box("ground", (-0.085, 0, -0.01), (0.2, 0.05, 0.02)),
        (1, 0.3, 0),
        0.05 + 0.015 * np.hypot(1, 0.3),
    ),
}
"""Boxes under parts of strips, the direction of those, and the length that they carry [m]."""


@pytest.mark.parametrize("edge", EDGES)
def test_points_are_dense_at_an_edge_alone(edge):
    obstacle, direction, covered = EDGES[edge]
    simulator = Simulator(
        load_scene(strip_on(obstacle, direction=direction, height=0.5 * THICK + 1e-5)), dt=1e-7, dimension=3
    )
    simulator.run(1e-7)
    gap, weight = pressing(simulator)
    assert len(gap) < 1200
    assert weight[gap < 0.1 * D_HAT].sum() == pytest.approx(covered, rel=0.02)


CORNERS = [(x, y) for x in (-0.0287, 0.0312) for y in (-0.0041, 0.0041)]
"""Places of pillars of 1 mm, between stations; beside each other, so that the strip hardly twists."""


def test_no_corner_comes_between_points():
    pillars = [box(f"p{k}", (x, y, -0.01), (1e-3, 1e-3, 0.02)) for k, (x, y) in enumerate(CORNERS)]
    simulator = Simulator(load_scene(strip_on(*pillars, materials={"gel": SOFT["gel"] | {"youngs_modulus": 2e7}})))
    judge = GapCheck(simulator.model)
    for _ in range(5):
        simulator.run(0.1)
        gap = judge.smallest(judge.moment(simulator.frame()))
        assert gap > (1.0 - SAG) * simulator.frame().min_gap - SAG * D_HAT
    assert simulator.frame().contact_forces[:, 2].sum() == pytest.approx(
        1000.0 * 9.81 * LENGTH * WIDTH * THICK, rel=1e-2
    )


@pytest.mark.parametrize("end", [0, -1])
def test_a_twisted_strip_ends_for_a_ball_where_its_last_section_is(end):
    path = {"shape": "helix", "start": [0, 0, 0], "axis": [1, 0, 0], "radius": 0.05, "pitch": 0.2, "angle": "144 deg"}
    strip = rod([layer(thickness=THICK)], stations=11, width=WIDTH) | {"path": path, "normal": [0, 0, 1]}
    content = scene([strip], contact=contact(D_HAT), materials=SOFT)
    model = build_model(load_scene(content))
    m1 = model.start_director1[end]
    along = np.diff(model.start_position, axis=0)[end] / np.linalg.norm(np.diff(model.start_position, axis=0)[end])
    border = model.start_position[end] + 0.5 * (WIDTH - THICK) * np.cross(along, m1)
    place = border + (2e-3 + 0.5 * THICK + 0.5 * D_HAT) * m1
    peg = {"name": "peg", "position": place.tolist(), "motion": {"type": "prescribed"}}
    content["bodies"] = [peg | {"surface": {"shape": "sphere", "radius": 2e-3}}]
    simulator = Simulator(load_scene(content), dt=1e-7)
    simulator.run(1e-7)
    assert simulator.frame().min_gap == pytest.approx(0.5 * D_HAT, abs=0.02 * D_HAT)


def test_whatever_is_within_the_barrier_bears_and_counts():
    place = [0.0012, 0, 2e-3 + THICK + 2e-5 + 0.5 * D_HAT]
    ball = {"name": "peg", "position": place, "motion": {"type": "prescribed"}}
    content = strip_on(FACES["box"], bodies=[ball | {"surface": {"shape": "sphere", "radius": 2e-3}}])
    content["gravity"] = [0, 0, 0]
    content["rods"][0]["path"]["start"][2] = 0.5 * THICK + 2e-5
    simulator = Simulator(load_scene(content), dt=1e-7, dimension=3)
    simulator.run(1e-7)
    gap, weight = pressing(simulator)
    assert len(gap) > 3 * STATIONS and (weight > 0.0).all()
    assert simulator.frame().contacts == (("rod", "peg"), ("rod", "ground"))

"""Surfaces and scales of pictures."""

from dataclasses import replace

import numpy as np
import pytest
from support import synthetic_run

from bilayer_core.log.messages.colours import strain_colours
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.observed.frame import ShapeInfo
from bilayer_core.view import geometry
from bilayer_core.view.colouring import choose_colouring
from bilayer_core.view.recording_layout import summary
from bilayer_core.view.scales import VIEW_ASPECT, VIEW_DIRECTION, choose_scales, place_eye, rounded_up


def closed_volume(vertices, triangles):
    """Volume inside a surface whose triangles turn anticlockwise seen from outside."""
    a, b, c = (vertices[triangles[:, i]].astype(float) for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def test_the_surface_of_a_ribbon_is_closed_and_holds_its_volume():
    memory = MemoryRecorder()
    synthetic_run.run(memory, np.array([0.0, 2.0]))
    run = memory.run_data()
    strand = run.description.strands[3]
    vertices = geometry.ribbon_vertices(strand, run.positions[:, strand.nodes], run.material_frames[:, strand.nodes])
    triangles = geometry.ribbon_triangles(synthetic_run.NODES)
    area = synthetic_run.WIDTH * synthetic_run.THICKNESS
    flat, curled = (closed_volume(part.reshape(-1, 3), triangles) for part in vertices)
    assert flat == pytest.approx(area * synthetic_run.LENGTH, rel=1e-3)
    # The centreline of the upper layer is longer by the curvature times its distance from the interface.
    assert curled == pytest.approx(area * synthetic_run.LENGTH * (1 + 42.0 * 0.0005), rel=2e-3)


def test_a_tapered_ribbon_is_drawn_with_its_taper():
    nodes = synthetic_run.NODES
    strand = replace(synthetic_run.description().strands[0], width=np.linspace(10e-3, 2e-3, nodes))
    line = np.zeros((1, nodes, 3))
    line[0, :, 2] = np.linspace(0, 0.06, nodes)
    frames = np.tile([0.0, 0.0, 0.0, 1.0], (1, nodes, 1))  # m1 along x, m2 along y, the ribbon along z
    vertices = geometry.ribbon_vertices(strand, line, frames)[0]
    span = vertices[:, :, 1].max(axis=1) - vertices[:, :, 1].min(axis=1)
    assert span == pytest.approx(strand.width, rel=1e-6)
    volume = closed_volume(vertices.reshape(-1, 3), geometry.ribbon_triangles(nodes))
    assert volume == pytest.approx(6e-3 * synthetic_run.THICKNESS * 0.06, rel=1e-6)


def test_a_ribbon_whose_nodes_are_not_in_its_middle_is_drawn_where_its_faces_are():
    nodes = synthetic_run.NODES
    strand = replace(
        synthetic_run.description().strands[0],
        thickness=np.linspace(2e-3, 1e-3, nodes),
        offset=np.linspace(0.0, -0.5e-3, nodes),
    )
    line = np.zeros((1, nodes, 3))
    line[0, :, 2] = np.linspace(0, 0.06, nodes)
    frames = np.tile([0.0, 0.0, 0.0, 1.0], (1, nodes, 1))  # m1 along x
    vertices = geometry.ribbon_vertices(strand, line, frames)[0]
    assert vertices[:, :, 0].min(axis=1) == pytest.approx(np.full(nodes, -1e-3))
    assert vertices[:, :, 0].max(axis=1) == pytest.approx(np.linspace(1e-3, 0.0, nodes), abs=1e-9)


TILTED = (0.0, 0.6, 0.0, 0.8)


@pytest.mark.parametrize(
    ("kind", "size", "rounding", "volume"),
    [
        ("sphere", (0.04, 0.04, 0.04), 0.0, 4 / 3 * np.pi * 0.02**3),
        ("box", (0.03, 0.02, 0.01), 0.0, 6e-6),
        ("box", (0.02, 0.02, 0.02), 0.01, 4 / 3 * np.pi * 0.01**3),  # rounded to a ball
        ("cylinder", (0.02, 0.02, 0.05), 0.0, np.pi * 0.01**2 * 0.05),
        ("cylinder", (0.02, 0.02, 0.05), 0.01, np.pi * 0.01**2 * 0.03 + 4 / 3 * np.pi * 0.01**3),  # a capsule
    ],
)
def test_the_surface_of_a_shape_holds_its_volume_and_shows_both_colours(kind, size, rounding, volume):
    shape = ShapeInfo(kind, size, rounding, (0.1, 0.2, 0.3), TILTED)
    colours = ((1, 2, 3), (4, 5, 6))
    vertices, normals, shades, triangles = geometry.shape_mesh(shape, colours)
    assert closed_volume(vertices - np.float32([0.1, 0.2, 0.3]), triangles) == pytest.approx(volume, rel=0.02)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(normals)), abs=1e-6)
    assert {tuple(shade) for shade in shades.tolist()} == set(colours)
    corners = geometry.shape_extent(shape)
    for axis in range(3):
        direction = geometry.rotated(np.array(TILTED), axis)
        found = (vertices @ direction).min(), (vertices @ direction).max()
        assert found == pytest.approx(((corners @ direction).min(), (corners @ direction).max()), abs=1e-7)


def test_squares_of_a_plane_lie_in_it_and_stay_where_they_are():
    turn = 0.5 * np.arctan2(0.6, 0.8)
    normal, point = np.array([0.6, 0.0, 0.8]), np.array([0.1, 0.0, 0.2])
    plane = ShapeInfo("plane", (0.0, 0.0, 0.0), 0.0, tuple(point), (0.0, np.sin(turn), 0.0, np.cos(turn)))
    colours = ((100, 100, 100), (50, 50, 50), (0, 0, 0))
    here, shades, triangles = geometry.plane_mesh(plane, np.zeros(3), 0.1, 0.02, colours)
    there, _, _ = geometry.plane_mesh(plane, np.array([0.0, 0.013, 0.0]), 0.1, 0.02, colours)
    np.testing.assert_allclose((here - point) @ normal, 0.0, atol=1e-8)
    shared = {tuple(row) for row in np.round(here, 6).tolist()} & {tuple(row) for row in np.round(there, 6).tolist()}
    assert len(shared) > 60
    assert (shades.min(), shades.max()) == (0, 100)
    a, b, c = (here[triangles[:, i]] for i in range(3))
    assert np.all(np.cross(b - a, c - a) @ normal > 0)


def test_everything_is_in_the_picture_and_fills_it():
    points = np.random.default_rng(0).uniform([-0.3, -0.1, 0.0], [0.1, 0.1, 0.2], (500, 3))
    eye, target = place_eye(points)
    back = VIEW_DIRECTION / np.linalg.norm(VIEW_DIRECTION)
    np.testing.assert_allclose((eye - target) / np.linalg.norm(eye - target), back, atol=1e-12)
    right = np.cross([0, 0, 1], back) / np.linalg.norm(np.cross([0, 0, 1], back))
    depth = (eye - points) @ back
    across, up = (points - eye) @ right / depth, (points - eye) @ np.cross(back, right) / depth
    shown = np.tan(np.radians(55 / 2))  # the viewer's field of view
    filled = max(np.abs(across).max() / (shown * VIEW_ASPECT), np.abs(up).max() / shown)
    assert 0.7 < filled < 0.95
    assert across.max() == pytest.approx(-across.min(), rel=0.1)


def test_the_text_beside_the_picture_states_its_scales():
    memory = MemoryRecorder()
    synthetic_run.run(memory, np.array([0.0, 2.0]))
    run = memory.run_data()
    exact = {**run.description.settings, "newton_tolerance": "2.6950000000000005e-06"}
    run = replace(run, description=replace(run.description, settings=exact))
    text = summary(run, choose_scales(run), choose_colouring(run))
    assert "newton_tolerance 2.695e-06" in text
    assert "axial strain [%]: -6 (blue) over 0 (grey) to +6 (red)" in text
    # Arrows of 21.5 mN become a quarter of the robot's 116 mm, up to rounding of the scale.
    assert "8 mN for 10 mm" in text
    assert "Squares on the ground: 15 mm" in text


@pytest.mark.parametrize(("value", "scale"), [(0.052, 0.06), (0.06, 0.06), (9.1e-5, 1e-4), (1.2, 1.5), (70.0, 70.0)])
def test_scales_are_round_numbers(value, scale):
    assert rounded_up(value) == pytest.approx(scale)


def test_colours_of_strain_run_from_blue_over_grey_to_red_and_saturate():
    colours = strain_colours(np.array([-9.0, -0.05, 0.0, 0.05, 9.0]), 0.05)
    np.testing.assert_array_equal(colours[0], colours[1])
    np.testing.assert_array_equal(colours[3], colours[4])
    blue, grey, red = colours[[1, 2, 3], :3]
    assert blue[2] > 2 * blue[0] and red[0] > 2 * red[2] and np.ptp(grey) < 0.03
    lightness = strain_colours(np.linspace(-0.05, 0.05, 41), 0.05)[:, :3] @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(lightness[:21]) > 0) and np.all(np.diff(lightness[20:]) < 0)

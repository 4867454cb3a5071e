"""Rods that are curved from the start."""

import numpy as np
import pytest
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene

RADIUS, ANGLE = 0.05, 1.2


def arc(layers, stations=31, toward="normal", **more):
    """A rod on part of a circle, clamped at its start."""
    curved = rod(layers, stations=stations, clamp_start="wall", **more)
    curved["path"] = {
        "shape": "arc",
        "start": [0, 0, 0],
        "direction": [1, 0, 0],
        "radius": RADIUS,
        "angle": ANGLE,
        "toward": toward,
    }
    return curved


@pytest.mark.parametrize("toward", ["normal", "opposite"])
@pytest.mark.parametrize("layers", [[layer()], [layer("bottom"), layer("top", thickness=2e-3)]])
def test_a_curved_rod_starts_on_its_circle_without_stress_and_stays(layers, toward):
    simulator = Simulator(load_scene(scene([arc(layers, toward=toward)], bodies=[fixed()])))
    side = 1.0 if toward == "normal" else -1.0
    heights = [0.0] if len(layers) == 1 else [-0.5e-3, 1e-3]
    center = np.array([0, 0, side * RADIUS])
    start = simulator.positions.copy()
    for strand, height in zip(simulator.model.strands, heights, strict=True):
        own = start[strand.first_node : strand.first_node + strand.node_count]
        assert np.linalg.norm(own - center, axis=1) == pytest.approx(np.full(31, RADIUS - side * height))
        tip = center + (RADIUS - side * height) * np.array([np.sin(ANGLE), 0, -side * np.cos(ANGLE)])
        assert own[-1] == pytest.approx(tip, abs=1e-12)
    assert sum(simulator.energy().values()) < 1e-18
    simulator.run(0.02)
    assert np.abs(simulator.positions - start).max() < 1e-12


def test_a_straight_layer_with_natural_curvature_relaxes_to_the_curved_one():
    straight = rod([layer(natural_curvature=1.0 / RADIUS)], length=RADIUS * ANGLE, stations=31, clamp_start="wall")
    relaxed = Simulator(load_scene(scene([straight], bodies=[fixed()], solver={"dt": 1.0, "newton_tolerance": 1e-11})))
    relaxed.run(20.0)
    curved = Simulator(load_scene(scene([arc([layer()])], bodies=[fixed()])))
    assert relaxed.positions[-1] == pytest.approx(curved.positions[-1], abs=2e-4 * RADIUS)


def test_growth_of_the_outer_layer_closes_an_arc_as_it_bends_a_straight_strip():
    stimuli = {"heat": {"schedule": {"type": "ramp", "start": 0, "end": 5, "from": 0, "to": 1}}}
    growing = [layer("outer", eigenstrain={"stimulus": "heat", "gain": 0.01}), layer("inner")]
    simulator = Simulator(
        load_scene(
            scene([arc(growing)], bodies=[fixed()], stimuli=stimuli, solver={"dt": 1.0, "newton_tolerance": 1e-11})
        )
    )
    before = simulator.curvatures[15]
    simulator.run(20.0)
    assert before == pytest.approx(1.0 / (RADIUS + 0.5e-3), rel=1e-3)
    # of the outer centreline, per its rest length: Timoshenko's 1.5 η/H to first order in thickness over radius
    assert simulator.curvatures[15] - before == pytest.approx(1.5 * 0.01 / 2e-3, rel=0.03)


@pytest.mark.parametrize("toward", ["normal", "opposite"])
@pytest.mark.parametrize("end_radius", [0.03, 0.08])
def test_a_spiral_has_its_radii_even_spacing_and_no_stress(toward, end_radius):
    angle, stations = 7.5, 601
    coil = rod([layer("bottom"), layer("top")], stations=stations, clamp_start="wall")
    coil["path"] = {
        "shape": "spiral",
        "start": [0, 0, 0],
        "direction": [1, 0, 0],
        "start_radius": RADIUS,
        "end_radius": end_radius,
        "angle": angle,
        "toward": toward,
    }
    simulator = Simulator(load_scene(scene([coil], bodies=[fixed()])))
    side = 1.0 if toward == "normal" else -1.0
    growth = (end_radius - RADIUS) / angle
    center = RADIUS * np.array([-growth, 0, side * RADIUS]) / np.hypot(RADIUS, growth)
    strands = [simulator.positions[s.first_node : s.first_node + stations] for s in simulator.model.strands]
    path = 0.5 * (strands[0] + strands[1])  # the layers are half a millimetre to either side
    outward = path - center
    radius = np.linalg.norm(outward, axis=1)
    turned = side * np.unwrap(np.arctan2(outward[:, 2], outward[:, 0]))
    assert radius == pytest.approx(RADIUS + growth * (turned - turned[0]), rel=1e-9)
    assert radius[[0, -1]] == pytest.approx([RADIUS, end_radius], rel=1e-9)
    assert turned[-1] - turned[0] == pytest.approx(angle, rel=1e-9)
    spacing = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert np.ptp(spacing) < 1e-3 * spacing.mean()  # chords of equal arcs
    assert spacing.sum() == pytest.approx(simulator.scene.rods[0].path.length, rel=1e-4)
    assert sum(simulator.energy().values()) < 1e-16

"""Layers, laws and profiles that end between stations are as long as the scene says."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene

BEGIN, END, LENGTH, GAIN, HEIGHT = 0.026, 0.074, 0.1, 0.005, 2e-3
WIDTH, MODULUS = 0.01, 1e8


def strip(stations, laws=None, model="laminate", loads=(), **of_top):
    """A clamped strip with a layer on top, in a plane."""
    top = layer("top", **of_top)
    if laws:
        top["eigenstrain"] = [{"stimulus": "heat", "gain": GAIN, **law} for law in laws]
    held = rod([layer("low"), top], LENGTH, stations, clamp_start="wall")
    stimuli = {"heat": {"schedule": {"type": "hold", "value": 1.0}}}
    content = scene([held], bodies=[fixed()], stimuli=stimuli, loads=list(loads))
    return Simulator(load_scene(content), model=model, dimension=2)


def turn(simulator):
    """Angle between the first and the last edge at rest [rad], positive where the strip bends down."""
    simulator.solve_static()
    edges = np.diff(simulator.positions[: simulator.scene.rods[0].stations], axis=0)[[0, -1]]
    first, last = np.arctan2(-edges[:, 2], edges[:, 0])
    return last - first


def arc(length):
    return 1.5 * GAIN / HEIGHT * length


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
@pytest.mark.parametrize("stations", [11, 21, 34])
def test_a_law_on_a_part_of_a_layer_turns_the_strip_by_its_length(model, stations):
    simulator = strip(stations, [{"interval": [BEGIN, END]}], model)
    assert turn(simulator) == pytest.approx(arc(END - BEGIN), rel=1e-3 if model == "laminate" else 2e-3)


def test_the_turn_grows_evenly_with_the_length_of_a_patch():
    ends = END + np.linspace(0.0, 0.01, 9)
    turns = [turn(strip(11, [{}], interval=[BEGIN, end])) for end in ends]
    assert np.diff(turns) == pytest.approx(arc(ends[1] - ends[0]), rel=2e-3)


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_laws_that_meet_between_stations_are_as_one(model):
    both = strip(11, [{"interval": [0.0, 0.033]}, {"interval": [0.033, LENGTH]}], model)
    whole = strip(11, [{}], model)
    for simulator in (both, whole):
        simulator.solve_static()
    assert both.positions == pytest.approx(whole.positions, abs=1e-7 * LENGTH)


@pytest.mark.parametrize("stations", [11, 21, 34])
def test_a_moment_turns_a_strip_with_a_patch_by_the_flexibilities_of_its_parts(stations):
    moment = 1e-4
    load = {"name": "m", "body": "end", "moment": [0, moment, 0]}
    held = rod(
        [layer("low"), layer("top", interval=[BEGIN, END])], LENGTH, stations, clamp_start="wall", clamp_end="end"
    )
    end = {"name": "end", "position": [LENGTH, 0, 0], "motion": {"type": "free", "mass": 0.0}}
    content = scene([held], bodies=[fixed(), end], loads=[load])
    simulator = Simulator(load_scene(content), model="laminate", dimension=2)
    one, two = (MODULUS * WIDTH * h**3 / 12 for h in (1e-3, 2e-3))
    between = moment * ((END - BEGIN) / two + (LENGTH - END + BEGIN - LENGTH / (stations - 1)) / one)
    assert turn(simulator) == pytest.approx(between, rel=2e-3)


def test_a_steep_profile_of_natural_curvature_has_its_area_at_every_mesh():
    curvature = {"at": [0.0, BEGIN - 1e-6, BEGIN, END, END + 1e-6, LENGTH], "value": [0, 0, 5.0, 5.0, 0, 0]}
    for model in ("laminate", "two_rod"):
        turns = [turn(strip(stations, None, model, natural_curvature=curvature)) for stations in (11, 34)]
        assert np.abs(turns) == pytest.approx(5.0 / 8.0 * (END - BEGIN), rel=1e-3)


def test_mass_of_a_layer_is_that_of_its_length():
    simulator = strip(11, interval=[BEGIN, END])
    assert simulator.model.rods.node_mass.sum() == pytest.approx(
        1000 * WIDTH * 1e-3 * (LENGTH + END - BEGIN), rel=1e-12
    )


def test_two_rods_say_where_a_layer_ends_for_them():
    said = [text for text in strip(11, model="two_rod", interval=[BEGIN, END]).plan.warnings if "two rods" in text]
    assert len(said) == 1 and "from 30 to 70 mm (interval: from 26 to 74 mm)" in said[0]
    assert not strip(11, model="two_rod", interval=[0.02, 0.07]).plan.warnings
    assert not strip(11, interval=[BEGIN, END]).plan.warnings


def test_faces_follow_the_end_of_a_layer():
    heights = [strip(11, interval=[0.0, end]).model.strands[0].thickness[5] for end in (0.04, 0.043, 0.049, 0.05)]
    assert heights == pytest.approx([1e-3, 1.3e-3, 1.9e-3, 2e-3])

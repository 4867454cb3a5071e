"""Patterns that are found from wanted shapes."""

import csv
import json
import math
import re
import signal
import subprocess

import numpy as np
import pytest
import yaml
from support.processes import command, environment

from bilayer_core import Simulator, design, load_scene
from bilayer_core.cli import main
from bilayer_core.cli.signals import WORDS
from bilayer_core.errors import InputError, SceneError, SimulationError
from bilayer_core.studies.shaping.shaped_rod import ShapedRod
from bilayer_core.studies.shaping.target_curve import TargetCurve, between, read_curve

GAIN = "rods.strip.layers.active.eigenstrain.gain"
HANGING, LENGTH = {"gravity": [0, 0, -9.81]}, 0.1
PLACES = np.linspace(0.0, LENGTH, 100)
PATTERN = 0.01 + 0.02 * np.sin(2.0 * np.pi * PLACES / LENGTH)


def curve_of(overrides, stimulus=1.0, scene="bending", channel="swelling", rod="strip"):
    """The curve between the strands of a strip, in equilibrium."""
    simulator = Simulator(load_scene(scene, overrides))
    simulator.set_stimulus(channel, stimulus)
    simulator.solve_static()
    strands = [strand.nodes for strand in simulator.description.strands if strand.rod == rod]
    return np.mean([simulator.positions[nodes] for nodes in strands], axis=0)


@pytest.fixture(scope="module")
def drawn():
    """What two rods with a known pattern make at four times the stations."""
    profile = {"at": PLACES.tolist(), "value": PATTERN.tolist()}
    return curve_of(HANGING | {"solver.model": "two_rod", "rods.strip.stations": 401, GAIN: profile})


def test_the_pattern_that_made_a_shape_is_found_in_few_equilibria(drawn):
    beam = HANGING | {"rods.strip.stations": 101, "rods.strip.section": "beam"}  # as those two rods are
    found = design(load_scene("bending", beam), drawn, {GAIN: (-0.05, 0.05, 100)})
    assert found.equilibria <= 6
    assert found.largest < 1e-3
    assert np.abs(found.values[0] - PATTERN).max() < 0.01 * np.abs(PATTERN).max()
    assert found.shapes[0].stable and found.at_bounds == 0


def test_the_scene_that_is_found_makes_the_shape_that_is_reported(drawn):
    found = design("bending", drawn, {GAIN: (-0.05, 0.05, 20)}, overrides=HANGING)
    own = found.scene.rods[0].layers[1].eigenstrain[0].gain
    again = curve_of(HANGING | {GAIN: {"at": own.at, "value": own.value}})
    assert np.abs(again - found.shapes[0].made).max() < 1e-9


def test_one_pattern_serves_two_shapes_at_two_stimuli():
    profile = {"at": [0, 0.05, 0.1], "value": [0.01, -0.02, 0.03]}
    levels = ({"swelling": 0.4}, {"swelling": 1.0})
    curves = [curve_of(HANGING | {GAIN: profile}, level["swelling"]) for level in levels]
    found = design("bending", curves, {GAIN: (-0.05, 0.05, 3)}, at=levels, overrides=HANGING)
    assert found.values[0] == pytest.approx(profile["value"], abs=1e-4)
    assert len(found.shapes) == 2


def film(**kind):
    """What makes a film become the U of an arc between two straight ends."""
    turn = math.pi * np.clip(np.linspace(-1.0, 2.0, 120), 0.0, 1.0)
    steps = np.stack([np.cos(turn), 0.0 * turn, np.sin(turn)], axis=1) * LENGTH / 119
    thin = {f"rods.strip.layers.{layer}.thickness": 0.2e-3 for layer in ("passive", "active")}
    return design("bending", np.cumsum(steps, axis=0), {GAIN: (-0.2, 0.2, 30)}, overrides=kind | thin)


@pytest.mark.parametrize(
    "kind",
    [
        HANGING | {"rods.strip.width": 2e-3},
        {"rods.strip.width": 10e-3},
        {"rods.strip.width": 40e-3},
        HANGING | {"rods.strip.width": 40e-3},
    ],
)
def test_a_film_that_sags_or_curls_across_on_the_way_becomes_a_u(kind):
    found = film(**kind)
    assert found.rms < 2e-4
    assert found.scene.rods[0].section == "auto" and found.scene.solver.model == "auto"


def test_the_report_says_whether_the_rod_comes_to_its_shape_from_the_start_of_the_scene(drawn):
    wide = film(**{"rods.strip.width": 40e-3})
    assert "but from the start of the scene the rod comes to another shape" in str(wide)
    simulator = Simulator(wide.scene)
    simulator.set_stimulus("swelling", 1.0)
    simulator.solve_static()
    assert np.abs(simulator.positions - wide.shapes[0].made).max() > 0.1 * LENGTH
    assert design("bending", drawn, {GAIN: (-0.05, 0.05, 20)}, overrides=HANGING).shapes[0].reached


def test_what_was_found_is_kept_where_the_sections_of_the_pattern_have_no_equilibrium(monkeypatch):
    built = ShapedRod.built

    def folding(self, *what):
        if "strip" in self.sections.values():
            raise SimulationError("folds", 0.0)
        return built(self, *what)

    monkeypatch.setattr(ShapedRod, "built", folding)
    found = film(**{"rods.strip.width": 20e-3})
    assert "no equilibrium is near with its own sections (rods.strip.section: strip" in found.termination
    assert found.rms < 2e-4 and found.shapes[0].stable and found.scene.rods[0].section == "beam"


def test_bounds_that_limit_a_shape_are_reported_with_the_distance():
    profile = {"at": [0, 0.1], "value": [0.03, 0.03]}
    found = design("bending", curve_of({GAIN: profile}), {GAIN: (-0.01, 0.01, 10)})
    assert found.at_bounds == 10
    assert found.largest > 0.05
    assert found.values[0] == pytest.approx(0.01)


def test_a_strip_lies_on_a_post_with_a_pattern_that_is_found_through_contact():
    post = {"name": "post", "type": "sphere", "radius": 0.005, "position": [0.03, 0, -0.0068]}
    touching = HANGING | {"obstacles": [post], "contact": {"barrier_distance": 2e-4, "stiffness": "1 MPa"}}
    wanted = curve_of(touching | {GAIN: {"at": [0, 0.05, 0.1], "value": [0.0, 0.01, 0.0]}})
    found = design("bending", wanted, {GAIN: (-0.03, 0.03, 3)}, overrides=touching)
    assert found.largest < 1e-4
    assert found.values[0] == pytest.approx([0.0, 0.01, 0.0], abs=1e-3)


def test_two_layers_make_the_rod_as_long_as_the_curve_and_one_says_what_is_left():
    turn = 0.5 * np.sin(np.linspace(0.0, 2.0 * math.pi, 60))
    curve = np.cumsum(np.stack([np.cos(turn), 0.0 * turn, np.sin(turn)], axis=1) * 0.107 / 59, axis=0)
    other, law = "rods.strip.layers.passive.eigenstrain", {"stimulus": "swelling", "gain": 0.01}
    both = design("bending", curve, {GAIN: (-0.1, 0.1, 20), f"{other}.gain": (-0.1, 0.1, 20)}, overrides={other: law})
    assert both.shapes[0].ends_apart < 5e-4 and both.rms < 1e-4
    one = design("bending", curve, {GAIN: (-0.1, 0.1, 20)})
    assert one.shapes[0].ends_apart > 5e-3 and one.rms < 1e-4
    assert f"ends {1e3 * one.shapes[0].ends_apart:.3g} mm apart" in str(one)


def test_a_shape_at_a_stimulus_at_which_nothing_acts_is_told_as_unreachable():
    levels = [{"swelling": 1.0}, {"swelling": 0.0}]
    found = design("bending", [straight(0.1)] * 2, {GAIN: (-0.05, 0.05, 5)}, at=levels, overrides=HANGING)
    assert re.search(r"unreachable: 3\.\d+ mm at swelling = 0, where nothing that varies moves", found.termination)


def test_thickness_of_a_layer_is_a_pattern_too():
    wanted = curve_of({"rods.strip.layers.active.thickness": 1.3e-3})
    found = design("bending", wanted, {"rods.strip.layers.active.thickness": (0.5e-3, 2e-3)})
    assert found.values[0] == pytest.approx([1.3e-3], rel=1e-2)


def test_angles_of_fibres_along_a_ribbon_that_made_a_curve_in_space_are_found():
    """Which lies flat at first, so that its plane is left."""
    angle, only = "rods.ribbon.layers.lower.fibres.angle", "rods.ribbon.layers.upper"
    ribbon = {f"{only}.fibres": None, f"{only}.eigenstrain": None, "rods.ribbon.width": 2e-3} | {
        "rods.ribbon.stations": 31,
        "rods.ribbon.path.length": 0.05,
        angle: "90 deg",
    }
    made = np.radians([70.0, 95.0, 120.0, 100.0])
    profile = {"at": [0, 0.015, 0.035, 0.05], "value": made.tolist()}
    curve = curve_of(ribbon | {angle: profile}, 1.0, "helical_ribbon", "humidity", "ribbon")
    flat = ribbon | {angle: profile | {"value": [math.pi / 2.0] * 4}}
    found = design("helical_ribbon", curve, [f"{angle}=45 deg:135 deg"], overrides=flat)
    assert found.rms < 1e-6
    assert found.values[0] == pytest.approx(made, abs=math.radians(0.1))


@pytest.mark.slow
def test_a_ribbon_winds_to_a_helix_on_a_cone_whose_turns_do_not_draw_its_end_away():
    s = np.linspace(0.0, 1.0, 400)
    radius = 1.002 * (0.02 - 0.012 * s)
    curve = np.stack([radius * np.cos(4 * np.pi * s), radius * np.sin(4 * np.pi * s), 0.0501 * s], axis=1)
    first, then = np.diff(curve[:3], axis=0)
    first /= np.linalg.norm(first)
    then -= (then @ first) * first
    frame = np.stack([first, np.cross(then, first), then])
    frame /= np.linalg.norm(frame, axis=1, keepdims=True)
    curve = (curve - curve[0]) @ frame.T  # along the ribbon, and first towards its normal
    gains = {f"rods.ribbon.layers.{layer}.eigenstrain.gain": (-0.06, 0.06, 40) for layer in ("lower", "upper")}
    ribbon = {"rods.ribbon.path.length": TargetCurve(curve).length, "rods.ribbon.width": 2e-3}
    angles = {f"rods.ribbon.layers.{of}.fibres.angle": f"{d} deg" for of, d in (("lower", -45), ("upper", 45))}
    found = design("helical_ribbon", curve, gains, overrides=ribbon | angles)
    assert found.rms < 3e-3 and found.shapes[0].ends_apart < 0.05 * found.size


def test_all_arms_of_a_swimmer_get_the_pattern_of_the_first_on_a_floating_hub():
    path, gains = "rods.arm.layers.active.eigenstrain.gain", [0.01, 0.03, 0.02]
    profile = {"at": [0.0, 0.05, 0.1], "value": gains}
    wanted = curve_of({path: profile}, 1.0, "swimming", "light", "arm_0")
    found = design("swimming", wanted, {path: (0.0, 0.1)}, overrides={path: profile | {"value": [0.05] * 3}})
    assert found.values[0] == pytest.approx(gains, abs=1e-5)
    assert found.largest < 1e-5 and found.shapes[0].reached
    assert "of arm_0, the first of 8 copies, from the target" in str(found)


def test_a_curve_turns_with_the_body_that_holds_the_rod():
    hinge = {"type": "guided", "hinge": [0, 1, 0], "turning": {"spring": 2.5e-3}}
    sprung = HANGING | {"bodies": [{"name": "wall", "position": [0, 0, 0], "motion": hinge}]}
    profile = {"at": [0, 0.05, 0.1], "value": [0.01, -0.02, 0.03]}
    simulator = Simulator(load_scene("bending", sprung | {GAIN: profile}))
    simulator.set_stimulus("swelling", 1.0)
    simulator.solve_static()
    curve, turned = simulator.positions, simulator._now.body_rotation[0]
    assert math.acos(turned[0, 0]) > math.radians(15.0)
    wanted = curve @ turned  # as the wall sees it
    found = design("bending", wanted, {GAIN: (-0.05, 0.05, 3)}, overrides=sprung)
    assert found.values[0] == pytest.approx(profile["value"], abs=1e-4)
    assert found.largest < 1e-4 and found.equilibria <= 10
    assert np.abs(found.shapes[0].target.points - curve).max() < 1e-3 * LENGTH  # drawn where the rod is


def test_the_first_rod_that_a_path_names_is_shaped():
    along, across = (f"rods.{name}.layers.active.eigenstrain.gain" for name in ("along", "across"))
    wanted = curve_of({along: 0.004}, 1.0, "films", "humidity", "along")
    assert design("films", wanted, {"gravity.2": (-1.0, 1.0), along: (0.0, 0.01)}).rms < 1e-4
    with pytest.raises(InputError, match="rods.across.*gain: acts on nothing of rods.along at these stimuli"):
        design("films", wanted, {along: (0.0, 0.01), across: (0.0, 0.01)})
    with pytest.raises(InputError, match=r"vary gravity\.2: names none of the rods along, all_around, across; the fir"):
        design("films", wanted, {"gravity.2": (-1.0, 1.0)})


def test_pieces_of_a_palette_that_made_a_shape_are_found():
    made = [0.0, 0.02, -0.02, 0.02, 0.02, 0.0, -0.02, 0.0]
    ends = np.repeat(np.linspace(0.0, LENGTH, 9), 2)[1:-1] + np.tile([1e-6, -1e-6], 8)
    wanted = curve_of(HANGING | {GAIN: {"at": ends.tolist(), "value": np.repeat(made, 2).tolist()}})
    found = design("bending", wanted, [f"{GAIN}=2%,-2%,0:8"], overrides=HANGING)
    assert found.values[0].tolist() == pytest.approx(made)
    assert found.largest < 1e-3 and found.at_bounds == 0


def test_pieces_of_two_materials_come_near_a_shape_that_needs_others(drawn):
    found = design("bending", drawn, {GAIN: ([-0.05, 0.05], 50)}, overrides=HANGING)
    assert set(found.values[0]) == {-0.05, 0.05}
    assert found.rms < 0.01
    gain = found.scene.rods[0].layers[1].eigenstrain[0].gain
    assert np.abs(curve_of(HANGING | {GAIN: {"at": gain.at, "value": gain.value}}) - found.shapes[0].made).max() < 1e-9


def test_more_pieces_of_a_palette_than_stations_come_nearer_than_few(drawn):
    few, many = (design("bending", drawn, [f"{GAIN}=-5%,0,5%:{pieces}"], overrides=HANGING) for pieces in (20, 100))
    assert many.rms < 0.2 * few.rms


@pytest.mark.slow
@pytest.mark.parametrize("pieces", [8, pytest.param(10, marks=pytest.mark.verify)])
def test_a_palette_beside_thickness_that_varies_comes_no_less_near_than_alone(drawn, pieces):
    alone = [f"{GAIN}=-10%,0,10%:{pieces}"]
    films = [*alone, "rods.strip.layers.active.thickness=0.8mm:1.5mm:3"]
    few, more = (design("bending", drawn, vary, overrides=HANGING) for vary in (alone, films))
    assert set(more.values[0]) <= {-0.1, 0.0, 0.1}
    assert more.rms < few.rms


def test_a_search_that_is_stopped_has_a_pattern_of_the_palette(drawn):
    calls = iter([False, False, True])
    found = design("bending", drawn, [f"{GAIN}=-5%,0,5%:50"], overrides=HANGING, interrupted=lambda: next(calls))
    assert found.termination.startswith("stopped") and set(found.values[0]) <= {-0.05, 0.0, 0.05}
    assert found.rms < 0.05


def test_a_layer_takes_the_film_next_to_the_thickness_that_is_best():
    path = "rods.strip.layers.active.thickness"
    found = design("bending", curve_of({path: 1.3e-3}), [f"{path}=1mm,1.25mm,2mm"])
    assert found.values[0] == pytest.approx([1.25e-3])
    assert "without it" in found.termination


def test_an_error_of_one_percent_moves_the_rod_as_reported(drawn):
    found = design("bending", drawn, {GAIN: (-0.05, 0.05, 20)}, overrides=HANGING)
    own = found.scene.rods[0].layers[1].eigenstrain[0].gain
    more = curve_of(HANGING | {GAIN: {"at": own.at, "value": [1.01 * gain for gain in own.value]}})
    moved = np.linalg.norm(more - found.shapes[0].made, axis=1).max()
    assert found.sensitivity[GAIN] == pytest.approx(moved, rel=0.02)
    path = "rods.strip.layers.passive.thickness"
    thicker = curve_of(HANGING | {GAIN: {"at": own.at, "value": own.value}, path: 1.01e-3})
    moved = np.linalg.norm(thicker - found.shapes[0].made, axis=1).max()
    assert found.sensitivity[path] == pytest.approx(moved, rel=0.05)


def test_a_drawn_curve_has_the_length_and_the_departures_of_its_circle():
    angle = np.linspace(0.0, math.pi, 40) ** 2 / math.pi  # uneven
    circle = TargetCurve(np.stack([np.sin(angle), 0.0 * angle, 1.0 - np.cos(angle)], axis=1))
    assert circle.length == pytest.approx(math.pi, rel=1e-4)
    beside = np.array([[1.2 * math.sin(1.0), 0.3, 1.0 - 1.2 * math.cos(1.0)]])
    ways, tangents = circle.departures(beside, np.array([1.3]))
    assert np.linalg.norm(ways) == pytest.approx(math.hypot(0.2, 0.3), rel=1e-3)
    assert tangents[0] == pytest.approx([math.cos(1.0), 0.0, math.sin(1.0)], abs=1e-3)


def test_shapes_on_the_way_to_a_helix_go_from_the_start_to_the_target():
    s = np.linspace(0.0, 1.0, 200)
    straight = np.stack([s, 0.0 * s, 0.0 * s], axis=1)
    helix = np.stack([s / 2.0**0.5, 0.1 * np.sin(s / 0.1414), 0.1 - 0.1 * np.cos(s / 0.1414)], axis=1)
    target = TargetCurve(helix)
    ends = [between(straight, target, part) for part in (0.0, 1.0)]
    assert np.abs(ends[0].points - straight).max() < 1e-9
    assert np.abs(ends[1].points - target.at(s * target.length)).max() < 0.02


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], "must be 4 points or more"),
        ([[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]], "point 3 is that before it"),
        ([[0, 0, 0], [1, 0, 0], [2, math.nan, 0], [3, 0, 0]], "point 3 is 2, nan, 0; must be finite"),
        ([[0, 0, 0], [1e200, 0, 0], [2e200, 0, 0], [3e200, 0, 0]], r"point 2 is 1e\+200, 0, 0; .* at most 1e\+06"),
        ([[0, 0, 0], [1, 0, 0], [1, 0, 1], [1, 0, 2]], "has a kink at point 2 .* where it turns by 90°"),
    ],
)
def test_what_is_no_smooth_curve_is_refused(points, message):
    with pytest.raises(InputError, match=message):
        TargetCurve(np.array(points, dtype=float))


def straight(length, direction=(1.0, 0.0, 0.0)):
    return np.linspace(0.0, length, 20)[:, None] * np.array(direction)


def aside(radius):
    turn = np.linspace(0.0, 1.0, 20)
    return radius * np.stack([np.sin(turn), 1.0 - np.cos(turn), 0.0 * turn], axis=1)


@pytest.mark.parametrize(
    ("target", "vary", "message"),
    [
        (straight(0.2), {GAIN: (-0.1, 0.1)}, "is 200 mm long; .* the rod becomes 95 to 105 mm long"),
        (straight(0.05), {GAIN: (-0.1, 0.1)}, "is 50 mm long; .* the rod becomes 95 to 105 mm long"),
        (aside(0.1), {GAIN: (-0.1, 0.1)}, "leaves its plane by 45.97 mm, in which the rod stays"),
        (straight(0.1, (0.0, 0.0, 1.0)), {GAIN: (-0.1, 0.1)}, "begins 90° from the direction in which the rod begins"),
        (straight(0.1), {"rods.strip.width": (1e-3, 2e-3)}, "vary rods.strip.width: acts on nothing"),
        (straight(0.1), {}, "vary: nothing is given"),
        (straight(0.1), {GAIN: (0.1, -0.1)}, "the lower bound 0.1 must be below the upper one"),
        (straight(0.1), {GAIN: (-0.1, 0.1, 1)}, "1 points are not allowed; it must be a whole number from 2 to 500"),
        (straight(0.1), [f"{GAIN}=1%,2%:5000"], "5000 points are not allowed"),
        (
            straight(0.1),
            [f"{GAIN}=0:1%:5", f"{GAIN}=0:2%:5"],
            "vary rods.strip.layers.active.eigenstrain.gain: is given twice",
        ),
        (
            [straight(0.1)],
            [f"{GAIN}=0:1%:5", "rods.0.layers.1.eigenstrain.gain=0:2%:5"],
            "twice, as rods.strip.layers.a",
        ),
        (straight(0.1), [f"{GAIN}=1%,1%:9"], "a palette must have two values or more"),
        (straight(0.1), [f"{GAIN}=1%,thick:9"], "gain: .*thick"),
        (straight(0.1), [f"{GAIN}=1%,2%:9:3"], "must be PATH=LO:HI, .* or PATH=V,V,…:PIECES"),
        (straight(0.1), {"gravity.2": (-1.0, 1.0, 5)}, "points need a number of a rod"),
        (straight(0.1), {"rods.strip.layers.active.gain": (0, 1)}, "vary rods.strip.layers.active.gain: there is no"),
        (straight(0.1), {"rods.strip.path.length": (0.1, 0.2, 5)}, "cannot vary along the rod, leave out :5: "),
        ([straight(0.1)] * 2, {GAIN: (-0.1, 0.1)}, "2 curves need values of stimuli each, 0 are given"),
    ],
)
def test_bad_input_of_a_design_is_refused(target, vary, message):
    with pytest.raises((InputError, SceneError), match=message):
        design("bending", target, vary)


def test_a_width_that_cancels_from_bending_under_weight_acts_on_nothing():
    with pytest.raises(InputError, match="vary rods.strip.width: acts on nothing"):
        design("bending", straight(0.1), {"rods.strip.width": (5e-3, 20e-3)}, overrides=HANGING)


@pytest.mark.parametrize("smoothness", [math.nan, math.inf, -1.0])
def test_a_smoothness_that_is_no_weight_is_refused(smoothness):
    with pytest.raises(InputError, match="smoothness: .* must be a finite number from 0 up"):
        design("bending", straight(0.1), {GAIN: (-0.1, 0.1)}, smoothness=smoothness)


def test_a_rod_that_nothing_holds_is_refused():
    with pytest.raises(InputError, match="begin where the rod does, which nothing holds: clamp_start"):
        design("bending", straight(0.1), {GAIN: (-0.1, 0.1, 3)}, overrides={"rods.strip.clamp_start": None})


def test_a_direction_in_which_nothing_moves_the_rod_is_named():
    found = design("bending", aside(0.1), {GAIN: (-0.1, 0.1)}, overrides={"solver.dimension": 3})
    assert re.search(r"unreachable: \d\d.* mm along \(0, 1, 0\)", found.termination)


def test_two_shapes_at_the_same_stimuli_are_refused():
    with pytest.raises(InputError, match="two curves are wanted at the same stimuli"):
        design("bending", [straight(0.1)] * 2, {GAIN: (-0.1, 0.1)}, at=[{"swelling": 1.0}] * 2)


def test_blanks_after_commas_of_a_curve_are_no_part_of_its_columns(tmp_path):
    (tmp_path / "curve.csv").write_text("x, y, z\n0, 0, 0\n1, 0, 0\n2, 0, 0\n3, 0, 0\n")
    assert read_curve(tmp_path / "curve.csv").length == pytest.approx(3.0)


def test_the_command_writes_scene_pattern_report_and_picture(tmp_path, capsys):
    wanted = curve_of({GAIN: {"at": [0, 0.1], "value": [0.0, 0.03]}})
    with open(tmp_path / "curve.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow("xyz")
        rows.writerows(wanted.tolist())
    out = tmp_path / "made"
    arguments = ["design", "bending", "--target", str(tmp_path / "curve.csv"), "--target-at", "swelling=1"]
    assert main([*arguments, "--vary", f"{GAIN}=-5%:5%:6", "--out", str(out), "--quiet"]) == 0
    assert "the rod 100" in capsys.readouterr().out
    scene = yaml.safe_load((out / "designed.yaml").read_text())
    value = scene["rods"][0]["layers"][1]["eigenstrain"]["gain"]["value"]
    with open(out / "pattern.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["value"]) for row in rows] == value == pytest.approx(np.linspace(0.0, 0.03, 6), abs=5e-4)
    assert (out / "report.json").exists() and (out / "design.png").stat().st_size > 10_000


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_search_that_a_signal_stops_writes_the_best_pattern_so_far(tmp_path, number):
    turn = np.pi * np.clip(np.linspace(-1.0, 2.0, 120), 0.0, 1.0)
    steps = np.stack([np.cos(turn), 0.0 * turn, np.sin(turn)], axis=1) * LENGTH / 119
    curve = tmp_path / "curve.csv"
    np.savetxt(curve, np.cumsum(steps, axis=0), delimiter=",", header="x,y,z", comments="")
    vary = ["--vary", f"{GAIN}=-10%,0,10%:30", "--vary", "rods.strip.layers.active.thickness=0.5mm:2mm:30"]
    arguments = command("design", "bending", "--target", str(curve), *vary, "--out", str(tmp_path / "made"))
    search = subprocess.Popen(arguments, env=environment(), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    for line in search.stderr:
        if "rms distance" in line:
            break
    search.send_signal(number)
    out, err = search.communicate(timeout=120)
    assert search.returncode == 128 + number and err.endswith(f"bilayer: {WORDS[number]}\n")
    assert "stopped; this is the best pattern so far" in out
    report = json.loads((tmp_path / "made" / "report.json").read_text())
    assert report["termination"].startswith("stopped")
    assert set(report["pattern"][GAIN]["value"]) <= {-0.1, 0.0, 0.1}
    assert load_scene(tmp_path / "made" / "designed.yaml").rods[0].layers[1].eigenstrain[0].gain.value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "must have columns x, y and z"),
        ("x,y,z,x\n1,2,3,4\n", "each once; its first line has: .*'z', 'x'"),
        ("x,y,z\n", "must be 4 points or more"),
        ("x,y,z\n1,2,\n", "line 2: must have three numbers"),
    ],
)
def test_a_file_that_holds_no_curve_is_refused(tmp_path, text, message):
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_curve(tmp_path / "curve.csv")

"""Two bonded rods where a layer ends: at free ends, and where it covers a part of the path."""

from dataclasses import replace

import numpy as np
import pytest
from support.evaluations import Problem, at_rest, check
from support.planar_scenes import AHEAD, HUBS, everything_in_plane
from support.records_by_hand import changed
from support.sample_scenes import everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.model.build_model import build_model
from bilayer_core.verification.validate.bending import THICKNESS, strip
from bilayer_core.verification.validate.closed_forms import timoshenko
from bilayer_core.verification.validate.ends import PAIRS, beam, patched
from bilayer_core.verification.validate.profiles import linear

HEAT = {"heat": {"schedule": {"type": "hold", "value": 1}}}
GROWTH = {"stimulus": "heat", "gain": 0.01}


def settled(content, model="two_rod", dimension=2):
    simulator = Simulator(load_scene(content), model=model, dimension=dimension)
    simulator.solve_static()
    return simulator


def two_layers(changes, stations=41, length=0.05, **more):
    """A clamped strip of 1.4 mm and 0.6 mm; `changes` of its bottom and top layer."""
    bottom, top = layer("bottom", thickness=1.4e-3) | changes[0], layer("top", thickness=0.6e-3) | changes[1]
    clamped = rod([bottom, top], length=length, stations=stations, clamp_start="wall", **more)
    return scene([clamped], bodies=[fixed()], stimuli=HEAT)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("free", ["start", "end"])
@pytest.mark.parametrize(("m", "n"), PAIRS)
def test_nodes_beside_a_free_end_have_timoshenkos_curvature_in_both_layers(m, n, free, dimension):
    content, beside = strip(m, n, 0.01), slice(-8, -1)
    if free == "start":
        content["rods"][0]["clamp_end"] = content["rods"][0].pop("clamp_start")
        content["bodies"], beside = [fixed(position=(0.05, 0, 0))], slice(1, 8)
    chi = settled(content, dimension=dimension).curvatures.reshape(2, -1)[:, beside]
    assert -chi * THICKNESS / 0.01 == pytest.approx(np.full((2, 7), timoshenko(m, n)), rel=2e-4)


def test_a_mesh_finer_than_the_layers_are_thick_is_right_beside_an_end():
    chi = settled(strip(3.3, 6.7, 0.01, 501)).curvatures.reshape(2, -1)[:, -8:-1]
    assert -chi * THICKNESS / 0.01 == pytest.approx(np.full((2, 7), timoshenko(3.3, 6.7)), rel=2e-4)


@pytest.mark.parametrize("stations", [21, 41, 161])
@pytest.mark.parametrize(("m", "n"), PAIRS)
def test_a_patch_turns_its_strip_by_its_curvature_times_its_length_at_every_mesh(m, n, stations):
    found, expected = patched(m, n, 2, stations), beam(m, n)
    per_edge = expected[0] / (0.1 * (stations - 1))
    chord = per_edge**2 / 12.0  # κ l = 2 tan(Δ/2) for the angle Δ between two edges
    assert found[0] == pytest.approx(expected[0], rel=2e-5 + chord)
    assert found[1] == pytest.approx(expected[1], rel=2e-5 + 2.0 * chord)


@pytest.mark.parametrize("covering", ["bottom", "top"])
@pytest.mark.parametrize("part", [[0.01, 0.02], [0.0, 0.02], [0.03, 0.05]])
@pytest.mark.parametrize("path", ["straight", "arc"])
def test_a_layer_on_a_part_bends_the_other_as_in_one_curve(covering, part, path):
    changes = [{}, {"interval": part, "eigenstrain": GROWTH}]
    content = two_layers(changes if covering == "bottom" else changes[::-1])
    if path == "arc":
        arc = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.02, "angle": 2.0}
        content["rods"][0]["path"] = arc
        part = [0.8 * s for s in part]  # of 40 mm
        content["rods"][0]["layers"][covering == "bottom"]["interval"] = part
    ends = []
    for model in ("two_rod", "laminate"):
        simulator = settled(content, model)
        slot = 0 if model == "laminate" else ("bottom", "top").index(covering)
        strand = simulator.model.strands[slot]
        start = simulator.model.start_position[strand.first_node + 40]
        ends.append(simulator.positions[strand.first_node + 40] - start)
    assert ends[0] == pytest.approx(ends[1], abs=5e-4 * np.abs(ends[1]).max())


@pytest.mark.parametrize("torsion", ["layers", "laminate"])
def test_a_layer_with_natural_twist_turns_its_part_of_a_strip_at_every_mesh(torsion):
    turns = []
    for stations, model in ((21, "laminate"), (21, "two_rod"), (81, "two_rod")):
        changes = [{}, {"interval": [0.02, 0.03], "natural_twist": 8.0}]
        simulator = settled(two_layers(changes, stations, torsion=torsion), model, 3)
        m1 = simulator.frame().directors[stations - 2]
        turns.append(np.arctan2(-m1[1], m1[2]))
    assert abs(turns[0]) > 1e-3
    assert turns[1:] == pytest.approx([turns[0]] * 2, rel=1e-4)


def test_natural_curvature_bends_all_nodes_alike():
    chi = settled(two_layers([{}, {"natural_curvature": 60.0}])).curvatures[:40]
    one_curve = settled(two_layers([{}, {"natural_curvature": 60.0}]), "laminate").curvatures[0]
    assert chi == pytest.approx(np.full(40, one_curve), rel=1e-4)


def test_the_tip_converges_at_second_order_where_curvature_varies():
    tips = []
    for stations in (21, 41, 81, 161):
        changes = [{}, {"natural_curvature": linear(100.0, 900.0)}]
        tips.append(settled(two_layers(changes, stations, 0.1)).positions[stations - 1])
    steps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    assert np.log2(steps[:-1] / steps[1:]) == pytest.approx([2.0, 2.0], abs=0.15)


def test_a_strip_that_bends_by_itself_has_no_shear_between_its_layers_at_the_ends():
    content = strip(1.0, 1.0, 0.01)
    simulator = settled(content)
    model, x = simulator.model, simulator.positions
    top0, top1, bottom0, bottom1 = (x[nodes] for nodes in model.bonds.node[:40].T)
    edges = np.array([model.rods.joint_a, model.rods.joint_b])[:, model.bonds.joint[:40]]
    tangent = np.diff(x, axis=0)[model.rods.edge_node[edges]].mean(axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    slip = np.einsum("ki,ki->k", 0.5 * (top0 + top1 - bottom0 - bottom1), tangent)
    assert np.abs(slip).max() < 1e-3 * 0.01 * model.rods.rest_length[0]


def ends_alone(model):
    """The model in which nothing bends or twists but the ends of layers."""
    assert len(model.bonds.joint) > len(model.rods.joint_a) - model.rods.bend_count
    return replace(model, rods=changed(model.rods, joint_stiffness=0.0 * model.rods.joint_stiffness))


@pytest.mark.parametrize("seed", [0, 1])
def test_derivatives_of_ends_agree_with_differences_in_space(seed):
    problem = Problem(everything(), np.random.default_rng(seed), change=ends_alone)
    model = problem.model
    rods = model.rods
    before = rods.edge_node[rods.joint_a[model.bonds.joint[len(rods.joint_a) - rods.bend_count :]]]
    assert np.isin(before, model.constrained.node).any()  # beside a clamp
    for force in ("bending", "twisting"):
        check(problem, (force,))
        assert problem.terms[force] > 0.0


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
def test_derivatives_of_ends_agree_with_differences_in_a_plane(ahead, hub):
    content = everything_in_plane(AHEAD[ahead], hub)
    problem = Problem(content, np.random.default_rng(2), dimension=2, change=ends_alone)
    check(problem, ("bending",))
    assert problem.terms["bending"] > 0.0


def test_a_clamp_bends_the_half_edge_beside_it_with_its_own_joint():
    layers = [layer("bottom"), layer("top")]
    walls = [fixed(), fixed("other", (0.1, 0, 0))]
    clamped = scene([rod(layers, clamp_start="wall", clamp_end="other")], bodies=walls)
    model = build_model(load_scene(clamped))
    assert len(model.bonds.joint) == len(model.rods.joint_a) - model.rods.bend_count


def test_tapered_layers_start_without_stress_at_their_ends():
    layers = [
        layer("bottom", thickness=linear(1e-3, 2e-3)),
        layer("top", thickness=linear(2e-3, 0.5e-3), interval=[0.02, 0.07]),
    ]
    evaluator, start = at_rest(build_model(load_scene(scene([rod(layers)]))), 1e-3)
    assert evaluator.forces(start, ("bending",))["bending"] < 1e-20

"""One curve for both layers: against closed forms, the planar beam, and two bonded rods."""

import numpy as np
import pytest
from support.evaluations import dense
from support.sample_scenes import GEL, GROUND, contact, everything, fixed, layer, rod, scene

import bilayer_core.model.laminate as laminate
from bilayer_core import Simulator, load_scene
from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.model.build_model import build_model
from bilayer_core.model.contact_points import start_contact_points
from bilayer_core.model.plan import make_plan, simplest_model
from bilayer_core.verification.beam2d.scene import beam_of, set_stimuli
from bilayer_core.verification.validate.bending import PAIRS, THICKNESS, strip
from bilayer_core.verification.validate.closed_forms import timoshenko

ELASTIC = ("stretching", "bending", "twisting")
HEAT = {"heat": {"schedule": {"type": "hold", "value": 1}}}


def settled(content, model="laminate", **more):
    simulator = Simulator(load_scene(content), model=model, **more)
    simulator.solve_static()
    return simulator


def growing(gain=0.05, **more):
    return layer("top", eigenstrain={"stimulus": "heat", "gain": gain}, **more)


@pytest.mark.parametrize(("m", "n"), PAIRS)
def test_every_node_has_timoshenkos_curvature(m, n):
    chi = settled(strip(m, n, 0.05)).curvatures
    assert -chi * THICKNESS / 0.05 == pytest.approx(np.full(len(chi), timoshenko(m, n)), rel=1e-10)


@pytest.mark.parametrize("height", [-1e-3, 0.3e-3])
def test_curvature_and_faces_do_not_depend_on_where_the_curve_lies(height, monkeypatch):
    content = strip(2.0, 0.5, 0.05)
    on_axis = settled(content)
    monkeypatch.setattr(laminate, "_axis_of", lambda *_: height)
    beside = settled(content)
    assert len(on_axis.model.off_axis.joint) == 0 < len(beside.model.off_axis.joint)
    assert beside.curvatures == pytest.approx(on_axis.curvatures, rel=1e-9)

    strands = [simulator.description.strands[0] for simulator in (on_axis, beside)]
    assert strands[0].thickness == pytest.approx(strands[1].thickness)
    ends = [
        simulator.positions[-1] + strand.offset[-1] * simulator.frame().directors[-1]
        for simulator, strand in zip((on_axis, beside), strands, strict=True)
    ]
    turn = 0.5 * 0.05 / 40 * abs(on_axis.curvatures[0])  # from the last edge to the end of the arc
    apart = abs(strands[0].offset[-1] - strands[1].offset[-1])
    assert np.linalg.norm(ends[0] - ends[1]) < 1.05 * turn * apart


@pytest.mark.parametrize("natural_curvature", [None, 10.0])
def test_wherever_the_curve_of_an_arch_lies_its_joints_have_the_same_angles(natural_curvature, monkeypatch):
    layers = [layer("bottom", natural_curvature=natural_curvature), growing(0.02, thickness=2e-3, natural_twist=3.0)]
    arc = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.02, "angle": 2.0}
    content = scene([rod(layers, stations=41, clamp_start="wall") | {"path": arc}], bodies=[fixed()], stimuli=HEAT)
    on_axis = settled(content)._stepper.engine.end.joint_strain
    monkeypatch.setattr(laminate, "_axis_of", lambda *_: -1e-3)
    beside = settled(content)._stepper.engine.end.joint_strain
    limits = np.array([2e-6, 1e-12, 1e-12])  # nodes are on the offset arc, not at the corners of the offset polygon
    assert np.all(np.abs(beside - on_axis).max(axis=0) < limits * np.abs(on_axis).max())


def test_a_strip_under_its_weight_agrees_with_the_planar_beam_of_appendix_a():
    content = strip(2.0, 0.5, 0.01) | {"gravity": [0, 0, -9.81]}
    content["materials"]["base"]["density"] = 4e3  # the mass centre lies on the interface, where the beam has its mass
    differences = []
    for stations in (21, 41):
        content["rods"][0]["stations"] = stations
        config = load_scene(content)
        beam = beam_of(config)
        set_stimuli(beam, config, {"heat": 1.0})
        beam.solve_static()
        simulator = settled(content)
        normal = simulator.frame().directors[-1, [0, 2]]
        interface = simulator.positions[-1, [0, 2]] + simulator.model.strands[0].offset[-1] * normal
        bottom, top = (part["thickness"] for part in content["rods"][0]["layers"])
        interface += 0.5 * (bottom - top) * normal
        differences.append(np.abs(interface - beam.position[-1]).max())
    assert differences[1] < 0.5 * differences[0] < 1e-5


def test_a_layer_on_a_part_bends_that_part_alone_as_two_rods_do():
    part = [0.03, 0.05]

    def strip_of(stations):
        short = growing(0.02, interval=part)
        rods = [rod([layer("bottom"), short], stations=stations, clamp_start="wall")]
        return scene(rods, bodies=[fixed()], stimuli=HEAT)

    simulator = settled(strip_of(51))
    assert 0 < len(simulator.model.off_axis.joint) < 15  # the curve is that of the long, single part
    chi = simulator.curvatures
    assert chi[16:25] == pytest.approx(np.full(9, -1.5 * 0.02 / 2e-3), rel=1e-9)
    assert np.abs(np.delete(chi, range(15, 26))).max() < 1e-7  # where Newton's method ends
    lengths = simulator.model.voronoi_length
    turned = chi[simulator.model.joint_node] @ lengths
    assert turned == pytest.approx(-1.5 * 0.02 / 2e-3 * (part[1] - part[0]), rel=1e-9)
    tangent = np.diff(settled(strip_of(51), "two_rod").positions[:51], axis=0)[-1]
    assert np.arctan2(tangent[2], tangent[0]) == pytest.approx(turned, rel=1e-4)


def test_the_elastic_energy_has_no_direction_that_costs_nothing_but_rigid_motions():
    content = scene([rod([layer("bottom"), growing(0.02, interval=[0.02, 0.06])], stations=21)], stimuli=HEAT)
    simulator = settled(content)
    assert simulator.solve_static().stable
    model, evaluator = simulator.model, Evaluator(simulator.model)
    at = evaluator.new()
    evaluator.take_state(simulator._state, at)
    strains = evaluator.rest_strains_of(simulator._state.transduction)
    evaluator.stand_still(simulator._state, at, 1.0, strains.edge, strains.joint, np.zeros(0))
    evaluator.start_stage(at)
    evaluator.evaluate(at, ELASTIC, second=True)
    hessian = dense(evaluator.assemble(at)[0], model.layout.size)
    scale = np.ones(model.layout.size)
    scale[model.layout.edge] = 1 / 5e-3
    values = np.linalg.eigvalsh(hessian * np.outer(scale, scale))
    assert np.count_nonzero(values < 1e-7 * values[-1]) == 6


def test_a_curved_strip_starts_without_stress_and_changes_its_curvature_as_two_rods_do():
    def arch(gain):
        strip_of = rod([layer("bottom"), growing(gain, thickness=2e-3)], stations=41, clamp_start="wall")
        arc = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.02, "angle": 2.0}
        return scene([strip_of | {"path": arc}], bodies=[fixed()], stimuli=HEAT)

    still = Simulator(load_scene(arch(0.0)), model="laminate")
    start = still.positions.copy()
    still.run(0.01)
    assert np.abs(still.positions - start).max() < 1e-12
    one, two = (settled(arch(0.02), model).curvatures for model in ("laminate", "two_rod"))
    # per length of either curve: that of the bottom layer is 4 % shorter than the laminate's
    along = np.linalg.norm(np.diff(still.positions, axis=0), axis=1).sum() / 0.04
    bottom = 1.0 + 0.5e-3 / 0.02
    assert one[20] * along == pytest.approx(two[20] * bottom, rel=2e-3)


def test_natural_curvature_and_twist_are_means_weighted_with_stiffness():
    layers = [layer("bottom", natural_curvature=12.0, natural_twist=6.0), layer("top", material="stiff")]
    content = scene(
        [rod(layers, torsion="layers", clamp_start="wall")],
        bodies=[fixed()],
        materials={"gel": GEL, "stiff": {**GEL, "youngs_modulus": 3e8}},
    )
    simulator = settled(content)
    # about the axis at y₀ = ±1/4 mm: D = Σ EI + EA z², with E = 1 : 3
    bending = sum(e * (1 / 12 + z**2) for e, z in ((1.0, 0.75), (3.0, 0.25)))
    assert simulator.curvatures == pytest.approx(np.full(21, 12.0 / 12 / bending), rel=1e-9)
    joints = simulator._stepper.engine.end.joint_strain[:, 2] / simulator.model.voronoi_length
    assert joints == pytest.approx(np.full(20, 6.0 / 4.0), rel=1e-9)


def test_mass_and_its_centre_are_those_of_two_rods_point_masses_included():
    content = everything()
    one, two = (Simulator(load_scene(content), model=model) for model in ("laminate", "two_rod"))
    assert one.model.rods.node_mass.sum() == pytest.approx(two.model.rods.node_mass.sum(), rel=1e-12)
    assert one.com == pytest.approx(two.com, abs=1e-12)
    assert one.model.unknowns < 0.7 * two.model.unknowns


@pytest.mark.parametrize("place", [0.0, 0.013, 0.05, 0.0875, 0.1])
def test_a_point_mass_is_on_the_path_wherever_the_curve_of_a_laminate_lies(place):
    layers = [layer("bottom"), layer("top", thickness=3e-3)]
    mass = {"name": "cargo", "rod": "rod", "position": place, "mass": 2e-3}
    light, heavy = (Simulator(load_scene(scene([rod(layers)], masses=m)), model="laminate") for m in ([], [mass]))
    own = light.model.rods.node_mass.sum()
    expected = (own * light.com + 2e-3 * np.array([place, 0.0, 0.0])) / (own + 2e-3)
    assert light.com[2] == pytest.approx(1e-3, rel=1e-9)  # of layers from −1 to 3 mm
    assert heavy.com == pytest.approx(expected, rel=1e-12, abs=1e-17)


def test_budget_of_a_driven_laminate_off_its_axis_closes():
    content = scene(
        [rod([layer("bottom"), growing(0.02, interval=[0.02, 0.06])], stations=21, clamp_start="wall")],
        bodies=[fixed()],
        stimuli={"heat": {"schedule": {"type": "ramp", "start": 0, "end": 0.05, "from": 0, "to": 1}}},
    )
    residuals = []
    for dt in (1e-3, 5e-4):
        simulator = Simulator(load_scene(content), model="laminate", integrator="sdirk2", dt=dt, budget=True)
        simulator.run(0.06)
        residuals.append(abs(simulator.budget()["relative_residual"]))
    assert residuals[1] < 0.3 * residuals[0] < 1e-3
    assert simulator.budget()["supplied"]["stimulus"] > 0.0


def test_a_saved_state_goes_on_bit_for_bit_and_is_not_that_of_two_rods():
    config = load_scene(everything())
    simulator = Simulator(config, model="laminate")
    simulator.run(0.01)
    snapshot = simulator.save_state()
    simulator.run(0.01)
    again = Simulator(config, model="laminate")
    again.load_state(snapshot)
    again.run(0.01)
    assert np.array_equal(again.save_state(), simulator.save_state(), equal_nan=True)
    with pytest.raises(Exception, match="saved state: has"):
        Simulator(config).load_state(snapshot)


@pytest.mark.parametrize("dimension", [2, 3])
def test_contact_counts_from_both_faces(dimension):
    content = scene([rod([layer("bottom"), layer("top", thickness=3e-3, interval=[0.02, 0.1])], stations=21)])
    model = build_model(load_scene(content), "laminate", dimension)
    (strand,) = model.strands
    low, high = (strand.offset + side * strand.thickness for side in (-0.5, 0.5))
    points, start = model.surfaces, start_contact_points(model)
    touching = points.weight > 0.0
    node = np.concatenate([np.arange(21), points.rod_points.node])[touching]
    height, radius = start[touching, 2] - model.start_position[node, 2], points.radius[touching]
    assert np.bincount(node, minlength=21).tolist() == [1 if dimension == 2 else 3] * 21
    assert height - radius == pytest.approx(low[node]) and height + radius == pytest.approx(high[node])
    assert np.bincount(node, points.weight[touching]) == pytest.approx(model.node_length)
    faces = model.start_position[:, 2] + np.array([low, high])
    assert faces[0] == pytest.approx(np.full(21, -1e-3))
    assert faces[1] == pytest.approx(np.where(np.arange(21) < 4, 0.0, 3e-3))


def test_the_simplest_model_is_the_laminate_unless_a_scene_needs_two_rods():
    plain = scene([rod([layer("bottom"), layer("top")])])
    assert simplest_model(load_scene(plain))[0] == "laminate"
    soft = simplest_model(load_scene(plain | {"coupling": {"bending": 3.0}}))
    assert soft[0] == "two_rod" and "coupling" in soft[1]


def test_the_plan_says_that_there_is_no_bond():
    plan = make_plan(load_scene(strip(1.0, 1.0, 0.01)), model="laminate")
    assert (plan.model, plan.terms["bond"]) == ("laminate", "skipped: one curve carries both layers")


def test_uneven_faces_are_told_where_rods_can_meet():
    uneven = rod([layer("bottom"), layer("top", interval=[0.02, 0.1])], start=(0, 0, 0.01))
    other = rod([layer()], start=(0, 0, 0.05), name="other")
    content = scene([uneven, other], obstacles=[GROUND], contact=contact())
    told = " ".join(make_plan(load_scene(content), model="laminate").warnings)
    assert "rods.rod: faces are 0 to 1 mm from the laminate's curve" in told
    assert "rods.other: faces" not in told
    assert "too early" not in " ".join(make_plan(load_scene(content)).warnings)
    for rods in ([uneven], [rod([layer("bottom"), layer("top")], start=(0, 0, 0.01)), other]):
        plan = make_plan(load_scene(content | {"rods": rods}), model="laminate")
        assert "too early" not in " ".join(plan.warnings)

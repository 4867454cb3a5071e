"""Elastic moduli that follow a stimulus: shapes at rest, derivatives, work of the stimulus, and what is refused."""

import math

import numpy as np
import pytest
from support.evaluations import Problem, check
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.edge_figures import edge_figures

SOFT = {"stimulus": "warmth", "gain": -0.8}
GAIN, HALF = 0.01, 1e-3
CHANNELS = {name: {"schedule": {"type": "hold", "value": value}} for name, value in (("heat", 1), ("warmth", 0))}


def bilayer(stations=21, change=SOFT, passive=None, **more):
    """A clamped strip whose active layer swells and softens."""
    law = {"stimulus": "heat", "gain": GAIN}
    layers = [
        layer("passive", HALF, stiffness_change=passive),
        layer("active", HALF, eigenstrain=law, stiffness_change=change),
    ]
    strip = rod(layers, stations=stations, clamp_start="wall")
    materials = {"gel": GEL | more.pop("gel", {})}
    return scene([strip], bodies=[fixed()], stimuli=CHANNELS, materials=materials, **more)


def timoshenko(m):
    """κH/η of two layers of one thickness, of moduli 1 and m."""
    return 24.0 / (12.0 + (1.0 + m) * (1.0 + 1.0 / m))


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_strip_whose_active_layer_softens_has_timoshenkos_curvature_at_each_modulus(dimension):
    simulator = Simulator(load_scene(bilayer(solver={"model": "auto"})), dimension=dimension)
    assert simulator.plan.model == "two_rod"
    for value in (0.0, 0.5, 1.0, 0.25):
        simulator.set_stimulus("warmth", value)
        simulator.solve_static()
        curvature = timoshenko(1.0 - 0.8 * value) * GAIN / (2.0 * HALF)
        assert np.abs(simulator.curvatures[3:-3]).mean() == pytest.approx(curvature, rel=5e-4)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("viscous", [False, True])
def test_derivatives_of_softened_layers_agree_with_differences(dimension, viscous):
    content = bilayer(7, gel={"retardation_time": 2e-4 if viscous else 0.0})
    content["rods"][0]["layers"][1] |= {"interval": [0.0, 0.07], "natural_curvature": 3.0}
    problem = Problem(content, np.random.default_rng(5), dimension=dimension)
    assert problem.evaluator.stage.rest_joint[-2:, 0] == pytest.approx([1.0 - 0.8 * 0.7, 1.0])
    check(problem)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_force_of_a_law_is_what_energy_changes_with_it(dimension):
    problem = Problem(
        bilayer(7, passive={"stimulus": "heat", "gain": 0.5}), np.random.default_rng(6), dimension=dimension
    )
    evaluator, conservative = problem.evaluator, ("stretching", "bending", "bond")
    conservative += ("twisting",) if dimension == 3 else ()
    forces = evaluator.forces_of_laws(problem.at)
    drives, stage = problem.model.drives, evaluator.stage
    edge, joint = stage.rest_edge.copy(), stage.rest_joint.copy()
    for law in range(len(forces)):
        energies = []
        for h in (-1e-5, 1e-5):
            stage.rest_edge[:], stage.rest_joint[:] = edge, joint
            np.add.at(stage.rest_edge, drives.driven_edge, drives.driven_weight * h * (drives.driven_law == law))
            rows = drives.driven_joint_weight * h * (drives.driven_joint_law == law)
            np.add.at(stage.rest_joint[:, 0], drives.driven_joint, rows)
            energies.append(sum(evaluator.forces(problem.at, conservative).values()))
        assert forces[law] == pytest.approx((energies[0] - energies[1]) / 2e-5, rel=1e-6)


@pytest.mark.parametrize(("dimension", "viscous"), [(3, False), (2, True)])
def test_the_work_of_a_stimulus_that_softens_a_layer_is_what_it_gains(dimension, viscous):
    content = bilayer(11, gravity=[0.0, 0.0, -9.81], gel={"retardation_time": 1e-3 if viscous else 0.0})
    ramp = {"type": "ramp", "start": 0.005, "end": 0.015, "from": 0.0, "to": 1.0}
    content["stimuli"] = {"heat": {"schedule": ramp}, "warmth": {"schedule": ramp}}
    integrator = "sdirk2" if viscous else "implicit_midpoint"  # which damps nothing that the jump excites
    content["solver"] = {"integrator": integrator, "dt": 2e-5, "newton_tolerance": 1e-10}
    simulator = Simulator(load_scene(content), model="two_rod", dimension=dimension, budget=True)
    simulator.run(0.02)
    simulator.set_stimulus("warmth", 0.2)  # both jump
    simulator.set_stimulus("heat", 0.5)
    simulator.run(0.005)
    limit = 1e-3 if viscous else 1e-4
    assert abs(simulator.summary()["numerical_energy"]) < limit * simulator.summary()["largest_energy"]
    budget = simulator.budget()
    assert abs(budget["residual"]) < 1e-6 * abs(budget["supplied"]["stimulus"])


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_wire_that_stiffens_sinks_less_by_as_much(model):
    wire = rod([{"name": "wire", "material": "gel"}], radius=1e-3, clamp_start="wall")
    wire["layers"][0]["stiffness_change"] = {"stimulus": "warmth", "gain": 1.5}
    del wire["width"]
    content = scene([wire], bodies=[fixed()], stimuli=CHANNELS, gravity=[0, 0, -1e-3])
    simulator, sunk = Simulator(load_scene(content), model=model), []
    for value in (0.0, 1.0):
        simulator.set_stimulus("warmth", value)
        simulator.solve_static()
        sunk.append(simulator.positions[-1, 2])
    assert sunk[0] == pytest.approx(2.5 * sunk[1], rel=1e-5)


def test_layers_that_change_alike_are_one_curve_with_the_shape_of_before():
    simulator = Simulator(load_scene(bilayer(passive=SOFT)), model="laminate")
    found = []
    for value in (0.0, 1.0):
        simulator.set_stimulus("warmth", value)
        simulator.solve_static()
        found.append(simulator.positions.copy())
    assert found[1] == pytest.approx(found[0], abs=1e-9)
    assert np.abs(simulator.curvatures[2:-2]).mean() == pytest.approx(1.5 * GAIN / (2.0 * HALF), rel=1e-6)


@pytest.mark.parametrize("width", [4e-3, 20e-3])
def test_torsion_of_a_softened_layer_is_that_of_a_softer_material(width):
    turns = []
    for change, value, stiffness in ((SOFT, 1.0, 1.0), (None, 0.0, 0.2)):
        content = bilayer(change=change)
        content["stimuli"] = content["stimuli"] | {"warmth": {"schedule": {"type": "hold", "value": value}}}
        content["rods"][0] |= {"clamp_end": "crank", "width": width}
        content["rods"][0]["layers"][1] |= {"eigenstrain": None, "stiffness": stiffness}
        motion = {"type": "free", "mass": 1e-3, "inertia": [1e-7, 1e-7, 1e-7]}
        content["bodies"].append({"name": "crank", "position": [0.1, 0, 0], "motion": motion})
        content["loads"] = [{"name": "moment", "body": "crank", "moment": [1e-4 * width, 0, 0]}]
        simulator = Simulator(load_scene(content), model="two_rod", dimension=3)
        simulator.solve_static()
        turns.append(2.0 * math.atan2(*simulator.frame().body_quaternions[1, [0, 3]]))
    assert turns[0] == pytest.approx(turns[1], rel=0.01)


def test_a_state_in_between_continues_bit_for_bit():
    content = bilayer(7, change=SOFT | {"time_constant_rising": 0.02})
    content["stimuli"] = content["stimuli"] | {"warmth": {"schedule": {"type": "hold", "value": 1}}}
    first, second = (Simulator(load_scene(content), model="two_rod") for _ in range(2))
    first.set_stimulus("warmth", 0.0)
    first.run(0.01)
    state = first.save_state()
    first.set_stimulus("warmth", 1.0)
    first.run(0.01)
    second.load_state(state)
    second.set_stimulus("warmth", 1.0)
    second.run(0.01)
    np.testing.assert_array_equal(first.save_state(), second.save_state())


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            {"stiffness_change": {"stimulus": "warmth", "gain": -1.2}},
            "must leave the layer stiff: `warmth` from 0 to 1",
        ),
        ({"stiffness_change": {"stimulus": "cold", "gain": 0.1}}, 'stiffness_change.stimulus: found "cold"'),
        ({"stiffness_change": {"stimulus": "lamp", "gain": 0.1}}, "`lamp` is a light"),
    ],
)
def test_changes_of_moduli_that_no_layer_can_have_are_refused(change, told):
    content = bilayer()
    lamp = {"schedule": {"type": "hold", "value": 0}, "light": {"from": [0, 0, 1]}}
    content["stimuli"] = content["stimuli"] | {"lamp": lamp}
    content["rods"][0]["layers"][1] |= change
    with pytest.raises(SceneError) as refused:
        load_scene(content)
    assert told in str(refused.value)


def test_figures_take_the_moduli_at_which_a_strip_bends_most():
    content = bilayer()
    content["rods"][0]["layers"][0] |= {"stiffness": 0.5}
    config = load_scene(content)
    figures = edge_figures(config, config.rods[0])
    assert figures.multiple_range == pytest.approx(np.array([[1.0, 0.2], [1.0, 1.0]]))
    assert figures.free_curvature().max() == pytest.approx(1.5 * GAIN / (2.0 * HALF), rel=1e-12)  # at 0.5 of both


def test_a_laminate_refuses_an_axis_that_moves():
    with pytest.raises(SceneError, match="one neutral axis, which moves .* allowed: two_rod"):
        Simulator(load_scene(bilayer()), model="laminate")


def softened_strip(stations=7, width=6e-3, **more):
    """A strip whose layers have fibres, and soften alike."""
    content = bilayer(stations, passive=SOFT, **more)
    content["rods"][0] |= {"section": "strip", "width": width}
    for own, angle in zip(content["rods"][0]["layers"], (0.4, -0.9), strict=True):
        own["fibres"] = {"angle": angle, "along": {"stiffness": 3.0}}
    return content


def test_derivatives_of_a_softened_strip_agree_with_differences():
    content = softened_strip(gel={"retardation_time": 2e-4})
    problem = Problem(content, np.random.default_rng(5), "laminate", dimension=3)
    assert problem.evaluator.stage.rest_joint[-2:, 0] == pytest.approx([1.0 - 0.8 * 0.7, 1.0])
    check(problem, ("flattening",))
    check(problem)


def test_a_strip_that_softens_sinks_under_its_weight_as_one_of_a_softer_material():
    ends = []
    for value, stiffness in ((1.0, 1.0), (0.0, 0.2)):
        content = softened_strip(21, 20e-3, gravity=[0.0, 0.0, -9.81])
        content["stimuli"] = content["stimuli"] | {"warmth": {"schedule": {"type": "hold", "value": value}}}
        for own in content["rods"][0]["layers"]:
            own["stiffness"] = stiffness
        simulator = Simulator(load_scene(content), model="laminate", dimension=3)
        simulator.solve_static()
        ends.append(simulator.positions[-1])
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    assert ends[0][2] < -1e-3


def test_the_work_of_a_stimulus_that_softens_a_strip_is_what_it_gains():
    content = softened_strip(11, gravity=[0.0, 0.0, -9.81], gel={"retardation_time": 1e-3})
    ramp = {"type": "ramp", "start": 0.005, "end": 0.015, "from": 0.0, "to": 1.0}
    content["stimuli"] = {"heat": {"schedule": ramp}, "warmth": {"schedule": ramp}}
    content["solver"] = {"integrator": "sdirk2", "dt": 2e-5, "newton_tolerance": 1e-10}
    simulator = Simulator(load_scene(content), model="laminate", budget=True)
    simulator.run(0.02)
    simulator.set_stimulus("warmth", 0.2)  # both jump
    simulator.set_stimulus("heat", 0.5)
    simulator.run(0.005)
    assert abs(simulator.summary()["numerical_energy"]) < 1e-3 * simulator.summary()["largest_energy"]
    budget = simulator.budget()
    assert abs(budget["residual"]) < 1e-6 * abs(budget["supplied"]["stimulus"])

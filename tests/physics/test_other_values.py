"""Numbers of a scene that change while a simulator goes on."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SceneError
from bilayer_core.log.run.memory import MemoryRecorder

STRIP = "rods.strip.layers."
GAIN, THICKNESS = f"{STRIP}active.eigenstrain.gain", f"{STRIP}active.thickness"
MODULUS = "materials.active.youngs_modulus"
SLOPING = {"at": [0.0, 0.1], "value": [0.0, 0.01]}
UNLIKE = {"gravity": [0, 0, -9.81], MODULUS: 3e6}
KINDS = {
    "laminate": {},
    "two rods": {"solver.model": "two_rod"},
    "strip": {"rods.strip.section": "strip"},
    "in space": {"solver.dimension": 3},
    "viscous": {"materials.active.retardation_time": 0.05},
    "with a history": {"solver.integrator": "generalised_alpha"},
}
VALUES = {
    "modulus": {MODULUS: 3e5},
    "layers that become alike": {MODULUS: 1e6},
    "thickness": {THICKNESS: 1.6e-3},
    "profile of thickness": {THICKNESS: {"at": [0.0, 0.1], "value": [1e-3, 2e-3]}},
    "width": {"rods.strip.width": 0.02},
    "gain": {GAIN: -0.01},
    "profile of a gain": {GAIN: SLOPING},
    "density, gravity and damping": {"materials.active.density": 3e3, "gravity": [0, 0, -4], "damping.mass": 2.0},
}


def strip(**values):
    simulator = Simulator(load_scene("bending", UNLIKE | values))
    simulator.set_stimulus("swelling", 0.5)
    return simulator


@pytest.mark.parametrize("kind", ["laminate", "two rods", "in space"])
@pytest.mark.parametrize("name", VALUES)
def test_an_equilibrium_with_values_that_were_set_is_that_of_a_new_simulator(name, kind):
    simulator, other = strip(**KINDS[kind]), strip(**KINDS[kind] | VALUES[name])
    simulator.solve_static()
    simulator.set_values(VALUES[name])
    for one in (simulator, other):
        one.solve_static()
    assert np.abs(simulator.positions - other.positions).max() < 1e-9


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", VALUES)
def test_a_run_goes_on_as_one_that_takes_its_state(name, kind):
    simulator, other = strip(**KINDS[kind]), strip(**KINDS[kind] | VALUES[name])
    simulator.run(0.05)
    simulator.set_values(VALUES[name])
    other.load_state(simulator.save_state())
    for one in (simulator, other):
        one.run(0.1)
    assert np.array_equal(simulator.save_state(), other.save_state(), equal_nan=True)
    for one in (simulator, other):
        one.reset()
        one.run(0.05)
    assert np.array_equal(simulator.save_state(), other.save_state(), equal_nan=True)


@pytest.mark.parametrize("kind", ["laminate", "two rods", "in space"])
@pytest.mark.parametrize("name", ["modulus", "thickness", "width"])
def test_what_layers_are_made_of_stays_in_its_place_and_keeps_its_velocity(name, kind):
    simulator = strip(**KINDS[kind])
    simulator.run(0.03)
    rod, clamp, height = simulator.rods["strip"], simulator.clamps["strip.start"], 0.0
    before, velocity = rod.middle_line, simulator.velocities[rod.nodes]
    held, momentum = clamp.position, simulator.momentum
    if name == "thickness":
        height = 0.5 * (VALUES[name][THICKNESS] - rod.layers["active"].thickness[0])
    simulator.set_values(VALUES[name])
    assert rod.layers["active"].thickness[0] == simulator.scene.rods[0].layers[1].thickness
    normals = np.array([rod.directors[[max(k - 1, 0), min(k, 39)]].mean(axis=0) for k in range(41)])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    assert np.abs(rod.middle_line - before - height * normals).max() < 2e-6
    assert np.abs(clamp.position - held).max() < 1e-12
    assert np.abs(simulator.velocities[rod.nodes] - velocity).max() < 0.02 * np.abs(velocity).max()
    if name == "modulus":  # masses stay
        assert simulator.momentum == pytest.approx(momentum, rel=1e-3, abs=1e-4 * np.abs(momentum).max())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["modulus", "thickness", "profile of a gain", "density, gravity and damping"])
def test_the_budget_has_what_other_values_supply(name, kind):
    scene = load_scene("bending", UNLIKE | KINDS[kind])
    simulator = Simulator(scene, budget=True)
    simulator.set_stimulus("swelling", 0.5)
    simulator.run(0.05)
    before = sum(simulator.energy().values())
    simulator.set_values(VALUES[name])
    jump = sum(simulator.energy().values()) - before
    assert simulator.budget()["supplied"]["other values"] == pytest.approx(jump, rel=0.05, abs=1e-9)
    simulator.run(0.05)
    assert abs(simulator.budget()["relative_residual"]) < 1e-5


def test_a_beam_becomes_a_strip_where_a_scene_that_is_new_has_one():
    simulator, gain = Simulator(load_scene("bending")), {GAIN: 0.05}
    simulator.set_stimulus("swelling", 1.0)
    simulator.run(0.1)
    assert "flattening" not in simulator.model.forces
    simulator.set_values(gain)
    other = Simulator(load_scene("bending", gain))
    other.set_stimulus("swelling", 1.0)
    assert simulator.model.forces == other.model.forces and "flattening" in other.model.forces
    assert simulator.plan.terms == other.plan.terms and simulator.plan.warnings == other.plan.warnings
    for one in (simulator, other):
        one.solve_static()
    assert np.abs(simulator.positions - other.positions).max() < 1e-9


@pytest.mark.parametrize("name", ["crawling_film", "ring", "gripping"])
def test_a_robot_on_the_ground_goes_on_with_other_values_as_one_that_takes_its_state(name):
    scene = load_scene(name)
    material, rod = next(iter(scene.materials)), scene.rods[0]
    values = {f"materials.{material}.youngs_modulus": 1.3 * scene.materials[material].youngs_modulus}
    values |= {f"rods.{rod.name}.layers.{layer.name}.thickness": 1.01 * layer.thickness for layer in rod.layers[-1:]}
    simulator, other = Simulator(scene), Simulator(load_scene(name, values))
    simulator.run(0.1)
    simulator.set_values(values)
    other.load_state(simulator.save_state())
    for one in (simulator, other):
        one.run(0.05)
    assert np.array_equal(simulator.save_state(), other.save_state(), equal_nan=True)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"rods.strip.path.length": 0.2}, "rods would change; allowed are materials, layers and sections of rods"),
        ({"duration": 3.0}, "duration would change"),
        ({f"materials.{of}.retardation_time": 0.1 for of in ("active", "passive")}, "rods would get or lose viscosity"),
        ({f"{GAIN}": SLOPING | {"value": [0]}}, "must be as many as `at`, 2"),
        ({f"{GAIN}": -3}, "must leave the layer a length"),
        ({f"{STRIP}passive.fibres": {"angle": "20 deg"}}, "fibres turn the rod out of the plane"),
        ({f"{STRIP}passive.thickness": 4e-3}, "node 40 of strip/.* would reach the surface of floor with these values"),
    ],
)
def test_other_changes_are_refused_and_change_nothing(values, message):
    floor = {"name": "floor", "type": "plane", "point": [0, 0, -0.01], "normal": [0, 0, 1]}
    contact = {"barrier_distance": 5e-4, "stiffness": 1e6}
    simulator, untouched = (strip(obstacles=[floor], contact=contact) for _ in range(2))
    for one in (simulator, untouched):
        one.run(1.0)
    with pytest.raises((InputError, SceneError), match=message):
        simulator.set_values(values)
    for one in (simulator, untouched):
        one.run(0.05)
    assert np.array_equal(simulator.save_state(), untouched.save_state(), equal_nan=True)


def test_a_run_before_other_values_is_not_differentiated_with_them():
    simulator = strip()
    run = simulator.run(0.02, gradients=True)
    simulator.set_values(VALUES["gain"])
    with pytest.raises(InputError, match="other values than in the run; differentiate before set_values"):
        run.gradient("com", GAIN)


def test_values_are_refused_while_somebody_looks_and_taken_after():
    simulator = strip()
    detach = simulator.attach(MemoryRecorder())
    with pytest.raises(InputError, match="not while a log or an observer is attached"):
        simulator.set_values(VALUES["width"])
    detach()
    simulator.set_values(VALUES["width"])
    assert simulator.rods["strip"].layers["active"].width[0] == 0.02


def test_fifty_changes_there_and_back_leave_a_strip_where_it_was():
    simulator = strip()
    simulator.solve_static()
    before = simulator.positions
    for thickness in [1.5e-3, 1e-3] * 25:
        simulator.set_values({THICKNESS: thickness})
    assert np.abs(simulator.positions - before).max() < 1e-9

"""Equilibria found without marching in time; those with a known answer are in `bilayer_core.verification.validate`."""

import math

import numpy as np
import pytest
from support.sample_scenes import GROUND, PAPER, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SimulationError

LENGTH = 0.1
EI = 1e8 * 0.01 * 1e-3**3 / 12  # of `sample_scenes.layer` 10 mm wide
EULER = math.pi**2 * EI / (4 * LENGTH**2)  # a column with one free end
LONG_STEPS = {**PAPER, "dt": 1.0, "newton_tolerance": 1e-11}
HEAT = {"heat": {"schedule": {"type": "hold", "value": 0}}}


def column(force, sideways=0.0):
    """A clamped column along x with a force towards the wall at its tip."""
    load = {"name": "press", "rod": "rod", "position": LENGTH, "force": [-force, 0, sideways]}
    return Simulator(
        load_scene(scene([rod([layer()], stations=81, clamp_start="wall")], bodies=[fixed()], loads=[load]))
    )


def bilayer(gain=0.03, **more):
    layers = [layer("bottom"), layer("top", eigenstrain={"stimulus": "heat", "gain": gain, "time_constant": 5.0})]
    return scene([rod(layers, **more)], stimuli=HEAT)


@pytest.mark.parametrize(("multiple", "unstable"), [(0.5, 0), (0.99, 0), (1.01, 1), (8.9, 1), (9.1, 2), (25.2, 3)])
def test_a_straight_column_loses_stability_at_each_of_eulers_loads(multiple, unstable):
    report = column(multiple * EULER).solve_static()
    assert (report.unstable_directions, report.stable) == (unstable, unstable == 0)


def test_a_disturbed_column_above_eulers_load_buckles_to_a_stable_shape_of_the_elastica():
    simulator = column(1.152 * EULER, sideways=1e-4 * EULER)
    report = simulator.solve_static()
    tip = simulator.positions[-1]
    assert report.stable
    # Timoshenko and Gere, Theory of Elastic Stability, table 2-3: P/P_cr 1.152 at a tip angle of 60 degrees
    assert tip[0] == pytest.approx(0.741 * LENGTH, abs=2e-3 * LENGTH)
    assert abs(tip[2]) == pytest.approx(0.593 * LENGTH, abs=2e-3 * LENGTH)


def test_the_equilibrium_is_where_time_would_lead_and_nothing_moves_there():
    surroundings = {"bodies": [fixed()], "gravity": [0, 0, -9.81], "solver": LONG_STEPS}
    description = bilayer(clamp_start="wall") | surroundings
    found = Simulator(load_scene(description))
    found.set_stimulus("heat", 1.0)
    found.solve_static()
    assert found.time == 0.0 and not found.velocities.any()
    shape = found.positions
    marched = Simulator(load_scene(description))
    marched.set_stimulus("heat", 1.0)
    marched.run(150.0)
    assert np.abs(marched.positions - shape).max() < 1e-8
    found.run(5.0)
    assert np.abs(found.positions - shape).max() < 1e-9


def ribbon_on_the_ground(layers, height, **section):
    strip = rod(layers, start=(0, 0, height), **section)
    surroundings = {"gravity": [0, 0, -9.81], "obstacles": [GROUND], "contact": contact(coefficient=0.5)}
    return Simulator(load_scene(scene([strip], **surroundings)))


def test_a_strip_on_the_ground_comes_to_rest_on_it_with_its_weight():
    simulator = ribbon_on_the_ground([layer(thickness=2e-3)], 5e-3)
    assert simulator.solve_static().stable
    weight = 9.81 * 1000.0 * 0.01 * 2e-3 * 0.1
    assert simulator.contact_forces.sum(axis=0) == pytest.approx([0, 0, weight], rel=1e-5, abs=1e-12)


def test_two_layers_stand_on_the_width_of_the_lower_and_a_narrow_blade_falls():
    layers = [layer("bottom"), layer("top")]
    assert ribbon_on_the_ground(layers, 5e-3).solve_static().stable
    # as wide as its lower layer is thick, it stands on a line
    assert ribbon_on_the_ground(layers, 5e-3, width=1e-3).solve_static().unstable_directions == 1


def test_a_free_bilayer_finds_its_shape_although_nothing_holds_it():
    simulator = Simulator(load_scene(bilayer()))
    simulator.set_stimulus("heat", 1.0)
    report = simulator.solve_static()
    assert report.stable
    assert simulator.curvatures[10] == pytest.approx(-1.5 * 0.03 / 2e-3, rel=1e-3)


def test_a_force_that_turns_with_the_tip_agrees_with_the_shape_in_the_end():
    load = {"name": "jet", "rod": "rod", "position": LENGTH, "force": [0, 2 * EI / LENGTH**2, 0], "frame": "material"}
    strip = rod([layer()], stations=41, clamp_start="wall")
    simulator = Simulator(load_scene(scene([strip], bodies=[fixed()], loads=[load])))
    simulator.solve_static()
    shape = simulator.positions
    marched = Simulator(load_scene(scene([strip], bodies=[fixed()], loads=[load])), dt=0.05)
    marched.run(5.0)
    assert shape[-1, 2] > 0.4 * LENGTH
    assert np.abs(marched.positions - shape).max() < 1e-7


def test_a_robot_that_falls_for_ever_has_no_equilibrium_and_stays_where_it_was():
    simulator = Simulator(load_scene(bilayer() | {"gravity": [0, 0, -9.81]}))
    before = simulator.save_state()
    with pytest.raises(SimulationError, match="no static equilibrium found: nothing holds the robot.* moved it by"):
        simulator.solve_static()
    assert np.array_equal(simulator.save_state(), before, equal_nan=True)
    simulator.step()


@pytest.mark.parametrize("tolerance", [0.0, -1e-9, math.nan])
def test_a_tolerance_that_is_none_is_refused(tolerance):
    with pytest.raises(InputError, match="positive number of metres"):
        column(EULER).solve_static(tolerance)


@pytest.mark.parametrize(("name", "channel"), [("gripping", "humidity"), ("crawling_dual_leg", "humidity")])
def test_a_robot_in_equilibrium_stays_there(name, channel):
    simulator = Simulator(load_scene(name))
    simulator.set_stimulus(channel, 1.0)
    assert simulator.solve_static().stable
    before = simulator.positions
    simulator.run(0.02)
    assert np.abs(simulator.positions - before).max() < 1e-7

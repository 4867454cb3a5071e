"""Point masses, forces and moments from outside, against closed forms."""

import math
import re

import numpy as np
import pytest
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.kinematics.rotation import matrix_from_quaternion

LENGTH = 0.1
SOFT = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}
FAR = rod([layer()], length=0.02, stations=3, start=(0, 0, 5), name="far", clamp_start="wall")
"""A scene has a rod; this one is out of the way."""


def strip(stations=41, **more):
    return rod([layer(thickness=2e-3)], length=LENGTH, stations=stations, clamp_start="wall", **more)


def force_on_rod(force, position=LENGTH, **more):
    return {"name": "pull", "rod": "rod", "position": position, "force": list(force), **more}


def test_a_force_on_the_path_between_two_layers_does_not_turn_them():
    thick = [layer("bottom", thickness=1e-3), layer("top", thickness=3e-3)]
    pulled = scene([rod(thick, stations=41)], loads=[force_on_rod([0.2, 0, 0], 0.05)], materials=SOFT)
    simulator = Simulator(load_scene(pulled))
    model, loads = simulator.model, simulator.model.loads
    moment = np.cross(model.start_position[loads.node] - [0.05, 0, 0], loads.node_vector).sum(axis=0)
    assert loads.node_vector.sum(axis=0) == pytest.approx([0.2, 0, 0])
    assert np.abs(moment).max() < 1e-18
    simulator.run(0.1)
    momentum = model.rods.node_mass @ simulator.velocities
    assert momentum == pytest.approx([0.02, 0, 0], abs=1e-12)


def test_a_mass_at_the_tip_slows_the_vibration_of_a_strip_as_the_formula_says():
    tip = 20e-3  # of the strip's own 2 g
    stiffness = 3 * 1e8 * 0.01 * 2e-3**3 / 12 / LENGTH**3
    released = force_on_rod([0, 0, 0.02 * LENGTH * stiffness])
    released["schedule"] = {"type": "table", "times": [0.0, 4.9999, 5.0], "values": [1, 1, 0]}
    swinging = scene(
        [strip(stations=21)],
        bodies=[fixed()],
        loads=[released],
        masses=[{"name": "tip", "rod": "rod", "position": LENGTH, "mass": tip}],
        solver={"dt": 2e-3, "newton_tolerance": 1e-9},
        damping={"mass": 3.0},
    )
    simulator = Simulator(load_scene(swinging))
    simulator.run(5.0)
    crossings, before = [], simulator.positions[-1, 2]
    for _ in range(1500):
        simulator.step()
        height = simulator.positions[-1, 2]
        if before > 0.0 >= height:
            crossings.append(simulator.time - 2e-3 * height / (height - before))
        before = height
    own = 1000.0 * 0.01 * 2e-3 * LENGTH
    natural = math.sqrt(stiffness / (tip + 33 / 140 * own))  # Rayleigh's share of the strip
    period = np.diff(crossings).mean()
    assert len(crossings) > 4
    assert 2 * math.pi / period == pytest.approx(math.sqrt(natural**2 - 1.5**2), rel=5e-3)


def test_point_masses_weigh_as_much_as_they_are_heavy():
    masses = [
        {"name": "near", "rod": "rod", "position": 0.0333, "mass": 1e-3},
        {"name": "far", "rod": "rod", "position": LENGTH, "mass": 5e-3},
    ]
    layers = [layer("bottom"), layer("top", thickness=2e-3, interval=[0.02, 0.08])]
    plain = Simulator(load_scene(scene([rod(layers)])))
    simulator = Simulator(load_scene(scene([rod(layers)], masses=masses)))
    own = plain.model.rods.node_mass.sum()
    assert simulator.model.rods.node_mass.sum() == pytest.approx(own + 6e-3)
    expected = (own * plain.com + np.array([1e-3 * 0.0333 + 5e-3 * LENGTH, 0, 0])) / (own + 6e-3)
    expected[2] -= 5e-3 * 0.5e-3 / (own + 6e-3)  # the tip is of the bottom layer alone
    assert simulator.com == pytest.approx(expected, abs=1e-15)
    assert simulator.frame().com == pytest.approx(expected, abs=1e-15)


def test_a_pattern_takes_a_load_on_all_copies_or_on_the_one_that_is_named():
    star = rod([layer()], length=0.02, stations=5, start=(0.005, 0, 0), name="arm", pattern={"count": 3})
    both = [
        {"name": "each", "rod": "arm", "position": 0.02, "force": [0, 0, 1.0]},
        {"name": "one", "rod": "arm_2", "position": 0.0, "force": [0, 0, 2.0]},
    ]
    masses = [{"name": "one", "rod": "arm_1", "position": 0.01, "mass": 1.0}]
    model = Simulator(load_scene(scene([star], loads=both, masses=masses))).model
    assert model.loads.node.tolist() == [4, 9, 14, 10]
    assert model.loads.node_vector[:, 2].tolist() == [1.0, 1.0, 1.0, 2.0]
    assert np.flatnonzero(model.rods.node_mass > 0.5).tolist() == [7]


def flyer(inertia=(3e-5, 3e-5, 3e-5), **motion):
    """A free body without a surface."""
    return {
        "name": "ball",
        "position": [0, 0, 0],
        "motion": {"type": "free", "mass": 0.2, "inertia": list(inertia), **motion},
    }


def in_space(body=None, dt=1e-3, **load):
    """A body without weight, and a load on it."""
    load = {"name": "push", "body": "ball", **load}
    solver = {"dt": dt, "newton_tolerance": 1e-10}
    return scene([FAR], bodies=[fixed(position=(0, 0, 5)), body or flyer()], loads=[load], solver=solver)


def test_a_force_accelerates_a_free_body_by_its_mass():
    simulator = Simulator(load_scene(in_space(force=[0.1, -0.2, 0.3])))
    simulator.run(0.5)
    frame = simulator.frame()
    assert frame.body_velocities[1] == pytest.approx(0.5 * np.array([0.1, -0.2, 0.3]) / 0.2, rel=1e-9)
    assert np.abs(frame.body_angular_velocities[1]).max() == 0.0


@pytest.mark.parametrize("frame", ["world", "material"])
def test_a_moment_turns_a_free_body_by_its_inertia(frame):
    moment = np.array([2e-4, -1e-4, 1e-4])
    simulator = Simulator(load_scene(in_space(moment=list(moment), frame=frame)))
    simulator.run(1.0)
    expected = 1.0 * moment / 3e-5
    assert simulator.frame().body_angular_velocities[1] == pytest.approx(expected, rel=1e-6)
    assert np.linalg.norm(expected) * 1.0 / 2 > 0.5 * math.pi  # it has turned by more than a small angle


def test_a_moment_across_the_spin_bends_the_angular_momentum_towards_itself():
    inertia = (3e-5, 4e-5, 5e-5)  # of no ball: a wrong order of rotations would show
    errors = []
    for dt in (2e-3, 1e-3):
        body = flyer(inertia, angular_velocity=[20.0, 0, 0])
        simulator = Simulator(load_scene(in_space(body, dt, moment=[0, 3e-4, 0])))
        simulator.run(0.2)
        frame = simulator.frame()
        rotation = matrix_from_quaternion(frame.body_quaternions[1])
        momentum = rotation @ np.diag(inertia) @ rotation.T @ frame.body_angular_velocities[1]
        errors.append(np.abs(momentum - [6e-4, 0.2 * 3e-4, 0]).max() / 6e-4)
    assert errors[1] < 0.02
    assert errors[1] < 0.6 * errors[0]  # of first order, as the integrator


def test_a_follower_force_on_a_spinning_body_goes_in_circles():
    spin = 10.0
    body = flyer(angular_velocity=[0, 0, spin])
    simulator = Simulator(load_scene(in_space(body, force=[0.4, 0, 0], frame="material")))
    simulator.run(0.4)
    expected = 0.4 / 0.2 / spin * np.array([math.sin(spin * 0.4), 1 - math.cos(spin * 0.4), 0])
    assert simulator.frame().body_velocities[1] == pytest.approx(expected, abs=0.01 * 0.4 / 0.2 / spin)


def test_a_guided_body_feels_the_force_along_its_rail():
    hub = {"name": "ball", "position": [0, 0, 0], "motion": {"type": "guided", "axis": [0.6, 0, 0.8], "mass": 0.5}}
    push = {"name": "push", "body": "ball", "force": [1.0, 2.0, 3.0]}
    simulator = Simulator(load_scene(scene([FAR], bodies=[fixed(position=(0, 0, 5)), hub], loads=[push])))
    simulator.run(0.1)
    expected = 0.1 * (0.6 + 2.4) / 0.5 * np.array([0.6, 0, 0.8])
    assert simulator.frame().body_velocities[1] == pytest.approx(expected, rel=1e-9)


def test_a_scheduled_force_gives_its_impulse_whatever_the_step():
    pulses = {"type": "pulse_train", "low": 0, "high": 1, "period": 0.1, "width": 0.05, "count": 2, "start": 0.02}
    found = []
    for dt in (2e-3, 1e-3):
        simulator = Simulator(load_scene(in_space(force=[0.1, 0, 0], schedule=pulses)), dt=dt)
        simulator.run(0.3)
        found.append(simulator.frame().body_velocities[1, 0])
    assert found == pytest.approx([0.1 * 2 * 0.05 / 0.2] * 2, rel=1e-9)


def test_the_work_of_loads_is_supplied_from_outside_and_no_energy_of_the_robot():
    simulator = Simulator(load_scene(in_space(force=[0.1, 0, 0], moment=[0, 0, 1e-4])))
    simulator.run(0.1)
    energy, work = simulator.energy(), 0.1 * simulator.bodies["ball"].position[0] + 1e-4 * 0.5 * 1e-4 / 3e-5 * 0.1**2
    assert "loads" not in energy and "moments" not in energy
    assert energy["kinetic"] == pytest.approx(work, rel=0.02)  # the integrator's loss is of first order
    assert {k: v for k, v in simulator.plan.terms.items() if k in ("loads", "followers", "moments")} == {
        "loads": "active",
        "followers": "skipped: no load in a material frame",
        "moments": "active",
    }


def test_a_state_restores_a_run_under_scheduled_loads_bit_for_bit():
    load = force_on_rod([0, 0, 0.01], schedule={"type": "sine", "mean": 0, "amplitude": 1, "period": 0.02})
    simulator = Simulator(load_scene(scene([strip(stations=11)], bodies=[fixed()], materials=SOFT, loads=[load])))
    simulator.run(0.01)
    snapshot = simulator.save_state()
    simulator.run(0.01)
    expected = simulator.positions
    simulator.load_state(snapshot)
    simulator.run(0.01)
    assert np.array_equal(simulator.positions, expected)


@pytest.mark.parametrize(
    "integrator", ["implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha", "implicit_midpoint"]
)
def test_a_factor_that_is_set_acts_from_the_next_step_on_with_its_whole_impulse(integrator):
    simulator = Simulator(load_scene(in_space(force=[0.1, 0, 0])), integrator=integrator, dt=1e-3, budget=True)
    speeds = []
    for factor in (0.0, 2.0, -3.0, None):
        simulator.set_load("push", factor)
        simulator.run(0.01)
        speeds.append(simulator.frame().body_velocities[1, 0])
    impulses = np.cumsum([0.0, 2.0, -3.0, 1.0]) * 0.1 * 0.01
    assert speeds == pytest.approx(impulses / 0.2, rel=1e-9, abs=1e-15)
    budget = simulator.budget()
    kinetic = 0.5 * 0.2 * speeds[-1] ** 2
    assert budget["supplied"]["loads"] - budget["lost"]["numerical"] == pytest.approx(kinetic, rel=1e-9)
    if integrator == "implicit_midpoint":
        assert budget["supplied"]["loads"] == pytest.approx(kinetic, abs=1e-12)


def test_a_factor_that_is_set_is_that_of_a_schedule_with_the_same_jump():
    def strip_under(load):
        content = scene([strip(stations=11)], bodies=[fixed()], materials=SOFT, loads=[load])
        return Simulator(load_scene(content), integrator="generalised_alpha", dt=1e-3)

    jump = {"type": "pulse_train", "low": 0, "high": 1, "period": 1.0, "width": 0.9, "count": 1, "start": 0.02}
    scheduled = strip_under(force_on_rod([0, 0, 0.01], schedule=jump))
    steered = strip_under(force_on_rod([0, 0, 0.01]))
    steered.set_load("pull", 0.0)
    steered.run(0.02)
    steered.set_load("pull", 1.0)
    snapshot = steered.save_state()
    for simulator, seconds in ((scheduled, 0.04), (steered, 0.02)):
        simulator.run(seconds)
    np.testing.assert_allclose(steered.positions, scheduled.positions, atol=1e-12)
    again = strip_under(force_on_rod([0, 0, 0.01]))
    again.load_state(snapshot)  # it has the factor
    again.run(0.02)
    np.testing.assert_array_equal(again.positions, steered.positions)


@pytest.mark.parametrize(
    ("name", "factor", "fault"),
    [
        ("pull", 1.0, "load 'pull': no such load; the scene 'sample' has: push"),
        ("push", math.inf, "load 'push': a factor of inf is not allowed; it must be finite"),
        ("push", math.nan, "load 'push': a factor of nan is not allowed; it must be finite"),
    ],
)
def test_a_load_that_cannot_be_set_changes_nothing(name, factor, fault):
    simulator = Simulator(load_scene(in_space(force=[0.1, 0, 0])))
    before = simulator.save_state()
    with pytest.raises(InputError, match=re.escape(fault)):
        simulator.set_load(name, factor)
    np.testing.assert_array_equal(simulator.save_state(), before)

"""The bundled six-finger gripper carries its cube 100 mm aside, and lets it go."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene

ASIDE = 0.1
CARRIED = 7.0
"""When the hub is at its highest, 100 mm aside [s]."""


def carried(*changes, **options):
    """A whole run, and where the cube was when the hub was highest and aside [m]."""
    simulator = Simulator(load_scene("six_finger_gripper", list(changes)), **options)
    simulator.run(CARRIED)
    aloft = simulator.bodies["cube"].position
    simulator.run()
    assert simulator.summary()["converged"] is True
    return simulator, aloft


def yaw(simulator):
    """By which the cube has turned about z, and by how much its z is off the vertical [rad]."""
    x, y, z, w = simulator.bodies["cube"].quaternion
    return 2.0 * np.arctan2(z, w), 2.0 * np.arcsin(np.hypot(x, y))


@pytest.mark.parametrize(
    "method",
    [
        {},
        {"model": "two_rod"},
        pytest.param({"tolerance": 1e-3}, marks=pytest.mark.verify),
        pytest.param({"tolerance": 1e-5}, marks=pytest.mark.verify),
        pytest.param({"integrator": "sdirk2"}, marks=pytest.mark.verify),
        pytest.param({"integrator": "generalised_alpha"}, marks=pytest.mark.verify),
        pytest.param({"integrator": "implicit_euler", "dt": 5e-3}, marks=pytest.mark.verify),
    ],
    ids=str,
)
def test_the_cube_ends_at_rest_on_the_floor_100_mm_aside(method):
    simulator, aloft = carried(**method)
    cube = simulator.bodies["cube"]
    assert aloft == pytest.approx([ASIDE, 0.0, 75.5e-3], abs=1e-3)
    assert cube.position == pytest.approx([ASIDE, 0.0, 15.5e-3], abs=1e-3)
    assert max(map(abs, yaw(simulator))) < 1e-3
    of_fingers = simulator.contact_forces[: len(simulator.model.rods.node_mass)]
    assert not of_fingers.any()  # all have let go
    before = cube.position
    simulator.run(0.5)
    assert simulator.bodies["cube"].position == pytest.approx(before, abs=1e-6)


def test_aloft_friction_bears_the_weight_of_the_cube():
    simulator = Simulator(load_scene("six_finger_gripper", ["bodies.hub.motion.times=[4.5, 5.5, 17, 18.5, 22, 23]"]))
    simulator.run(5.5)
    forces = []
    for _ in range(40):
        simulator.run(0.05)
        forces.append(simulator.bodies["cube"].contact_wrench[:3])
    assert np.mean(forces, axis=0) == pytest.approx([0.0, 0.0, 0.02 * 9.81], abs=0.02 * 0.02 * 9.81)


@pytest.mark.parametrize("change", ["contact.friction.coefficient=0", "bodies.cube.motion.mass=60 g"])
def test_a_smooth_or_heavy_cube_stays_where_it_is(change):
    simulator, aloft = carried(change)
    for position in (aloft, simulator.bodies["cube"].position):
        assert position == pytest.approx([0.0, 0.0, 15.5e-3], abs=0.1e-3)


@pytest.mark.parametrize("turned", [15, 40])
def test_a_turned_cube_is_carried_as_far_and_set_down_upright(turned):
    simulator, _ = carried(f"bodies.cube.rotation=[0, 0, {turned} deg]")
    assert simulator.bodies["cube"].position == pytest.approx([ASIDE, 0.0, 15.5e-3], abs=2e-3)
    about, off = yaw(simulator)
    assert about == pytest.approx(np.radians(turned), abs=np.radians(5.0))
    assert abs(off) < 1e-3


def test_fingers_push_a_cube_that_is_3_mm_off_nearer_to_the_middle():
    simulator, _ = carried("bodies.cube.position=[3 mm, 2 mm, 15.5 mm]")
    x, y, z = simulator.bodies["cube"].position
    assert np.hypot(x - ASIDE, y) < np.hypot(3e-3, 2e-3)
    assert z == pytest.approx(15.5e-3, abs=0.1e-3)

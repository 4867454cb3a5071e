"""Starts in motion: rods move as what holds them, whole robots as the scene says."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError

GEL = {"gel": {"youngs_modulus": "1 MPa", "poisson_ratio": 0.4, "density": 1000}}
SPIN, SPEED = [0.0, 20.0, 0.0], [0.3, 0.0, 1.0]


def rod(name="rod", start=(0, 0, 0), **more):
    path = {"shape": "straight", "start": list(start), "direction": [1, 0, 0], "length": "100 mm"}
    layers = [{"name": "gel", "material": "gel", "thickness": "2 mm"}]
    return {"name": name, "width": "10 mm", "path": path, "normal": [0, 0, 1], "stations": 11, "layers": layers, **more}


def body(name, position, **motion):
    own = {"type": "free", "mass": 0.002, "inertia": [1e-7] * 3, **motion}
    return {"name": name, "position": list(position), "motion": own}


def simulator(rods, bodies=(), model="laminate", dimension="auto", **more):
    content = {"schema": 1, "name": "s", "title": "t", "duration": 0.1, "gravity": [0, 0, 0], "materials": GEL}
    scene = load_scene({**content, "rods": rods, "bodies": list(bodies), **more})
    return Simulator(scene, model=model, dimension=dimension)


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_rod_moves_as_the_body_that_holds_it(model):
    hub = body("hub", [0.02, 0, 0.01], velocity=SPEED, angular_velocity=[3.0, 20.0, 0.0])
    thrown = simulator([rod(clamp_start="hub")], [hub], model)
    arm = thrown.positions - [0.02, 0, 0.01]
    assert thrown.velocities == pytest.approx(SPEED + np.cross([3.0, 20.0, 0.0], arm), abs=1e-15)
    assert thrown._state.spin == pytest.approx(3.0)


def test_motion_goes_on_along_rods_and_joints_to_bodies_that_say_nothing():
    bodies = [
        body("hub", [0, 0, 0], velocity=[0, 0, 1]),
        body("middle", [0.1, 0, 0]),
        body("hinged", [0.1, 0, 0]),
        body("apart", [0, 0, 0.5]),
    ]
    hinge = {"name": "h", "type": "hinge", "bodies": ["middle", "hinged"], "point": [0.1, 0, 0], "axis": [0, 1, 0]}
    found = simulator([rod(clamp_start="hub", clamp_end="middle")], bodies, joints=[hinge])
    assert [found.bodies[name].velocity[2] for name in ("hub", "middle", "hinged", "apart")] == [1, 1, 1, 0]
    assert found.velocities[:11] == pytest.approx(np.tile([0.0, 0.0, 1.0], (11, 1)))


def test_between_bodies_that_move_differently_a_rod_agrees_with_both():
    bodies = [body("a", [0, 0, 0], velocity=SPEED), body("b", [0.1, 0, 0], angular_velocity=SPIN)]
    found = simulator([rod(clamp_start="a", clamp_end="b", stations=201)], bodies)
    assert found.velocities[0] == pytest.approx(SPEED) and found.velocities[200] == pytest.approx(0.0, abs=1e-15)
    slope = (found.velocities[200] - found.velocities[199]) / 0.0005
    assert slope[2] == pytest.approx(np.cross(SPIN, [1, 0, 0])[2], rel=0.01)


def test_a_rod_between_a_body_in_motion_and_a_wall_rests_at_the_wall():
    wall = {"name": "wall", "position": [0.1, 0, 0], "motion": {"type": "prescribed"}}
    found = simulator([rod(clamp_start="a", clamp_end="wall")], [body("a", [0, 0, 0], velocity=[0, 0, 1]), wall])
    assert found.velocities[0, 2] == 1.0 and not found.velocities[10].any()
    assert found.velocities[5, 2] == pytest.approx(0.5)


def test_the_scene_sets_the_whole_robot_in_motion_about_its_mass_centre():
    bodies = [body("hub", [0, 0, 0]), body("ball", [0, 0, 0.5]), body("thrown", [0, 0, 0.2], velocity=[0, 0, 7])]
    found = simulator([rod(clamp_start="hub"), rod("free", (0, 0, 0.1))], bodies, velocity=SPEED, angular_velocity=SPIN)
    masses = np.concatenate([found.model.rods.node_mass, [0.002]])
    places = np.concatenate([found.positions[: len(masses) - 1], [[0, 0, 0]]])
    speeds = np.concatenate([found.velocities[: len(masses) - 1], [found.bodies["hub"].velocity]])
    assert masses @ speeds / masses.sum() == pytest.approx(SPEED)
    centre = masses @ places / masses.sum()
    assert speeds == pytest.approx(SPEED + np.cross(SPIN, places - centre))
    assert not found.bodies["ball"].velocity.any() and found.bodies["thrown"].velocity[2] == 7.0


def test_a_rod_that_nothing_holds_has_a_motion_of_its_own():
    found = simulator([rod(velocity=SPEED, angular_velocity=SPIN), rod("other", (0, 0, 0.1))])
    assert found.velocities[:11].mean(axis=0) == pytest.approx(SPEED)
    assert not found.velocities[11:].any()


def test_a_held_rod_with_a_motion_of_its_own_is_refused():
    with pytest.raises(SceneError, match=r"rods\.rod\.velocity.*must be left out"):
        simulator([rod(clamp_start="hub", velocity=SPEED)], [body("hub", [0, 0, 0])])


@pytest.mark.parametrize("motion", [{"velocity": [0, 1, 0]}, {"angular_velocity": [1, 0, 0]}])
@pytest.mark.parametrize("of_rod", [False, True])
def test_a_motion_that_leaves_the_plane_makes_the_model_one_in_space(motion, of_rod):
    found = simulator([rod(**motion)]) if of_rod else simulator([rod()], **motion)
    assert found.plan.dimension == 3 and next(iter(motion)) in found.plan.reasons["dimension"]
    assert simulator([rod()], velocity=SPEED, angular_velocity=SPIN).plan.dimension == 2


def test_a_state_of_another_start_is_taken_into_a_scene():
    moving, resting = simulator([rod()], velocity=SPEED), simulator([rod()])
    resting.load_state(moving.save_state())
    assert resting.velocities == pytest.approx(np.tile(SPEED, (11, 1)))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_thrown_robot_goes_on_without_a_shock(model, dimension):
    thrown = simulator([rod(clamp_start="hub")], [body("hub", [0, 0, 0], velocity=SPEED)], model, dimension)
    start = thrown.com
    thrown.run(0.1)
    assert thrown.com - start == pytest.approx(0.1 * np.array(SPEED), rel=1e-12)
    energy = thrown.energy()
    assert sum(energy.values()) - energy["kinetic"] < 1e-20


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_thrown_robot_falls_as_its_mass_with_that_of_the_bodies_it_holds(model):
    bodies = [body("hub", [0, 0, 0]), body("hinged", [0, 0, 0.01]), body("apart", [0, 0, 0.5])]
    hinge = {"name": "h", "type": "hinge", "bodies": ["hub", "hinged"], "point": [0, 0, 0], "axis": [0, 1, 0]}
    more = {"velocity": SPEED, "angular_velocity": SPIN, "gravity": [0, 0, -9.81]}
    thrown = simulator([rod(clamp_start="hub")], bodies, model, joints=[hinge], **more)
    start = thrown.com
    assert start == pytest.approx([0.05 / 3, 0, 0.01 / 3], abs=1e-15)  # the rod weighs 2 g, and so does each body
    thrown.run(0.15)
    flown = 0.15 * np.array(SPEED) + [0, 0, -0.5 * 9.81 * 0.15**2]
    assert thrown.com - start == pytest.approx(flown, abs=1e-6)
    assert thrown.positions[10, 0] < thrown.positions[0, 0]  # by half a turn
    top = start[2] + SPEED[2] ** 2 / (2.0 * 9.81)
    assert thrown.summary()["com_max_height"] == pytest.approx(top, rel=1e-3)

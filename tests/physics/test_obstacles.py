"""Bodies and obstacles of every shape: resting, sliding, rolling, colliding, and never crossing."""

import math

import numpy as np
import pytest
from support.sample_scenes import GROUND, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SimulationError

AWAY = rod([layer()], length=0.02, stations=3, start=(0, 5, 5), clamp_start="wall")
WALL = fixed(position=(0, 5, 5))
SOFT = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}
BOX = {"shape": "box", "size": [0.04, 0.03, 0.02]}
ROLL = {"shape": "cylinder", "axis": [0, 1, 0], "radius": 0.02, "length": 0.03}
SHAPES = {
    "sphere": {"radius": 0.02},
    "box": {"size": [0.04, 0.04, 0.04]},
    "cylinder": {"radius": 0.02, "length": 0.04, "axis": [0, 1, 0]},
}


def body(name, position, surface, mass=0.02, **motion):
    return {
        "name": name,
        "position": list(position),
        "motion": {"type": "free", "mass": mass, **motion},
        "surface": surface,
    }


def alone(bodies, **settings):
    """Bodies without a rod near them."""
    return Simulator(load_scene(scene([AWAY], bodies=[WALL, *bodies], **settings)))


def slope(angle, g=9.81):
    """Gravity over level ground that acts like a slope."""
    return [g * math.sin(angle), 0.0, -g * math.cos(angle)]


def velocity(simulator, index=1):
    return simulator.frame().body_velocities[index]


def test_a_block_resting_on_the_ground_presses_with_its_weight_from_its_lower_corners():
    block = body("block", (0, 0, 0.01085), BOX)
    simulator = alone([block], gravity=[0, 0, -9.81], obstacles=[GROUND], contact=contact(coefficient=0.5))
    simulator.run(0.5)
    forces = simulator.contact_forces[3:, 2]
    assert forces.sum() == pytest.approx(0.02 * 9.81, rel=1e-6)
    assert np.sort(forces)[-4:] == pytest.approx(np.full(4, 0.02 * 9.81 / 4), rel=1e-4)
    assert simulator.frame().contact_wrenches[1] == pytest.approx([0, 0, 0.02 * 9.81, 0, 0, 0], abs=1e-6)


def test_a_box_creeps_down_a_gentle_slope_at_the_smoothed_laws_speed():
    angle, mu, threshold = 0.2, 0.5, 1e-3
    law = contact(barrier_distance=2e-4, coefficient=mu, speed_threshold=threshold)
    block = body("block", (0, 0, 0.01017), BOX)
    simulator = alone([block], gravity=slope(angle), obstacles=[GROUND], contact=law)
    simulator.run(0.4)
    expected = threshold * (1.0 - math.sqrt(1.0 - math.tan(angle) / mu))
    # front corners carry more than rear ones: each has the speed that its own load asks for, and they move as one
    assert velocity(simulator)[0] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("support", ["plane", "box"])
def test_a_box_slides_down_a_steep_slope_as_coulomb_says(support):
    angle, mu = 0.5, 0.3
    floor = {"name": "ground", "type": "box", "position": [0.1, 0, -0.05], "size": [1.0, 0.5, 0.1]}
    block = body("block", (0, 0, 0.01017), BOX)
    law = contact(barrier_distance=2e-4, coefficient=mu)
    obstacles = [GROUND if support == "plane" else floor]
    simulator = alone([block], gravity=slope(angle), obstacles=obstacles, contact=law)
    simulator.run(0.1)
    start = velocity(simulator)[0]
    simulator.run(0.2)
    acceleration = (velocity(simulator)[0] - start) / 0.2
    assert acceleration == pytest.approx(9.81 * (math.sin(angle) - mu * math.cos(angle)), rel=0.01)


def test_a_solid_cylinder_rolls_down_a_slope_with_two_thirds_of_the_acceleration():
    angle = 0.3
    roll = body("roll", (0, 0, 0.0208), ROLL)
    simulator = alone([roll], gravity=slope(angle), obstacles=[GROUND], contact=contact(coefficient=0.6))
    simulator.run(0.1)
    start = velocity(simulator)[0]
    simulator.run(0.2)
    acceleration = (velocity(simulator)[0] - start) / 0.2
    assert acceleration == pytest.approx(2 / 3 * 9.81 * math.sin(angle), rel=0.02)
    spin = simulator.frame().body_angular_velocities[1, 1]
    assert spin * 0.02 == pytest.approx(velocity(simulator)[0], rel=0.03)


def test_a_ball_and_a_tumbling_box_collide_and_keep_their_momentum():
    block = body("block", (0.05, 0.005, 0.004), BOX, velocity=[-0.5, 0, 0], angular_velocity=[3.0, 5.0, 20.0])
    moving = ball((-0.02, 0, 0), velocity=[1.0, 0.1, 0])
    law = contact(barrier_distance=2e-4, coefficient=0.3, speed_threshold=1e-3)
    simulator = alone([block, moving], contact=law, solver={"newton_tolerance": 1e-11})
    masses = np.array([0.02, 2.7e-3])
    simulator.run(0.1)
    frame = simulator.frame()
    assert frame.body_velocities[2, 0] < 0.5  # it was hit
    total = masses @ frame.body_velocities[1:]
    exchanged = 2.7e-3
    assert np.abs(total - masses @ np.array([[-0.5, 0, 0], [1.0, 0.1, 0]])).max() < 1e-9 * exchanged


@pytest.mark.parametrize("mu", [0.0, 0.5])
@pytest.mark.parametrize("shape", SHAPES)
def test_action_is_reaction_between_bodies_moments_included(shape, mu):
    surface = {"shape": shape, **SHAPES[shape]}
    lower = body("lower", (0, 0, 0), surface, angular_velocity=[1.0, 2.0, 3.0])
    upper = ball((0.003, 0.002, 0.0406), velocity=[0.3, 0.2, -0.05], angular_velocity=[10.0, -5.0, 2.0])
    # forces are those before Newton's last correction, positions those after it: it is to be nothing but rounding
    settings = {"contact": contact(coefficient=mu, speed_threshold=1e-2), "solver": {"newton_tolerance": 1e-11}}
    simulator = alone([lower, upper], **settings)
    before = simulator.frame()
    simulator.step()
    frame = simulator.frame()
    wrench, position = frame.contact_wrenches[1:], frame.body_positions[1:]
    force = np.linalg.norm(wrench[0, :3])
    assert force > 1e-3 and (mu == 0.0 or np.linalg.norm(wrench[1, 3:]) > 1e-6)
    left = (wrench[:, 3:] + np.cross(position, wrench[:, :3])).sum(axis=0)
    assert wrench[:, :3].sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12 * force)
    # in a step the two halves of a frozen contact point come apart by what the bodies approach each other
    approach = np.linalg.norm(np.diff(frame.body_positions[1:] - before.body_positions[1:], axis=0))
    assert np.linalg.norm(left) <= mu * force * approach + 1e-12 * force


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("thrown", ["strip", "ball"])
def test_nothing_crosses_a_shape_however_fast_it_comes(shape, thrown):
    target = {"name": "target", "type": shape, "position": [0, 0, 0], **SHAPES[shape]}
    if thrown == "strip":
        strip = rod([layer()], length=0.05, stations=26, start=(-0.02, 0.003, 0.2))
        settings = scene([strip], obstacles=[target], contact=contact(), gravity=[0, 0, -2e4])
    else:
        shot = ball((-0.05, 0.001, 0.0005), radius=0.005, velocity=[40.0, 0, 0])  # its diameter four times a step
        settings = scene([AWAY], bodies=[WALL, shot], obstacles=[target], contact=contact())
    simulator = Simulator(load_scene(settings))
    for _ in range(8):
        simulator.step()
        assert 0.0 < simulator.frame().min_gap
    if thrown == "ball":
        assert velocity(simulator)[0] < 30.0  # it was hit


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("mu", "sticks"), [(0.5, True), (0.1, False)])
def test_a_short_strip_on_top_of_a_shape_sticks_or_slides_as_coulomb_says(shape, mu, sticks):
    target = {"name": "target", "type": shape, "position": [0, 0, -0.02], **SHAPES[shape]}
    # flat: friction acts at its face, and a cube would rock on a round top
    strip = rod([layer(thickness=2e-4)], length=2e-3, stations=3, start=(-1e-3, 0, 2.995e-4), width=2e-4)
    angle = 0.2
    law = contact(barrier_distance=2e-4, coefficient=mu)
    simulator = Simulator(load_scene(scene([strip], gravity=slope(angle), obstacles=[target], contact=law)))
    simulator.run(0.005)
    start, duration = simulator.velocities[:, 0].mean(), 0.01
    simulator.run(duration)
    speed = simulator.velocities[:, 0].mean()
    if sticks:
        assert abs(speed) < 1e-4
    else:
        assert (speed - start) / duration == pytest.approx(9.81 * (math.sin(angle) - mu * math.cos(angle)), rel=0.06)


def test_a_ribbon_drapes_over_a_fixed_cylinder_and_presses_on_it_with_its_weight():
    bar = {"name": "bar", "type": "cylinder", "position": [0, 0, 0], "axis": [0, 1, 0], "radius": 0.02, "length": 0.04}
    ribbon = rod([layer()], length=0.08, stations=41, start=(-0.04, 0, 0.0214))
    draped = scene(
        [ribbon],
        obstacles=[bar],
        materials=SOFT,
        gravity=[0, 0, -9.81],
        contact=contact(coefficient=0.5),
        damping={"mass": 20.0},
        solver={"dt": 5e-3},
    )
    simulator = Simulator(load_scene(draped))
    simulator.run(1.5)
    weight = 9.81 * simulator.model.rods.node_mass.sum()
    assert simulator.contact_forces.sum(axis=0) == pytest.approx([0, 0, weight], abs=0.01 * weight)
    assert simulator.positions[[0, -1], 2].max() < 0.0  # both ends hang
    distance = np.hypot(simulator.positions[:, 0], simulator.positions[:, 2])
    assert distance.min() > 0.0205


def test_a_scheduled_box_pushes_a_ribbon_and_turns_it():
    pusher = {
        "name": "pusher",
        "position": [0.05, 0, -0.006],
        "motion": {
            "type": "prescribed",
            "times": [0, 0.2],
            "displacements": [[0, 0, 0], [0, 0, 0.012]],
            "rotations": [[0, 0, 0], [0, "20 deg", 0]],
        },
        "surface": {"shape": "box", "size": [0.01, 0.02, 0.008]},
    }
    ribbon = rod([layer()], length=0.06, stations=31, clamp_start="wall")
    pushed = scene(
        [ribbon], bodies=[fixed(), pusher], materials=SOFT, contact=contact(2e-4, 0.3), damping={"mass": 50.0}
    )
    simulator = Simulator(load_scene(pushed))
    simulator.run(0.4)
    assert simulator.positions[25, 2] > 0.008
    assert simulator.bodies["pusher"].quaternion == pytest.approx(
        [0, math.sin(math.pi / 18), 0, math.cos(math.pi / 18)]
    )
    frame = simulator.frame()
    nodes = frame.contact_forces[: simulator.model.node_count].sum(axis=0)
    assert nodes[2] > 0.0
    assert frame.contact_wrenches[1, :3] == pytest.approx(-nodes, abs=1e-9)
    assert simulator.statistics.min_gap > 0.0
    assert simulator.statistics.bodies["pusher"].nodes >= 1


def test_a_rod_may_grow_out_of_a_body_that_holds_it():
    hub = body("hub", (0, 0, 0), BOX, mass=0.01)
    arm = rod([layer()], length=0.03, stations=16, start=(0.02, 0, 0), clamp_start="hub")
    simulator = Simulator(load_scene(scene([arm], bodies=[hub], contact=contact())))
    simulator.run(0.02)
    assert np.abs(simulator.contact_forces).max() == 0.0


@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2"])
@pytest.mark.parametrize("tolerance", [0.1, 1.0, 10.0])
def test_no_last_correction_crosses_a_surface_however_loose_newtons_tolerance(tolerance, integrator):
    """Where it is small beside the smallest gap it is taken without a look at each pair; at 10 m/s it is nearly all."""
    strip = rod([layer()], length=0.05, stations=21, start=(0, 0, 0.02))
    falling = {"name": "ball", "position": [0.025, 0, 0.06], "surface": {"shape": "sphere", "radius": 5e-3}}
    falling["motion"] = {"type": "free", "mass": 5e-3, "velocity": [0, 0, -5.0]}
    thrown = scene(
        [strip], bodies=[falling], obstacles=[GROUND], gravity=[3.0, 0, -9.81], contact=contact(coefficient=0.4)
    )
    thrown["solver"] = {"newton_tolerance": tolerance}
    simulator = Simulator(load_scene(thrown), integrator=integrator, dt=5e-3)
    lowest, met = [], 1e-3
    try:
        simulator.run(0.1, each_step=lambda time: lowest.append(simulator.positions[:, 2].min()))
    except SimulationError as stopped:  # where so much is left undone that steps would make energy
        assert "make energy" in str(stopped) and "leave `solver.newton_tolerance` out" in str(stopped)
        met = math.inf  # as early as the step in which the ball arrives
    assert min(lowest) > 0.0 and 0.0 < simulator.summary()["min_gap"] < met

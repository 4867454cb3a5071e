"""Poses that controllers ask of prescribed bodies at run time."""

from __future__ import annotations

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.kinematics.rotation import matrix_from_quaternion, rotation_matrix
from bilayer_core.simulation.poses import rotation_vector_between

HALF_TURN = [0.0, 0.0, 1.0, 0.0]


def scene(**motion):
    """A strip held by a hub that controllers may move at 0.2 m/s and 2 rad/s."""
    return {
        "schema": 1,
        "name": "controlled",
        "title": "A strip on a hub that controllers move",
        "duration": 1.0,
        "materials": {
            "rubber": {"youngs_modulus": 1e6, "density": 1000, "poisson_ratio": 0.5, "retardation_time": 0.01}
        },
        "rods": [
            {
                "name": "strip",
                "width": 0.01,
                "stations": 21,
                "path": {"shape": "straight", "start": [0, 0, 0], "direction": [1, 0, 0], "length": 0.1},
                "normal": [0, 0, 1],
                "clamp_start": "hub",
                "layers": [{"name": "sheet", "material": "rubber", "thickness": 0.002}],
            }
        ],
        "bodies": [
            {
                "name": "hub",
                "position": [0, 0, 0],
                "motion": {"type": "prescribed", "top_speed": 0.2, "top_angular_speed": 2.0} | motion,
            },
            {
                "name": "ball",
                "position": [0, 0, 5],
                "motion": {"type": "free", "mass": 1.0, "inertia": [1e-4, 1e-4, 1e-4]},
            },
        ],
    }


def simulator(dimension=3, **motion):
    data = scene(**motion)
    if dimension == 2:
        data["bodies"].pop()
    return Simulator(load_scene(data), dimension=dimension)


def speeds(sim, until):
    """Times and largest speeds and angular speeds of the hub on the way, by differences of poses as well."""
    found, last = [], None
    while sim.time < until - 1e-9:
        before = sim.time, sim.bodies["hub"].position, matrix_from_quaternion(sim.bodies["hub"].quaternion)
        sim.step(until=min(until, sim.time + 2e-3))
        after = sim.bodies["hub"].position, matrix_from_quaternion(sim.bodies["hub"].quaternion)
        h = sim.time - before[0]
        turn = rotation_vector_between(before[2], after[1])
        last = np.linalg.norm(after[0] - before[1]) / h, np.linalg.norm(turn) / h
        found.append((sim.time, *last))
    return np.array(found)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_body_goes_to_its_pose_at_its_top_speed_and_rests_there(dimension):
    sim = simulator(dimension)
    sim.run(0.05)
    sim.set_pose("hub", [0.03, 0.0, 0.04])
    way = speeds(sim, 0.05 + 1.5 * 0.05 / 0.2)
    assert way[:, 1].max() == pytest.approx(0.2, rel=1e-3)
    assert sim.bodies["hub"].position == pytest.approx([0.03, 0.0, 0.04], abs=1e-12)
    sim.run(0.1)
    assert sim.bodies["hub"].position == pytest.approx([0.03, 0.0, 0.04], abs=1e-12)
    assert sim._state.body_velocity[0] == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_body_turns_to_its_orientation_at_its_top_angular_speed():
    sim = simulator()
    sim.set_pose("hub", quaternion=HALF_TURN)
    way = speeds(sim, 1.5 * np.pi / 2.0)
    assert way[:, 2].max() == pytest.approx(2.0, rel=1e-3)
    assert matrix_from_quaternion(sim.bodies["hub"].quaternion) == pytest.approx(np.diag([-1.0, -1.0, 1.0]), abs=1e-9)


def test_an_unhurried_goal_takes_the_time_that_is_asked_for():
    sim = simulator()
    sim.set_pose("hub", [0.01, 0.0, 0.0], over=0.5)
    sim.run(0.25)
    assert sim.bodies["hub"].position[0] == pytest.approx(0.005, abs=1e-12)
    sim.run(0.25)
    assert sim.bodies["hub"].position[0] == pytest.approx(0.01, abs=1e-12)


def test_goals_that_follow_each_other_keep_the_velocity_continuous_and_the_limits():
    sim, generator = simulator(), np.random.default_rng(7)
    way = []
    for _ in range(12):
        quaternion = generator.normal(size=4)
        sim.set_pose("hub", generator.uniform(-0.05, 0.05, 3), quaternion)
        before = sim._state.body_velocity[0].copy(), sim._state.body_angular_velocity[0].copy()
        sim.step(until=sim.time + 1e-6)
        assert sim._state.body_velocity[0] == pytest.approx(before[0], abs=1e-4)
        assert sim._state.body_angular_velocity[0] == pytest.approx(before[1], abs=1e-3)
        way.append(speeds(sim, sim.time + generator.uniform(0.01, 0.3)))
    way = np.concatenate(way)
    assert way[:, 1].max() <= 0.2 * 1.001
    assert way[:, 2].max() <= 2.0 * 1.001


def test_a_steady_stream_of_goals_is_followed_with_the_stated_lag():
    sim = simulator()
    for k in range(100):
        sim.set_pose("hub", [0.1 * 0.01 * k, 0.0, 0.0])
        sim.run(0.01)
    behind = 0.1 * 0.01 * 99 - sim.bodies["hub"].position[0]
    assert behind / 0.1 + 0.01 == pytest.approx(2.0 / 3.0 * 0.1, rel=0.1)
    assert sim._state.body_velocity[0, 0] == pytest.approx(0.1, rel=0.01)


def test_a_goal_that_is_sent_again_changes_nothing():
    once, again = simulator(), simulator()
    once.set_pose("hub", [0.02, 0.0, 0.01])
    for _ in range(20):
        again.set_pose("hub", [0.02, 0.0, 0.01])
        again.run(0.02)
        once.run(0.02)
    assert np.array_equal(once.save_state(), again.save_state())


def test_a_controller_takes_over_from_the_schedule_without_a_jump():
    sim = simulator(times=[0.0, 0.4], displacements=[[0, 0, 0], [0.04, 0, 0]])
    sim.run(0.2)
    velocity = sim._state.body_velocity[0].copy()
    assert velocity[0] == pytest.approx(0.15)
    sim.set_pose("hub", [0.0, 0.0, 0.0])
    way = speeds(sim, 0.9)
    assert way[0, 1] == pytest.approx(0.15, rel=0.1)
    assert way[:, 1].max() <= 0.2 * 1.001
    assert sim.bodies["hub"].position == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_saved_state_goes_on_to_its_goal_bit_for_bit():
    sim, other = simulator(), simulator()
    sim.set_pose("hub", [0.02, 0.03, 0.01], [0.0, 0.3, 0.0, 1.0])
    sim.run(0.1)
    other.load_state(sim.save_state())
    sim.run(0.3)
    other.run(0.3)
    assert np.array_equal(sim.save_state(), other.save_state())


@pytest.mark.parametrize("pose_first", [True, False])
def test_a_load_that_is_set_together_with_a_pose_acts_from_the_next_step_on(pose_first):
    content = scene()
    content["loads"] = [{"name": "tug", "rod": "strip", "position": 0.1, "force": [0, 0, 0.1]}]
    pushed, free = (Simulator(load_scene(content)) for _ in range(2))
    for sim in (pushed, free):
        if pose_first:
            sim.set_pose("hub", [0.01, 0.0, 0.0])
        sim.set_load("tug", 1.0 if sim is pushed else 0.0)
        if not pose_first:
            sim.set_pose("hub", [0.01, 0.0, 0.0])
        sim.run(0.02)
    assert pushed.positions[-1, 2] - free.positions[-1, 2] > 1e-4


def test_reset_forgets_goals_and_brings_the_body_back():
    sim, fresh = simulator(), simulator()
    sim.set_pose("hub", [0.02, 0.03, 0.01])
    sim.run(0.3)
    sim.reset()
    sim.run(0.1)
    fresh.run(0.1)
    assert np.array_equal(sim.save_state(), fresh.save_state())
    assert sim.bodies["hub"].position == pytest.approx(np.zeros(3), abs=0.0)


def test_the_strip_follows_and_the_energy_account_knows_the_work():
    sim = simulator()
    sim.set_pose("hub", [0.0, 0.0, 0.05], [0.0, 0.7, 0.0, 1.0])
    sim.run(1.0)
    summary = sim.summary()
    assert abs(summary["numerical_energy"]) < 0.01 * summary["largest_energy"]
    assert summary["energy"]["gravity"] == pytest.approx(0.0, abs=1.0) and sim.positions[0, 2] > 0.04


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("nub", [0, 0, 0]), "no such body; the scene 'controlled' has: hub, ball"),
        (("ball", [0, 0, 0]), "it is a free body; only prescribed bodies have set poses"),
        (("hub",), "needs a position, a quaternion, or both"),
        (("hub", [0, 0]), "position [0, 0] is not allowed; it must be 3 finite numbers"),
        (("hub", [0, 0, np.nan]), "must be 3 finite numbers"),
        (("hub", None, [0, 0, 0, 0]), "its length must be above 0"),
    ],
)
def test_a_pose_that_cannot_be_is_refused_and_changes_nothing(arguments, text):
    sim = simulator()
    before = sim.save_state()
    with pytest.raises(InputError) as refused:
        sim.set_pose(*arguments)
    assert text in str(refused.value)
    assert np.array_equal(sim.save_state(), before, equal_nan=True)


@pytest.mark.parametrize(
    ("motion", "arguments", "text"),
    [
        ({"top_speed": None, "top_angular_speed": None}, ([0, 0, 0.1],), "nothing may move it from outside"),
        ({"top_speed": None}, ([0, 0, 0.1],), "must not be moved from outside; give `bodies.hub.motion.top_speed`"),
        ({"top_angular_speed": None}, (None, HALF_TURN), "must not be turned from outside"),
    ],
)
def test_a_body_without_a_top_speed_says_which_key_allows_it(motion, arguments, text):
    with pytest.raises(InputError, match=text):
        simulator(**motion).set_pose("hub", *arguments)


def test_a_goal_out_of_the_plane_is_refused_in_two_dimensions():
    sim = simulator(2)
    with pytest.raises(InputError, match="leaves the plane of the scene"):
        sim.set_pose("hub", [0.0, 0.01, 0.0])
    with pytest.raises(InputError, match="leaves the plane of the scene"):
        sim.set_pose("hub", quaternion=HALF_TURN)


@pytest.mark.parametrize("seed", range(5))
def test_the_rotation_between_two_poses_leads_from_one_to_the_other(seed):
    generator = np.random.default_rng(seed)
    first, last = (rotation_matrix(generator.normal(size=3) * scale) for scale in (1.0, 2.0))
    assert rotation_matrix(rotation_vector_between(first, last)) @ first == pytest.approx(last, abs=1e-12)

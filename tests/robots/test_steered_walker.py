"""The bundled walker with three legs goes straight on and turns to the side of the leg that rests."""

from functools import cache

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene

WALKING = "{type: sine, mean: 0.5, amplitude: 0.5, period: 1 s, phase: -90 deg}"
HALF = "{type: sine, mean: 0.25, amplitude: 0.25, period: 1 s, phase: -90 deg}"
RESTING = "{type: hold, value: 0}"


@cache
def driven(left, right, *changes, cycles=3, **options):
    """Way of the hub in its own axes [m] and its turn to the left [deg] over each of some cycles, after the first."""
    schedules = [f"stimuli.left.schedule={left}", f"stimuli.right.schedule={right}"]
    simulator = Simulator(load_scene("steered_walker", [*schedules, *changes]), **options)
    poses = []
    for _ in range(cycles + 1):
        simulator.run(1.0)
        poses.append(pose(simulator))
    assert simulator.summary()["converged"] is True
    ways = []
    for (x0, y0, heading), (x1, y1, _) in zip(poses, poses[1:], strict=False):
        c, s = np.cos(np.radians(heading)), np.sin(np.radians(heading))
        ways.append((c * (x1 - x0) + s * (y1 - y0), c * (y1 - y0) - s * (x1 - x0)))
    return np.array(ways), np.diff([heading for *_, heading in poses])


def pose(simulator):
    """Of the hub: x, y [m] and heading [deg]."""
    hub = simulator.bodies["hub"]
    return *hub.position[:2], float(np.degrees(2.0 * np.arctan2(*hub.quaternion[2:])))


def test_with_equal_stimuli_it_walks_straight_on():
    ways, turns = driven(WALKING, WALKING)
    assert ways[:, 0] == pytest.approx(np.full(3, 21e-3), abs=1e-3)
    assert np.abs(ways[:, 1]).max() < 1e-5
    assert np.abs(turns).max() < 0.01


@pytest.mark.parametrize("less", [RESTING, HALF])
def test_it_turns_to_the_side_that_gets_less_and_as_much_either_way(less):
    (to_left, left_turns), (to_right, right_turns) = driven(less, WALKING), driven(WALKING, less)
    assert (left_turns > 2.0).all()
    assert right_turns == pytest.approx(-left_turns, abs=0.05)
    assert to_right == pytest.approx(to_left * [1.0, -1.0], abs=1e-4)
    assert (to_left[:, 0] > 10e-3).all()


def test_it_turns_more_the_less_one_side_gets():
    turns = [driven(less, WALKING)[1][-1] for less in (RESTING, HALF, WALKING)]
    assert turns[0] > 1.5 * turns[1] > 3.0


def test_with_the_same_friction_both_ways_it_stays():
    ways, turns = driven(WALKING, WALKING, "contact.friction.coefficient=0.6")
    assert np.abs(ways).max() < 1e-3
    assert np.abs(turns).max() < 0.01


@pytest.mark.parametrize(
    "method",
    [
        {"model": "two_rod"},
        pytest.param({"tolerance": 1e-3}, marks=pytest.mark.verify),
        pytest.param({"tolerance": 1e-5}, marks=pytest.mark.verify),
        pytest.param({"integrator": "sdirk2"}, marks=pytest.mark.verify),
        pytest.param({"integrator": "generalised_alpha"}, marks=pytest.mark.verify),
        {"integrator": "implicit_euler", "dt": 2e-3},
    ],
    ids=str,
)
def test_no_model_tolerance_or_integrator_changes_its_way_by_4_percent(method):
    (ways, turns), (others, other_turns) = driven(RESTING, WALKING), driven(RESTING, WALKING, **method)
    assert others[:, 0] == pytest.approx(ways[:, 0], rel=0.04)
    assert other_turns == pytest.approx(turns, rel=0.04)


def test_the_scene_turns_left_and_then_back_to_where_it_headed():
    simulator = Simulator(load_scene("steered_walker"))
    headings = []
    for duration in (5.0, 10.0, 10.0):
        simulator.run(duration)
        headings.append(pose(simulator)[2])
    assert headings == pytest.approx([0.0, 72.0, 0.0], abs=1.0)

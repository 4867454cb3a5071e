"""Friction that differs along a direction of a surface or of the world, whatever way what slides lies."""

import math

import numpy as np
import pytest
from support.evaluations import Problem, check
from support.sample_scenes import GROUND, contact, everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.verification.validate.friction import (
    FAR,
    GRAIN,
    GRAVITY,
    MASS,
    SIZE,
    acceleration_on_grain,
    at_rest,
    block,
    pulled_over_grain,
    resting_gap,
)

DIRECTED = dict(zip(("forward", "backward", "sideways"), GRAIN, strict=True))


@pytest.mark.parametrize("of", ["surfaces", "world"])
@pytest.mark.parametrize(("model", "dimension"), [("two_rod", 3), ("laminate", 3)])
def test_derivatives_of_friction_along_a_grain_agree_with_differences(of, model, dimension):
    content = everything()
    content["bodies"][0]["motion"] = {"type": "free", "mass": 1e-3, "inertia": [2e-8, 3e-8, 4e-8]}
    if of == "world":
        content["contact"]["friction"]["axis"] = [1, 2, -0.5]
    else:
        content["obstacles"][0]["grain"] = [1, -1, 0.2]
        content["bodies"][1]["surface"]["grain"] = [0.3, 1, 0.5]
    content["contact"]["rods"] = False  # noise moves borders of arms into each other
    problem = Problem(content, np.random.default_rng(4), model, dimension)
    check(problem, ("friction",))
    sliding = problem.evaluator.problem.sliding
    mu = sliding.mu[: sliding.count[0]]
    assert np.allclose(mu, [0.3, 0.6, 0.4])  # points of bodies as well, whose own coefficient is 0.5


@pytest.mark.parametrize("solver", [{}, {"integrator": "implicit_euler", "dt": 1e-3}], ids=["default", "Euler"])
def test_a_block_slides_along_the_grain_and_sticks_against_it(solver):
    along, against = (pulled_over_grain(0.4, off, solver) for off in (0.0, math.pi))
    assert along[0] == pytest.approx(0.5 * (0.5 - GRAIN[0]) * GRAVITY, rel=2e-3)
    assert np.abs(against).max() < 1e-5  # no faster than the speed threshold


@pytest.mark.parametrize("off", [0.3, 1.2, 2.0, 2.9, -0.7])
@pytest.mark.parametrize("of", ["block", "world"])
def test_a_grain_of_the_block_or_an_axis_of_the_world_does_what_that_of_the_ground_does(of, off):
    ground, other = (pulled_over_grain(0.9, off, {}, grain) for grain in (None, {"of": of}))
    expected = 0.5 * acceleration_on_grain(off)
    assert np.abs(ground[:2] - expected).max() < 2e-3
    assert np.abs(other - ground).max() < 1e-4


def on_a_slope(uphill):
    """Distance [m] that a block slides down a real slope of 0.45 rad in half a second."""
    tilt = 0.45
    down, normal = [math.cos(tilt), 0, -math.sin(tilt)], [math.sin(tilt), 0, math.cos(tilt)]
    law = contact(coefficient=0.4, speed_threshold=1e-5)
    law["friction"] |= DIRECTED
    body = block((0, 0, 0)) | {"rotation": [0, tilt, 0]}
    start = 0.5 * SIZE[2] + resting_gap(law, float(sum(SIZE)) / 2)
    body["position"] = [start * c for c in normal]
    content = scene(
        [rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")],
        gravity=[0, 0, -GRAVITY],
        obstacles=[{"name": "slope", "type": "plane", "point": [0, 0, 0], "normal": normal,
                    "grain": [c * (-1 if uphill else 1) for c in down]}],
        contact=law,
        bodies=[fixed(position=FAR), body],
    )  # fmt: skip
    content["solver"] = {}
    simulator = Simulator(load_scene(content))
    simulator.run(0.5)
    return float((simulator.bodies["block"].position - np.array(body["position"])) @ down)


def test_on_a_slope_the_grain_decides_whether_a_block_slides():
    assert on_a_slope(False) == pytest.approx(0.125 * GRAVITY * (math.sin(0.45) - GRAIN[0] * math.cos(0.45)), rel=0.02)
    assert abs(on_a_slope(True)) < 1e-3


def after_a_turn(turn):
    """Speed [m/s] of a block 0.5 s after it is pulled along x on a plate that has turned with it by an angle [rad]."""
    pull = {"type": "ramp", "start": 1.0, "end": 1.0001, "from": 0, "to": 1}
    motion = {"type": "prescribed", "times": [0, 0.8], "rotations": [[0, 0, 0], [0, 0, turn]]}
    law = contact(coefficient=0.4, speed_threshold=1e-5)
    law["friction"] |= DIRECTED
    content = scene(
        [rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")],
        gravity=[0, 0, -GRAVITY],
        contact=law,
        bodies=[
            fixed(position=FAR),
            block((0, 0, SIZE[2])),
            {
                "name": "plate",
                "position": [0, 0, -0.02],
                "motion": motion,
                "surface": {"shape": "box", "size": [2.0, 2.0, 0.04], "grain": [1, 0, 0]},
            },
        ],
        loads=[{"name": "pull", "body": "block", "force": [0.7 * MASS * GRAVITY, 0, 0], "schedule": pull}],
    )
    content["solver"] = {}
    simulator = at_rest(content)
    simulator.run(1.5)
    return float(simulator.frame().body_velocities[1, 0])


@pytest.mark.parametrize(("turn", "coefficient"), [(0.0, 0), (0.5 * math.pi, 2), (-0.5 * math.pi, 2), (math.pi, 1)])
def test_a_plate_that_turns_takes_its_grain_along(turn, coefficient):
    assert after_a_turn(turn) == pytest.approx(0.5 * (0.7 - GRAIN[coefficient]) * GRAVITY, rel=0.01)


ON_BARRIER = 1.1988475e-3
"""Height at which the strip below rests [m]: half its thickness, and where the barrier carries its weight."""


def dragged(dimension, model, direction, **more):
    """Distance [m] that a strip slides from 0.1 s after the start, at which it lies on the barrier, to 0.3 s."""
    law = contact(barrier_distance=2e-4, coefficient=0.4, speed_threshold=1e-4)
    law["friction"] |= DIRECTED | more
    strip = rod([layer("a"), layer("b")], length=0.02, stations=6, start=(0, 0, ON_BARRIER), friction_axis="across")
    ground = GROUND | {"grain": [1, 0, 0]}
    content = scene([strip], gravity=[direction * 4.0, 0, -10.0], obstacles=[ground], contact=law)
    content["solver"] = {"model": model, "dimension": dimension}
    simulator = Simulator(load_scene(content))
    simulator.run(0.1)
    before = simulator.com[0]
    simulator.run(0.2)
    return float(simulator.com[0] - before)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("model", ["two_rod", "laminate"])
def test_rods_slide_by_the_grain_and_not_by_an_axis_of_their_own(dimension, model):
    assert dragged(dimension, model, 1) == pytest.approx(0.04 * (4.0 - 2.0), rel=0.02)
    assert abs(dragged(dimension, model, -1)) < 1e-4


def test_where_the_grain_is_along_the_normal_friction_is_the_same_every_way():
    content = everything()
    content["obstacles"][0]["grain"] = [0, 0, 1]
    problem = Problem(content, np.random.default_rng(4))
    sliding, surfaces = problem.evaluator.problem.sliding, problem.evaluator.problem.surfaces
    count = sliding.count[0]
    on_ground = surfaces.body[sliding.surface[:count]] == len(content["bodies"])
    assert on_ground.any() and np.all(sliding.mu[:count][on_ground] == 0.5)
    check(problem, ("friction",))

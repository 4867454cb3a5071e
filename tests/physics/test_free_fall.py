"""What nothing holds falls as gravity asks, however weak gravity is and however short the steps are."""

import numpy as np
import pytest
from support.sample_scenes import GROUND, contact, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.jit import kernel
from bilayer_core.kinematics.compensated import add_exactly

INTEGRATORS = ("implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha", "implicit_midpoint")
GRAVITIES = (1e-6, 1e-3, 1.0, 9.81, 1e4)
LENGTHS_OF_STEPS = (1e-8, 1e-6, 1e-4, 1e-2)
STEPS = 200
ROUNDING = 1e-9  # relative
DOWN = np.array([0.0, 0.0, -1.0])
TILTED = np.array([0.3, -0.5, -0.8]) / np.sqrt(0.98)
FREE = {"type": "free", "mass": 2.7e-3, "inertia": [1e-7, 2e-7, 2.5e-7]}


def falling(gravity, start=(0, 0, 0), youngs_modulus=1e8, held=False, **solver):
    """A strip of two layers, and a body beside it or one that holds an end of it."""
    gel = {"youngs_modulus": youngs_modulus, "poisson_ratio": 0.5, "density": 1000.0}
    body = {"name": "body", "position": [start[0], start[1], start[2] + (0.0 if held else 0.1)], "motion": FREE}
    clamp = {"clamp_start": "body"} if held else {}
    strip = rod([layer("lower"), layer("upper")], start=start, stations=11, **clamp)
    falls = scene([strip], bodies=[body], gravity=[float(g) for g in gravity], materials={"gel": gel})
    falls["solver"] = {"model": "laminate", "dimension": 2, **solver}
    return Simulator(load_scene(falls))


def error_of_fall(simulator, gravity, duration, euler_step=0.0):
    """Run and compare velocities, and ways with the digits that positions have no room for, with those of a fall.

    Implicit Euler falls by ½ g t (t + h), the others by ½ g t². Elasticity sees rounded positions, so nodes tremble by
    some of their last digits in a step; the mass centre does not. Returns the largest error over what rounding allows.
    """
    state = simulator._state
    before = state.copy()
    simulator.run(duration)
    time = simulator.time
    assert time == pytest.approx(duration, rel=1e-9)
    speed, way = gravity * time, 0.5 * gravity * time * (time + euler_step)
    step = simulator.time / simulator.statistics.steps
    last_digits = 64.0 * np.spacing(np.abs(before.position).max())
    mass = simulator.model.rods.node_mass / simulator.model.rods.node_mass.sum()
    errors = []
    for name, shares, tremble in (("", mass, last_digits), ("body_", np.ones(1), 0.0)):
        position, low = getattr(state, f"{name}position"), getattr(state, f"{name}position_low")
        fallen = (position - getattr(before, f"{name}position")) + low
        velocity = getattr(state, f"{name}velocity")
        for found, expected, allowed in ((velocity, speed, tremble / step), (fallen, way, tremble)):
            rounding = ROUNDING * np.linalg.norm(expected)
            errors.append(np.linalg.norm(shares @ found - expected) / rounding)
            errors.append(np.linalg.norm(found - expected, axis=1).max() / (rounding + allowed))
    return max(errors)


def error_in_fixed_steps(gravity, dt, integrator, **more):
    simulator = falling(gravity, integrator=integrator, dt=dt, **more)
    return error_of_fall(simulator, gravity, STEPS * dt, dt if integrator == "implicit_euler" else 0.0)


@pytest.mark.parametrize("dt", LENGTHS_OF_STEPS)
@pytest.mark.parametrize("gravity", GRAVITIES)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_strip_and_body_fall_exactly_in_a_plane(integrator, gravity, dt):
    assert error_in_fixed_steps(gravity * DOWN, dt, integrator) <= 1.0


@pytest.mark.parametrize("dt", LENGTHS_OF_STEPS)
@pytest.mark.parametrize("gravity", [1e-6, 9.81, 1e4])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_strip_and_body_fall_exactly_in_space_far_from_the_origin(integrator, gravity, dt):
    assert error_in_fixed_steps(gravity * TILTED, dt, integrator, start=(1.0, 0.3, 0.7), dimension=3) <= 1.0


@pytest.mark.parametrize(("gravity", "dt"), [(1e-6, 1e-8), (1e-3, 1e-3), (9.81, 1e-6), (1e4, 1e-2)])
@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2"])
def test_two_rods_fall_exactly(integrator, gravity, dt):
    away = {"dimension": 3, "start": (1.0, 0.3, 0.7)}
    assert error_in_fixed_steps(gravity * TILTED, dt, integrator, model="two_rod", **away) <= 1.0


@pytest.mark.parametrize(("gravity", "dt"), [(1e-6, 1e-8), (1e-3, 1e-3), (9.81, 1e-6), (1e4, 1e-2)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_body_and_the_strip_that_it_holds_fall_exactly(dimension, gravity, dt):
    assert error_in_fixed_steps(gravity * DOWN, dt, "sdirk2", held=True, dimension=dimension) <= 1.0


@pytest.mark.parametrize(("gravity", "dt"), [(1e-6, 1e-8), (1e-3, 1e-6), (9.81, 1e-4), (9.81, 1e-2)])
@pytest.mark.parametrize("youngs_modulus", [1e4, 1e11])
def test_stiffness_does_not_matter_to_a_fall(youngs_modulus, gravity, dt):
    away = {"dimension": 3, "start": (1.0, 0.3, 0.7)}
    assert error_in_fixed_steps(gravity * TILTED, dt, "sdirk2", youngs_modulus=youngs_modulus, **away) <= 1.0


@pytest.mark.parametrize("gravity", [1e-6, 1e-4, *GRAVITIES[1:]])
@pytest.mark.parametrize("integrator", ["sdirk2", "tr_bdf2", "generalised_alpha"])
def test_adaptive_steps_fall_exactly(integrator, gravity):
    assert error_of_fall(falling(gravity * DOWN, integrator=integrator), gravity * DOWN, 0.5) <= 1.0


@pytest.mark.parametrize("gravity", [1e-6, 1e-3, 9.81])
def test_adaptive_steps_of_order_one_fall_within_their_tolerance_each(gravity):
    simulator = falling(gravity * DOWN, integrator="implicit_euler")
    before = simulator.positions.copy()
    steps = simulator.run(0.5).steps
    np.testing.assert_allclose(simulator.velocities[:, 2], -0.5 * gravity, rtol=ROUNDING)
    behind = (simulator.positions - before)[:, 2] + 0.125 * gravity
    assert -1e-4 * 0.1 * steps <= behind.min() and behind.max() < 0.0


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_slow_strip_keeps_its_speed_where_steps_are_below_the_last_digit(dimension):
    simulator = falling(0.0 * DOWN, integrator="sdirk2", dt=1e-8, dimension=dimension, start=(1.0, 0, 0))
    state, speed = simulator._state, 3e-10  # 3e-18 m a step, where the last digit of a coordinate is 2e-16 m
    state.velocity[:, 0] = speed
    state.body_velocity[:, 0] = speed
    before = state.copy()
    simulator.run(STEPS * 1e-8)
    for now, low, then in (
        (state.position, state.position_low, before.position),
        (state.body_position, state.body_position_low, before.body_position),
    ):
        np.testing.assert_allclose((now - then + low)[:, 0], speed * simulator.time, rtol=1e-9)


@pytest.mark.parametrize("gravity", [1e-3, 9.81])
def test_a_ribbon_sinks_to_the_gap_that_carries_its_weight(gravity):
    thickness, width, barrier_distance, stiffness = 2e-3, 0.01, 1e-3, 1e7
    resting = scene(
        [rod([layer("lower"), layer("upper")], start=(0, 0, thickness), stations=11)],
        gravity=[0, 0, -gravity],
        obstacles=[GROUND],
        contact=contact(barrier_distance),
        damping={"mass": 20.0},
        duration=20.0,
    )
    resting["solver"] = {"model": "laminate"}
    simulator = Simulator(load_scene(resting))
    simulator.run()
    load = 1000.0 * thickness * width * gravity  # weight per length [N/m]
    low, high = 0.5 * barrier_distance, barrier_distance
    for _ in range(100):
        gap = 0.5 * (low + high)
        short = gap - barrier_distance
        force = stiffness * (2.0 * short * np.log(gap / barrier_distance) + short**2 / gap)
        low, high = (gap, high) if force > load else (low, gap)
    gaps = simulator.positions[:, 2] - 0.5 * thickness
    np.testing.assert_allclose(gaps, gap, rtol=0.0, atol=1e-6 * barrier_distance)


@kernel
def sum_of(values):
    """Sum and rest; a kernel whose own arithmetic may be reordered."""
    total, low = 0.0, 0.0
    for i in range(values.shape[0]):
        total, low = add_exactly(total, low, values[i])
    return total, low


def test_sums_keep_what_rounding_cuts_off():
    values = np.full(10_000, 1e-20)
    values[0] = 1.0
    total, low = sum_of(values)
    assert total == 1.0 and low == pytest.approx(9999e-20, rel=1e-12)
    assert sum_of(np.array([1.0, 1e-16, 1e-16, 1e-16]))[0] == 1.0 + 2.0**-52

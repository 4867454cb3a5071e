"""Contact damping of bodies from a coefficient of restitution; rebounds are cases of `bilayer validate`."""

from fractions import Fraction

import numpy as np
import pytest
from support.sample_scenes import GROUND, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.contact.barrier import barrier
from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.errors import SceneError
from bilayer_core.forces.restitution import damping_of, integral_of_barrier
from bilayer_core.model.build_model import build_model
from bilayer_core.model.state import initial_state
from bilayer_core.verification.validate.impacts import rebound, thrown


def speed_after(content, seconds, **steps):
    """Of the ball, upwards, and the simulator."""
    simulator = Simulator(load_scene(content), **steps)
    simulator.run(seconds)
    height = simulator.bodies["ball"].position[2]
    simulator.run(1e-4)
    return (simulator.bodies["ball"].position[2] - height) / 1e-4, simulator


@pytest.mark.parametrize(("restitution", "z"), [(1.0, 0.0), (0.9, 0.1665), (0.5, 1.433), (0.1, 10.0), (0.0, 100.0)])
def test_the_damping_of_a_coefficient_is_that_of_the_closed_form(restitution, z):
    assert damping_of(restitution) == pytest.approx(z, rel=1e-3, abs=1e-12)


def exact_logarithm(x):
    """ln x to 40 digits, by ln x = −k ln 2 + 2 artanh((m − 1)/(m + 1)) with m = 2^k x in [1, 2)."""

    def doubled_artanh(z):
        return 2 * sum(z ** (2 * k + 1) / (2 * k + 1) for k in range(60))

    doublings = 0
    while x < 1:
        x, doublings = 2 * x, doublings + 1
    return doubled_artanh((x - 1) / (x + 1)) - doublings * doubled_artanh(Fraction(1, 3))


@pytest.mark.parametrize("gap", [1e-9, 0.1, 0.3, 0.69, 0.7, 0.71, 0.9, 0.99, 0.999, 1.0 - 1e-6])
def test_the_integral_of_the_barrier_keeps_its_digits(gap):
    distance = 1e-3
    y = 1 - Fraction(gap * distance) / Fraction(distance)
    closed = ((y**3 - 1) * exact_logarithm(1 - y) - y - y**2 / 2 - y**3 / 3) / 3
    reference = Fraction(distance) ** 3 * closed
    rounding = 2e-16 / float(y)  # of 1 − d/d̂
    assert abs(integral_of_barrier(gap * distance, distance) / reference - 1) < 1e-14 + 4 * rounding


@pytest.mark.parametrize("gap", [0.2, 0.65, 0.75, 0.95])
def test_the_integral_of_the_barrier_has_the_barrier_as_its_slope(gap):
    distance, h = 1e-3, 1e-8
    above, below = (integral_of_barrier(gap * distance + s * h, distance) for s in (1, -1))
    assert (above - below) / (2 * h) == pytest.approx(barrier(gap * distance, distance), rel=1e-6)


@pytest.mark.parametrize("integrator", ["sdirk2", "tr_bdf2", "generalised_alpha"])
@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.9])
def test_fixed_steps_that_resolve_the_impact_rebound_with_the_coefficient(restitution, integrator):
    content = thrown(1e9, 2, restitution=restitution)
    assert speed_after(content, 3e-4, dt=1e-6, integrator=integrator)[0] / 10.0 == pytest.approx(restitution, abs=0.01)


@pytest.mark.parametrize(("stiffness", "speed"), [(1e9, 10.0), (1e10, 10.0), (1e9, 1.0), (1e11, 30.0)])
def test_it_does_not_depend_on_speed_or_stiffness(stiffness, speed):
    content = thrown(stiffness, 2, restitution=0.6)
    content["bodies"][0]["motion"]["velocity"] = [0, 0, -speed]
    after, _ = speed_after(content, 4e-3, tolerance=1e-4)
    assert after / speed == pytest.approx(0.6, abs=0.02)


def test_two_bodies_rebound_from_each_other_and_keep_their_momentum():
    thin = rod([layer()], start=(0, 1.0, 0.5))
    balls = [ball((0, 0, z), mass=mass) | {"name": name} for name, z, mass in (("low", 0, 2e-3), ("high", 0.042, 1e-3))]
    for body, speed in zip(balls, (0.0, -5.0), strict=True):
        body["motion"] |= {"velocity": [0, 0, speed], "inertia": [4e-7] * 3}
        body["contact_points"] = [{"position": [0, 0, 0], "length": 0.02, "offset": 0.02}]
    law = contact(1e-4) | {"stiffness": 1e9, "restitution": 0.5}
    simulator = Simulator(load_scene(scene([thin], solver={"dt": None}, bodies=balls, contact=law)), tolerance=1e-5)
    simulator.run(2e-3)
    low, high = simulator._state.body_velocity[:2, 2]
    assert 2e-3 * low + 1e-3 * high == pytest.approx(-5e-3, rel=1e-6)
    assert (high - low) / 5.0 == pytest.approx(0.5, abs=0.03)


def test_a_ball_that_bounces_loses_the_same_part_each_time_and_comes_to_rest():
    content = thrown(1e8, 2, restitution=0.7) | {"gravity": [0, 0, -9.81], "duration": 2.0}
    content["bodies"][0] |= {"position": [0.05, 1.0, 0.07]}
    content["bodies"][0]["motion"]["velocity"] = [0, 0, 0]
    simulator, heights = Simulator(load_scene(content), tolerance=1e-5), []
    simulator.run(2.0, each_step=lambda time: heights.append(simulator.bodies["ball"].position[2]))
    heights = np.array(heights) - 0.02
    tops = heights[1:-1][(heights[1:-1] >= heights[:-2]) & (heights[1:-1] > heights[2:])]
    assert tops[0] == pytest.approx(0.05 * 0.49, rel=0.04) and tops[1] == pytest.approx(0.05 * 0.49**2, rel=0.06)
    assert abs(simulator._state.body_velocity[0, 2]) < 1e-3


def test_its_loss_is_in_the_energy_budget():
    simulator = Simulator(load_scene(thrown(1e9, 2, restitution=0.5)), tolerance=1e-5, budget=True)
    simulator.run(1e-3)
    kinetic = 0.5 * 2.7e-3 * 100.0
    assert simulator.budget()["lost"]["restitution"] == pytest.approx(0.75 * kinetic, rel=0.03)


@pytest.mark.parametrize("speed", [0.02, 2.0, -2.0])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_derivatives_agree_with_differences(restitution, speed):
    content = thrown(1e6, 3, restitution=restitution)
    content["bodies"][0]["position"][2] = 0.02 + 5e-5
    model = build_model(load_scene(content), "laminate", 3)
    evaluator, state = Evaluator(model), initial_state(model, memory=1)
    state.memory[:], state.strain_rate[:] = 1.0, -speed
    at, trial = evaluator.new(), evaluator.new()
    evaluator.take_state(state, at)
    drive = model.drives.rest_strain, model.drives.joint_rest, np.zeros(0)
    evaluator.stand_still(state, at, 1e-5, *drive)
    evaluator.start_stage(at)

    def value(height, forces=("restitution",), second=False):
        body_step = np.zeros((1, 6))
        body_step[0, 2] = height
        evaluator.move(at, np.zeros(model.layout.size), body_step, trial)
        evaluator.evaluate(trial, forces, second=second)
        return evaluator.total, evaluator.sums.body[0, 2], evaluator.sums.body_hessian[2, 2]

    _, gradient, hessian = value(0.0, second=True)
    h = 1e-9
    assert gradient == pytest.approx((value(h)[0] - value(-h)[0]) / (2 * h), rel=1e-5)
    assert hessian == pytest.approx((value(h)[1] - value(-h)[1]) / (2 * h), rel=1e-5)
    assert np.sign(gradient) == -np.sign(speed)


def test_without_a_coefficient_nothing_is_computed_and_one_gives_all_back():
    simulator = Simulator(load_scene(thrown(1e9, 2)))
    assert simulator.plan.terms["restitution"] == "skipped: contact.restitution is not below 1"
    assert rebound(2, "sdirk2", 1e-4, restitution=1.0) == rebound(2, "sdirk2", 1e-4)


def test_a_saved_state_goes_on_within_an_impact():
    content = thrown(1e9, 2, restitution=0.5)
    whole = Simulator(load_scene(content), tolerance=1e-4)
    whole.run(1e-4)
    rest = Simulator(load_scene(content), tolerance=1e-4)
    rest.load_state(whole.save_state())
    for simulator in (whole, rest):
        simulator.run(3e-4)
    assert np.array_equal(whole.save_state(), rest.save_state(), equal_nan=True)


@pytest.mark.parametrize("value", [-0.1, 1.5, "high"])
def test_a_coefficient_that_is_none_is_refused(value):
    strip = rod([layer()], clamp_start="wall")
    content = scene([strip], bodies=[fixed()], obstacles=[GROUND], contact=contact() | {"restitution": value})
    with pytest.raises(SceneError, match=r"contact\.restitution"):
        load_scene(content)

"""Free strips that spin about their axis while it turns, in space."""

from functools import cache

import numpy as np
import pytest
from support.budgets import EXACT, SOFT
from support.evaluations import Problem
from support.sample_scenes import layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.model.plan import MODELS

SPIN = [50.0, 20.0, 3.0]  # [rad/s], the first about the axis of the strip


@cache
def spun(model, integrator, dt):
    """The part by which the angular momentum of a free strip about its mass centre changes in 50 ms."""
    strip = rod([layer("lower", 2e-3), layer("upper", 2e-3)], 0.1, 11)
    content = scene([strip], {**EXACT, "model": model}, materials=SOFT, angular_velocity=SPIN, velocity=[0.3, 0, 0.1])
    simulator = Simulator(load_scene(content), integrator=integrator, dt=dt)
    start = about_mass_centre(simulator)
    simulator.run(0.05)
    return np.linalg.norm(about_mass_centre(simulator) - start) / np.linalg.norm(start)


def about_mass_centre(simulator):
    return simulator.angular_momentum - np.cross(simulator.com, simulator.momentum)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("integrator", ["implicit_midpoint", "tr_bdf2"])
def test_a_spinning_strip_keeps_its_angular_momentum_to_an_order(model, integrator):
    coarse, fine = (spun(model, integrator, dt) for dt in (5e-4, 2.5e-4))
    assert fine < 2e-6  # 2.7e-2 without the force, at any step
    assert np.log2(coarse / fine) > 1.8


def test_the_force_of_an_edge_has_the_moment_that_turns_its_spin_and_does_no_work():
    problem = Problem(scene([rod([layer("lower"), layer("upper")], 0.03, 7)]), np.random.default_rng(2))
    evaluator, at, model = problem.evaluator, problem.at, problem.model
    evaluator.update_lagged(at)
    energy = evaluator.forces(at, ("gyroscopic",))["gyroscopic"]
    stage, node, edges = evaluator.stage, model.rods.edge_node, model.rods.edge_count
    edge, before = (x[node + 1] - x[node] for x in (at.position, stage.origin_position))
    rate, tangent = (edge - before) / stage.length, at.tangent[:edges]
    turning = (rate - (rate * tangent).sum(axis=1)[:, None] * tangent) / at.length[:edges, None]
    spin = (at.total_angle - stage.origin_angle) / stage.length
    force = -evaluator.sums.edge[:edges, :3]
    wanted = -(model.rods.spin_inertia * spin)[:, None] * turning
    np.testing.assert_allclose(np.cross(edge, force), wanted, rtol=1e-9, atol=1e-12 * np.abs(wanted).max())
    assert abs(energy) < 1e-12 * (np.abs(force) * np.abs(edge - before)).sum()


def test_nothing_spins_in_a_plane():
    strip = scene([rod([layer()])], angular_velocity=[0, 20.0, 0])
    simulators = [Simulator(load_scene(strip), dimension=dimension) for dimension in (2, 3)]
    told = [simulator.plan.terms["gyroscopic"] for simulator in simulators]
    assert told == ["skipped: nothing turns about its axis in a plane", "active"]


@pytest.mark.parametrize("motion", [{"type": "free", "mass": 1e-3, "inertia": [1e-8] * 3}, {"type": "prescribed"}])
def test_a_force_taken_anew_leaves_the_gradient_of_an_evaluation_with_it(motion):
    arm = rod([layer("lower"), layer("upper")], 0.03, 7, clamp_start="hub", clamp_end="tip")
    hubs = [{"name": name, "position": [x, 0, 0], "motion": motion} for name, x in (("hub", 0.0), ("tip", 0.03))]
    problem = Problem(scene([arm], bodies=hubs), np.random.default_rng(2))
    evaluator, at, sums = problem.evaluator, problem.at, problem.evaluator.sums

    def gradients():
        return np.concatenate([part.ravel() for part in (sums.gradient, sums.body, sums.attached, sums.edge)])

    evaluator.evaluate(at, ("gyroscopic",))
    elsewhere = gradients()
    evaluator.update_lagged(at)
    taken = gradients()
    evaluator.evaluate(at, ("gyroscopic",))
    anew = gradients()
    largest = np.abs(anew).max()
    assert np.abs(elsewhere - anew).max() > 1e-3 * largest
    assert np.abs(taken - anew).max() < 1e-13 * largest

"""The energy budget of whole runs: that it closes, and what the integrator loses."""

import math

import numpy as np
import pytest
from support.budgets import EXACT, SOFT, clamped, driven, moving, run, throw
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.integrators.integrator_register import INTEGRATORS

# what the integrator loses


def test_what_implicit_euler_loses_is_what_its_velocities_say():
    """With a = Δv/h the accelerations of its steps: Σ ½ (aₙ + aₙ₊₁)·M Δx − ΔT, from velocities and masses alone.

    These are trapezoids, so the two come together at second order.
    """
    differences = []
    for dt in (1e-3, 5e-4):
        simulator = Simulator(load_scene(clamped((0, 0, -9.81))), dt=dt, integrator="implicit_euler", budget=True)
        mass = simulator.model.rods.node_mass[1:, None]
        v, a = np.zeros((8, 3)), np.array([0, 0, -9.81])
        work = 0.0
        for _ in range(round(0.05 / dt)):
            simulator.step()
            new = simulator.velocities[1:]
            work += 0.5 * np.sum(mass * (a + (new - v) / dt) * new) * dt
            a, v = (new - v) / dt, new
        lost = simulator.budget()["lost"]["numerical"]
        differences.append(abs(lost - (work - 0.5 * np.sum(mass * v**2))))
        assert lost > 0.005 * simulator.budget()["stored"]["kinetic"]
        assert differences[-1] < 2e-3 * lost
    assert math.log2(differences[0] / differences[1]) > 1.6


def test_the_spin_of_a_tumbling_body_costs_only_what_the_integrator_loses():
    away = rod([layer()], length=0.02, stations=3, start=(0, 5, 5), clamp_start="wall")
    motion = {"type": "free", "mass": 0.01, "inertia": [1e-6, 2e-6, 2.5e-6], "angular_velocity": [3.0, 20.0, 1.0]}
    tumbling = scene(
        [away], bodies=[fixed(position=(0, 5, 5)), {"name": "brick", "position": [0, 0, 0], "motion": motion}]
    )
    changes = []
    for dt in (1e-3, 5e-4):
        budget = run(tumbling, 0.3, dt).budget()
        assert budget["lost"]["numerical"] == pytest.approx(-budget["stored"]["kinetic"], rel=1e-9)
        changes.append(budget["stored"]["kinetic"])
    assert abs(changes[1]) < 0.05 * 0.5 * 2e-6 * 20.0**2
    assert math.log2(changes[0] / changes[1]) == pytest.approx(1.0, abs=0.1)


def test_a_strip_that_spins_freely_loses_angular_momentum_at_first_order():
    strip = scene([rod([layer()], length=0.1, stations=11, start=(-0.05, 0, 0))], solver=EXACT)
    lost = []
    for dt in (5e-4, 2.5e-4):
        simulator = Simulator(load_scene(strip), dt=dt, integrator="implicit_euler")
        masses, radius = simulator.model.rods.node_mass, simulator.positions[:, 0]
        throw(simulator, np.stack([0 * radius, 10.0 * radius, 0 * radius], axis=1))
        simulator.run(0.1)
        momentum = masses @ np.cross(simulator.positions, simulator.velocities)
        lost.append(1.0 - momentum[2] / (10.0 * masses @ radius**2))
    assert 0.0 < lost[1] < 0.01
    assert math.log2(lost[0] / lost[1]) == pytest.approx(1.0, abs=0.03)


# the whole


def flyer():
    """A free hub with two unlike arms: it turns while they bend."""
    active = layer("active", eigenstrain={"stimulus": "heat", "gain": 0.03})
    arm = rod([layer("passive"), active], length=0.03, stations=9, start=(0.004, 0, 0), name="arm", clamp_start="hub")
    wing = rod([layer()], length=0.02, stations=6, start=(0.004, 0, 0.01), name="wing", clamp_start="hub")
    motion = {"type": "free", "mass": 1e-3, "inertia": [1e-8, 2e-8, 3e-8]}
    wave = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.2, "phase": -math.pi / 2}
    return scene(
        [arm, wing],
        bodies=[{"name": "hub", "position": [0, 0, 0], "motion": motion}],
        materials=SOFT,
        stimuli={"heat": {"schedule": wave}},
        solver=EXACT,
    )


CLAMPED, FLYING = (driven(gravity=[0, 0, -9.81]), 4.0), (flyer(), 2.0)  # what a turning body holds goes along arcs


@pytest.mark.parametrize(
    ("description", "quadrature", "integrator"),
    [
        pytest.param(*scene_, name, id=f"{of}-{name}", marks=() if name in quick else pytest.mark.verify)
        for of, scene_, quick in (
            ("clamped", CLAMPED, ("implicit_euler", "tr_bdf2", "implicit_midpoint")),
            ("flying", FLYING, ("sdirk2", "generalised_alpha")),
        )
        for name in INTEGRATORS
    ],
)
def test_budget_of_a_driven_bilayer_closes_and_its_numerical_loss_has_the_order(description, quadrature, integrator):
    budgets = [run(description, 0.15, dt, integrator=integrator).budget() for dt in (1e-3, 2.5e-4)]
    residual = [abs(budget["residual"]) for budget in budgets]
    numerical = [budget["lost"]["numerical"] for budget in budgets]
    largest = budgets[1]["residual"] / budgets[1]["relative_residual"]
    assert residual[1] < 1e-5 * largest
    assert math.log(residual[0] / residual[1], 4) == pytest.approx(quadrature, abs=0.4)
    order = INTEGRATORS[integrator].order
    assert abs(numerical[1]) < (0.05 if order == 1 else 5e-4) * largest
    assert math.log(numerical[0] / numerical[1], 4) == pytest.approx(order, abs=0.25)


@pytest.mark.verify
def test_the_first_cycle_of_the_inchworm_closes():
    lost = []
    for dt in (2e-3, 1e-3):
        simulator = Simulator(load_scene("crawling_inchworm"), dt=dt, integrator="implicit_euler", budget=True)
        simulator.run(0.4)
        assert abs(simulator.budget()["relative_residual"]) < 1e-4
        simulator.load_state(simulator.save_state())  # it has come to lie on the barrier: a shock, whatever the step
        numerical = [0.0]
        for _ in range(5):
            simulator.run(0.4)
            numerical.append(simulator.budget()["lost"]["numerical"])
        budget = simulator.budget()
        assert abs(budget["relative_residual"]) < 1e-5
        paid = budget["supplied"]["stimulus"] - sum(budget["stored"].values())
        assert budget["lost"]["friction"] == pytest.approx(paid, rel=1e-3)
        # friction with the loads of a step's start takes too much while they fall and too little while they rise
        lost.append(np.abs(np.diff(numerical)).sum())
    assert lost[0] / lost[1] > 1.8


def test_the_inertia_of_a_flowing_fluid_takes_part_in_the_budget():
    fluid = {"drag_along": 0.3, "drag_across": 1.2, "added_mass": True, "velocity": [0.1, 0, 0.2]}
    towed = driven(fluid=fluid, bodies=[moving("wall", (0, 0, 0), (0, 3e-3, 0.01), 0.1)])
    budgets = [run(towed, 0.1, dt).budget() for dt in (5e-4, 2.5e-4)]
    lost = [budget["lost"]["numerical"] for budget in budgets]
    assert budgets[1]["stored"]["fluid"] > 10.0 * lost[1]
    assert abs(budgets[1]["relative_residual"]) < 1e-5
    assert math.log2(lost[0] / lost[1]) == pytest.approx(1.0, abs=0.1)


# the keeping of it


def test_keeping_the_budget_changes_nothing_and_a_loaded_state_starts_it_from_zero():
    kept, plain = Simulator(load_scene(driven()), budget=True), Simulator(load_scene(driven()))
    kept.run(0.02)
    plain.run(0.02)
    assert np.array_equal(kept.save_state(), plain.save_state(), equal_nan=True)
    assert kept.energy() == plain.energy()
    assert "budget" not in plain.summary()
    with pytest.raises(InputError, match="budget=True"):
        plain.budget()
    assert kept.summary()["budget"]["supplied"]["stimulus"] > 0.0
    kept.load_state(kept.save_state())
    assert kept.budget()["supplied"]["stimulus"] == kept.budget()["residual"] == 0.0
    kept.run(0.01)
    kept.solve_static()
    assert kept.budget()["supplied"]["stimulus"] == kept.budget()["stored"]["bending"] == 0.0


def test_parts_of_halved_steps_enter_the_budget():
    hasty = driven(gain=0.1, solver={"max_newton_iterations": 4, "max_halvings": 6})
    simulator = run(hasty, 0.1, 1e-2)
    assert simulator.statistics.rejected > 0
    assert abs(simulator.budget()["relative_residual"]) < 0.02


def test_accepted_parts_of_a_step_that_fails_stay_in_state_and_budget():
    simulator = run(driven(solver={"max_halvings": 1}), 0.05, 1e-3)
    engine, state = simulator._stepper.engine, simulator._state
    integrate, newton, parts = engine.integrate, engine._newton, []

    def fails_after_the_first_part(*arguments):
        if parts:
            engine._newton = 1e-30, 1
        found = integrate(*arguments)
        parts.append((simulator.time, simulator.save_state(), found))
        return found

    state.next_step[0] = 0.5e-3  # as after a step that failed
    engine.integrate = fails_after_the_first_part
    record, budgets = simulator._stepper.ledger.record, []
    simulator._stepper.ledger.record = lambda *arguments: (record(*arguments), budgets.append(simulator.budget()))
    with pytest.raises(SimulationError, match=r"stopped at t = 0\.0505 s"):
        simulator.step()
    assert [found.done for _, _, found in parts] == [1, 0] and len(budgets) == 1
    np.testing.assert_array_equal(simulator.save_state(), parts[0][1])
    assert simulator.budget() == budgets[0]
    del engine.integrate, simulator._stepper.ledger.record
    engine._newton = newton
    simulator.step()
    assert simulator.time == pytest.approx(0.051, abs=1e-15)
    assert simulator.budget()["supplied"]["stimulus"] > budgets[0]["supplied"]["stimulus"]
    assert abs(simulator.budget()["relative_residual"]) < 1e-4

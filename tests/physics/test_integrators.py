"""Every integrator of the table: its order, what it conserves, how it damps, and that it can be restarted."""

import math
from functools import cache

import numpy as np
import pytest
from support.moving_scenes import EXACT, PROBLEMS, SOFT, cantilever, driven, part, spinner, with_parts
from support.sample_scenes import GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.integrators.method import Method

HISTORY = [name for name, method in INTEGRATORS.items() if method.history is not None]
SECOND_ORDER = [name for name, method in INTEGRATORS.items() if method.order == 2]
DAMPED = [name for name in INTEGRATORS if name != "implicit_midpoint"]


def turning_with(simulator):
    """Give the strip of `spinner` the velocities of the body that holds it."""
    spin, shift = part(simulator, "body_angular_velocity")[0], part(simulator, "body_velocity")[0]
    position = part(simulator, "position")
    tangent = np.diff(position, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    with_parts(simulator, velocity=shift + np.cross(spin, position), spin=tangent @ spin)


@cache
def end_of(problem, integrator, dt):
    """Positions with directions, and velocities, at the end of a problem."""
    description, duration = PROBLEMS[problem]
    simulator = Simulator(load_scene(description), dt=dt, integrator=integrator)
    if problem == "spinning body":
        turning_with(simulator)
    simulator.run(duration)
    places = [part(simulator, name) for name in ("position", "director1", "body_position", "body_rotation")]
    speeds = [part(simulator, name) for name in ("velocity", "body_velocity", "body_angular_velocity")]
    return [np.concatenate([np.ravel(values) for values in group]) for group in (places, speeds)]


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_positions_and_velocities_converge_at_the_order_of_the_integrator(integrator, problem):
    runs = [end_of(problem, integrator, dt) for dt in (5e-4, 2.5e-4, 1.25e-4)]
    for coarse, middle, fine in zip(*runs, strict=True):
        first, second = np.linalg.norm(coarse - middle), np.linalg.norm(middle - fine)
        assert math.log2(first / second) == pytest.approx(INTEGRATORS[integrator].order, abs=0.2)


THREE = 0.4358665215084590  # of Alexander's method, L-stable, whose last stage is the end of the step
ENDS = -(6 * THREE**2 - 16 * THREE + 1) / 4, (6 * THREE**2 - 20 * THREE + 5) / 4
CROUZEIX = 0.5 + math.sqrt(3) / 6
OF_ORDER_3 = {
    "alexander": Method(
        "alexander", 3, THREE, (THREE, 0.5 * (1 + THREE), 1.0), ((), (0.5 * (1 - THREE),), ENDS), None, ""
    ),
    "crouzeix": Method("crouzeix", 3, CROUZEIX, (CROUZEIX, 1 - CROUZEIX), ((), (1 - 2 * CROUZEIX,)), (0.5, 0.5), ""),
}


@pytest.mark.parametrize("name", OF_ORDER_3)
def test_a_method_may_have_any_number_of_stages_and_end_beyond_the_last(name, monkeypatch):
    """Methods that only this test knows, in the place of another: three stages; two, and an end beyond them."""
    monkeypatch.setitem(INTEGRATORS, "sdirk2", OF_ORDER_3[name])
    runs = [end_of.__wrapped__("cantilever", "sdirk2", dt) for dt in (1e-3, 5e-4, 2.5e-4)]
    for coarse, middle, fine in zip(*runs, strict=True):
        first, second = np.linalg.norm(coarse - middle), np.linalg.norm(middle - fine)
        assert math.log2(first / second) == pytest.approx(3.0, abs=0.3)


def free_strip():
    """A soft strip with nothing around it."""
    return scene([rod([layer(thickness=4e-3)], length=0.03, stations=5)], materials=SOFT, solver=EXACT)


def thrown(integrator, dt):
    """`free_strip` after a while, thrown so that it spins, stretches and bends in a plane: linear and angular momentum,
    before and after, and the impulses that nodes have exchanged.
    """
    simulator = Simulator(load_scene(free_strip()), dt=dt, integrator=integrator)
    mass, along = simulator.model.rods.node_mass[:, None], part(simulator, "position")[:, :1] - 0.015
    with_parts(simulator, velocity=np.hstack([3.0 * along, 0.0 * along + 0.3, 4.0 * along + 100.0 * along**2]))
    places, speeds = [simulator.positions], [simulator.velocities]
    simulator.run(0.1)
    places.append(simulator.positions)
    speeds.append(simulator.velocities)
    linear = [(mass * v).sum(axis=0) for v in speeds]
    angular = [np.cross(x, mass * v).sum(axis=0) for x, v in zip(places, speeds, strict=True)]
    return linear, angular, np.abs(mass * (speeds[1] - speeds[0])).sum()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_linear_momentum_of_a_free_strip_is_kept(integrator):
    (before, after), _, exchanged = thrown(integrator, 1e-3)
    assert exchanged > 1e-5
    assert np.abs(after - before).max() < 1e-9 * exchanged


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_angular_momentum_of_a_free_strip_is_kept_at_the_order_of_the_integrator(integrator):
    losses = []
    for dt in (2.5e-4, 1.25e-4):
        _, (before, after), _ = thrown(integrator, dt)
        losses.append(np.linalg.norm(after - before) / np.linalg.norm(before))
    if integrator == "implicit_midpoint":
        assert max(losses) < 1e-9  # the tolerance of Newton
    else:
        assert losses[1] < (1e-3 if INTEGRATORS[integrator].order == 1 else 1e-5)
        assert math.log2(losses[0] / losses[1]) == pytest.approx(INTEGRATORS[integrator].order, abs=0.25)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_body_that_flies_freely_keeps_its_angular_momentum(integrator):
    description = spinner()
    description["bodies"].append(fixed())
    description["rods"][0]["clamp_start"] = "wall"
    description["rods"][0]["path"]["start"] = [0, 0, 0]
    simulator = Simulator(load_scene(description), dt=5e-3, integrator=integrator)

    def angular_momentum():
        turn, spin = part(simulator, "body_rotation")[0], part(simulator, "body_angular_velocity")[0]
        return turn @ (np.array([1e-7, 2e-7, 2.5e-7]) * (turn.T @ spin))

    before, spin = angular_momentum(), part(simulator, "body_angular_velocity")[0].copy()
    simulator.run(1.0)
    assert np.linalg.norm(part(simulator, "body_angular_velocity")[0] - spin) > 1.0  # it tumbles
    assert angular_momentum() == pytest.approx(before, rel=1e-9, abs=1e-9 * np.linalg.norm(before))


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_run_goes_on_bit_for_bit_from_a_saved_state(integrator):
    description = driven(added_mass=True)
    description["obstacles"] = [{**GROUND, "point": [0, 0, -2.5e-3]}]
    description["contact"] = {**contact(coefficient=0.3, barrier_distance=1e-4), "stiffness": 1e4}
    description["loads"] = cantilever()["loads"]
    first, second = (Simulator(load_scene(description), dt=2e-3, integrator=integrator) for _ in range(2))
    first.run(0.03)
    snapshot = first.save_state()
    first.run(0.03)
    second.load_state(snapshot)
    second.run(0.03)
    assert first.statistics.max_contact_force > 0.0
    np.testing.assert_array_equal(second.save_state(), first.save_state())


@pytest.mark.parametrize("integrator", DAMPED)
def test_a_ribbon_that_is_dropped_comes_to_rest_on_the_barrier(integrator):
    strip = rod([layer(thickness=2e-3)], length=0.04, stations=9, start=(0, 0, 2e-3))
    dropped = scene(
        [strip],
        gravity=[0.5, 0, -9.81],
        obstacles=[GROUND],
        contact=contact(coefficient=0.3, barrier_distance=2e-4),
    )
    simulator = Simulator(load_scene(dropped), dt=1e-3, integrator=integrator)  # five periods of the barrier
    simulator.run(0.3)
    weight = 9.81 * simulator.model.rods.node_mass.sum()
    for _ in range(20):
        simulator.step()
        assert np.abs(simulator.velocities[:, 2]).max() < 1e-5
        assert simulator.contact_forces[:, 2].sum() == pytest.approx(weight, rel=1e-2)
    assert simulator.statistics.min_gap > 0.0


@pytest.mark.parametrize("integrator", SECOND_ORDER)
def test_a_jump_of_the_stimulus_at_the_end_of_a_step_leaves_the_order_as_it_is(integrator):
    growth = {"stimulus": "heat", "gain": 0.02}
    layers = [layer("bottom", thickness=2e-3), layer("top", thickness=2e-3, eigenstrain=growth)]
    softest = {"gel": {**SOFT["gel"], "youngs_modulus": 30.0}}  # all its vibrations are followed
    jumping = scene(
        [rod(layers, length=0.03, stations=3, clamp_start="wall")],
        bodies=[fixed()],
        materials=softest,
        stimuli={"heat": {"schedule": {"type": "square", "low": 0, "high": 1, "period": 0.04, "start": 0.02}}},
        loads=[
            {
                "name": "pull",
                "rod": "rod",
                "position": 0.03,
                "force": [0, 2e-6, 1e-6],
                "schedule": {"type": "square", "low": 0, "high": 1, "period": 0.06, "start": 0.01},
            }
        ],
        solver=EXACT,
    )
    ends = []
    for dt in (2.5e-4, 1.25e-4, 6.25e-5):
        simulator = Simulator(load_scene(jumping), dt=dt, integrator=integrator)
        simulator.run(0.055)
        ends.append((simulator.positions, simulator.velocities))
    for coarse, middle, fine in zip(*ends, strict=True):
        first, second = np.linalg.norm(coarse - middle), np.linalg.norm(middle - fine)
        assert math.log2(first / second) == pytest.approx(2.0, abs=0.25)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_halved_steps_end_where_short_steps_end(integrator):
    description = driven()
    one = Simulator(load_scene(description), dt=2e-3, integrator=integrator)
    place = [name for name, _ in one.description.state_layout].index("next_step")
    state = one.save_state()
    state[place] = 1e-3  # as after a step that failed
    one.load_state(state)
    report = one.step()
    two = Simulator(load_scene(description), dt=1e-3, integrator=integrator)
    two.run(2e-3)
    assert report.substeps == 2
    np.testing.assert_allclose(one.positions, two.positions, rtol=0, atol=1e-15)
    np.testing.assert_allclose(one.velocities, two.velocities, rtol=0, atol=1e-12)


@pytest.mark.parametrize("integrator", HISTORY)
def test_an_integrator_with_a_history_makes_its_first_step_as_sdirk2(integrator):
    ends = []
    for name in (integrator, "sdirk2"):
        simulator = Simulator(load_scene(driven()), dt=1e-3, integrator=name)
        simulator.step()
        ends.append(simulator.positions)
        simulator.step()
        ends.append(simulator.positions)
    np.testing.assert_array_equal(ends[0], ends[2])
    assert np.abs(ends[1] - ends[3]).max() > 0.0


def test_sdirk2_and_tr_bdf2_are_the_same_for_a_linear_vibration():
    # a strip stretched along its axis is linear but for the change of its length's direction, which is none
    ends = []
    for name in ("sdirk2", "tr_bdf2"):
        simulator = Simulator(
            load_scene(scene([rod([layer()], length=0.03, stations=4)], materials=SOFT, solver=EXACT)),
            dt=1e-3,
            integrator=name,
        )
        with_parts(simulator, velocity=np.outer([1e-2, 2e-2, -1e-2, -3e-2], [1.0, 0, 0]))
        simulator.run(0.02)
        ends.append(simulator.positions)
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
    assert np.ptp(ends[0][:, 0]) != pytest.approx(0.03, rel=1e-4)


def test_velocities_of_prescribed_bodies_are_those_of_their_schedule():
    path = {"type": "prescribed", "times": [0.0, 0.1], "displacements": [[0, 0, 0], [0.01, 0, 0]]}
    strip = rod([layer(thickness=4e-3)], length=0.02, stations=3, clamp_start="hub")
    moved = scene([strip], bodies=[{"name": "hub", "position": [0, 0, 0], "motion": path}], materials=SOFT)
    for integrator in INTEGRATORS:
        simulator = Simulator(load_scene(moved), dt=5e-3, integrator=integrator)
        simulator.run(0.025)
        expected = 0.01 * 6.0 * 0.25 * 0.75 / 0.1
        assert simulator.frame().body_velocities[0, 0] == pytest.approx(expected, rel=1e-12)
        assert simulator.velocities[0, 0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_no_step_writes_beyond_the_values_of_its_state(integrator):
    """A step that may be refused at its end keeps the whole state, whatever parts that has."""
    description, _ = PROBLEMS["cantilever"]
    simulator = Simulator(load_scene(description), dt=2.5e-4, integrator=integrator)
    simulator.run(1e-3)
    assert simulator._stepper.engine._integration.start_state.values.shape == simulator.save_state().shape

"""Adaptive steps: their error, what refused ones leave, how they go on, and how long they are."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.moving_scenes import ADAPTIVE, EXACT, PROBLEMS, cantilever, driven, falling, part, simulate, with_parts
from support.sample_scenes import GROUND, PAPER, contact, everything, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.engine import error_norm_of
from bilayer_core.engine.error_norm import step_defect
from bilayer_core.engine.step_outcome import IntegrationReport
from bilayer_core.engine.step_size import LARGEST_GROWTH, after_rejection, after_success, fit
from bilayer_core.errors import InputError, SceneError, SimulationError
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.model.records.status import BEYOND, BLOCKED, MAX_ITERATIONS, TOO_INACCURATE, UNSETTLED
from bilayer_core.model.records.step import StateArrays
from bilayer_core.simulation.remedies import remedy


def defect_between(simulator, before, after, h):
    """That of a step of length `h`, from its ends."""
    ends = (StateArrays(**{name: getattr(state, name) for name in StateArrays.names}) for state in (before, after))
    return step_defect(error_norm_of(simulator.model), *ends, h)


# the error


@pytest.mark.parametrize("integrator", ADAPTIVE)
@pytest.mark.parametrize("problem", ["cantilever", "driven bilayer", "jet"])
def test_the_estimate_is_the_local_error_of_a_step(problem, integrator):
    description, h = PROBLEMS[problem][0], 5e-4
    start = simulate(description, 0.03, dt=h, integrator=integrator)
    exact = Simulator(load_scene(description), dt=h / 32, integrator="tr_bdf2")
    with_parts(exact, **{name: part(start, name) for name in ("position", "velocity", "director1", "spin", "twist")})
    with_parts(exact, **{name: part(start, name) for name in ("time", "transduction", "body_position")})
    before = start._state.copy()
    start.step()
    exact.run(h)
    found = INTEGRATORS[integrator].estimate * defect_between(start, before, start._state, h)
    # with the same velocities at both ends, D is the difference of the two ends
    apart = exact._state.copy()
    apart.velocity[:], apart.spin[:] = 0.0, 0.0
    other = start._state.copy()
    other.velocity[:], other.spin[:] = 0.0, 0.0
    assert found == pytest.approx(defect_between(start, apart, other, h), rel=0.2)


@pytest.mark.parametrize("integrator", ADAPTIVE)
def test_the_error_of_a_run_falls_with_the_tolerance_at_the_order_of_the_integrator(integrator):
    description = {**PROBLEMS["jet"][0], "solver": {**PAPER, **EXACT, "max_step": 0.02}}
    exact = simulate(description, 0.1, dt=5e-5, integrator="tr_bdf2")
    errors, steps = [], []
    tolerances = (1e-5, 1e-6, 1e-7)
    for tolerance in tolerances:
        run = simulate(description, 0.1, dt=1e-4, tolerance=tolerance, integrator=integrator)
        errors.append(np.linalg.norm(run.positions - exact.positions))
        steps.append(run.statistics.steps)
    order = INTEGRATORS[integrator].order
    assert math.log(errors[0] / errors[2]) / math.log(steps[2] / steps[0]) == pytest.approx(order, abs=0.35)
    slope = math.log(errors[0] / errors[2]) / math.log(tolerances[0] / tolerances[2])
    assert slope == pytest.approx(order / (order + 1), abs=0.12)


def test_the_estimate_does_not_depend_on_the_mesh():
    found = []
    for stations in (9, 33):
        strip = rod([layer(thickness=4e-3)], length=0.03, stations=stations, clamp_start="wall")
        simulator = simulate({**cantilever(), "rods": [strip]}, 0.02, dt=5e-4, integrator="sdirk2")
        before = simulator._state.copy()
        simulator.step()
        found.append(defect_between(simulator, before, simulator._state, 5e-4))
    assert found[1] == pytest.approx(found[0], rel=0.1)


@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2", "generalised_alpha"])
def test_a_ball_bounces_ever_nearer_to_where_it_fell_from(integrator):
    """The barrier is elastic: what lacks is the integrator's loss, in the impact most of all."""
    losses = []
    data = falling(max_step=0.02)
    for tolerance in (1e-4, 1e-5) if integrator == "implicit_euler" else (1e-4, 1e-5, 1e-6):
        simulator, heights = Simulator(load_scene(data), tolerance=tolerance, integrator=integrator), []
        simulator.run(
            0.2, each_step=lambda time, of=simulator, to=heights: to.append((time, of.bodies["ball"].position))
        )
        # at 0.152 s it would be at its highest again; its energy there, gravity's potential being 0 on top
        top = max(place[2] for time, place in heights if time > 0.1)
        losses.append((0.05 - top) / 0.029)
    limit = {"implicit_euler": 0.4, "sdirk2": 2e-3, "generalised_alpha": 1e-2}[integrator]
    assert losses == sorted(losses, reverse=True) and -1e-3 < losses[-1] < limit
    assert simulator.statistics.longest > 20.0 * simulator.statistics.shortest


def test_a_loop_that_lands_comes_nearer_to_its_motion_as_the_tolerance_falls():
    """The jumper, dropped: it lands at 0.7 m/s, is flattened and springs back."""
    dropped = load_scene("jumping", ["rods.loop.path.start=[8.1 mm, 0, 78.6 mm]"])
    ends = []
    for tolerance in (1e-3, 1e-6, 1e-7):
        simulator = Simulator(dropped, model="laminate", integrator="sdirk2", tolerance=tolerance)
        simulator.run(0.12)
        assert simulator.statistics.max_contact_force > 0.1  # [N], many times a node's weight
        ends.append(simulator.positions)
    coarse, fine = (np.sqrt(np.square(end - ends[2]).sum(axis=1).mean()) for end in ends[:2])
    assert fine < 0.3 * coarse
    assert fine < 5e-3 * dropped.rods[0].path.length


def test_what_lies_on_a_barrier_does_not_hold_steps_up():
    strip = rod([layer(thickness=2e-3)], length=0.04, stations=9, start=(0, 0, 1.199e-3))
    law = contact(coefficient=0.3, barrier_distance=2e-4)
    dropped = scene([strip], gravity=[0.5, 0, -9.81], obstacles=[GROUND], contact=law)
    simulator = simulate(dropped, 1.0, tolerance=1e-5, integrator="sdirk2")
    assert np.abs(simulator.velocities).max() < 1e-4
    assert part(simulator, "next_step")[0] == pytest.approx(simulator.steps.longest)


@pytest.mark.parametrize(("duration", "longest"), [(0.1, 1e-3), (3.0, 0.02), (50.0, 0.2)])
def test_the_longest_step_follows_from_the_duration_and_not_from_the_rate(duration, longest):
    for rate in (5.0, 500.0):
        config = load_scene(cantilever() | {"duration": duration, "output": {"rate": rate, "marker_rate": rate}})
        assert Simulator(config, tolerance=1e-4).steps.longest == pytest.approx(longest)


def test_newton_leaves_no_longer_a_way_in_a_long_step_than_in_one_of_20_ms():
    slow = driven() | {"duration": 50.0}
    slow["stimuli"]["heat"]["schedule"] = {"type": "ramp", "start": 0, "end": 50, "from": 0, "to": 1}
    simulator, reports = Simulator(load_scene(slow), tolerance=1e-4), []
    while simulator.time < 50.0:
        reports.append(simulator.step(until=50.0))
    most = 0.02 * simulator.steps.newton_tolerance
    assert max(of.residual * of.length for of in reports) <= most and reports[-1].length > 0.1


# what steps leave


@pytest.mark.parametrize("integrator", ADAPTIVE)
def test_a_refused_step_leaves_nothing(integrator):
    description = driven(added_mass=True)
    description["loads"] = cantilever()["loads"]
    settings = {"tolerance": 1e-5, "integrator": integrator, "budget": True}
    first, second = (Simulator(load_scene(description), **settings) for _ in range(2))
    for simulator in (first, second):
        simulator.run(0.02)
    with_parts(first, next_step=0.02)
    report = first.step()
    assert report.inaccurate > 0 and report.length < 0.02
    with_parts(second, next_step=report.length)
    assert second.step().rejected == 0
    for name in ("time", "step", "position", "velocity", "director1", "has_history", "acceleration", "transduction"):
        np.testing.assert_array_equal(part(second, name), part(first, name))
    assert second.budget() == first.budget()


@pytest.mark.parametrize("integrator", ADAPTIVE)
def test_a_run_goes_on_bit_for_bit_from_a_state_between_two_outputs(integrator):
    description = driven(added_mass=True)
    description["obstacles"] = [{**GROUND, "point": [0, 0, -2.5e-3]}]
    description["contact"] = {**contact(coefficient=0.3, barrier_distance=1e-4), "stiffness": 1e4}
    description["loads"] = cantilever()["loads"]
    first, second = (Simulator(load_scene(description), tolerance=1e-4, integrator=integrator) for _ in range(2))
    while first.time < 0.0283:
        first.step(until=0.06)
    snapshot = first.save_state()
    while first.time < 0.06:
        first.step(until=0.06)
    second.load_state(snapshot)
    while second.time < 0.06:
        second.step(until=0.06)
    assert first.statistics.max_contact_force > 0.0
    np.testing.assert_array_equal(second.save_state(), first.save_state())


def test_the_energy_budget_closes_over_adaptive_steps():
    simulator = simulate(driven(), 0.1, dt=0.02, tolerance=1e-5, integrator="sdirk2", budget=True)
    assert simulator.statistics.inaccurate > 0
    assert abs(simulator.budget()["relative_residual"]) < 1e-3


def test_a_step_in_which_newton_fails_is_shortened_and_the_run_goes_on():
    kicked = {**cantilever(), "solver": {**PAPER, **EXACT, "dt": 2e-2, "max_step": 2e-2, "max_newton_iterations": 6}}
    kicked["loads"][0]["schedule"] = {"type": "hold", "value": 3.0}
    simulator = Simulator(load_scene(kicked), tolerance=0.1, integrator="sdirk2")
    reports = [simulator.step(until=0.1)]
    while simulator.time < 0.1:
        reports.append(simulator.step(until=0.1))
    assert reports[0].rejected > reports[0].inaccurate and reports[0].length < 2e-2
    assert simulator.statistics.largest_residual <= EXACT["newton_tolerance"]


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_impact_faster_than_any_wave_of_the_robot_stops_no_run(dimension):
    """At 14 m/s a strip in which sound goes at 3 m/s meets a barrier of 1 µm, within a millionth of its length."""
    strip = rod([layer(thickness=2e-3)], length=0.05, stations=21, start=(0, 0, 10))
    law = {**contact(barrier_distance=1e-6), "stiffness": 1e9}
    soft = {"gel": {"youngs_modulus": 1e4, "poisson_ratio": 0.5, "density": 1000.0}}
    dropped = scene([strip], gravity=[0, 0, -9.81], obstacles=[GROUND], contact=law, materials=soft)
    dropped["solver"] = {"tolerance": 1e-6, "dimension": dimension}
    simulator = Simulator(load_scene(dropped))
    simulator.run(1.5)
    assert simulator.statistics.shortest < 0.2 * simulator.steps.shortest  # which is 1e-6 s or less
    assert simulator.statistics.min_gap > 0.0 and simulator.velocities[:, 2].mean() > 1.0


# refusals


def test_newton_that_never_converges_stops_the_run_and_keeps_the_state():
    solver = {**PAPER, "max_newton_iterations": 1, "max_halvings": 3, "newton_tolerance": 1e-15}
    hopeless = {**everything(), "solver": solver}
    simulator = Simulator(load_scene(hopeless), tolerance=1e-3)
    before = simulator.save_state()
    with pytest.raises(SimulationError, match=r"stopped at t = 0 s: .*tried down to 0\.000125 s \(correction left"):
        simulator.run(0.05)
    np.testing.assert_array_equal(simulator.save_state(), before)


def test_a_tolerance_that_no_step_meets_stops_the_run_and_is_named():
    kicked = {**driven(), "solver": {**PAPER, "max_halvings": 1, "dt": 2e-3}}
    kicked["loads"] = [{"name": "kick", "rod": "rod", "position": 0.03, "force": [0, 0, 1e-2]}]
    simulator = Simulator(load_scene(kicked), tolerance=1e-9, integrator="sdirk2")
    before = simulator.save_state()
    told = r"tried down to 0\.001 s, stays above the tolerance \(.* of the longest rod, allowed 1e-09\)"
    with pytest.raises(SimulationError, match=told):
        simulator.run(0.05)
    np.testing.assert_array_equal(simulator.save_state(), before)


def kicked(**solver):
    """A strip that a force of 10 mN pushes at once."""
    kick = {"name": "kick", "rod": "rod", "position": 0.03, "force": [0, 0, 1e-2]}
    return {**driven(), "solver": solver, "loads": [kick]}


STOPPED = {
    "too few halvings": kicked(max_halvings=0, dt=2e-2, tolerance=1e-4),
    "too few iterations": kicked(max_newton_iterations=1),
}


@pytest.mark.parametrize("name", STOPPED)
def test_a_stop_names_a_remedy_that_works(name):
    simulator = Simulator(load_scene(STOPPED[name]))
    with pytest.raises(SimulationError) as stop:
        simulator.run(0.02)
    assert f"remedy: {stop.value.remedy}" in str(stop.value)
    simulator = Simulator(load_scene(STOPPED[name], stop.value.remedy.overrides()))
    simulator.run(0.02)
    assert simulator.time == pytest.approx(0.02)


def on_ground(start=0.0, threshold=1e-4, stiffness=1e7, **solver):
    """A strip at rest on the ground, with friction."""
    strip = rod([layer(thickness=2e-3)], length=0.05, start=(start, 0, 2e-3))
    law = contact(barrier_distance=1e-4, coefficient=0.3, speed_threshold=threshold) | {"stiffness": stiffness}
    return {**scene([strip], obstacles=[GROUND], contact=law), "solver": solver}


FAILED = {
    "set `solver.tolerance` to 0.0007": (on_ground(), {"status": TOO_INACCURATE, "error": 3.1}, 1.0),
    "let what acts on the robot grow": (on_ground(), {"status": TOO_INACCURATE, "error": 1e4}, 1.0),
    "leave `solver.dt` out for adaptive steps, or set it to 0.001 s": (on_ground(dt=1e-2), {}, 1.0),
    "set `contact.friction.speed_threshold` to 3e-05 m/s": (on_ground(threshold=1e-9), {}, 1.0),
    "set `contact.friction.speed_threshold` to 0.001 m/s": (on_ground(), {"status": UNSETTLED}, 1.0),
    "set `contact.stiffness` to 6e+11 Pa": (on_ground(), {}, 1e-9),  # ½ ρ A u²/(0.81 ln 10 d̂²) at 1000 m/s
    "set `solver.newton_tolerance` to 0.0003 m/s": (on_ground(), {"residual": 1.1e-4}, 1.0),
    "leave `solver.newton_tolerance` out": (on_ground(newton_tolerance=1e-12), {}, 1.0),
    "set `solver.tolerance` to 1e-05": (on_ground(), {"residual": 1.0}, 1.0),
    "set `solver.integrator` to sdirk2": (on_ground(), {"status": BEYOND}, 1.0),
    "must stop before nothing can give way": (on_ground(stiffness=1e12), {"status": BLOCKED}, 1.0),
    "set `contact.stiffness` to 6e+11": (on_ground(), {"status": BLOCKED}, 1.0),  # as above
    "nearer to the origin: 1e+05 m from it positions are known to 9e-11 m": (
        on_ground(start=1e5, tolerance=1e-9),
        {},
        1.0,
    ),
}
"""Remedies, each with the scene that stops, how its last attempt failed, and its smallest gap [m]."""


@pytest.mark.parametrize("told", FAILED)
def test_every_failure_has_a_remedy(told):
    content, failure, gap = FAILED[told]
    simulator = Simulator(load_scene(content))
    found = IntegrationReport(0, MAX_ITERATIONS, -1, 50, 1, 0, 1e3)
    method = INTEGRATORS[simulator.plan.integrator]
    named = remedy(replace(found, **failure), simulator.steps, method, simulator.model, gap, 1e3)
    assert told in str(named)
    load_scene(content, named.overrides())
    assert bool(named.changes) == str(named).startswith(("set ", "leave "))


@pytest.mark.parametrize("tolerance", [0.0, -1e-4, 0.2, math.nan])
def test_a_tolerance_that_is_none_is_refused(tolerance):
    with pytest.raises(InputError, match="tolerance: .* is not allowed; it must be a part of the longest rod above 0"):
        Simulator(load_scene(driven()), tolerance=tolerance)


def test_implicit_midpoint_has_no_adaptive_steps():
    with pytest.raises(InputError, match="not allowed with the integrator implicit_midpoint, which has no estimate"):
        Simulator(load_scene(driven()), tolerance=1e-4, integrator="implicit_midpoint")


@pytest.mark.parametrize(
    ("solver", "fault"),
    [
        ({"tolerance": "1e-6 m/s"}, "(the speed at which Newton ends is `newton_tolerance`) above 0 and at most 0.1"),
        ({"tolerance": 0.2}, "solver.tolerance: found 0.2; must be a part of the longest rod"),
        ({"tolerance": 1e-3, "max_step": 0}, "solver.max_step: found 0; must be a time [s] above 0"),
    ],
)
def test_bad_values_of_a_scene_are_refused(solver, fault):
    with pytest.raises(SceneError) as refused:
        load_scene({**driven(), "solver": solver})
    assert fault in str(refused.value)


# the controller itself


def test_steps_settle_at_the_tolerance_where_the_error_goes_with_a_power_of_their_length():
    for order in (1, 2):
        h, before, lengths = 1e-4, 0.0, []
        for _ in range(40):
            error = (h / 1e-2) ** (order + 1)
            while error > 1.0:
                h = after_rejection(order, h, error)
                error = (h / 1e-2) ** (order + 1)
            lengths.append(h)
            h, before = after_success(order, h, error, before, 3.0, False), error
        assert lengths[-1] == pytest.approx(lengths[-2], rel=1e-3)
        assert lengths[-1] == pytest.approx(0.9**2.5 * 1e-2, rel=1e-3)  # where 0.9 E^(−2/5k) is 1


def test_steps_neither_grow_too_fast_nor_where_newton_works_hard():
    assert after_success(2, 1e-3, 1e-9, 0.0, 3.0, False) == pytest.approx(LARGEST_GROWTH * 1e-3)
    assert after_success(2, 1e-3, 1e-9, 0.0, 3.0, True) == 1e-3
    assert after_success(2, 1e-3, 1e-9, 0.0, 60.0, False) == 0.5e-3


def test_steps_do_not_grow_beyond_the_longest():
    calm = Simulator(load_scene({**driven(), "solver": {**PAPER, "max_step": 4e-3}}), tolerance=1e-1)
    calm.set_stimulus("heat", 0.3)
    calm.run(0.1)
    assert calm.statistics.longest == pytest.approx(4e-3, rel=0.05)


@pytest.mark.parametrize(("left", "length"), [(1.04, 1.04), (0.3, 0.3), (1.5, 0.75), (2.5, 1.0)])
def test_steps_come_to_an_end_without_a_short_last_one(left, length):
    assert fit(1.0, left) == pytest.approx(length)

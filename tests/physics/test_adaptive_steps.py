"""Adaptive steps: their error, where they end, what refused ones leave, and how they go on."""

import math

import numpy as np
import pytest
from moving_scenes import EXACT, PROBLEMS, cantilever, driven, part, with_parts
from sample_scenes import GROUND, PAPER, ball, contact, everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.adaptive import yardstick_of
from bilayer_core.engine.error_norm import deviation
from bilayer_core.engine.step_size import LARGEST_GROWTH, after_rejection, after_success, fit
from bilayer_core.errors import InputError, SceneError, SimulationError
from bilayer_core.integrators.register import INTEGRATORS
from bilayer_core.model.model import scheduled_motion
from bilayer_core.model.records.step import StateArrays
from bilayer_core.record.memory import MemoryRecorder

ADAPTIVE = [name for name, method in INTEGRATORS.items() if method.estimate is not None]


def simulate(description, duration=None, **settings):
    simulator = Simulator(load_scene(description), **settings)
    if duration:
        simulator.run(duration)
    return simulator


def falling(obstacles=(GROUND,), **solver):
    """A ball 28 mm above the ground, with a distant strip because a scene must have one."""
    strip = rod([layer()], start=(1, 0, 1), length=0.05, stations=3, clamp_start="wall")
    return scene(
        [strip],
        gravity=[0, 0, -9.81],
        bodies=[fixed("wall", (1, 0, 1)), ball((0, 0, 0.05))],
        obstacles=list(obstacles),
        contact=contact(barrier_distance=1e-3),
        solver={"newton_tolerance": 1e-9, **solver},
    )


def deviation_between(simulator, before, after, h):
    """That of a step of length `h`, from its ends."""
    ends = (StateArrays(**{name: getattr(state, name) for name in StateArrays.names}) for state in (before, after))
    return deviation(yardstick_of(simulator.model), *ends, h)


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
    found = INTEGRATORS[integrator].estimate * deviation_between(start, before, start._state, h)
    # with the same velocities at both ends, D is the difference of the two ends
    apart = exact._state.copy()
    apart.velocity[:], apart.spin[:] = 0.0, 0.0
    other = start._state.copy()
    other.velocity[:], other.spin[:] = 0.0, 0.0
    assert found == pytest.approx(deviation_between(start, apart, other, h), rel=0.2)


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
        found.append(deviation_between(simulator, before, simulator._state, 5e-4))
    assert found[1] == pytest.approx(found[0], rel=0.1)


@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2", "generalised_alpha"])
def test_a_ball_bounces_ever_nearer_to_where_it_fell_from(integrator):
    """The barrier is elastic: what lacks is the integrator's loss, in the impact most of all."""
    losses = []
    data = falling(max_step=0.02) | {"output": {"rate": 1.0, "marker_rate": 1.0}}  # no output time near an impact
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
    for tolerance in (1e-3, 1e-5, 1e-6):
        simulator = Simulator(dropped, model="laminate", integrator="sdirk2", tolerance=tolerance)
        simulator.run(0.12)
        assert simulator.statistics.max_contact_force > 0.1  # [N], many times a node's weight
        ends.append(simulator.positions)
    coarse, fine = (np.sqrt(np.square(end - ends[2]).sum(axis=1).mean()) for end in ends[:2])
    assert fine < 0.3 * coarse
    assert fine < 5e-3 * dropped.rods[0].path.length


def test_what_lies_on_a_barrier_does_not_hold_steps_up():
    strip = rod([layer(thickness=2e-3)], length=0.04, stations=9, start=(0, 0, 2e-3))
    law = contact(coefficient=0.3, barrier_distance=2e-4)
    dropped = scene([strip], gravity=[0.5, 0, -9.81], obstacles=[GROUND], contact=law)
    simulator = simulate(dropped, 1.0, tolerance=1e-5, integrator="sdirk2")  # it has bounced for half of that time
    assert np.abs(simulator.velocities).max() < 1e-4
    assert part(simulator, "next_step")[0] == pytest.approx(simulator.steps.longest)


# where steps end


def test_a_pulse_of_a_millisecond_is_never_missed():
    pulse = {"type": "pulse_train", "low": 0, "high": 1, "period": 1.0, "width": "1 ms", "start": 0.4567, "count": 1}
    kick = {"name": "kick", "body": "ball", "force": [0.1, 0, 0], "schedule": pulse}
    description = {**falling([]), "gravity": [0, 0, 0], "loads": [kick], "contact": contact()}
    for integrator in ADAPTIVE:
        simulator = simulate(description, 1.0, tolerance=1e-2, integrator=integrator)
        speed = simulator.frame().body_velocities[1, 0]
        assert speed == pytest.approx(0.1 * 1e-3 / 2.7e-3, rel=1e-9)
        assert simulator.statistics.steps < 150


def test_steps_end_on_every_breakpoint_and_are_short_after_a_jump():
    description = driven()
    square = {"type": "square", "low": 0, "high": 1, "period": 0.07, "start": 0.0123}
    description["stimuli"]["heat"]["schedule"] = square
    simulator = Simulator(load_scene(description), tolerance=1e-3, dt=1e-3, integrator="sdirk2")
    times, reports = [0.0], []
    while simulator.time < 0.2:
        reports.append(simulator.step(until=0.2))
        times.append(simulator.time)
    schedule, points, t = simulator.scene.stimuli["heat"].schedule, [], 0.0
    while (t := schedule.breakpoint_after(t + 1e-9)) < 0.2:
        points.append(t)
    assert len(points) == 6 and set(points) <= set(times) and times[-1] == 0.2
    after = [reports[times.index(point)].length for point in points]
    assert max(after) < 1.001e-3 < max(report.length for report in reports)


def test_a_channel_set_from_outside_no_longer_stops_steps_and_setting_it_is_a_jump():
    description = driven()
    description["stimuli"]["heat"]["schedule"] = {"type": "square", "low": 0, "high": 1, "period": 2e-3}
    simulator = Simulator(load_scene(description), tolerance=1e-3, dt=5e-4, integrator="sdirk2")
    simulator.set_stimulus("heat", 0.3)
    simulator.run(0.3)
    assert simulator.statistics.longest > 2e-3
    simulator.set_stimulus("heat", 0.3)
    assert part(simulator, "next_step")[0] > 5e-4
    simulator.set_stimulus("heat", 0.9)
    assert simulator.step().length == pytest.approx(5e-4)


def ends_of_steps(simulator, end):
    """Times at which steps end that are made one by one."""
    times = []
    while simulator.time < end:
        simulator.step()
        times.append(simulator.time)
    return times


def test_observers_see_exact_times_and_the_run_ends_exactly():
    """Those with the scene's own rate see its output times; others the first step that ends at or after theirs."""
    fast, slow = MemoryRecorder(rate=50.0), MemoryRecorder(rate=7.0)
    simulator = Simulator(load_scene(driven()), tolerance=1e-3, integrator="sdirk2")
    ends = ends_of_steps(simulator, 0.5)
    simulator.reset()
    simulator.run(0.5, observers=[fast, slow])
    assert [frame.time for frame in fast.frames] == [k / 50.0 for k in range(26)]
    expected = [0.0, *(next(end for end in ends if end >= k / 7.0) for k in range(1, 4)), 0.5]
    assert [frame.time for frame in slow.frames] == expected
    assert expected[1] > 1 / 7.0
    assert simulator.time == 0.5
    simulator.run(0.123)
    assert simulator.time == 0.5 + 0.123


@pytest.mark.parametrize("integrator", ["sdirk2", "tr_bdf2", "generalised_alpha"])
def test_a_run_is_the_same_bit_for_bit_whatever_watches_it(integrator):
    simulator = Simulator(load_scene(everything()), tolerance=1e-3, integrator=integrator)
    start, states = simulator.save_state(), []
    for rates in ((), (7.0,), (1000.0,), (50.0, 33.0)):
        simulator.load_state(start)
        recorders = [MemoryRecorder(rate=rate) for rate in rates]
        result = simulator.run(0.1, observers=recorders)
        states.append(simulator.save_state())
        for recorder in recorders:
            assert recorder.frames[-1].time == 0.1
            assert len(recorder.frames) <= 2 + min(result.steps, 0.1 * recorder.rate)
    simulator.load_state(start)
    simulator.run(0.1, each_step=lambda time: None)
    states.append(simulator.save_state())
    simulator.load_state(start)
    ends_of_steps(simulator, 0.1)
    states.append(simulator.save_state())
    simulator.load_state(start)
    simulator.run(0.04)
    simulator.run(0.06)
    states.append(simulator.save_state())
    for state in states[1:]:
        np.testing.assert_array_equal(state, states[0])


def test_a_step_does_not_pass_until_and_until_must_lie_ahead():
    simulator = Simulator(load_scene(driven()), tolerance=1e-3, integrator="sdirk2")
    report = simulator.step(until=3e-4)
    assert (report.time, report.length, simulator.time) == (3e-4, 3e-4, 3e-4)
    with pytest.raises(InputError, match=r"until: 0\.0003 is not allowed; it must be later than the present time"):
        simulator.step(until=3e-4)


# what acts during them

WAVES = {
    "ramp": {"type": "ramp", "start": 0.011, "end": 0.043, "from": 0.9, "to": 0.2},
    "table": {"type": "table", "times": [0.01, 0.02, 0.06], "values": [0.1, 0.8, 0.3]},
    "sine": {"type": "sine", "mean": 0.5, "amplitude": 0.4, "period": 0.037, "start": 0.013, "phase": "40 deg"},
    "square": {"type": "square", "low": 0.1, "high": 0.9, "period": 0.021, "duty": 0.3, "start": 0.004},
    "flanks": {
        "type": "pulse_train",
        "low": 0,
        "high": 1,
        "period": 0.03,
        "width": 0.01,
        "rise_time": 3e-3,
        "count": 2,
    },
}
WAVES["sequence"] = {
    "type": "sequence",
    "repeat": True,
    "parts": [{"duration": 0.017, "schedule": WAVES["sine"]}, {"duration": 0.023, "schedule": WAVES["table"]}],
}


@pytest.mark.parametrize("wave", WAVES)
def test_stages_see_the_schedule(wave):
    description = driven()
    description["stimuli"]["heat"]["schedule"] = WAVES[wave]
    simulator = Simulator(load_scene(description), tolerance=1e-3, dt=1e-3, integrator="sdirk2")
    schedule = simulator.scene.stimuli["heat"].schedule
    while simulator.time < 0.1:
        report = simulator.step(until=0.1)
        stages = simulator._stepper._rooms[simulator._stepper.method]
        begin = report.time - report.length
        assert stages.first[0, 0] == pytest.approx(schedule.value(begin + 1e-12), abs=1e-8)
        for node, value in zip(INTEGRATORS["sdirk2"].nodes, stages.stimulus[0, :, 0], strict=True):
            time = begin + node * report.length
            assert value == pytest.approx(schedule.value_before(time, node * report.length), abs=1e-8)


def test_a_body_on_a_path_is_where_the_path_leads_with_its_rates():
    path = {"type": "prescribed", "times": [0.01, 0.05, 0.08]}
    path["displacements"] = [[0, 0, 0], [0.01, 0.02, -0.01], [0.02, 0, 0]]
    path["rotations"] = [[0, 0, 0], [0.5, -1.2, 0.3], [0.1, 0.4, 0]]
    description = {**cantilever(), "gravity": [0, 0, -9.81]}
    (description["bodies"][0],) = ({**body, "motion": path} for body in description["bodies"])
    simulator = Simulator(load_scene(description), tolerance=1e-3, dt=1e-3)
    moved = 0
    while simulator.time < 0.1:
        simulator.step(until=0.1)
        state = simulator._state
        position, rotation, rates = scheduled_motion(simulator.model.bodies, 0, simulator.time)
        np.testing.assert_allclose(state.body_position[0], position, atol=1e-15)
        np.testing.assert_allclose(state.body_rotation[0], rotation, atol=1e-14)
        np.testing.assert_allclose(state.body_velocity[0], rates[:3], atol=1e-12)
        np.testing.assert_allclose(state.body_angular_velocity[0], rates[3:], atol=1e-11)
        moved += bool(rates.all())
    assert moved > 10


def test_after_a_jump_of_a_load_a_method_that_starts_itself_makes_one_step():
    pulse = {"type": "pulse_train", "low": 0, "high": 1, "period": 1.0, "width": "10 ms", "start": 0.02, "count": 1}
    pulled = cantilever()
    pulled["loads"] = [{**pulled["loads"][0], "schedule": pulse}]
    simulator = Simulator(load_scene(pulled), tolerance=1e-3, dt=1e-3, integrator="generalised_alpha")
    used = []
    while simulator.time < 0.05:
        begin = simulator.time
        simulator.step(until=0.05)
        used.append((begin, simulator._stepper.used.name))
    assert [begin for begin, name in used if name == "sdirk2"] == pytest.approx([0.0, 0.02, 0.03])


def test_steps_made_one_by_one_and_many_at_once_are_the_same():
    description = driven(added_mass=True)
    description["stimuli"]["heat"]["schedule"] = WAVES["square"]
    for integrator in ADAPTIVE:
        runs = [Simulator(load_scene(description), tolerance=1e-4, integrator=integrator) for _ in range(2)]
        runs[0].run(0.05)
        while runs[1].time < 0.05:
            runs[1].step(until=0.05)
        np.testing.assert_array_equal(runs[0].save_state(), runs[1].save_state())
        first, second = (vars(run.statistics) for run in runs)
        assert first == second


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
    for name in ("time", "step", "position", "velocity", "director1", "kept", "acceleration", "transduction"):
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
    kicked = {**cantilever(), "solver": {**PAPER, **EXACT, "dt": 2e-2, "max_newton_iterations": 6}}
    kicked["loads"][0]["schedule"] = {"type": "hold", "value": 3.0}
    simulator = Simulator(load_scene(kicked), tolerance=0.1, integrator="sdirk2")
    reports = [simulator.step(until=0.1)]
    while simulator.time < 0.1:
        reports.append(simulator.step(until=0.1))
    assert reports[0].rejected > reports[0].inaccurate and reports[0].length < 2e-2
    assert simulator.statistics.largest_residual <= EXACT["newton_tolerance"]


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
        assert 0.7e-2 < lengths[-1] < 1e-2


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

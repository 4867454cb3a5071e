"""Where adaptive steps end, and what acts during them."""

import math

import numpy as np
import pytest
from oracles.prescribed_motion import scheduled_motion
from support.moving_scenes import ADAPTIVE, cantilever, driven, falling, part, simulate
from support.sample_scenes import contact, everything

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.log.run.memory import MemoryRecorder

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
    while (t := schedule.span(t + 1e-9).until) < 0.2:
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


def test_observers_see_exact_times_and_the_run_ends_exactly():
    fast, slow = MemoryRecorder(rate=500.0), MemoryRecorder(rate=7.0)
    simulator = Simulator(load_scene(driven()), tolerance=1e-3, integrator="sdirk2")
    simulator.run(0.5, observers=[fast, slow])
    assert [frame.time for frame in fast.frames] == pytest.approx([k / 500.0 for k in range(251)], abs=1e-15)
    assert [frame.time for frame in slow.frames] == pytest.approx([0.0, 1 / 7, 2 / 7, 3 / 7, 0.5], abs=1e-9)
    assert simulator.statistics.steps < 200
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
        simulator.run(0.1, observers=recorders)
        states.append(simulator.save_state())
        for recorder in recorders:
            assert recorder.frames[-1].time == 0.1
            assert len(recorder.frames) == 1 + math.ceil(0.1 * recorder.rate - 1e-9)
    simulator.load_state(start)
    simulator.run(0.1, each_step=lambda time: None)
    states.append(simulator.save_state())
    simulator.load_state(start)
    while simulator.time < 0.1:
        simulator.step(until=0.1)
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
        stages = simulator._stepper.engine._inputs
        begin = report.time - report.length
        assert stages.first[0] == pytest.approx(schedule.value(begin + 1e-12), abs=1e-8)
        for node, value in zip(INTEGRATORS["sdirk2"].nodes, stages.stimulus[:2, 0], strict=True):
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
        position, rotation, rates = scheduled_motion(simulator.model, 0, simulator.time)
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
    simulator.compile()
    used = []
    while simulator.time < 0.05:
        begin = simulator.time
        found = simulator._loop.integrate(1, 0.05, math.inf)
        assert found.done == 1
        used.append((begin, found.restarts))
    assert [begin for begin, restarts in used if restarts] == pytest.approx([0.0, 0.02, 0.03])


STEPS = {f"adaptive {name}": {"tolerance": 1e-4, "integrator": name} for name in ADAPTIVE}
STEPS |= {f"fixed {name}": {"dt": 1e-3, "integrator": name} for name in INTEGRATORS}


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("kind", ["driven", "touching"])
def test_steps_made_one_by_one_and_many_at_once_are_the_same(kind, steps):
    description = driven(added_mass=True) if kind == "driven" else everything()
    if kind == "driven":
        description["stimuli"]["heat"]["schedule"] = WAVES["square"]
    else:
        description["solver"] = {}
    if "midpoint" in steps:  # which follows neither viscosity nor friction of joints
        for material in description["materials"].values():
            material.pop("retardation_time", None)
        for joint in description.get("joints", ()):
            joint.pop("turning", None)
            joint.pop("sliding", None)
    runs = [Simulator(load_scene(description), **STEPS[steps]) for _ in range(2)]
    runs[0].run(0.04)
    while runs[1].time < 0.04 - 1e-9:
        runs[1].step(until=0.04)
    np.testing.assert_array_equal(runs[0].save_state(), runs[1].save_state())
    first, second = (vars(run.statistics) for run in runs)
    assert first == second

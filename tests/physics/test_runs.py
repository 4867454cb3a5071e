"""Runs to a time, until a condition, and what looks at more than one of them."""

import numpy as np
import pytest
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene, read_log
from bilayer_core.errors import InputError, SceneError
from bilayer_core.runs.replay import verify
from bilayer_core.simulation import stepper
from bilayer_core.simulation.run_result import Termination


@pytest.fixture
def simulator():
    return Simulator(load_scene(everything()))


@pytest.fixture(scope="module")
def adaptive():
    return Simulator(load_scene("crawling_inchworm"))


class Watcher:
    """Keeps the times of the frames that it sees."""

    def __init__(self, rate):
        self.rate, self.times, self.closed = rate, [], 0

    def start(self, description):
        self.description = description

    def observe(self, frame):
        self.times.append(frame.time)

    def close(self, complete, termination=""):
        self.closed += 1


def test_a_run_to_a_time_is_the_run_for_the_time_left(adaptive):
    adaptive.reset()
    adaptive.run(0.1)
    adaptive.run(0.15)
    in_parts = adaptive.save_state()
    adaptive.reset()
    result = adaptive.run(until=0.1)
    assert result.simulated == 0.1
    adaptive.run(until=0.25)
    assert adaptive.time == 0.25
    np.testing.assert_array_equal(adaptive.save_state(), in_parts)
    assert adaptive.run(until=0.25).steps == 0


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        ({"until": 0.05}, "until: 0.05 is not allowed; it must be a number of seconds from the present time, 0.1, up"),
        ({"until": float("nan")}, "until: nan is not allowed"),
        ({"until": float("inf")}, "until: inf is not allowed"),
        ({"duration": 1.0, "until": 2.0}, "give a duration or a time `until`, not both"),
        ({"duration": -1.0}, "duration: -1.0 is not allowed"),
    ],
)
def test_a_time_that_cannot_be_reached_is_refused(adaptive, asked, fault):
    adaptive.reset()
    adaptive.run(until=0.1)
    before = adaptive.save_state()
    with pytest.raises(InputError, match=fault):
        adaptive.run(**asked)
    np.testing.assert_array_equal(adaptive.save_state(), before)


def test_a_scene_that_is_over_asks_how_long_to_go_on(simulator):
    simulator.run(until=simulator.scene.duration + 0.01)
    with pytest.raises(InputError, match="duration: is missing; the scene ends at .* say how long to go on"):
        simulator.run()


def test_a_condition_is_asked_after_every_step_and_ends_the_run_there(adaptive):
    adaptive.reset()
    times = []
    adaptive.run(0.2, each_step=times.append)
    adaptive.reset()
    asked = []
    result = adaptive.run(0.2, stop=lambda: asked.append(adaptive.time) or len(asked) == 7)
    assert result.termination is Termination.STOPPED and result.steps == 7
    assert asked == times[:7]
    adaptive.run(until=0.2)
    after = adaptive.save_state()
    adaptive.reset()
    adaptive.run(0.2)
    np.testing.assert_array_equal(adaptive.save_state(), after)


def test_a_condition_that_is_met_by_the_last_step_stopped_the_run(simulator):
    result = simulator.run(0.02, stop=lambda: simulator.time > 0.0195)
    assert result.termination is Termination.STOPPED
    assert simulator.run(0.02, stop=lambda: False).termination is Termination.COMPLETED


def test_a_stopped_run_is_complete_for_its_observers(simulator):
    ends = []
    watcher = Watcher(100.0)
    watcher.close = lambda complete, termination: ends.append((complete, termination))
    simulator.run(0.05, observers=[watcher], stop=lambda: simulator.time > 0.0225)
    assert ends == [(True, "stopped")] and watcher.times[-1] == simulator.time


def test_what_is_attached_sees_single_steps_and_all_runs_at_its_rate(adaptive):
    adaptive.reset()
    watcher = Watcher(100.0)
    detach = adaptive.attach(watcher)
    adaptive.run(until=0.055)
    while adaptive.time < 0.1:
        adaptive.step(until=0.1)
    adaptive.run(until=0.2)
    marks = [0.0, *(0.01 * k for k in range(1, 21))]
    for mark in marks:
        assert any(mark - 1e-9 <= time < mark + 0.01 for time in watcher.times), mark
    assert 0.055 in watcher.times and watcher.times == sorted(set(watcher.times))
    assert watcher.closed == 0
    detach()
    detach()
    assert watcher.closed == 1
    seen = len(watcher.times)
    adaptive.run(0.05)
    assert len(watcher.times) == seen


def test_what_is_attached_changes_no_step(adaptive):
    adaptive.reset()
    adaptive.run(until=0.2)
    alone = adaptive.save_state()
    adaptive.reset()
    detach = adaptive.attach(Watcher(313.0))
    adaptive.run(until=0.2)
    detach()
    np.testing.assert_array_equal(adaptive.save_state(), alone)


def test_what_is_attached_sees_where_a_loaded_state_is(adaptive):
    adaptive.reset()
    adaptive.run(until=0.1)
    saved = adaptive.save_state()
    watcher = Watcher(50.0)
    detach = adaptive.attach(watcher)
    adaptive.run(until=0.16)
    adaptive.load_state(saved)
    adaptive.run(until=0.12)
    detach()
    jump = watcher.times.index(0.16)
    assert watcher.times[0] == 0.1 and watcher.times[jump + 1] == 0.1 and watcher.times[-1] == 0.12


def test_a_run_writes_a_log_from_which_it_is_made_again(simulator, tmp_path):
    simulator.run(0.02)
    simulator.set_stimulus("humidity", 0.7)
    simulator.run(0.04, log=tmp_path / "run.mcap")
    run, found = read_log(tmp_path / "run.mcap"), verify(tmp_path / "run.mcap")
    assert found.passed and found.states == len(run.times) > 2
    assert run.times[-1] == simulator.time and run["com"].values[-1] == pytest.approx(simulator.com)
    before = simulator.save_state()
    with pytest.raises(InputError, match="exists already"):
        simulator.run(0.04, log=tmp_path / "run.mcap")
    with pytest.raises(InputError, match="must end in .mcap"):
        simulator.run(0.04, log=str(tmp_path / "run.bag"))
    np.testing.assert_array_equal(simulator.save_state(), before)


def test_overrides_may_be_values_by_path():
    one = load_scene(everything(), ["rods.arm.stations=7", "duration=3 s", "contact.friction=null"])
    other = load_scene(everything(), {"rods.arm.stations": 7, "duration": np.float64(3.0), "contact.friction": None})
    assert one == other
    moved = load_scene(everything(), {"bodies.ball.position": np.array([0.0, 0.0, 0.03])})
    assert moved.bodies[1].position == (0.0, 0.0, 0.03)


@pytest.mark.parametrize(
    ("overrides", "fault"),
    [
        ({"rods.arm.station": 7}, "override rods.arm.station=7: there is no station of rods.arm, did you mean"),
        ({"rods..arm": 7}, "override rods..arm=7: must be PATH=VALUE"),
        ("duration=3", "overrides: must be texts"),
        ([("duration", 3)], "overrides: must be texts"),
        ({"duration": object()}, "duration: found"),
    ],
)
def test_overrides_that_are_none_are_refused(overrides, fault):
    with pytest.raises(SceneError, match=fault):
        load_scene(everything(), overrides)


def in_passes(monkeypatch, count):
    """The way of a run in which steps pause after so many passes of Newton's method, and how often they did."""
    if count:
        monkeypatch.setattr(stepper, "PERIOD", 0.0)
        monkeypatch.setattr(stepper, "FIRST_PASSES", count)
        monkeypatch.setattr(stepper, "PATIENCE", 1)
    simulator, pauses = Simulator(load_scene("jumping")), []
    simulator.run(0.02, interrupted=lambda: pauses.append(simulator.time))
    return simulator, len(pauses)


def test_a_run_whose_steps_pause_ends_as_one_whose_steps_do_not(monkeypatch):
    whole, asked = in_passes(monkeypatch, None)
    assert whole.statistics.rejected > 2
    for passes in (1, 4):
        paused, pauses = in_passes(monkeypatch, passes)
        assert pauses > asked + 20
        np.testing.assert_array_equal(paused.save_state(), whole.save_state())
        for name in ("steps", "rejected", "iterations"):
            assert getattr(paused.statistics, name) == getattr(whole.statistics, name)


@pytest.mark.parametrize("ends", ["by what is asked", "by an exception"])
def test_a_run_can_end_within_a_step_which_leaves_the_state_as_it_was(monkeypatch, ends):
    monkeypatch.setattr(stepper, "FIRST_PASSES", 1)
    simulator = Simulator(load_scene("jumping"))
    simulator.compile()
    before, gap, looks = simulator.save_state(), simulator.frame().min_gap, []

    def ended():
        if ends == "by an exception":
            raise KeyboardInterrupt
        return True

    if ends == "by an exception":
        with pytest.raises(KeyboardInterrupt):
            simulator.run(0.02, interrupted=ended)
    else:
        result = simulator.run(0.02, interrupted=ended, each_step=looks.append)
        assert result.termination is Termination.INTERRUPTED
    assert not looks
    np.testing.assert_array_equal(simulator.save_state(), before)
    assert simulator.frame().min_gap == gap
    simulator.run(0.02)
    other = Simulator(load_scene("jumping"))
    other.run(0.02)
    np.testing.assert_array_equal(simulator.save_state(), other.save_state())

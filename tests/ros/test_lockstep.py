"""Ticks and answers, without ROS topics."""

import threading
import time

import pytest

from bilayer_core.errors import InputError
from bilayer_core.scene.schedule import Hold
from bilayer_sim_ros.control.control_ticks import Control, tick_rate
from bilayer_sim_ros.control.lockstep import Lockstep, channels_that_answer, refuse_without_clock
from bilayer_sim_ros.control.pending_changes import POSE, Commands
from bilayer_sim_ros.control.periods import Periods
from bilayer_sim_ros.control.stimulus import Channel, StimulusInputs
from bilayer_sim_ros.control.tick_answers import DUPLICATE, LATE, Answers, mount

PERIOD = 0.1
TICK = 100_000_000
"""The same in nanoseconds."""


class Simulated:
    """A simulator's time, and what is set on it."""

    def __init__(self, time):
        self.time = time
        self.set = []

    def set_stimulus(self, channel, value, *, over=0.0, shape="linear"):
        self.set.append((channel, value, pytest.approx(over)))


class Run:
    """A run with controllers in lockstep, ten ticks a second."""

    def __init__(self, channels=("heat",), needed=(), start=2.0, fallback="schedule", patience=0.0):
        schedule = Hold(**{"type": "hold", "value": 0.25})
        self.published, self.missed = [], []
        answers = Answers(channels, needed)
        of_scene = [Channel(name, 0.0, 1.0, schedule) for name in channels]
        self.inputs = StimulusInputs(of_scene, 0.0, fallback, answers)
        self.inputs.missed = lambda time, names: self.missed.append((time, names))
        self.lockstep = Lockstep(self.inputs, self.published.append, patience)
        commands = Commands(lambda reason: None)
        self.control = Control(self.inputs, commands, 1.0 / PERIOD, "hold", self.lockstep)
        self.simulated = Simulated(start)
        self.control.start(start)

    @property
    def waiting(self):
        return self.control.waiting

    def act(self):
        """What is set at the present time: channel to value."""
        self.simulated.set = []
        self.control.act(self.simulated)
        return {name: value for name, value, _ in self.simulated.set}

    def advance(self, time):
        self.simulated.time = time
        self.control.advance_to(time)

    def reset(self, time=0.0):
        self.control.reset()
        self.simulated.time = time
        self.control.start(time)


@pytest.fixture
def run():
    return Run()


def answer(run, value=0.5):
    run.inputs.receive("heat", value)
    assert not run.waiting
    assert run.act() == {"heat": value}


def test_the_start_is_a_tick(run):
    assert (run.waiting, run.published) == (True, [2.0])
    answer(run)


def test_what_came_before_the_tick_acts_but_is_no_answer(run):
    answer(run)
    run.inputs.receive("heat", 0.75)
    run.advance(2.1)
    assert run.waiting
    run.inputs.receive_all([1.0])
    assert not run.waiting
    assert run.act() == {"heat": 1.0}


def test_a_refused_message_is_no_answer(run):
    with pytest.raises(InputError):
        run.inputs.receive("heat", 2.0)
    assert run.waiting


def test_between_ticks_nothing_is_awaited_published_or_taken(run):
    answer(run)
    run.advance(2.05)
    run.inputs.receive("heat", 0.75)
    run.control.repeat(2.05)
    assert (run.waiting, run.act(), run.published) == (False, {}, [2.0])
    assert run.control.next_stop(2.05) == pytest.approx(2.1)


@pytest.mark.parametrize("time", [2.1 - 1e-12, 2.1, 2.13])
def test_a_tick_is_reached_when_it_is_crossed_to_rounding(run, time):
    answer(run)
    run.advance(time)
    assert (run.waiting, run.published) == (True, [2.0, time])
    assert run.control.next_stop(time) == pytest.approx(2.2)


def test_a_time_that_stands_still_is_repeated_until_it_is_left(run):
    run.control.repeat(2.0)
    run.inputs.receive("heat", 0.5)
    run.control.repeat(2.0)
    assert run.published == [2.0] * 3
    run.act()
    run.control.repeat(2.0)
    assert run.published == [2.0] * 3


def test_a_reset_asks_anew(run):
    answer(run)
    run.advance(2.1)
    run.inputs.receive("heat", 0.75)
    run.reset()
    assert (run.waiting, run.published) == (True, [2.0, 2.1, 0.0])
    answer(run)


@pytest.mark.parametrize("taken", [False, True])
def test_an_answer_to_the_start_stands_while_no_later_time_was_heard(taken):
    run = Run(start=0.0)
    run.inputs.receive("heat", 0.5)
    if taken:
        run.act()
        run.advance(0.05)
    for _ in range(2):
        run.reset()
        assert not run.waiting
        assert run.act() == {"heat": 0.5}
    run.advance(0.1)
    assert run.waiting


def test_a_message_wakes_who_waits(run):
    woken = []
    run.inputs.notify = lambda: woken.append(run.inputs.answered)
    run.inputs.receive("heat", 0.5)
    assert woken == [True]


def test_a_tick_is_complete_when_every_channel_that_is_needed_has_answered():
    run = Run(("a", "b", "c"), needed=("a", "b"))
    run.inputs.receive("c", 0.1)
    run.inputs.receive("a", 0.2)
    assert run.waiting
    assert run.inputs.receive_stamped(20 * TICK, ["b"], [0.3]) == ""
    assert not run.waiting
    assert run.act() == {"a": 0.2, "b": 0.3, "c": 0.1}
    run.advance(2.1)
    run.inputs.receive_all([0.5, 0.6, 0.7])
    assert not run.waiting


def test_a_tick_may_wait_for_a_pose_too_which_is_taken_before_it_acts():
    run, taken = Run(needed=("heat", mount("hub"))), []
    run.inputs.receive("heat", 0.5)
    assert run.waiting
    acted = threading.Thread(target=run.act)

    def take():
        acted.start()
        acted.join(0.1)
        assert acted.is_alive()  # it waits for the pose to be taken
        taken.append(1)

    assert run.inputs.answer(mount("hub"), 20 * TICK, take) == ""
    acted.join(10.0)
    assert not acted.is_alive() and not run.waiting
    run.advance(2.1)
    assert run.inputs.answer(mount("hub"), 20 * TICK, lambda: taken.append(2)) == LATE
    assert run.inputs.answer(mount("hub"), 21 * TICK, lambda: taken.append(5)) == ""
    assert run.inputs.answer(mount("hub"), 21 * TICK, lambda: taken.append(3)) == DUPLICATE
    assert run.inputs.answer(mount("other"), 7, lambda: taken.append(4)) == ""  # nobody waits for it
    assert taken == [1, 5, 4] and run.inputs.ignored[LATE] == run.inputs.ignored[DUPLICATE] == 1


def test_without_channels_ticks_wait_for_a_pose_that_is_listed():
    run = Run(channels=(), needed=(mount("hub"),))
    assert run.waiting
    run.inputs.answer(mount("hub"), None, lambda: None)
    assert not run.waiting


def test_a_pose_that_acted_at_the_start_acts_again_where_nobody_heard_of_a_later_time():
    moved, commands = [], Commands(pytest.fail)
    commands.ask((POSE, "hub"), lambda simulator, over: moved.append("pose"))
    commands.ask(("load", "push"), lambda simulator, over: moved.append("load"))
    assert commands.apply(None, {}) and sorted(moved) == ["load", "pose"]
    commands.reset(keep_first=True)
    assert commands.apply(None, {}) and sorted(moved) == ["load", "pose", "pose"]
    commands.reset()
    assert not commands.apply(None, {}) and len(moved) == 3


@pytest.mark.parametrize(
    ("stamp", "why"), [(20, "late"), (20.5, "late"), (21, "duplicate"), (22, "foreign"), (300, "foreign")]
)
def test_answers_to_other_ticks_are_counted_and_ignored(stamp, why):
    run = Run(("a", "b"), needed=("a", "b"))
    run.inputs.receive_all([0.1, 0.2])
    run.act()
    run.advance(2.1)
    run.inputs.receive_stamped(21 * TICK, ["a"], [0.5])
    assert run.inputs.receive_stamped(int(stamp * TICK), ["a"], [0.9]) == why
    assert dict(run.inputs.ignored) == {"late": 0, "duplicate": 0, "foreign": 0} | {why: 1}
    assert run.waiting
    run.inputs.receive_stamped(21 * TICK, ["b"], [0.6])
    assert run.act() == {"a": 0.5, "b": 0.6}


def test_an_answer_to_a_tick_that_has_just_been_left_does_not_act_at_the_next():
    run = Run(("a", "b"))
    run.inputs.receive_stamped(20 * TICK, ["a"], [0.5])
    run.act()
    assert run.inputs.receive_stamped(20 * TICK, ["b"], [0.9]) == "late"
    run.advance(2.1)
    assert run.waiting
    run.inputs.receive("a", 0.6)
    assert run.act() == {"a": 0.6}


@pytest.mark.parametrize(
    ("names", "values", "reason"),
    [
        (["a"], [], "1 names .a. and 0 positions"),
        ([], [], "0 names"),
        (["a", "a"], [0.1, 0.2], "each name once"),
        (["a", "z"], [0.1, 0.2], "no stimulus 'z'; allowed is a, b"),
        (["a", "b"], [0.1, 7.0], "stimulus 'b' is 7; allowed is 0 to 1"),
    ],
)
def test_a_stamped_message_that_cannot_be_is_refused_as_a_whole(names, values, reason):
    run = Run(("a", "b"))
    with pytest.raises(InputError, match=reason):
        run.inputs.receive_stamped(20 * TICK, names, values)
    assert run.waiting


def test_outside_lockstep_a_stamp_is_not_looked_at():
    schedule = Hold(**{"type": "hold", "value": 0.25})
    inputs = StimulusInputs([Channel("a", 0.0, 1.0, schedule)], 0.0, "schedule")
    assert inputs.receive_stamped(77, ["a"], [0.5]) == ""
    assert inputs.changes(0.0) == {"a": 0.5}


def test_a_scene_without_channels_does_not_wait():
    run = Run(())
    assert not run.waiting
    run.advance(2.1)
    assert (run.waiting, run.published) == (False, [2.0, 2.1])


@pytest.mark.parametrize(("fallback", "expected"), [("zero", 0.0), ("schedule", None), ("hold", 0.3)])
def test_after_the_timeout_the_fallback_acts_on_channels_that_are_missing(fallback, expected):
    run = Run(("a", "b"), needed=("a", "b"), fallback=fallback, patience=0.02)
    run.inputs.receive_all([0.2, 0.3])
    run.act()
    for tick, value in ((2.1, 0.6), (2.2, 0.7)):
        run.advance(tick)
        run.inputs.receive("a", value)
        begin = time.monotonic()
        assert run.waiting
        while run.waiting:
            time.sleep(0.001)
        assert 0.02 <= time.monotonic() - begin < 5.0
        changes = run.act()
        assert changes.pop("a") == value
        assert changes == ({"b": expected} if tick == 2.1 and fallback != "hold" else {})
    assert run.missed == [(2.1, ["b"])]
    run.advance(2.3)
    run.inputs.receive_all([0.4, 0.5])
    assert run.act() == {"a": 0.4, "b": 0.5}


def test_the_wait_begins_when_time_is_to_go_on_and_anew_after_a_pause():
    run = Run(patience=1000.0)
    assert run.control.wait_ends_at == float("inf")
    assert run.waiting
    first = run.control.wait_ends_at
    assert run.waiting and run.control.wait_ends_at == first < time.monotonic() + 1000.1
    run.control.wait_anew()
    assert run.waiting and run.control.wait_ends_at > first


@pytest.mark.parametrize(("control_period", "expected"), [(0.0, 50.0), (0.1, 10.0), (0.001, 1000.0)])
def test_ticks_come_with_frames_or_at_the_control_period(control_period, expected):
    assert tick_rate(control_period, 50.0, shortest=0.001) == pytest.approx(expected, rel=1e-12)


def test_a_control_period_shorter_than_a_step_is_refused():
    with pytest.raises(InputError, match="'control_period' is 0.0009; allowed is a finite number >= 0.001"):
        tick_rate(0.0009, 50.0, shortest=0.001)


def test_lockstep_without_a_clock_is_refused():
    refuse_without_clock(True)
    with pytest.raises(InputError, match="'publish_clock' is False; with 'lockstep' allowed is True"):
        refuse_without_clock(False)


def test_a_pose_that_ticks_wait_for_is_one_of_a_body_that_may_move():
    assert channels_that_answer(["a", "mount_pose/hub"], ["a"], ["hub"]) == ["a", "mount_pose/hub"]
    with pytest.raises(InputError, match="'mount_pose/wall' is no channel .*each once, a, mount_pose/hub"):
        channels_that_answer(["mount_pose/wall"], ["a"], ["hub"])


def test_channels_that_answer_are_channels_each_once():
    assert channels_that_answer([""], ["a", "b"]) == []
    assert channels_that_answer(["b", "a"], ["a", "b"]) == ["b", "a"]
    with pytest.raises(InputError, match="'c' is no channel of the scene; allowed are, each once, a, b"):
        channels_that_answer(["c"], ["a", "b"])
    with pytest.raises(InputError, match="'a' is there twice"):
        channels_that_answer(["a", "a"], ["a", "b"])
    with pytest.raises(InputError, match="none, as the scene has no channel"):
        channels_that_answer(["a"], [])


def test_periods_end_one_after_the_other_from_the_start_on():
    periods = Periods(30.0)
    periods.start(1.0)
    ends = [1.0]
    for count in range(100):
        assert periods.complete(ends[-1]) == count
        ends.append(periods.next_end(ends[-1]))
    assert ends == pytest.approx([1.0 + k / 30.0 for k in range(101)], abs=1e-12)


@pytest.mark.parametrize(("late", "end"), [(0.0, 1), (1e-12, 1), (-1e-12, 1), (0.049, 1), (0.051, 2), (0.099, 2)])
def test_a_ramp_that_begins_late_ends_at_the_tick_nearest_to_a_period_later(late, end):
    periods = Periods(1.0 / PERIOD)
    periods.start(2.0)
    assert late + periods.time_to_nearest_end(2.0 + late) == pytest.approx(end * PERIOD)

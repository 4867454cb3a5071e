"""Ticks and answers, without ROS."""

import pytest

from bilayer_core.errors import InputError
from bilayer_core.scene.schedule import Hold
from bilayer_sim_ros.lockstep import Lockstep, tick_rate
from bilayer_sim_ros.periods import Periods
from bilayer_sim_ros.stimulus import Channel, StimulusInputs


@pytest.fixture
def inputs():
    schedule = Hold(**{"type": "hold", "value": 0.25})
    return StimulusInputs([Channel("humidity", 0.0, 1.0, schedule)], timeout=0.0, fallback="schedule")


@pytest.fixture
def published():
    return []


@pytest.fixture
def lockstep(inputs, published):
    """Ten ticks a second; the run has started at 2 s."""
    lockstep = Lockstep(inputs, 10.0, published.append)
    lockstep.start(2.0)
    return lockstep


def answer(inputs, lockstep, time, value=0.5):
    inputs.receive("humidity", value)
    assert not lockstep.waiting
    assert lockstep.changes(time) == {"humidity": value}


def test_the_start_is_a_tick(lockstep, inputs, published):
    assert (lockstep.waiting, published) == (True, [2.0])
    answer(inputs, lockstep, 2.0)


def test_what_came_before_the_tick_acts_but_is_no_answer(inputs):
    inputs.receive("humidity", 0.75)
    lockstep = Lockstep(inputs, 10.0, lambda time: None)
    lockstep.start(0.0)
    assert lockstep.waiting
    inputs.receive_all([0.5])
    assert lockstep.changes(0.0) == {"humidity": 0.5}
    inputs.receive("humidity", 0.75)
    lockstep.advance_to(0.1)
    assert lockstep.waiting
    inputs.receive("humidity", 1.0)
    assert not lockstep.waiting


def test_a_refused_message_is_no_answer(lockstep, inputs):
    with pytest.raises(InputError):
        inputs.receive("humidity", 2.0)
    assert lockstep.waiting


def test_between_ticks_nothing_is_awaited_published_or_taken(lockstep, inputs, published):
    answer(inputs, lockstep, 2.0)
    lockstep.advance_to(2.05)
    inputs.receive("humidity", 0.75)
    lockstep.repeat(2.05)
    assert (lockstep.waiting, lockstep.changes(2.05), published) == (False, {}, [2.0])
    assert lockstep.next_stop(2.05) == pytest.approx(2.1)


@pytest.mark.parametrize("time", [2.1 - 1e-12, 2.1, 2.13])
def test_a_tick_is_reached_when_it_is_crossed_to_rounding(lockstep, inputs, published, time):
    answer(inputs, lockstep, 2.0)
    lockstep.advance_to(time)
    assert (lockstep.waiting, published) == (True, [2.0, time])
    assert lockstep.next_stop(time) == pytest.approx(2.2)


def test_a_time_that_stands_still_is_repeated_until_it_is_left(lockstep, inputs, published):
    lockstep.repeat(2.0)
    inputs.receive("humidity", 0.5)
    lockstep.repeat(2.0)
    assert published == [2.0] * 3
    lockstep.changes(2.0)
    lockstep.repeat(2.0)
    assert published == [2.0] * 3


def test_a_reset_asks_anew(lockstep, inputs, published):
    answer(inputs, lockstep, 2.0)
    lockstep.advance_to(2.1)
    inputs.receive("humidity", 0.75)
    lockstep.reset()
    lockstep.start(0.0)
    assert (lockstep.waiting, published) == (True, [2.0, 2.1, 0.0])
    answer(inputs, lockstep, 0.0)


def test_an_answer_to_the_start_outlives_a_reset_at_the_start(lockstep, inputs):
    inputs.receive("humidity", 0.5)
    lockstep.reset()
    lockstep.start(2.0)
    assert not lockstep.waiting
    assert lockstep.changes(2.0) == {"humidity": 0.5}


def test_a_message_wakes_who_waits(inputs):
    woken = []
    inputs.notify = lambda: woken.append(inputs.answered)
    inputs.receive("humidity", 0.5)
    assert woken == [True]


@pytest.mark.parametrize(("control_period", "expected"), [(0.0, 50.0), (0.1, 10.0), (0.001, 1000.0)])
def test_ticks_come_with_frames_or_at_the_control_period(control_period, expected):
    assert tick_rate(control_period, 50.0, clock=True, shortest=0.001) == pytest.approx(expected, rel=1e-12)


def test_a_control_period_shorter_than_a_step_is_refused():
    with pytest.raises(InputError, match="'control_period' is 0.0009; allowed is a finite number >= 0.001"):
        tick_rate(0.0009, 50.0, clock=True, shortest=0.001)


def test_lockstep_without_a_clock_is_refused():
    with pytest.raises(InputError, match="'publish_clock' is False; with 'lockstep' allowed is True"):
        tick_rate(0.0, 50.0, clock=False, shortest=0.001)


def test_periods_end_one_after_the_other_from_the_start_on():
    periods = Periods(30.0)
    periods.start(1.0)
    ends = [1.0]
    for count in range(100):
        assert periods.complete(ends[-1]) == count
        ends.append(periods.next_end(ends[-1]))
    assert ends == pytest.approx([1.0 + k / 30.0 for k in range(101)], abs=1e-12)

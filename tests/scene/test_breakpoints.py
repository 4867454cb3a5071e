"""Where schedules have corners and jumps, for steps to end there."""

import math

import pytest
from pydantic import TypeAdapter

from bilayer_core.scene.load import Load
from bilayer_core.scene.schedule import Schedule

RAMP = {"type": "ramp", "start": 0.3, "end": 1.1, "from": 0.2, "to": 1.0}
TABLE = {"type": "table", "times": [0.1, 0.7, 0.8, 2.0], "values": [0.0, 1.0, 0.2, 0.2]}
SQUARE = {"type": "square", "low": 0.1, "high": 0.9, "period": 0.7, "duty": 0.3, "start": 0.2}
TRAPEZOID = {**SQUARE, "rise_time": 0.05}
TRAIN = {"type": "pulse_train", "low": 0, "high": 1, "period": 1.3, "width": 1e-3, "count": 3, "start": 0.4}
PARTS = [
    {"duration": 0.9, "schedule": RAMP},
    {"duration": 0.5, "schedule": TABLE},
    {"duration": 1.0, "schedule": TRAIN},
]
PIECEWISE_LINEAR = {
    "hold": {"type": "hold", "value": 0.3},
    "ramp": RAMP,
    "table": TABLE,
    "square": SQUARE,
    "trapezoid": TRAPEZOID,
    "pulse train": TRAIN,
    "sequence": {"type": "sequence", "parts": PARTS},
    "repeated sequence": {"type": "sequence", "parts": PARTS, "repeat": True},
}
END = 6.0


def schedule(**content):
    return TypeAdapter(Schedule).validate_python(content)


def breakpoints(of, end=END):
    """All of them from 0 to `end`."""
    found, t = [], -1e-3
    while (t := of.span(t).until) < end:
        found.append(t)
    return found


@pytest.mark.parametrize("content", PIECEWISE_LINEAR.values(), ids=PIECEWISE_LINEAR)
def test_between_breakpoints_a_schedule_is_linear(content):
    own = schedule(**content)
    times = [0.0, *breakpoints(own), END]
    assert times == sorted(times) and len(times) < 40
    for begin, end in zip(times, times[1:], strict=False):
        inside = [begin + part * (end - begin) for part in (0.01, 0.3, 0.59, 0.88)]
        first, second, third, fourth = map(own.value, inside)
        assert second - first == pytest.approx(third - second, abs=1e-6)
        assert third - second == pytest.approx(fourth - third, abs=1e-6)


@pytest.mark.parametrize("content", PIECEWISE_LINEAR.values(), ids=PIECEWISE_LINEAR)
def test_breakpoints_are_where_the_slope_or_the_value_changes_and_nowhere_else(content):
    own, h = schedule(**content), 1e-5
    for t in breakpoints(own):
        slopes = [(own.value(b) - own.value(a)) / (b - a) for a, b in ((t - 2 * h, t - h), (t + h, t + 2 * h))]
        corner, jump = abs(slopes[1] - slopes[0]) > 1e-3, abs(own.value(t + h) - own.value(t - h)) > 1e-3
        parts_meet = content["type"] == "sequence" and any(
            abs(t % 2.4 - end) < 1e-9 or abs(t % 2.4 - end - 2.4) < 1e-9 for end in (0.0, 0.9, 1.4, 2.4)
        )
        level = content["type"] == "table" and t == 2.0  # given, though it goes on level
        assert corner or jump or parts_meet or level


@pytest.mark.parametrize("content", [SQUARE, TRAIN])
def test_at_a_jump_the_step_before_has_the_old_value_and_the_step_after_the_new_one(content):
    own = schedule(**content)
    for t in breakpoints(own):
        before, after = own.value_before(t, 1e-3), own.value(t)
        assert {before, after} == {content["low"], content["high"]}


def test_a_pulse_of_a_millisecond_has_its_two_ends():
    found = breakpoints(schedule(**TRAIN))
    assert found == pytest.approx([0.4, 0.401, 1.7, 1.701, 3.0, 3.001], abs=1e-12)


def test_breakpoints_of_a_wave_do_not_drift_or_repeat_after_many_periods():
    wave = schedule(**{**SQUARE, "period": 0.1, "duty": 0.5, "start": 0.0})
    t, count = 0.0, 0
    while t < 1000.0 - 1e-9:
        t, count = wave.span(t).until, count + 1
    assert count == 20000 and t == pytest.approx(1000.0, abs=1e-12)


def test_a_sine_is_seen_four_times_a_period_from_its_start_on():
    sine = schedule(type="sine", mean=0.5, amplitude=0.4, period=0.02, start=1.0)
    assert sine.span(0.0).until == 1.0
    found = [t for t in breakpoints(sine, 1.0601)]
    assert found == pytest.approx([1.0 + 0.005 * k for k in range(13)], abs=1e-12)


def test_loads_have_those_of_what_drives_them():
    load = {"name": "pull", "rod": "arm", "position": 0.0, "force": [0, 0, 1]}
    assert Load(**load).factor.span(0.0).until == math.inf
    assert Load(**load, schedule=RAMP).factor.span(0.3).until == 1.1

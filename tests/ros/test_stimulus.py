import math

import pytest

from bilayer_core.errors import InputError
from bilayer_core.scene.schedule import Hold, Ramp
from bilayer_sim_ros.control.stimulus import Channel, StimulusInputs

HUMIDITY = Channel("humidity", 0.0, 1.0, Ramp(**{"type": "ramp", "start": 0.0, "end": 10.0, "from": 0.25, "to": 0.75}))
CURRENT = Channel("current", 2.0, 8.0, Hold(**{"type": "hold", "value": 4.0}))


def inputs(fallback="schedule", timeout=0.0):
    return StimulusInputs([HUMIDITY, CURRENT], timeout, fallback)


def test_a_message_changes_its_channel_once():
    stimulus = inputs()
    stimulus.receive("humidity", 0.5)
    assert stimulus.changes(0.0) == {"humidity": 0.5}
    assert stimulus.changes(0.001) == {}


def test_of_several_messages_between_two_steps_the_last_counts():
    stimulus = inputs()
    stimulus.receive("humidity", 0.5)
    stimulus.receive_all([0.6, 3.0])
    stimulus.receive("current", 5.0)
    assert stimulus.changes(0.0) == {"humidity": 0.6, "current": 5.0}


def test_values_that_pass_the_range_by_rounding_are_its_ends_by_every_topic():
    stimulus = inputs()
    stimulus.receive("humidity", 1.0000000000000002)
    assert stimulus.changes(0.0) == {"humidity": 1.0}
    stimulus.receive_all([-1e-17, 8.000000000000002])
    assert stimulus.changes(0.1) == {"humidity": 0.0, "current": 8.0}
    assert stimulus.receive_stamped(1, ["humidity", "current"], [1.0 + 1e-12, 2.0 - 1e-12]) == ""
    assert stimulus.changes(0.2) == {"humidity": 1.0, "current": 2.0}


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.1, 1.1, 1.00000001, -1e-8])
def test_a_value_out_of_range_is_refused_and_the_last_good_one_stays(value):
    stimulus = inputs()
    stimulus.receive("humidity", 0.5)
    with pytest.raises(InputError, match="'humidity' is .*allowed is 0 to 1"):
        stimulus.receive("humidity", value)
    assert stimulus.changes(0.0) == {"humidity": 0.5}


@pytest.mark.parametrize("values", [[], [0.5], [0.5, 3.0, 1.0]])
def test_a_message_of_wrong_length_is_refused_with_the_channels(values):
    with pytest.raises(InputError, match=f"{len(values)} values; expected are 2: humidity, current"):
        inputs().receive_all(values)


def test_one_bad_value_refuses_the_whole_message():
    stimulus = inputs()
    with pytest.raises(InputError, match="'current'"):
        stimulus.receive_all([0.5, math.nan])
    assert stimulus.changes(0.0) == {}


@pytest.mark.parametrize(
    ("fallback", "expected"),
    [("hold", {"humidity": 0.25, "current": 4.0}), ("zero", {"humidity": 0.0, "current": 2.0}), ("schedule", {})],
)
def test_before_the_first_message_the_fallback_acts(fallback, expected):
    stimulus = inputs(fallback)
    assert stimulus.changes(0.0) == expected
    assert stimulus.changes(5.0) == {}


@pytest.mark.parametrize(
    ("fallback", "expected"),
    [("hold", {}), ("zero", {"humidity": 0.0, "current": 2.0}), ("schedule", {"humidity": None, "current": None})],
)
def test_the_fallback_acts_once_the_timeout_is_over(fallback, expected):
    stimulus = inputs(fallback, timeout=1.0)
    stimulus.receive_all([0.9, 3.0])
    stimulus.changes(0.0)
    assert stimulus.changes(0.999) == {}
    assert stimulus.changes(1.0) == expected
    assert stimulus.changes(2.0) == {}


def test_without_a_timeout_the_last_message_acts_for_ever():
    stimulus = inputs("zero")
    stimulus.receive_all([0.9, 3.0])
    stimulus.changes(0.0)
    assert stimulus.changes(1e6) == {}


def test_the_fallback_acts_on_the_silent_channel_alone():
    stimulus = inputs("zero", timeout=1.0)
    stimulus.receive_all([0.9, 3.0])
    stimulus.changes(0.0)
    stimulus.receive("current", 3.0)
    stimulus.changes(0.5)
    assert stimulus.changes(1.0) == {"humidity": 0.0}


def test_a_message_ends_the_fallback():
    stimulus = inputs("zero", timeout=1.0)
    stimulus.changes(0.0)
    stimulus.receive("humidity", 0.4)
    assert stimulus.changes(2.0) == {"humidity": 0.4}
    assert stimulus.changes(2.5) == {}


def test_a_reset_forgets_all_messages():
    stimulus = inputs("hold")
    stimulus.receive_all([0.9, 3.0])
    stimulus.changes(0.0)
    stimulus.receive("humidity", 0.8)
    stimulus.reset()
    assert stimulus.changes(0.0) == {"humidity": 0.25, "current": 4.0}

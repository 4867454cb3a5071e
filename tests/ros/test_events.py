"""What a node says of events: on its topic and in its log."""

import pytest
from rcl_interfaces.msg import Log
from std_msgs.msg import Float64

from bilayer_core import read_log
from bilayer_sim_ros.control.stimulus import Channel, StimulusInputs


class Silent:
    def value(self, t):
        return 0.0


def test_a_late_channel_is_told_once_until_its_next_message():
    told = []
    inputs = StimulusInputs([Channel("heat", 0.0, 1.0, Silent())], 0.1, "hold")
    inputs.late = lambda time, name: told.append((time, name))
    inputs.changes(0.0)
    inputs.changes(1.0)
    assert told == []  # nobody has begun to send
    inputs.receive("heat", 0.5)
    for time in (1.1, 1.15, 1.2, 1.3):
        inputs.changes(time)
    inputs.receive("heat", 0.6)
    for time in (1.4, 1.6):
        inputs.changes(time)
    assert told == [(1.2, "heat"), (1.6, "heat")]


@pytest.fixture(scope="module")
def told(domain_of_module, start, connect, tmp_path_factory):
    """Events of a jumper that stands on the ground and whose controller falls silent, as heard and as logged."""
    log = tmp_path_factory.mktemp("events") / "run.mcap"
    parameters = {"scene": "jumping", "start_paused": True, "real_time_factor": 0, "stimulus_timeout": 0.05}
    process = start("sim_node", domain_of_module, parameters | {"log": str(log)})
    client = connect(process)
    events = []
    subscription = client.node.create_subscription(Log, "/bilayer_sim/events", events.append, 100)
    client.spin_until(lambda: client.node.count_publishers(subscription.topic_name) > 0, "the publisher of events")
    client.drain(1.0)  # until the node knows of the subscription too
    client.sender(Float64, "/bilayer_sim/stimulus/current")(Float64(data=0.1))
    client.drain()
    for _ in range(6):
        assert client.call("step").success
    client.spin_until(lambda: any(event.name == "stimulus" for event in events), "a late stimulus")
    process.end()
    return [(event.level, event.name, event.msg) for event in events], read_log(log).events


def test_contact_and_a_late_stimulus_are_heard_and_logged(told):
    heard, logged = told
    assert (20, "contact", "contact made: loop with ground") in heard
    assert (30, "stimulus", "stimulus late: none on current for 0.05 s; the last value stays") in heard
    told = [(event.level, event.name, event.text) for event in logged]  # a paused node shows other frames as well
    assert {event for event in heard if event[1] != "steps"} <= set(told)

"""Events of runs: what frames tell of contact, rejected steps and flight, as messages and from real runs."""

from dataclasses import replace

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from support import synthetic_run

from bilayer_core import Simulator, load_scene, read_log
from bilayer_core.log.file import mcap_log
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.event_messages import decode_event, encode_event
from bilayer_core.log.messages.events import DEBUG, INFO, REJECTED_FRAMES, WARN, Event, EventDetector, late_stimulus
from bilayer_core.log.messages.topics import EVENTS
from bilayer_core.log.run.memory import MemoryRecorder

HELD = synthetic_run.description()
FREE = replace(HELD, bodies=tuple(replace(body, prescribed=False) for body in HELD.bodies))
BASE = synthetic_run.frame(0.0)


def seen(frames, description=FREE):
    """Texts of all events of frames that are given by their contacts and counts of rejected steps."""
    detector, found = EventDetector(description), []
    for k, (contacts, rejected) in enumerate(frames):
        found += detector.see(replace(BASE, time=0.1 * k, contacts=contacts, rejected=rejected))
    return found + detector.end(0.1 * len(frames))


def texts(events):
    return [event.text for event in events]


def test_contact_is_told_when_it_is_made_and_lost_with_what_touches_what():
    grip = (("arm_0", "ball"), ("arm_1", "ball"), ("ball", "ground"))
    contacts = [(("ball", "ground"),), grip, grip, (("arm_1", "ball"),), (("arm_1", "arm_1"),)]
    assert texts(seen([(of, (0, 0, 0)) for of in contacts], HELD)) == [
        "in contact: ball with ground",
        "contact made: arm_0, arm_1 with ball",
        "contact lost: arm_0 with ball",
        "contact lost: ball with ground",
        "contact lost: arm_1 with ball",
        "contact made: arm_1 with itself",
    ]


def test_a_robot_takes_off_and_lands_and_one_that_is_held_does_not():
    ground, air, own = (("arm_0", "ground"),), (), (("arm_0", "arm_1"), ("ball", "ground"))
    flight = [(of, (0, 0, 0)) for of in (ground, own, air, ground)]
    found = [event for event in seen(flight) if event.name == "flight"]
    times = [(round(event.time, 9), event.text.partition(":")[0]) for event in found]
    assert times == [(0.1, "take-off"), (0.3, "landing")]
    assert not [event for event in seen(flight, HELD) if event.name == "flight"]


def test_thousands_of_rejected_steps_are_few_messages_that_add_up():
    frames = [((), (10 * k, 7 * k, 2 * k)) for k in range(1, 1001)]
    found = seen(frames)
    assert len(found) <= 1000 / REJECTED_FRAMES + 2
    assert found[0].text.startswith("10 steps rejected") and found[0].time == 0.0
    assert sum(int(event.text.split()[0]) for event in found) == 10_000
    assert "7 with too large an error, 2 that made energy, 1 in which Newton did not converge" in found[0].text


def test_steps_refused_for_their_error_alone_are_no_warning():
    (found,) = seen([((), (1, 1, 0))])
    assert (found.level, found.text) == (DEBUG, "1 step rejected and made again, shorter: 1 with too large an error")
    (found,) = seen([((), (1, 0, 0))])
    assert found.level == WARN


def test_a_reset_begins_to_count_anew():
    found = seen([((), (5, 5, 0)), *[((), (0, 0, 0))] * 60, ((), (2, 2, 0))])
    assert [text.split()[0] for text in texts(found)] == ["5", "2"]


@pytest.mark.parametrize(
    "event",
    [
        Event(12.75, INFO, "contact", "contact made: arm_0 with ball"),
        Event(0.0, DEBUG, "steps", ""),
        late_stimulus(1e5, "Lichtstärke_µ", "the last value stays"),
    ],
)
def test_an_event_is_read_back_here_and_by_rosbags(event):
    data = encode_event(event)
    assert decode_event(data) == event
    message = get_typestore(Stores.ROS2_KILTED).deserialize_cdr(data, EVENTS.type)
    assert (message.level, message.name, message.msg) == (event.level, event.name, event.text)
    assert message.stamp.sec + 1e-9 * message.stamp.nanosec == event.time


@pytest.fixture(scope="module")
def jump(tmp_path_factory):
    """The jumper in its log, from before it takes off, and in memory."""
    path = tmp_path_factory.mktemp("events") / "jump.mcap"
    simulator = Simulator(load_scene("jumping"))
    memory = MemoryRecorder(50.0)
    simulator.run(1.25, observers=[McapRecorder(path), memory])
    return path, memory, simulator


def test_a_jump_is_in_the_log_as_take_off_with_contact_lost(jump):
    path, memory, _ = jump
    events = read_log(path).events
    assert events == memory.run_data().events
    flight = [event for event in events if event.name == "flight"]
    assert flight[-1].text.startswith("take-off") and 1.0 < flight[-1].time <= 1.1
    assert any(e.text == "contact lost: loop with ground" and e.time == flight[-1].time for e in events)


def test_what_touches_is_what_forces_act_on():
    simulator, memory = Simulator(load_scene("jumping")), MemoryRecorder(2000.0)  # every step: it touches itself in few
    simulator.run(1.25, observers=[memory])
    for frame in memory.frames:
        nodes = frame.contact_forces[: simulator.model.node_count]
        assert bool(frame.contacts) == bool(nodes.any())
        low = frame.positions[:, 2].min() < 2e-3 + simulator.model.surfaces.radius.max()
        assert low or ("loop", "ground") not in frame.contacts
    assert {pair for frame in memory.frames for pair in frame.contacts} == {("loop", "ground"), ("loop", "loop")}


def test_all_rejected_steps_of_a_run_are_told(jump):
    path, _, simulator = jump
    told = [event for event in read_log(path).events if event.name == "steps"]
    assert sum(int(event.text.split()[0]) for event in told) == simulator.statistics.rejected > 0


def test_bodies_are_named_with_what_they_touch_before_the_first_step():
    assert Simulator(load_scene("gripping")).frame().contacts == (("ball", "ground"),)


def test_an_older_log_has_no_events(tmp_path, monkeypatch):
    before = mcap_log.input_topics
    monkeypatch.setattr(mcap_log, "input_topics", lambda of: tuple(s for s in before(of) if s is not EVENTS))
    monkeypatch.setattr(mcap_log._LogFile, "_add_events", lambda self, events: None)
    synthetic_run.run(McapRecorder(tmp_path / "old.mcap"), np.arange(5) * 0.1)
    assert read_log(tmp_path / "old.mcap").events == ()

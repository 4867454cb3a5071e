from itertools import pairwise

import numpy as np
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from support import synthetic_run

from bilayer_core.errors import InputError
from bilayer_core.log.file.indexed_log import IndexedLog
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_sim_ros.replay.stored_qos import LARGEST_DEPTH, offered_profile

INFINITE = "{sec: 9223372036, nsec: 854775807}"


def entry(**policies):
    return "- " + "\n  ".join(f"{name}: {value}" for name, value in policies.items()) + "\n"


def test_what_a_run_writes_is_what_the_node_offered(tmp_path):
    synthetic_run.run(McapRecorder(tmp_path / "run.mcap"), np.array([0.0, 0.1]))
    with IndexedLog(tmp_path / "run.mcap") as log:
        profiles = {channel.topic: offered_profile(channel.qos) for channel in log.channels if channel.qos}
    assert len(profiles) == len(log.channels)
    for topic, profile in profiles.items():
        assert (profile.history, profile.depth) == (HistoryPolicy.KEEP_LAST, 1 if topic == "/clock" else 10)
        assert (profile.reliability, profile.durability) == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)


@pytest.mark.parametrize("text", ["", "[]", "- {}", entry(history=3, depth=0, reliability=0, durability="unknown")])
def test_what_a_log_does_not_say_is_reliable_volatile_and_ten_deep(text):
    profile, default = offered_profile(text), QoSProfile(depth=10)
    for name in ("history", "depth", "reliability", "durability", "liveliness", "deadline", "lifespan"):
        assert getattr(profile, name) in (getattr(default, name), 1 if name == "liveliness" else None), name


def test_policies_are_understood_as_numbers_and_by_name():
    numbers = entry(history=1, depth=3, reliability=2, durability=1, liveliness=3)
    names = entry(
        history="keep_last",
        depth=3,
        reliability="best_effort",
        durability="transient_local",
        liveliness="manual_by_topic",
    )
    assert offered_profile(numbers) == offered_profile(names)
    assert offered_profile(names).reliability == ReliabilityPolicy.BEST_EFFORT
    assert offered_profile(names).durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_durations_are_kept():
    profile = offered_profile(entry(depth=1, deadline="{sec: 1, nsec: 500000000}", lifespan=INFINITE))
    assert profile.deadline == Duration(seconds=1.5)
    assert profile.lifespan == Duration(nanoseconds=2**63 - 1)


def test_of_several_publishers_the_strongest_offers_count_and_depths_add_up():
    weak = entry(depth=1, reliability=2, durability=2, deadline="{sec: 1, nsec: 0}")
    strong = entry(depth=1, reliability=1, durability=1)
    for text in (weak + strong, strong + weak):
        profile = offered_profile(text)
        assert (profile.reliability, profile.durability, profile.depth) == (1, 1, 2)
        assert profile.deadline == Duration()


@pytest.mark.parametrize("depth", [{"history": 2}, {"history": 1, "depth": 10**9}])
def test_no_topic_keeps_all_of_a_long_log(depth):
    assert offered_profile(entry(**depth)).depth == LARGEST_DEPTH


@pytest.mark.parametrize(
    "text",
    ["3", "[1", "[1]", "hello", entry(history=9), entry(depth="x"), entry(deadline=3), entry(lifespan="{sec: 1}")],
)
def test_what_cannot_be_understood_is_refused(text):
    with pytest.raises(InputError, match="not in the form of rosbag2"):
        offered_profile(text)


def test_aliases_that_write_out_to_gigabytes_are_refused():
    lists = "".join(f"- &{name} [{', '.join(['*' + last] * 9)}]\n" for last, name in pairwise("abcdefghij"))
    with pytest.raises(InputError, match="more than .* values"):
        offered_profile(f"- &a [1, 1]\n{lists}- history: *j\n")

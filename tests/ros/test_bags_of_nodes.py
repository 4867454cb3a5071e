"""What a recorder gets of real nodes is read as their own logs are, to the last digit."""

import functools
import struct
import time

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from support.bags import write_bag

from bilayer_core import Simulator, load_scene, read_log
from bilayer_core.cli import main
from bilayer_core.log.messages.topics import output_topics
from bilayer_core.log.run.log_reader import read_info
from bilayer_sim_ros.node.message_types import message_class

PARAMETERS = {"scene": "bending", "start_paused": True, "rate": 50.0}
OTHER = "/lab/robot1"


class Recorder:
    """Subscribes to all topics of some nodes with the quality of service of their publishers, as rosbag2 does."""

    def __init__(self, client, nodes):
        self._client = client
        self.messages = []
        node = client.node
        for name in nodes:
            client.caller("resume", name)  # services are made after topics, so these are known
        for topic, (ros_type, *_) in node.get_topic_names_and_types():
            if topic.startswith(tuple(f"{name}/" for name in nodes)) and (
                offered := node.get_publishers_info_by_topic(topic)
            ):
                kept = offered[0].qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
                quality = QoSProfile(
                    depth=1000,
                    reliability=ReliabilityPolicy.RELIABLE,
                    durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
                )
                take = functools.partial(self._take, topic, ros_type)
                node.create_subscription(message_class(ros_type), topic, take, quality, raw=True)
        client.spin_until(lambda: len(self.count("/description")) == len(nodes), "the descriptions")
        description = Simulator(load_scene(PARAMETERS["scene"])).description
        topics = [spec.name for spec in output_topics(description) if not spec.name.startswith("/")]
        topics = [f"{name}/{topic}" for name in nodes for topic in topics]
        client.spin_until(lambda: all(map(self.count, topics)), "all of the frames of the start")

    def _take(self, topic, ros_type, data, information):
        self.messages.append((topic, ros_type, information["received_timestamp"], bytes(data)))

    def count(self, topic):
        """The messages of the topics that end so."""
        return [message for message in self.messages if message[0].endswith(topic)]

    def last_stamp(self, topic):
        """Time in the header of the last message [s], which begins after four bytes of encapsulation."""
        seconds, nanoseconds = struct.unpack_from("<iI", self.count(topic)[-1][3], 4)
        return seconds + 1e-9 * nanoseconds


@pytest.fixture(scope="module")
def recorded(start, connect, domain_of_module, tmp_path_factory):
    """A directory with the logs ``own.mcap`` (and ``own_1.mcap`` after a reset) and ``other.mcap`` of two nodes, and
    the bags ``own``, ``other`` and ``both``.
    """
    at = tmp_path_factory.mktemp("recorded")
    names = ["--ros-args", "-r", "__ns:=/lab", "-r", "__node:=robot1", "--"]
    own = start("sim_node", domain_of_module, PARAMETERS | {"log": at / "own.mcap"})
    other = {"log": at / "other.mcap", "publish_clock": False, "duration": 0.3}
    start("sim_node", domain_of_module, PARAMETERS | other, arguments=names)
    client = connect(own)
    recorder = Recorder(client, ["/bilayer_sim", OTHER])
    assert client.call("resume", OTHER).success and client.call("resume").success
    client.spin_until(lambda: len(recorder.count("/bilayer_sim/com")) > 15, "frames")
    assert client.call("reset").success
    count = len(recorder.count("/bilayer_sim/com"))
    client.spin_until(lambda: len(recorder.count("/bilayer_sim/com")) > count + 15, "frames of the second run")
    client.spin_until(lambda: recorder.last_stamp(f"{OTHER}/com") > 0.299, "the last frame of the other node")
    own.end()
    client.drain()
    for bag, prefix in (("own", "/bilayer_sim/"), ("other", f"{OTHER}/"), ("both", "/")):
        write_bag(at / bag, [message for message in recorder.messages if message[0].startswith(prefix)])
    return at


def assert_same_values(bag, log):
    """All quantities of the bag are those of the log at the same times: all frames, and most shapes, whose rate begins
    with the first frame that is sent.
    """
    found, whole = read_log(bag), read_log(log)
    assert list(found.quantities) == list(whole.quantities)
    assert np.isin(found.times, whole.times).all() and np.ptp(found.times) > 0.2
    for name, quantity in found.quantities.items():
        stored = whole[name]
        times, rows, places = np.intersect1d(stored.times, quantity.times, return_indices=True)
        np.testing.assert_array_equal(stored.values[rows], quantity.values[places], err_msg=name)
        assert len(times) >= len(quantity.times) - 2 > 2


@pytest.mark.parametrize(
    ("bag", "log"),
    [("own:@1", "own.mcap"), ("own:@2", "own_1.mcap"), ("other", "other.mcap"), (f"both:{OTHER}", "other.mcap")],
)
def test_a_bag_holds_what_the_node_logged_of_the_same_run(bag, log, recorded):
    assert_same_values(f"{recorded}/{bag}", recorded / log)


def test_a_bag_is_described_by_its_runs_in_simulated_time(recorded, capsys):
    assert main(["info", str(recorded / "both")]) == 0
    told = capsys.readouterr().out
    for run in (":/bilayer_sim@1, simulated 0", ":/bilayer_sim@2, simulated 0", f":{OTHER}, simulated 0"):
        assert f"{recorded / 'both'}{run}" in told
    assert f"recorded  {time.strftime('%Y-%m-%d', time.gmtime())}" in told
    info = read_info(recorded / "other")
    assert (info.kind, info.scene, info.channels) == ("bag", "bending", ("swelling",))
    assert info.topics[f"{OTHER}/description"]["count"] == 1 and info.last_time <= 0.3


def test_a_bag_is_plotted_viewed_exported_and_compared(recorded, tmp_path):
    bag = str(recorded / "other")
    assert main(["plot", bag, "com.z", "energy/*", "--out", str(tmp_path / "figure.png")]) == 0
    assert main(["view", bag, "--save", str(tmp_path / "run.rrd")]) == 0
    assert main(["export", bag, "--npz", str(tmp_path / "run.npz")]) == 0
    assert main(["compare", bag, str(recorded / "other.mcap")]) == 0
    assert (tmp_path / "figure.png").stat().st_size > 5000
    assert b"world/strands/strip/" in (tmp_path / "run.rrd").read_bytes()
    whole = read_log(recorded / "other.mcap")
    with np.load(tmp_path / "run.npz") as data:
        rows = np.searchsorted(whole.times, data["time"])
        np.testing.assert_array_equal(data["com"], whole.com[rows])

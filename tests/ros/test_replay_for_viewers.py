"""What viewers get of a replay: markers of one time alone, the description, whole frames, positions and clocks."""

import signal

from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from support import recordings
from support.written_logs import number, write_log
from visualization_msgs.msg import Marker, MarkerArray

from bilayer_core.log.messages.description_text import from_json
from bilayer_core.log.run.log_reader import read_description

NODE = "/bilayer_replay"
EPOCH = 1_764_000_000.0


def test_markers_of_another_time_are_deleted_at_the_start_after_a_seek_and_in_each_loop(
    start, connect, domain, run_log
):
    parameters = {"play.start_paused": True, "play.loop": True, "play.start_offset": 0.1}
    node = start("replay_node", domain, parameters, [str(run_log)])
    client, heard = connect(node), []
    markers = client.node.create_subscription(MarkerArray, f"{NODE}/markers", heard.append, QoSProfile(depth=100))
    client.spin_until(lambda: markers.get_publisher_count() > 0, "a publisher of markers")
    assert client.call("resume", NODE).success
    client.spin_until(lambda: len(heard) > 12, "two passes")
    assert client.set_parameter("play.position", 0.3, NODE).successful
    count = len(heard)
    client.spin_until(lambda: len(heard) > count + 2, "markers after a seek")
    arrays = [(array.markers[0].action == Marker.DELETEALL, array.markers[-1].header.stamp.nanosec) for array in heard]
    passes = [deletes for deletes, _ in arrays]
    assert arrays[0][0] and sum(passes) >= 3
    for (_, before), (deletes, stamp) in zip(arrays, arrays[1:], strict=False):
        assert deletes or stamp > before
        assert not deletes or stamp <= before or stamp >= 0.3e9


def test_view_follow_shows_a_replay_with_its_description(start, connect, domain, run_log, tmp_path):
    node = start("replay_node", domain, {"play.start_paused": True, "play.rate": 0.5}, [str(run_log)])
    client, told = connect(node), []
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    client.node.create_subscription(String, f"{NODE}/description", told.append, kept)
    client.spin_until(lambda: told, "the description")
    assert from_json(told[0].data).scene_text == read_description(run_log).scene_text
    path = tmp_path / "seen.rrd"
    follower = start("follower", domain, arguments=["--serve", f"--node={NODE}", f"--save={path}"])
    follower.wait_for(f"following {NODE}")
    client.call("resume", NODE)
    follower.wait_for(f"{NODE} has ended")
    assert node.wait() == 0, node.output
    follower.send(signal.SIGTERM)
    assert follower.wait() == 0, follower.output
    times = recordings.times_of(path)
    shown, shapes = times["/plots/stimulus/humidity"], times["/world/strands/arm_0/active"]
    assert shown[0] == 0.0 and shown[-1] == 0.5 and len(shown) > 20
    assert shapes[0] == 0.0 and len(shapes) > 8


def test_positions_of_a_log_with_epoch_stamps_count_from_its_first_message(start, connect, domain, tmp_path):
    log = write_log(tmp_path / "log.mcap", [("/a", EPOCH + 0.5 * k, number(k)) for k in range(5)])
    node = start("replay_node", domain, {"play.start_paused": True, "play.position": 0.5}, [str(log)])
    client = connect(node)
    assert client.call("is_paused", NODE).message == "paused at t = 1764000000.5 s"
    assert client.call("play_next", NODE).message == "sent /a of t = 1764000000.5 s"
    assert client.set_parameter("play.position", 1.5, NODE).successful
    assert client.call("play_next", NODE).message == "sent /a of t = 1764000001.5 s"
    assert client.get_parameter("play.position", NODE) == 1.5
    refused = client.set_parameter("play.position", 3.0, NODE)
    assert not refused.successful and "is not in what is played, which is 1764000000 to 1764000002 s" in refused.reason


def test_the_clock_of_a_log_is_played_where_it_is_asked_for(start, connect, domain, run_log):
    node = start("replay_node", domain, {"play.start_paused": True, "play.clock_from_log": True}, [str(run_log)])
    client, clock = connect(node), []
    heard = client.node.create_subscription(Clock, "/clock", clock.append, QoSProfile(depth=100))
    client.spin_until(lambda: heard.get_publisher_count() > 0, "a publisher of /clock")
    client.call("resume", NODE)
    client.spin_to_the_end()
    assert node.wait() == 0
    assert [message.clock.nanosec for message in clock] == [round(0.02e9 * k) for k in range(26)]

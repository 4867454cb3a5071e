"""A node that is shown while it runs: its viewers come and go, stop and die, and its physics does not notice."""

import re
import signal
import time

import psutil
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from support import recordings

from bilayer_core import Simulator, load_scene
from bilayer_core.log.messages.description_text import from_json
from bilayer_sim_ros.publishing.conversions import to_seconds

SERVED = {"scene": "bending", "rerun": "serve"}
ADDRESS = r"following (\S+): rerun rerun\+http://127\.0\.0\.1:(\d+)/proxy  or in a browser  http://127\.0\.0\.1:(\d+)/"
LEAST_PART = 0.4
"""Of the pace without viewers. A node that waits for stopped viewers stands still; other programs may take a part of
the processor in any phase."""


def followers(node):
    """The processes that show a node: its follower, the follower's server, and what ends that one."""
    (follower,) = (
        of
        for of in psutil.process_iter(["cmdline", "ppid"])
        if of.info["ppid"] == node.pid and "bilayer_sim_ros.follower" in (of.info["cmdline"] or ())
    )
    return [follower, *follower.children(recursive=True)]


def gone(process):
    return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE


def simulated(message):
    """Simulated time in a message of /diagnostics [s]."""
    return float(next(of.value for of in message.status[0].values if of.key == "simulated time [s]"))


def test_a_served_node_says_where_at_this_machine_and_its_viewers_end_with_it(start, domain, tmp_path):
    node = start("sim_node", domain, SERVED)
    node.wait_for("live view: following /bilayer_sim: ")
    said = re.search(ADDRESS, node.output)
    process = psutil.Process(node.pid)
    assert recordings.listening(process) == {("127.0.0.1", int(port)) for port in said.groups()[1:]}
    late = recordings.seen_late(f"rerun+http://127.0.0.1:{said[2]}/proxy", tmp_path / "late.rrd", 3.0)
    shapes, frames = late["/world/strands/strip/active"], late["/plots/stimulus/swelling"]
    assert shapes[0] == frames[0] == 0.0
    assert frames[-1] > 0.5 and len(frames) > 0.5 * 50 * frames[-1] and len(shapes) > 0.5 * 20 * shapes[-1]
    below = process.children(recursive=True)
    lower = min(process.nice() + 10, 19)
    assert len(below) == 3 and all(of.nice() == lower for of in below)
    node.send(signal.SIGINT)
    assert node.wait() == 0, node.output
    psutil.wait_procs(below, 10)
    assert all(map(gone, below))
    assert "has ended" not in node.output and "Traceback" not in node.output


@pytest.mark.slow
def test_the_viewers_of_a_killed_node_end_as_well(start, domain):
    node = start("sim_node", domain, SERVED | {"start_paused": True})
    node.wait_for("live view: following")
    below = psutil.Process(node.pid).children(recursive=True)
    node.send(signal.SIGKILL)
    psutil.wait_procs(below, 15)
    assert len(below) == 3 and all(map(gone, below))


@pytest.mark.slow
def test_a_follower_shows_a_run_from_its_first_frame_and_a_reset_as_another(start, connect, domain, tmp_path):
    # Ten frames a second: one that is lost is a sign of more than a busy machine.
    node = start("sim_node", domain, {"scene": "bending", "start_paused": True, "real_time_factor": 0.2, "rate": 50.0})
    client = connect(node)
    com = client.listen(PointStamped, "/bilayer_sim/com")
    path = tmp_path / "seen.rrd"
    follower = start("follower", domain, arguments=["--serve", f"--save={path}"])
    follower.wait_for("following /bilayer_sim")

    def stand():
        """Until everybody has got the frame at which the node is paused: it is repeated once a second."""
        count = len(com)
        client.spin_until(lambda: len(com) > count + 2, "repetitions")

    client.spin_until(lambda: path.exists() and path.stat().st_size > recordings.EMPTY, "the first frame to be shown")
    client.call("resume")
    client.spin_until(lambda: to_seconds(com[-1].header.stamp) > 0.4, "some frames")
    end = float(re.search(r"t = (\S+) s", client.call("pause").message)[1])
    stand()
    client.call("reset")
    stand()
    assert client.call("step").success
    stand()
    follower.send(signal.SIGTERM)
    assert follower.wait() == 0, follower.output
    first, second = (recordings.times_of(tmp_path / name) for name in ("seen.rrd", "seen_1.rrd"))
    times = first["/plots/stimulus/swelling"]
    assert times[0] == 0.0 and times[-1] == pytest.approx(end, abs=1e-6)
    assert len(times) > 0.8 * 50 * end  # 50 frames a second; a message may be lost
    for layer in ("passive", "active"):
        shown = first[f"/world/strands/strip/{layer}"]
        assert shown[0] == 0.0 and len(shown) > 0.8 * 20 * end
    assert second["/plots/stimulus/swelling"].tolist() == pytest.approx([0.0, 0.02])


def test_a_stopped_follower_does_not_slow_the_physics_and_a_killed_one_is_told_once(start, connect, domain):
    node = start("sim_node", domain, SERVED | {"scene": "gripping", "stimulus_fallback": "schedule"})
    node.wait_for("live view: following")
    showing = followers(node)
    client = connect(node)
    reports = client.listen(DiagnosticArray, "/diagnostics")

    def pace(seconds):
        """Simulated over real time, as it is told once a second."""
        count = len(reports)
        client.spin_until(lambda: len(reports) > count, "a report")
        begin, real = simulated(reports[-1]), time.monotonic()
        client.spin_until(lambda: time.monotonic() - real > seconds, "time to pass")
        count = len(reports)
        client.spin_until(lambda: len(reports) > count, "another report")
        return (simulated(reports[-1]) - begin) / (time.monotonic() - real)

    shown = pace(2.0)
    for of in showing:
        of.suspend()
    stopped = pace(4.0)
    for of in showing:
        of.resume()
    showing[0].kill()
    node.wait_for("the live view has ended with exit code -9; the simulation goes on without it")
    alone = pace(1.0)
    print(f"\nsimulated over real time: shown {shown:.3f}, with stopped viewers {stopped:.3f}, alone {alone:.3f}")
    assert min(shown, stopped) > LEAST_PART * alone > 0.0
    assert node.output.count("live view has ended") == 1


def test_what_a_run_is_of_is_told_to_who_comes_late(start, connect, domain):
    node = start("sim_node", domain, {"scene": "bending", "start_paused": True})
    client, told = connect(node), []
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    client.node.create_subscription(String, "/bilayer_sim/description", told.append, kept)
    client.spin_until(lambda: told, "the description")
    expected = Simulator(load_scene("bending")).description
    found = from_json(told[0].data)
    assert (found.scene_text, found.state_layout) == (expected.scene_text, expected.state_layout)
    assert [strand.name for strand in found.strands] == [strand.name for strand in expected.strands]


@pytest.mark.slow
def test_what_cannot_be_served_ends_the_node_before_it_begins(start, domain):
    node = start("sim_node", domain, SERVED | {"rerun_port": 0.5})
    assert node.wait() == 2 and "'rerun_port' is 0.5; allowed is a whole number from 0 to 65535" in node.output
    node = start("sim_node", domain, SERVED | {"rerun_bind": "192.0.2.7"})
    assert node.wait() == 2 and "Traceback" not in node.output
    assert "sim_node: rerun: serve: --bind: cannot listen at 192.0.2.7" in node.output


@pytest.mark.slow
def test_a_follower_waits_for_its_node_and_refuses_what_is_no_name(start, domain):
    follower = start("follower", domain, arguments=["--serve", "--node=not a name"])
    assert follower.wait() == 2 and "is no name of a node" in follower.output
    follower = start("follower", domain, arguments=["--serve", "--node=other"])
    follower.wait_for("no node other publishes /other/live yet")
    node = start("sim_node", domain, {"scene": "bending"}, arguments=["--ros-args", "-r", "__node:=other"])
    follower.wait_for("following other: rerun")
    node.send(signal.SIGINT)
    follower.wait_for("other has ended; what it showed is served until Ctrl-C")

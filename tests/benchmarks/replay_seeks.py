"""How long `replay_node` takes to seek in a log of ten minutes, what memory it needs, and what playing costs (Linux).

    python tests/benchmarks/replay_seeks.py [--log FILE.mcap] [--minutes 10] [--seeks 300]

Without --log a log is made: frames of a gripper at 50 Hz with markers at 20 Hz. Each seek is `play.position` set from
another process, to a random time, and then `~/play_next`; counted is the time until the parameter's answer, and until
the first message from there has come.
"""

import argparse
import dataclasses
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS.parent)]

import rclpy  # noqa: E402
from mcap.reader import make_reader  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from support import synthetic_run  # noqa: E402
from support.processes import claimed_domain, environment  # noqa: E402

from bilayer_core.log.file.mcap_log import McapRecorder  # noqa: E402
from bilayer_sim_ros.node.message_types import message_class  # noqa: E402

NODE = "/bilayer_replay"
PLAYED = 10.0
"""Real time for which the cost of playing is measured [s]."""


def write_log(path: Path, minutes: float) -> None:
    """A log of that length, of 250 different frames."""
    frames = [synthetic_run.frame(time, 5.0) for time in np.arange(250) * 0.02]
    recorder = McapRecorder(path, 50.0, 20.0)
    recorder.start(synthetic_run.description())
    for index in range(round(minutes * 3000) + 1):
        recorder.observe(dataclasses.replace(frames[index % 250], time=index * 0.02))
    recorder.close(True)


def cpu_time(pid: int) -> float:
    """CPU time of a running process [s]."""
    user, system = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def largest_memory(pid: int) -> float:
    """Largest resident memory of a process until now [MB]."""
    return int(re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{pid}/status").read_text())[1]) / 1000


def measure(log: Path, seeks: int, domain: int) -> None:
    """Seek and play; print what was found."""
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
    start, end = summary.statistics.message_start_time * 1e-9, summary.statistics.message_end_time * 1e-9
    command = [sys.executable, "-m", "bilayer_sim_ros.replay_node", str(log)]
    command += ["--ros-args", "-p", "play.start_paused:=true"]
    node = subprocess.Popen(command, env=environment() | {"ROS_DOMAIN_ID": str(domain)}, stderr=subprocess.DEVNULL)
    rclpy.init(domain_id=domain)
    client = rclpy.create_node("client")
    try:
        position = client.create_client(SetParameters, f"{NODE}/set_parameters")
        service = {name: client.create_client(Trigger, f"{NODE}/{name}") for name in ("play_next", "resume")}
        arrived = []
        for channel in summary.channels.values():
            ros_class = message_class(summary.schemas[channel.schema_id].name)
            topic = channel.topic.replace("/bilayer_sim", NODE)
            client.create_subscription(ros_class, topic, arrived.append, QoSProfile(depth=100), raw=True)
        for waited in (position, *service.values()):
            assert waited.wait_for_service(60.0)
        time.sleep(3.0)  # until all topics have found each other

        def call(to, request):
            future = to.call_async(request)
            rclpy.spin_until_future_complete(client, future, timeout_sec=10.0)
            return future.result()

        answered, shown = [], []
        before, cpu = largest_memory(node.pid), cpu_time(node.pid)
        for _ in range(seeks):
            del arrived[:]
            wished = Parameter("play.position", value=random.uniform(start, end - 1.0)).to_parameter_msg()
            begin = time.perf_counter()
            (result,) = call(position, SetParameters.Request(parameters=[wished])).results
            answered.append(time.perf_counter() - begin)
            assert result.successful, result.reason
            assert call(service["play_next"], Trigger.Request()).success
            while not arrived:
                rclpy.spin_once(client, timeout_sec=1.0)
            shown.append(time.perf_counter() - begin)
        for name, times in (("answer", answered), ("first message", shown)):
            median, high, most = 1e3 * np.percentile(times, [50, 99, 100])
            print(f"{seeks} seeks, until the {name}: median {median:.1f} ms, 99 % {high:.1f} ms, longest {most:.1f} ms")
        print(f"CPU time of the node for a seek and a message: {1e3 * (cpu_time(node.pid) - cpu) / seeks:.1f} ms")
        wished = Parameter("play.position", value=start).to_parameter_msg()
        call(position, SetParameters.Request(parameters=[wished]))
        call(service["resume"], Trigger.Request())
        cpu, begin = cpu_time(node.pid), time.perf_counter()
        while time.perf_counter() < begin + PLAYED:
            rclpy.spin_once(client, timeout_sec=0.1)
        share = (cpu_time(node.pid) - cpu) / (time.perf_counter() - begin)
        print(f"playing at rate 1 to {len(summary.channels)} subscribers: {100 * share:.1f} % of a core")
        memory = largest_memory(node.pid)
        size = log.stat().st_size / 1e6
        print(f"largest memory: {before:.0f} MB before the first seek, {memory:.0f} MB in all; log of {size:.0f} MB")
    finally:
        node.terminate()
        print(f"exit code after SIGTERM: {node.wait(20)}")
        client.destroy_node()
        rclpy.shutdown()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--log", type=Path)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seeks", type=int, default=300)
    options = parser.parse_args()
    with claimed_domain() as domain, tempfile.TemporaryDirectory() as directory:
        log = options.log or Path(directory) / "run.mcap"
        if options.log is None:
            write_log(log, options.minutes)
        measure(log, options.seeks, domain)


if __name__ == "__main__":
    main()

"""How fast the node goes while a controller drives it, and how far off it is (Linux, two processors).

    python tests/benchmarks/closed_loop.py [--only sine] [--mode topics] [--seeds 1 2 3] [--scene NAME]
                                           [--set PATH=VALUE] [--duration S]

The node, with its log, has processor 0, the controller processor 1. The controller follows /clock and sends a signal at
a rate in simulated time. Over topics the node does not wait for it; in lockstep it does, and the controller answers
each tick with the latest value of the signal. Each signal runs once for each seed: the noise differs, and over topics
the ticks at which commands act. The table has the smallest and the largest figure of the runs.

The node goes as fast as it can (`--factor 0`), or is asked for a real-time factor. "Reached" is simulated over real
time, from where the node is ready and resumed to its end; the other factors are simulated time over the CPU time of
the stepping thread and of the whole process. On a busy machine all of them are smaller: late commands act as jumps, and
steps after a jump are short. The error is the largest distance of a node from the same run at a tenth of the tolerance,
with the same commands at the same times, over the longest rod.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np

NODE_CORE, CONTROLLER_CORE = 0, 1
FACTORS = {"reached": "real", "factor, steps": "cpu", "factor, node": "process"}
"""Column of the table to time of a run."""
ERRORS = ("largest error", "error at the end")
COMPILATION = 600.0
"""Longest wait for a node that compiles [s]."""


def sine(now: float, _: random.Random) -> float:
    """0.5 Hz, all of the range."""
    return 0.5 - 0.5 * math.cos(math.pi * now)


def square(now: float, _: random.Random) -> float:
    """0.2 and 0.6, a new one each half second."""
    return 0.2 if now % 1.0 < 0.5 else 0.6


def noise(part: float) -> Callable[[float, random.Random], float]:
    """By a part of the range, about a value that rises from there to the middle in 2 s: no blow at the start."""
    return lambda now, chance: part + (0.5 - part) * min(0.5 * now, 1.0) + part * (2.0 * chance.random() - 1.0)


SIGNALS = {
    "sine": (sine, 100.0),
    "square": (square, 2.0),
    "noise 5 %": (noise(0.05), 1000.0),
    "noise 20 %": (noise(0.2), 1000.0),
}
"""Name to law, and messages per simulated second."""


TOPICS, LOCKSTEP = "topics", "lockstep"
MODES = (TOPICS, LOCKSTEP)


def control(name: str, channel: str, seed: int, mode: str) -> None:
    """Send a signal as simulated time goes on, until nobody listens any more; runs in a process of its own.

    Prints when it resumes the node [s].
    """
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from rosgraph_msgs.msg import Clock
    from std_msgs.msg import Float64
    from std_srvs.srv import Trigger

    law, rate = SIGNALS[name]
    chance, sent, answered, value = random.Random(seed), 0, -1.0, 0.0
    rclpy.init()
    node = Node("signal")
    publisher = node.create_publisher(Float64, f"/bilayer_sim/stimulus/{channel}", 10)
    resume = node.create_client(Trigger, "/bilayer_sim/resume")

    def hear(message: Clock) -> None:
        nonlocal sent, answered, value
        now = message.clock.sec + 1e-9 * message.clock.nanosec
        while sent / rate <= now:
            value = law(sent / rate, chance)
            sent += 1
            if mode == TOPICS:
                publisher.publish(Float64(data=value))
        if mode == LOCKSTEP and now != answered and publisher.get_subscription_count() > 0:
            answered = now
            publisher.publish(Float64(data=value))

    node.create_subscription(Clock, "/clock", hear, QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE))
    deadline = time.monotonic() + COMPILATION
    while publisher.get_subscription_count() == 0 or not resume.service_is_ready():
        rclpy.spin_once(node, timeout_sec=0.05)
        if time.monotonic() > deadline:
            raise SystemExit("there is no node")
    print(time.monotonic(), flush=True)
    resume.call_async(Trigger.Request())
    try:
        while publisher.get_subscription_count() > 0:
            rclpy.spin_once(node, timeout_sec=0.5)
    except ExternalShutdownException:  # the node has come to its end
        pass


def cpu_time(pid: int) -> float:
    """CPU time of a running process [s]."""
    user, system = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def scene_with(overrides: list[str], scene: str, directory: Path) -> str:
    """The scene itself, or a file with some of its values changed."""
    from bilayer_core import load_scene
    from bilayer_core.scene.loader import scene_text

    if not overrides:
        return scene
    path = directory / "scene.yaml"
    path.write_text(scene_text(load_scene(scene, overrides)), encoding="utf-8")
    return str(path)


def measure(name: str, mode: str, seed: int, log: Path, options: argparse.Namespace) -> dict[str, float]:
    """Run a node with a controller: CPU time of its steps and of all of it, real time [s], and how often it warned."""
    from bilayer_core import load_scene

    channel = next(iter(load_scene(options.scene).stimuli))
    parameters = {"scene": options.scene, "log": log, "duration": options.duration, "start_paused": "true"}
    parameters |= {"real_time_factor": options.factor, "stimulus_interpolation": options.interpolation}
    parameters |= {"tolerance": options.tolerance, "lockstep": str(mode == LOCKSTEP).lower()}
    command = ["taskset", "-c", str(NODE_CORE), sys.executable, "-m", "bilayer_sim_ros.sim_node", "--ros-args"]
    for key, value in parameters.items():
        command += ["-p", f"{key}:={value}"]
    driver = ["taskset", "-c", str(CONTROLLER_CORE), sys.executable, __file__, "--control", name, "--channel", channel]
    driver += ["--mode", mode, "--seeds", str(seed)]
    output, ready, begun, ended, cpu = "", 0.0, 0.0, 0.0, 0.0
    with ExitStack() as stack:
        node = stack.enter_context(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
        controller = stack.enter_context(subprocess.Popen(driver, stdout=subprocess.PIPE, text=True))
        for line in node.stderr:
            output += line
            if "is ready" in line:
                ready, begun = time.monotonic(), cpu_time(node.pid)
            elif "ended at" in line:
                ended, cpu = time.monotonic(), cpu_time(node.pid) - begun
        controller.terminate()
        resumed = float(controller.stdout.readline())
    steps = re.search(r"CPU time of the steps: ([\d.]+) s", output)
    if steps is None:
        raise SystemExit(f"the node did not reach its end:\n{output}")
    behind = re.findall(r"behind: .*", output)
    if behind:
        print(f"    {name}, {mode}: {behind[-1]}", file=sys.stderr)
    return {"cpu": float(steps[1]), "process": cpu, "real": ended - max(ready, resumed), "warnings": len(behind)}


def error_of(log: Path, part: float) -> tuple[float, float]:
    """Largest, and last, distance of a node from the run at a part of the tolerance, over the longest rod."""
    from bilayer_core import read_log
    from bilayer_core.log.run.log_reader import read_info
    from bilayer_core.runs.replay import branch, simulator_of

    finer, inputs = branch(log, 0.0, [f"solver.tolerance={part * simulator_of(log).tolerance}"])
    end = read_info(log).last_time
    finer.run(until=end, inputs=inputs, log=log.with_suffix(".finer.mcap"))
    run, other = read_log(log), read_log(log.with_suffix(".finer.mcap"))
    if not np.array_equal(run.shape_times, other.shape_times):
        raise SystemExit("the two logs have shapes of different times")
    found = np.linalg.norm(run.positions - other.positions, axis=2).max(axis=1)
    longest = max(rod.path.length for rod in finer.scene.rods)
    return float(found.max() / longest), float(found[-1] / longest)


def figures_of(name: str, mode: str, seed: int, log: Path, options: argparse.Namespace) -> dict[str, float]:
    """Run a node with a controller: factors of real time, and errors over the longest rod."""
    found = measure(name, mode, seed, log, options)
    worst, last = (math.nan, math.nan) if options.no_error else error_of(log, options.part)
    factors = {key: options.duration / found[time] for key, time in FACTORS.items()}
    return {"seed": seed} | found | factors | {"largest error": worst, "error at the end": last}


def row(name: str, mode: str, runs: list[dict[str, float]]) -> str:
    """The row of a table: from the smallest to the largest figure of some runs."""
    cells = [name, f"{SIGNALS[name][1]:g}", mode]
    cells += [extent([run[key] for run in runs]) for key in FACTORS]
    cells += [f"{extent([100.0 * run[key] for run in runs])} %" for key in ERRORS]
    return f"| {' | '.join(cells)} |"


def extent(values: list[float]) -> str:
    """From the smallest to the largest of some values."""
    low, high = f"{min(values):.2g}", f"{max(values):.2g}"
    return low if low == high else f"{low} to {high}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=SIGNALS)
    parser.add_argument("--mode", choices=MODES, help="one mode alone")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3], help="one run for each")
    parser.add_argument("--scene", default="gripping")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help="of the scene")
    parser.add_argument("--factor", type=float, default=0.0, help="real-time factor asked for; 0 = as fast as possible")
    parser.add_argument("--duration", type=float, default=10.0, help="simulated time [s]")
    parser.add_argument("--interpolation", default="linear", choices=["linear", "smooth", "hold"])
    parser.add_argument("--tolerance", type=float, default=0.0, help="of steps; 0 = as the scene says")
    parser.add_argument("--no-error", action="store_true")
    parser.add_argument("--part", type=float, default=0.1, help="of the tolerance, for the error")
    parser.add_argument("--keep", type=Path, help="directory for the logs")
    parser.add_argument("--json", type=Path, help="file to write the figures to")
    parser.add_argument("--control", choices=SIGNALS, help=argparse.SUPPRESS)
    parser.add_argument("--channel", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.control:
        control(options.control, options.channel, options.seeds[0], options.mode)
        return
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    figures: dict[str, list[dict[str, float]]] = {}
    what = " ".join([options.scene, *options.set])
    print(f"{what}, {options.interpolation}, {options.duration:g} s; load average {os.getloadavg()[0]:.1f}")
    columns = ["signal", "messages/s", "mode", *FACTORS, *ERRORS]
    print(f"| {' | '.join(columns)} |\n|{' --- |' * len(columns)}")
    with tempfile.TemporaryDirectory() as directory:
        options.scene = scene_with(options.set, options.scene, Path(directory))
        for name in [options.only] if options.only else SIGNALS:
            for mode in [options.mode] if options.mode else MODES:
                stem = f"{name.replace(' %', '').replace(' ', '_')}_{mode}"
                logs = [(options.keep or Path(directory)) / f"{stem}_{seed}.mcap" for seed in options.seeds]
                runs = [
                    figures_of(name, mode, seed, log, options) for seed, log in zip(options.seeds, logs, strict=True)
                ]
                figures[f"{name}, {mode}"] = runs
                print(row(name, mode, runs), flush=True)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()

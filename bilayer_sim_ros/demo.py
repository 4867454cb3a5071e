"""The demonstration `make demo`: simulation node and controller as two processes, then log, recording and picture."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rosgraph_msgs.msg import Clock

from bilayer_core import load_scene
from bilayer_core.errors import BilayerError, SimulationError
from bilayer_core.log.run.log_reader import read_log
from bilayer_core.log.run.run_data import RunData
from bilayer_core.view.rerun_view import convert_log, screenshot
from bilayer_sim_ros.publishing.conversions import to_seconds

INTERRUPTED = 130
"""Exit code after SIGINT."""
SCENE, CHANNEL, BALL = "gripping", "humidity", "ball"
RAMP_DURATION = 13.3
"""Time in which the controller takes the stimulus from nothing to all [s]."""
STOP_TIMEOUT = 20.0
"""Longest wait for a process that was asked to end [s]."""
COMPILATION = 600.0
"""Longest wait of the controller for a node that compiles for the first time [s]."""


@dataclass(frozen=True)
class Outcome:
    """Contact and lift of the ball, and the speed of the simulation.

    Attributes
    ----------
    first_contact : float
        When the first node of the arms touched it, to the nearest frame of shapes [s].
    contact_nodes : int
        Nodes of the arms that touch it at the end.
    lift : float
        Height at the end above that at the start [m].
    real_time_factor : float
        Simulated seconds per CPU second of the stepping thread.
    """

    first_contact: float
    contact_nodes: int
    lift: float
    real_time_factor: float


def outcome(run: RunData) -> Outcome:
    """Read off a run what happened to the ball."""
    ball = [body.name for body in run.description.bodies].index(BALL)
    arms = slice(0, max(strand.nodes.stop for strand in run.description.strands))
    touching = np.any(run.contact_forces[:, arms] != 0.0, axis=2).sum(axis=1)
    if not touching.any():
        raise SimulationError("the gripper never touched the ball", float(run.times[-1]))
    heights = run.body_positions[:, ball, 2]
    return Outcome(
        first_contact=float(run.shape_times[np.argmax(touching > 0)]),
        contact_nodes=int(touching[-1]),
        lift=float(heights[-1] - heights[0]),
        real_time_factor=float(run.times[-1] / run.solver["cpu_time"][-1]),
    )


def node_command(module: str, **parameters: str | float | bool) -> list[str]:
    """Return the command line of one of our nodes."""
    command = [sys.executable, "-m", f"bilayer_sim_ros.{module}", "--ros-args", "--log-level", "warn"]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
    return command


@contextmanager
def process(command: list[str]):
    """Run a process; when the block is left, ask it to end, and kill it if it does not."""
    child = subprocess.Popen(command)
    try:
        yield child
    finally:
        if child.poll() is None:
            child.send_signal(signal.SIGINT)
            try:
                child.wait(STOP_TIMEOUT)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


def simulate(log: Path, duration: float, console: Console) -> None:
    """Run simulation node and controller side by side until the simulated `duration` [s] is over."""
    simulation = node_command(
        "sim_node",
        scene=SCENE,
        log=log,
        duration=duration,
        real_time_factor=0.0,
        start_paused=True,
        lockstep=True,
    )
    controller = node_command(
        "controllers.ramp_controller",
        channel=CHANNEL,
        duration=RAMP_DURATION,
        hold=True,
        resume=True,
        connection_timeout=COMPILATION,
    )
    simulated = 0.0

    def hear(message: Clock) -> None:
        nonlocal simulated
        simulated = to_seconds(message.clock)

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node("demo")
        node.create_subscription(Clock, "/clock", hear, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
        state, simulated_time = TextColumn("{task.description}"), TextColumn("{task.fields[time]}")
        bar = Progress(state, BarColumn(), simulated_time, TimeElapsedColumn(), console=console)
        with process(simulation) as sim, process(controller) as ramp, bar as progress:
            task = progress.add_task("starting two nodes", total=duration, time="")
            while sim.poll() is None:
                rclpy.spin_once(node, timeout_sec=0.2)
                if ramp.poll() is not None:
                    raise SimulationError("the controller ended", simulated)
                if simulated > 0.0:
                    state = "closing" if simulated < RAMP_DURATION else "holding and lifting"
                    progress.update(task, completed=simulated, description=state, time=f"{simulated:.1f} s simulated")
            if sim.returncode:
                raise SimulationError(f"the simulation node ended with exit code {sim.returncode}", simulated)
    finally:
        rclpy.try_shutdown()


def demonstrate(directory: Path) -> None:
    """Run everything; files go to `directory`, replacing those of an earlier run."""
    console = Console()
    directory.mkdir(exist_ok=True)
    log, recording, picture = (directory / f"{SCENE}.{ending}" for ending in ("mcap", "rrd", "png"))
    for path in (log, recording, picture):
        path.unlink(missing_ok=True)
    console.print(
        f"The scene '{SCENE}', simulated by one ROS 2 node; another one ramps its stimulus '{CHANNEL}'.\n"
        "The first start on a machine compiles what it needs, which takes one to three minutes.",
        soft_wrap=True,
    )
    start = time.monotonic()
    simulate(log, load_scene(SCENE).duration, console)
    wall = time.monotonic() - start
    run = read_log(log)
    result = outcome(run)
    console.print("Drawing ...")
    convert_log(log, recording)
    screenshot(recording, picture)
    console.print(
        f"\nfirst contact      {result.first_contact:.1f} s after the start\n"
        f"contact nodes      {result.contact_nodes} of the arms at the end\n"
        f"ball lifted by     {1e3 * result.lift:.1f} mm\n"
        f"simulated          {run.times[-1]:.2f} s, {result.real_time_factor:.1f} times as fast as real time; "
        f"{wall:.0f} s with the start of both nodes\n"
        f"\nlog                {log}\nrerun recording    {recording}    (look at it: bilayer view {recording})\n"
        f"picture            {picture}",
        highlight=False,
        soft_wrap=True,
    )


def main() -> int:
    """Run the demonstration in the present directory; the exit code."""
    # Two nodes of one machine, and not of the whole network.
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    try:
        demonstrate(Path("runs"))
    except BilayerError as error:
        print(f"demo: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("demo: interrupted; what was logged so far is in runs/", file=sys.stderr)
        return INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())

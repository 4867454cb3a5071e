"""The simulation on ROS topics: stimuli come in, frames go out, services pause and reset."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from std_msgs.msg import Float64, Float64MultiArray
from std_srvs.srv import Trigger

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import BilayerError, InputError
from bilayer_sim_ros.conversions import to_diagnostics
from bilayer_sim_ros.pacing import Pacer
from bilayer_sim_ros.parameters import Value
from bilayer_sim_ros.publishing import FramePublisher
from bilayer_sim_ros.recording import Recording
from bilayer_sim_ros.stimulus import Channel, StimulusInputs
from bilayer_sim_ros.worker import SimulationWorker, Status

# Longest wait of a service for the simulation: one output period may take many steps [s].
SERVICE_TIMEOUT = 60.0
WARNING_PERIOD = 1.0
"""Real time between two warnings about refused messages [s]."""


def simulate(node: Node, parameters: Mapping[str, Value], stop: threading.Event) -> None:
    """Simulate until the duration is reached or `stop` is set; raises what the simulation stopped with."""
    scene = load_scene(parameters["scene"])
    rate = parameters["rate"] or scene.output.rate
    rerun_path = "" if parameters["rerun"] == "off" else parameters["rerun"]
    recording = Recording(parameters["log"], rerun_path, rate, scene.output.marker_rate)
    simulator = Simulator(
        scene,
        model=parameters["model"],
        dimension=parameters["dimension"],
        dt=parameters["dt"] or None,
        tolerance=parameters["tolerance"] or None,
    )
    node.get_logger().info("compiling, the first start on a machine may take two minutes ...")
    seconds = simulator.compile()
    description = simulator.description
    inputs = StimulusInputs(
        [
            Channel(name, minimum, maximum, scene.stimuli[name].schedule)
            for name, (minimum, maximum) in zip(description.channels, description.channel_ranges, strict=True)
        ],
        parameters["stimulus_timeout"],
        parameters["stimulus_fallback"],
    )
    worker = SimulationWorker(
        simulator,
        inputs=inputs,
        publisher=FramePublisher(node, description, rate, scene.output.marker_rate, parameters["publish_clock"]),
        recording=recording,
        rate=rate,
        pacer=Pacer(parameters["real_time_factor"]),
        duration=parameters["duration"] or math.inf,
        paused=parameters["start_paused"],
        report=_diagnostics(node, parameters["real_time_factor"]),
        finished=stop.set,
    )
    _subscribe(node, inputs, description.channels)
    _serve(node, worker)
    state = "paused" if parameters["start_paused"] else "running"
    node.get_logger().info(f"'{description.scene_name}' is ready ({seconds:.1f} s to compile or load kernels), {state}")
    worker.start()
    try:
        stop.wait()
    finally:
        worker.stop()
    if worker.error is not None:
        raise worker.error
    node.get_logger().info(f"ended at t = {simulator.time:.6g} s; CPU time of the steps: {simulator.cpu_time:.3f} s")


def _diagnostics(node: Node, real_time_factor: float) -> Callable[[Status], None]:
    """What publishes a status on /diagnostics."""
    publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    name = node.get_fully_qualified_name()

    def publish(status: Status) -> None:
        if publisher.get_subscription_count() > 0:
            publisher.publish(to_diagnostics(status, name, real_time_factor))

    return publish


def _subscribe(node: Node, inputs: StimulusInputs, channels: tuple[str, ...]) -> None:
    """Subscribe to the stimulus topics. What is refused is said in a warning and changes nothing."""

    def take(receive: Callable, message: Float64 | Float64MultiArray) -> None:
        try:
            receive(message.data)
        except InputError as error:
            node.get_logger().warning(
                f"refused: {error}; the last good value stays", throttle_duration_sec=WARNING_PERIOD
            )

    node.create_subscription(Float64MultiArray, "~/stimulus", partial(take, inputs.receive_all), 10)
    for channel in channels:
        receive = partial(take, partial(inputs.receive, channel))
        node.create_subscription(Float64, f"~/stimulus/{channel}", receive, 10)


def _serve(node: Node, worker: SimulationWorker) -> None:
    """Offer the services; each answers when the simulation has done what was asked."""

    def answer(ask: Callable[[], Future], _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            response.message = ask().result(timeout=SERVICE_TIMEOUT)
            response.success = True
        except (BilayerError, TimeoutError) as error:
            response.message = str(error) or "the simulation did not answer in time"
            response.success = False
        return response

    for name in ("pause", "resume", "step", "reset"):
        node.create_service(Trigger, f"~/{name}", partial(answer, getattr(worker, name)))

"""The simulation on ROS topics: stimuli come in, frames go out, services pause and reset."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from functools import partial

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64, Float64MultiArray

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_core.model.model import Model
from bilayer_core.record.events import Event, late_stimulus
from bilayer_sim_ros.commands import Commands
from bilayer_sim_ros.conversions import PATIENCE, to_diagnostics
from bilayer_sim_ros.lockstep import SHORTEST_PERIOD, Asynchronous, Lockstep, tick_rate
from bilayer_sim_ros.pacing import Pacer
from bilayer_sim_ros.parameters import Value
from bilayer_sim_ros.publishing import ClockPublisher, FramePublisher
from bilayer_sim_ros.recording import Recording
from bilayer_sim_ros.services import Services, trigger
from bilayer_sim_ros.status import Status
from bilayer_sim_ros.stimulus import Channel, StimulusInputs
from bilayer_sim_ros.worker import SimulationWorker

COMPILATION_PERIOD = 5.0
"""Between two messages about compilation [s]."""
FALLBACKS = {"hold": "the last value stays", "zero": "zero acts", "schedule": "the scene's schedule acts"}
"""What an event says of each `stimulus_fallback`."""
UNPACED_PATIENCE = 0.25
"""Longest wait for the disk of a simulation that goes as fast as it can, and has no rhythm to keep [s]."""
WARNING_PERIOD = 1.0
"""Real time between two warnings about refused messages [s]."""
DROPPING_PERIOD = 10.0
"""Real time between two warnings about frames that a log lacks [s]."""


def simulate(node: Node, parameters: Mapping[str, Value], stop: threading.Event) -> None:
    """Simulate until the duration is reached or `stop` is set; raises what the simulation stopped with."""
    scene = load_scene(parameters["scene"])
    rate = parameters["rate"] or scene.output.rate
    rerun_path = "" if parameters["rerun"] == "off" else parameters["rerun"]
    patience = 0.0 if parameters["real_time_factor"] else UNPACED_PATIENCE
    recording = Recording(parameters["log"], rerun_path, rate, scene.output.marker_rate, patience)
    simulator = Simulator(
        scene,
        model=parameters["model"],
        dimension=parameters["dimension"],
        dt=parameters["dt"] or None,
        tolerance=parameters["tolerance"] or None,
    )
    lockstep, clock = parameters["lockstep"], parameters["publish_clock"]
    if lockstep:
        shortest = simulator.dt if simulator.tolerance is None else SHORTEST_PERIOD
        ticks = tick_rate(parameters["control_period"], rate, clock, shortest)
    ensure_compiled(_progress_of_compilation(node))
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
    control = Asynchronous(inputs)
    if lockstep:
        control = Lockstep(inputs, ticks, ClockPublisher(node, description).publish)
    commands = Commands(partial(_warn_of_refusal, node))
    worker = SimulationWorker(
        simulator,
        control=control,
        commands=commands,
        publisher=FramePublisher(node, description, rate, scene.output.marker_rate, clock and not lockstep),
        recording=recording,
        rate=rate,
        pacer=Pacer(parameters["real_time_factor"]),
        duration=parameters["duration"] or math.inf,
        paused=parameters["start_paused"],
        report=_diagnostics(node, parameters["real_time_factor"], lambda event: worker.tell(event)),
        finished=stop.set,
    )
    fallback = FALLBACKS[parameters["stimulus_fallback"]]
    inputs.late = lambda time, name: worker.tell(
        late_stimulus(time, f"none on {name} for {parameters['stimulus_timeout']:g} s", fallback)
    )
    if lockstep:
        inputs.notify = worker.wake
    _subscribe(node, inputs, description.channels)
    _subscribe_commands(node, commands, simulator.model)
    services = Services(node, [trigger(name, getattr(worker, name)) for name in ("pause", "resume", "step", "reset")])
    state = "paused" if parameters["start_paused"] else "running"
    node.get_logger().info(f"'{description.scene_name}' is ready ({seconds:.1f} s to compile or load kernels), {state}")
    worker.start()
    try:
        stop.wait()
    finally:
        worker.stop()
        services.finish()
    if worker.log_status.dropped:
        node.get_logger().warning(f"the log lacks {worker.log_status.dropped} frames: the disk was too slow")
    if worker.error is not None:
        raise worker.error
    node.get_logger().info(f"ended at t = {simulator.time:.6g} s; CPU time of the steps: {simulator.cpu_time:.3f} s")


def _diagnostics(node: Node, real_time_factor: float, tell: Callable[[Event], None]) -> Callable[[Status], None]:
    """What publishes a status on /diagnostics, and says if no controller answers, and what a log lacks."""
    publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    name = node.get_fully_qualified_name()
    missed, failure = False, ""

    def publish(status: Status) -> None:
        nonlocal missed, failure
        if status.log.failure and status.log.failure != failure:
            node.get_logger().error(f"{status.log.failure}; the simulation goes on without it")
        elif status.dropped:
            node.get_logger().warning(
                f"the disk is slower than the log: {status.log.dropped} frames are left out so far, but no input",
                throttle_duration_sec=DROPPING_PERIOD,
            )
        failure = status.log.failure
        if status.waited >= PATIENCE and not missed:
            node.get_logger().warning(
                f"lockstep: simulated time stands still at t = {status.time:.6g} s, as no stimulus has come for "
                f"{status.waited:.0f} s; a controller has to answer each time on /clock"
            )
            tell(late_stimulus(status.time, f"no answer for {status.waited:.0f} s", "simulated time stands still"))
        missed = status.waited >= PATIENCE
        if publisher.get_subscription_count() > 0:
            publisher.publish(to_diagnostics(status, name, real_time_factor))

    return publish


def _progress_of_compilation(node: Node) -> Callable[[int, int], None]:
    """Says now and then how many pieces of the engine are compiled."""

    def report(done: int, total: int) -> None:
        node.get_logger().info(
            f"compiling kernels, once for this version on this machine: {done} of {total} pieces",
            throttle_duration_sec=COMPILATION_PERIOD,
        )

    return report


def _subscribe(node: Node, inputs: StimulusInputs, channels: tuple[str, ...]) -> None:
    """Subscribe to the stimulus topics. What is refused is said in a warning and changes nothing."""

    def take(receive: Callable, message: Float64 | Float64MultiArray) -> None:
        try:
            receive(message.data)
        except InputError as error:
            _warn_of_refusal(node, str(error))

    node.create_subscription(Float64MultiArray, "~/stimulus", partial(take, inputs.receive_all), 10)
    for channel in channels:
        receive = partial(take, partial(inputs.receive, channel))
        node.create_subscription(Float64, f"~/stimulus/{channel}", receive, 10)


def _subscribe_commands(node: Node, commands: Commands, model: Model) -> None:
    """Subscribe to the poses of bodies that controllers may move, and to factors of loads."""

    def take_pose(body: str, message: PoseStamped) -> None:
        try:
            commands.ask_pose(body, message)
        except InputError as error:
            _warn_of_refusal(node, str(error))

    def take_load(name: str, message: Float64) -> None:
        commands.ask_load(name, message.data)

    for index in model.bodies.controlled:
        body = model.bodies.names[index]
        node.create_subscription(PoseStamped, f"~/mount_pose/{body}", partial(take_pose, body), 10)
    for load in model.scene.loads:
        node.create_subscription(Float64, f"~/load/{load.name}", partial(take_load, load.name), 10)


def _warn_of_refusal(node: Node, reason: str) -> None:
    node.get_logger().warning(f"refused: {reason}; the last good value stays", throttle_duration_sec=WARNING_PERIOD)

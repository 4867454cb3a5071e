"""The simulation on ROS topics: stimuli come in, frames go out, services pause and reset."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from functools import partial

from rclpy.node import Node

from bilayer_core import Simulator, load_scene
from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_sim_ros.answers import Answers
from bilayer_sim_ros.commands import Commands
from bilayer_sim_ros.control import SHORTEST_PERIOD, Control, tick_rate
from bilayer_sim_ros.live_parameters import LiveParameters
from bilayer_sim_ros.live_view import SERVE, live_view
from bilayer_sim_ros.lockstep import Lockstep, channels_that_answer, refuse_without_clock
from bilayer_sim_ros.pacing import Pacer
from bilayer_sim_ros.parameters import OFF, SIM_NODE, Value
from bilayer_sim_ros.publishing import ClockPublisher, FramePublisher
from bilayer_sim_ros.recording import Recording
from bilayer_sim_ros.saying import Announcer
from bilayer_sim_ros.services import Services, trigger
from bilayer_sim_ros.stimulus import Channel, StimulusInputs
from bilayer_sim_ros.subscriptions import Rest, subscribe_commands, subscribe_stimuli, warn_of_refusal
from bilayer_sim_ros.worker import SimulationWorker

UNPACED_PATIENCE = 0.25
"""Longest wait for the disk of a simulation that goes as fast as it can, and has no rhythm to keep [s]."""


def simulate(node: Node, parameters: Mapping[str, Value], stop: threading.Event) -> None:
    """Simulate until the duration is reached or `stop` is set; raises what the simulation stopped with."""
    scene = load_scene(parameters["scene"])
    rate, marker_rate = parameters["rate"] or scene.output.rate, parameters["marker_rate"] or scene.output.marker_rate
    rerun_path = "" if parameters["rerun"] in (OFF, SERVE) else parameters["rerun"]
    patience = 0.0 if parameters["real_time_factor"] else UNPACED_PATIENCE
    recording = Recording(parameters["log"], rerun_path, rate, marker_rate, patience)
    simulator = Simulator(
        scene,
        model=parameters["model"],
        dimension=parameters["dimension"],
        dt=parameters["dt"] or None,
        tolerance=parameters["tolerance"] or None,
    )
    lockstep, clock = parameters["lockstep"], parameters["publish_clock"]
    needed = channels_that_answer(parameters["lockstep_answers"], list(scene.stimuli))
    if lockstep:
        refuse_without_clock(clock)
    shortest = simulator.dt if lockstep and simulator.tolerance is None else SHORTEST_PERIOD
    ticks = tick_rate(parameters["control_period"], rate, shortest)
    description = simulator.description
    inputs = StimulusInputs(
        [
            Channel(name, minimum, maximum, scene.stimuli[name].schedule)
            for name, (minimum, maximum) in zip(description.channels, description.channel_ranges, strict=True)
        ],
        parameters["stimulus_timeout"],
        parameters["stimulus_fallback"],
        Answers(description.channels, needed) if lockstep else None,
    )
    commands = Commands(partial(warn_of_refusal, node))
    gate = None
    if lockstep:
        gate = Lockstep(inputs, ClockPublisher(node, description).publish, parameters["lockstep_timeout"])
        inputs.notify = lambda: worker.wake()
    announcer = Announcer(node, inputs, parameters, lambda event: worker.tell(event))
    pacer = Pacer(parameters["real_time_factor"])
    publisher = FramePublisher(node, description, rate, marker_rate, clock and not lockstep)
    worker = SimulationWorker(
        simulator,
        control=Control(inputs, commands, ticks, parameters["stimulus_interpolation"], gate),
        publisher=publisher,
        recording=recording,
        rate=rate,
        marker_rate=marker_rate,
        pacer=pacer,
        duration=parameters["duration"] or math.inf,
        paused=parameters["start_paused"],
        report=announcer.report,
        finished=stop.set,
    )
    rest = None if lockstep else Rest(ticks, lambda: pacer.factor)
    subscribe_stimuli(node, inputs, description.channels, rest)
    subscribe_commands(node, commands, simulator.model)
    changes = {
        "real_time_factor": worker.set_real_time_factor,
        "rate": lambda value: worker.set_rate(value or scene.output.rate),
        "marker_rate": lambda value: worker.set_marker_rate(value or scene.output.marker_rate),
    }
    LiveParameters(node, SIM_NODE, changes)
    services = Services(node, [trigger(name, getattr(worker, name)) for name in ("pause", "resume", "step", "reset")])
    viewers = live_view(node, parameters)
    state = "paused" if parameters["start_paused"] else "running"
    try:
        # What is asked for and sent meanwhile waits.
        ensure_compiled(announcer.say_compiling)
        seconds = simulator.compile()
        node.get_logger().info(
            f"'{description.scene_name}' is ready ({seconds:.1f} s to compile or load kernels), {state}"
        )
        viewers.wait(stop, publisher.is_shown)
        worker.start()
        stop.wait()
    finally:
        worker.stop()
        publisher.finish()
        viewers.end()
        services.finish()
    if worker.log_status.dropped:
        node.get_logger().warning(f"the log lacks {worker.log_status.dropped} frames: the disk was too slow")
    if worker.error is not None:
        raise worker.error
    node.get_logger().info(f"ended at t = {simulator.time:.6g} s; CPU time of the steps: {simulator.cpu_time:.3f} s")

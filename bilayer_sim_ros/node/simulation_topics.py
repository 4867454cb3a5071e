"""The simulation on ROS topics: stimuli come in, frames go out, services pause and reset."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from rclpy.node import Node

from bilayer_core import Simulator, load_scene
from bilayer_sim_ros.control.control_ticks import SHORTEST_PERIOD, Control, tick_rate
from bilayer_sim_ros.control.lockstep import Lockstep, channels_that_answer, refuse_without_clock
from bilayer_sim_ros.control.pacing import Pacer
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.control.stimulus import Channel, StimulusInputs
from bilayer_sim_ros.control.subscriptions import (
    Rest,
    controlled_bodies,
    subscribe_commands,
    subscribe_stimuli,
    warn_of_refusal,
)
from bilayer_sim_ros.control.tick_answers import Answers
from bilayer_sim_ros.node.after_shutdown import WhileValid, while_valid
from bilayer_sim_ros.node.graph_watch import GraphWatch
from bilayer_sim_ros.node.live_friction import LiveFriction, friction_overrides
from bilayer_sim_ros.node.live_parameters import LiveParameters
from bilayer_sim_ros.node.parameters import FRICTION, OFF, SIM_NODE, Value
from bilayer_sim_ros.node.run_reports import Announcer
from bilayer_sim_ros.node.worker import SimulationWorker
from bilayer_sim_ros.publishing.live_view import SERVE
from bilayer_sim_ros.publishing.output_rates import refuse_marker_rate
from bilayer_sim_ros.publishing.run_files import Recording
from bilayer_sim_ros.publishing.tf_topic import tf_prefix
from bilayer_sim_ros.publishing.topic_publishers import ClockPublisher, FramePublisher
from bilayer_sim_ros.services.simulator_services import simulator_services
from bilayer_sim_ros.services.steps_action import offer_steps
from bilayer_sim_ros.services.trigger_services import Services, trigger

UNPACED_PATIENCE = 0.25
"""Longest wait for the disk of a simulation that goes as fast as it can, and has no rhythm to keep [s]."""


@dataclass(frozen=True)
class Simulation:
    """A simulation with all its topics and services; what is asked for and sent before it runs waits."""

    simulator: Simulator  # At its start, not compiled
    worker: SimulationWorker  # Not started
    frames: WhileValid  # Where its frames are published
    services: Services
    announcer: Announcer
    state: str
    """``paused`` or ``running``, as it starts."""


def wire(
    node: Node, parameters: Mapping[str, Value], finished: Callable[[], None], end: Callable[[str], None]
) -> Simulation:
    """Return the simulation that parameters describe, connected to topics and services of a node.

    Parameters
    ----------
    node : Node
    parameters : mapping
        Values of `SIM_NODE`.
    finished : callable
        Called when a run has ended by itself, in its thread.
    end : callable
        Ends it, for a reason.

    Raises
    ------
    InputError
        For parameters that cannot be.
    """
    scene = load_scene(parameters["scene"])
    if changed := friction_overrides(scene, parameters):
        scene = load_scene(parameters["scene"], changed)
    rate, marker_rate = parameters["rate"] or scene.output.rate, parameters["marker_rate"] or scene.output.marker_rate
    refuse_marker_rate(parameters["marker_rate"], rate)
    rerun_path = "" if parameters["rerun"] in (OFF, SERVE) else parameters["rerun"]
    patience = 0.0 if parameters["real_time_factor"] else UNPACED_PATIENCE
    tf = tf_prefix(node, parameters)
    recording = Recording(parameters["log"], rerun_path, rate, marker_rate, patience, tf)
    simulator = Simulator(
        scene,
        model=parameters["model"],
        dimension=parameters["dimension"],
        dt=parameters["dt"] or None,
        tolerance=parameters["tolerance"] or None,
    )
    lockstep, clock = parameters["lockstep"], parameters["publish_clock"]
    needed = channels_that_answer(
        parameters["lockstep_answers"], list(scene.stimuli), controlled_bodies(simulator.model)
    )
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
        publish = while_valid(node, ClockPublisher(node, description).publish)
        gate = Lockstep(inputs, publish, parameters["lockstep_timeout"])
        inputs.notify = lambda: worker.wake()
    announcer = Announcer(node, inputs, parameters, lambda event: worker.tell(event))
    frames = WhileValid(node, FramePublisher(node, description, rate, marker_rate, clock and not lockstep, tf))
    pacer = Pacer(parameters["real_time_factor"])
    worker = SimulationWorker(
        simulator,
        control=Control(inputs, commands, ticks, parameters["stimulus_interpolation"], gate),
        publisher=frames,
        recording=recording,
        rate=rate,
        marker_rate=marker_rate,
        pacer=pacer,
        duration=parameters["duration"] or math.inf,
        paused=parameters["start_paused"],
        report=while_valid(node, announcer.report),
        finished=finished,
    )
    rest = None if lockstep else Rest(ticks, lambda: pacer.factor)
    subscribe_stimuli(node, inputs, rest)
    subscribe_commands(node, commands, inputs, simulator.model)
    changes = {
        "real_time_factor": worker.set_real_time_factor,
        "rate": lambda value: worker.set_rate(value or scene.output.rate),
        "marker_rate": lambda value: worker.set_marker_rate(value or scene.output.marker_rate, asked=value > 0.0),
        **LiveFriction(simulator, commands, lambda event: worker.tell(event)).changes,
    }
    live = LiveParameters(node, SIM_NODE, changes)
    as_given = {name: parameters[name] for name in FRICTION}
    commands.forgotten = lambda: node.executor and node.executor.create_task(live.show, as_given)
    offered = [trigger(name, getattr(worker, name)) for name in ("pause", "resume", "step", "reset")]
    services = Services(node, offered + simulator_services(node, worker, description, end))
    offer_steps(node, worker.step, services)
    GraphWatch(node)
    state = "paused" if parameters["start_paused"] else "running"
    return Simulation(simulator, worker, frames, services, announcer, state)

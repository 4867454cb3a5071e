"""Topics on which controllers send; what is refused is said in a warning and changes nothing."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from bilayer_core.errors import InputError
from bilayer_core.model.model import Model
from bilayer_core.printable import shortened
from bilayer_sim_ros.control.contradictions import Contradictions, source_of, warn_of_contradiction
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.control.stimulus import StimulusInputs
from bilayer_sim_ros.control.tick_answers import mount
from bilayer_sim_ros.publishing.conversions import nanoseconds_of

DEPTH = 10
STAMPED_DEPTH = 100
"""All controllers may send on one topic, and no answer is to be lost."""
LONGEST_REST = 0.005
"""So long services may wait for the end of a rest [s]."""
ROUND = 0.5e-3
"""Messages that are looked for at once are taken within about that time of each other [s]."""
LONGEST_WARNING = 300
"""Characters of a warning that quotes what others sent."""
REFUSAL_PERIOD = 1.0
"""Real time between two warnings about refused messages [s]."""
IGNORED_PERIOD = 10.0
"""Real time between two warnings about answers that are ignored [s]."""


class Rest:
    """Lets the thread of the executor rest after a round of messages of which the last alone acts.

    To look for messages costs the executor 0.3 to 1 ms whatever comes, so that a controller of 1 kHz would take half of
    a processor from the physics.

    `rate`: ticks per simulated second [Hz]: the rest takes a quarter of their period, and at most `LONGEST_REST`.
    `factor`: simulated seconds per second at the present; 0 means as many as can be, and no rest.
    """

    def __init__(self, rate: float, factor: Callable[[], float]):
        self._rate, self._factor = rate, factor
        self._ended = -math.inf

    def __call__(self) -> None:
        """Rest unless it has just been done."""
        factor = self._factor()
        length = min(0.25 / (self._rate * factor), LONGEST_REST) if factor else 0.0
        if length > 0.0 and time.monotonic() - self._ended > ROUND:
            time.sleep(length)
            self._ended = time.monotonic()


def subscribe_stimuli(node: Node, inputs: StimulusInputs, rest: Callable[[], None] | None) -> None:
    """Take stimuli: all channels, one, or those that a message names beside the tick that it answers.

    With a `rest`, which is taken after each message, only the last message of a topic counts; without one, in lockstep,
    each does. The node warns of controllers that contradict each other.
    """
    depth = DEPTH if rest is None else 1
    names = [channel.name for channel in inputs.channels]
    contradictions = Contradictions(inputs.channels, lambda: inputs.ticks, partial(warn_of_contradiction, node))
    topics = {name: node.resolve_topic_name(f"~/{name}") for name in ("stimulus", "stimulus_stamped")}

    def all_channels(message: Float64MultiArray, info: Mapping[str, Any]) -> None:
        with resting(rest):
            inputs.receive_all(message.data)
        note(message.data, names, topics["stimulus"], info)

    def one(channel: str, topic: str, message: Float64, info: Mapping[str, Any]) -> None:
        with resting(rest):
            inputs.receive(channel, message.data)
        note([message.data], [channel], topic, info)

    def stamped(message: JointState, info: Mapping[str, Any]) -> None:
        tick = nanoseconds_of(message.header.stamp)
        fault = inputs.receive_stamped(tick, message.name, message.position)
        if fault:
            _warn_of_ignored(node, inputs, message.name, tick, fault)
        else:
            note(message.position, message.name, topics["stimulus_stamped"], info)

    def note(values: Sequence[float], channels: Sequence[str], topic: str, info: Mapping[str, Any]) -> None:
        contradictions.note(dict(zip(channels, values, strict=True)), source_of(topic, info))

    _subscribe(node, Float64MultiArray, "~/stimulus", all_channels, depth)
    for channel in names:
        topic = f"~/stimulus/{channel}"
        _subscribe(node, Float64, topic, partial(one, channel, node.resolve_topic_name(topic)), depth)
    _subscribe(node, JointState, "~/stimulus_stamped", stamped, STAMPED_DEPTH)


@contextmanager
def resting(rest: Callable[[], None] | None) -> Iterator[None]:
    """Take the rest after a message, if there is one, also after one that is refused."""
    try:
        yield
    finally:
        if rest is not None:
            rest()


def subscribe_commands(node: Node, commands: Commands, inputs: StimulusInputs, model: Model) -> None:
    """Take the poses of bodies that controllers may move, and factors of loads. Where ticks of a lockstep wait for the
    pose of a body, its stamp says which one it answers; without a stamp that is the open one.
    """

    def pose(body: str, message: PoseStamped, _: Mapping[str, Any]) -> None:
        tick = nanoseconds_of(message.header.stamp) or None
        fault = inputs.answer(mount(body), tick, commands.pose(body, message))
        if fault:
            _warn_of_ignored(node, inputs, [mount(body)], tick or 0, fault)

    def factor(load: str, message: Float64, _: Mapping[str, Any]) -> None:
        commands.ask_load(load, message.data)

    for body in controlled_bodies(model):
        _subscribe(node, PoseStamped, f"~/{mount(body)}", partial(pose, body))
    for load in model.scene.loads:
        _subscribe(node, Float64, f"~/load/{load.name}", partial(factor, load.name))


def controlled_bodies(model: Model) -> list[str]:
    """Return the names of bodies that controllers may move."""
    return [model.bodies.names[index] for index in model.bodies.controlled]


def _warn_of_ignored(node: Node, inputs: StimulusInputs, names: Sequence[str], tick: int, fault: str) -> None:
    counts = ", ".join(f"{count} {why}" for why, count in inputs.ignored.items() if count)
    node.get_logger().warning(
        f"lockstep: an answer of {shortened(', '.join(names))} to t = {tick * 1e-9:.9g} s is {fault} and is ignored "
        f"(so far: {counts})",
        throttle_duration_sec=IGNORED_PERIOD,
    )


def warn_of_refusal(node: Node, reason: str) -> None:
    """Say why something is refused, if that has not been said just now."""
    text = f"refused: {shortened(reason, LONGEST_WARNING)}; the last good value stays"
    node.get_logger().warning(text, throttle_duration_sec=REFUSAL_PERIOD)


def _subscribe(
    node: Node, kind: type, topic: str, take: Callable[[Any, Mapping[str, Any]], None], depth: int = DEPTH
) -> None:
    def callback(message: Any, info: Mapping[str, Any]) -> None:
        try:
            take(message, info)
        except InputError as error:
            warn_of_refusal(node, str(error))

    node.create_subscription(kind, topic, callback, depth)

"""A log on ROS topics: its messages go out by their time, services and parameters pause, seek and step."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from concurrent.futures import Future

from rclpy.node import Node
from std_srvs.srv import Trigger

from bilayer_core.errors import BilayerError, InputError
from bilayer_core.log.file.indexed_log import IndexedLog
from bilayer_core.log.messages.cdr import NANOSECONDS, nanoseconds, seconds_text
from bilayer_sim_ros.node.live_parameters import LiveParameters
from bilayer_sim_ros.node.parameters import REPLAY_NODE, Value
from bilayer_sim_ros.replay.player import Playback, Player
from bilayer_sim_ros.replay.replay_topics import ReplayTopics
from bilayer_sim_ros.services.rosbag2_services import rosbag2_services
from bilayer_sim_ros.services.trigger_services import Service, Services, trigger

LAG_PERIOD = 5.0
"""Real time between two warnings that messages come late [s]."""
POSITION, RATE = "play.position", "play.rate"
CLOCKS_MADE = ("play.clock_publish_frequency", "play.clock_publish_on_topic_publish")
STORED_CLOCK = "play.clock_from_log"
LATEST_CLOCK = 2**31 * NANOSECONDS
"""Time that a message on /clock cannot hold [ns]."""


def play(node: Node, parameters: Mapping[str, Value], stop: threading.Event) -> None:
    """Play a log until its end or until `stop` is set; raises what playing stopped with."""
    if not parameters["log"]:
        raise InputError("no log is given: replay_node LOG.mcap, or the parameter 'log'")
    with IndexedLog(parameters["log"]) as log:
        _play(node, log, parameters, stop)


def _play(node: Node, log: IndexedLog, parameters: Mapping[str, Value], stop: threading.Event) -> None:
    playback = playback_of(log, parameters)
    logger = node.get_logger()
    topics = ReplayTopics(node, log, playback, logger.warning)
    if not topics.channels:
        raise InputError(f"{log.path}: holds no topic that can be published")

    def move(time: int) -> None:
        node.executor.create_task(show, (time - log.start) / NANOSECONDS)

    def show(position: float) -> None:
        live.show({POSITION: position, RATE: player.rate})

    def seek(position: float) -> Future:
        return player.seek(log.start + nanoseconds(position))

    def warn_of_lag(lag: float) -> None:
        logger.warning(
            f"cannot keep up with {RATE} = {player.rate:g}: messages go out {lag:.2f} s later than it asks by now, "
            "none is left out",
            throttle_duration_sec=LAG_PERIOD,
        )

    player = Player(log, topics, playback, moved=move, behind=warn_of_lag, finished=stop.set)
    offered = trigger_services(player) if parameters["services"] == "std_srvs" else rosbag2_services(node, player)
    changes = {POSITION: seek, RATE: player.set_rate}
    live = LiveParameters(node, REPLAY_NODE, changes)
    services = Services(node, offered)
    kind = "std_srvs/Trigger" if parameters["services"] == "std_srvs" else "rosbag2_interfaces"
    span = f"t = {seconds_text(playback.first)} to {seconds_text(playback.end)} s"
    logger.info(
        f"{'paused' if playback.paused else 'playing'} {log.path}, {span}, {len(topics.channels)} topics; "
        f"services ({kind}): {' '.join(f'~/{service.name}' for service in offered)}"
    )
    player.start()
    try:
        stop.wait()
    finally:
        player.stop()
        services.finish()
    if player.error is not None:
        raise player.error
    late = f"; {player.lag:.2f} s later than {RATE} asked" if player.lag else ""
    logger.info(f"ended at t = {seconds_text(player.position)} s{late}")


def playback_of(log: IndexedLog, parameters: Mapping[str, Value]) -> Playback:
    """Return the playback of a log that parameters ask for, or raise InputError."""
    offset, duration, until, position = (
        parameters[f"play.{name}"]
        for name in ("start_offset", "playback_duration", "playback_until_timestamp", "position")
    )
    made = [name for name in CLOCKS_MADE if parameters[name]]
    if parameters[STORED_CLOCK] and made:
        raise InputError(
            f"parameter '{STORED_CLOCK}' is true, and '{made[0]}' asks for another /clock; set one of them"
        )
    if made and log.end >= LATEST_CLOCK:
        raise InputError(f"parameter '{made[0]}': {log.path} has times that do not fit into a message on /clock")
    length = (log.end - log.start) / NANOSECONDS
    if offset > length:
        raise InputError(f"parameter 'play.start_offset' is {offset:g}; {log.path} takes {length:.9g} s")
    begin = log.start + nanoseconds(offset)
    ends = [log.end] if duration < 0.0 and until < 0.0 else []
    if duration >= 0.0:
        ends.append(begin + nanoseconds(min(duration, length)))
    if until >= 0.0:
        ends.append(nanoseconds(min(until, log.end / NANOSECONDS)))
    end = min(max(ends), log.end)
    if end < begin:
        span = f"{seconds_text(begin)} to {seconds_text(log.end)} s"
        raise InputError(f"parameter 'play.playback_until_timestamp' is {until:.9g}; {log.path} is played from {span}")
    first = log.start + nanoseconds(position) if position else begin
    if not log.start <= first <= end:
        span = f"0 to {seconds_text(end - log.start)} s from its first message on"
        raise InputError(f"parameter '{POSITION}' is {position:.9g}; {log.path} is played from {span}")
    return Playback(
        begin=begin,
        end=end,
        first=first,
        rate=parameters[RATE],
        loop=parameters["play.loop"],
        paused=parameters["play.start_paused"],
        clock_rate=parameters[CLOCKS_MADE[0]],
        clock_on_publish=parameters[CLOCKS_MADE[1]],
        stored_clock=parameters[STORED_CLOCK],
    )


def trigger_services(player: Player) -> list[Service]:
    """Return the services whose requests say nothing, and whose answers are a success and a text."""

    def say_whether_paused(response: Trigger.Response, future: Future) -> None:
        try:
            response.success, response.message = future.result()
        except BilayerError as error:
            response.success, response.message = False, str(error)

    return [
        trigger("pause", player.pause),
        trigger("resume", player.resume),
        trigger("toggle_paused", player.toggle_paused),
        Service("is_paused", Trigger, lambda _: player.is_paused(), say_whether_paused),
        trigger("play_next", player.play_next),
        trigger("stop", player.end),
    ]

"""The services of rosbag2's player, with its types and names."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.type_support import check_is_valid_srv_type

from bilayer_core.errors import BilayerError, InputError
from bilayer_core.log.messages.cdr import NANOSECONDS
from bilayer_sim_ros.replay.player import Player
from bilayer_sim_ros.services.requests import answered
from bilayer_sim_ros.services.trigger_services import Service


def rosbag2_services(node: Node, player: Player) -> list[Service]:
    """Return all services of rosbag2's player. Raises InputError if their types are not installed."""
    try:
        from rosbag2_interfaces import srv

        check_is_valid_srv_type(srv.IsPaused)  # loads the libraries of the package
    except Exception as error:  # of several kinds: the package, or what its libraries need, is missing
        raise InputError(
            f"parameter 'services' is 'rosbag2', but its types cannot be imported ({error}): install the package "
            "rosbag2_interfaces of your ROS 2 distribution, which has no wheel, or take 'std_srvs'"
        ) from error

    def play(_: Any) -> Future:
        # As rosbag2's player answers while it is in playback, which this one is as long as it lives.
        node.get_logger().warning("~/play: dismissed, as the log is being played; ~/seek goes to another time")
        return answered(False)

    def seek(time: Time) -> Future:
        return player.seek(time.sec * NANOSECONDS + time.nanosec)

    def answer(write: Callable[[Any, Any], None], refused: Any = None) -> Callable[[Any, Future], None]:
        """Return a function that writes a result into a response, or `refused`, with the reason in a warning."""

        def fill(response: Any, future: Future) -> None:
            try:
                write(response, future.result())
            except BilayerError as error:
                node.get_logger().warning(f"refused: {error}")
                write(response, refused)

        return fill

    nothing = answer(lambda response, result: None)
    success = answer(lambda response, result: setattr(response, "success", result not in (None, False)))
    paused = answer(lambda response, result: setattr(response, "paused", result[0]), (True, ""))
    rate = answer(lambda response, result: setattr(response, "rate", result))
    burst = answer(lambda response, result: setattr(response, "actually_burst", result), 0)
    return [
        Service("pause", srv.Pause, lambda _: player.pause(), nothing),
        Service("resume", srv.Resume, lambda _: player.resume(), nothing),
        Service("toggle_paused", srv.TogglePaused, lambda _: player.toggle_paused(), nothing),
        Service("is_paused", srv.IsPaused, lambda _: player.is_paused(), paused),
        Service("get_rate", srv.GetRate, lambda _: answered(player.rate), rate),
        Service("set_rate", srv.SetRate, lambda request: player.set_rate(request.rate), success),
        Service("play", srv.Play, play, success),
        Service("play_next", srv.PlayNext, lambda _: player.play_next(), success),
        Service("burst", srv.Burst, lambda request: player.burst(request.num_messages), burst),
        Service("seek", srv.Seek, lambda request: seek(request.time), success),
        Service("stop", srv.Stop, lambda _: player.end(), nothing),
    ]

"""Poses of bodies and factors of loads from topics: the latest of each waits for the next step."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from geometry_msgs.msg import Pose, PoseStamped

from bilayer_core.errors import InputError
from bilayer_core.simulation.simulator import Simulator

FRAMES = ("", "world")
"""Frames in which a pose may be given."""


class Commands:
    """Collects what messages ask for (any thread) until the next step begins (the stepping thread).

    Parameters
    ----------
    refuse : callable
        Called with the reason when something cannot be done, in the stepping thread.
    """

    def __init__(self, refuse: Callable[[str], None]):
        self._refuse = refuse
        self._lock = threading.Lock()
        self._waiting: dict[tuple[str, str], Callable[[Simulator], None]] = {}

    def reset(self) -> None:
        """Forget what waits, as at the start of a run."""
        with self._lock:
            self._waiting = {}

    def ask_pose(self, body: str, message: PoseStamped) -> None:
        """Have a body go to a pose; InputError if its frame is not that of the world."""
        if message.header.frame_id not in FRAMES:
            frame = message.header.frame_id
            raise InputError(f"pose of body {body!r}: frame {frame!r} is not allowed; it must be 'world'")
        position, quaternion = position_and_quaternion(message.pose)
        self._keep(("pose", body), lambda simulator: simulator.set_pose(body, position, quaternion))

    def ask_load(self, name: str, factor: float) -> None:
        """Have a load act with a factor."""
        self._keep(("load", name), lambda simulator: simulator.set_load(name, factor))

    def _keep(self, key: tuple[str, str], action: Callable[[Simulator], None]) -> None:
        with self._lock:
            self._waiting[key] = action

    def apply(self, simulator: Simulator) -> None:
        """Have what waits act from the next step on."""
        if not self._waiting:
            return
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        for action in waiting.values():
            try:
                action(simulator)
            except InputError as error:
                self._refuse(str(error))


def position_and_quaternion(pose: Pose) -> tuple[Sequence[float], Sequence[float]]:
    """Position [m] and orientation x y z w of a message."""
    at, turned = pose.position, pose.orientation
    return (at.x, at.y, at.z), (turned.x, turned.y, turned.z, turned.w)

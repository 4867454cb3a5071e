"""Poses of bodies, factors of loads and other changes from outside: the latest of each waits for the next tick."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import TypedDict

from geometry_msgs.msg import Pose, PoseStamped

from bilayer_core.errors import InputError
from bilayer_core.printable import shortened
from bilayer_core.simulation.simulator import Simulator

FRAMES = ("", "world")
"""Frames in which a pose may be given."""
POSE = "pose"


class Ramp(TypedDict, total=False):
    """How a stimulus or a load gets to its value; see `Simulator.set_stimulus`. Empty: it jumps."""

    over: float
    shape: str


class Commands:
    """Collects what messages ask for (any thread) until a tick begins (the stepping thread).

    `refuse`: called with the reason when something cannot be done, in the stepping thread.
    """

    def __init__(self, refuse: Callable[[str], None]):
        self._refuse = refuse
        self._lock = threading.Lock()
        self._waiting: dict[tuple[str, str], Callable[[Simulator, Ramp], None]] = {}
        self.forgotten: Callable[[], None] = lambda: None  # Called by `reset`, in the stepping thread
        self._first: dict[tuple[str, str], Callable[[Simulator, Ramp], None]] = {}
        self._begun = False

    def reset(self, keep_first: bool = False) -> None:
        """Forget what waits, as at the start of a run, but poses that acted at its start if they are to again."""
        with self._lock:
            self._waiting = self._first | self._waiting if keep_first else {}
        self._first, self._begun = {}, False
        self.forgotten()

    def pose(self, body: str, message: PoseStamped) -> Callable[[], None]:
        """Return a function that asks for a body to go to a pose; raise InputError if its frame is not the world's."""
        if message.header.frame_id not in FRAMES:
            frame = shortened(message.header.frame_id)
            raise InputError(f"pose of body {body!r}: frame {frame!r} is not allowed; it must be 'world'")
        position, quaternion = position_and_quaternion(message.pose)
        return lambda: self.ask((POSE, body), lambda simulator, _: simulator.set_pose(body, position, quaternion))

    def ask_load(self, name: str, factor: float) -> None:
        """Let a load act with a factor."""
        self.ask(("load", name), lambda simulator, ramp: simulator.set_load(name, factor, **ramp))

    def ask(self, key: tuple[str, str], action: Callable[[Simulator, Ramp], None]) -> None:
        """Ask for something to be done at the next tick, instead of what waits under the same key."""
        with self._lock:
            self._waiting[key] = action

    def apply(self, simulator: Simulator, ramp: Ramp) -> bool:
        """Let what waits act from now on, loads by a ramp; poses have limits of their own.

        Returns whether anything did.
        """
        if self._begun and not self._waiting:
            return False
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        if not self._begun:
            self._begun, self._first = True, {key: action for key, action in waiting.items() if key[0] == POSE}
        for key in sorted(waiting):  # whichever came first
            try:
                waiting[key](simulator, ramp)
            except InputError as error:
                self._refuse(str(error))
        return bool(waiting)


def position_and_quaternion(pose: Pose) -> tuple[Sequence[float], Sequence[float]]:
    """Return the position [m] and orientation x y z w of a message."""
    at, turned = pose.position, pose.orientation
    return (at.x, at.y, at.z), (turned.x, turned.y, turned.z, turned.w)

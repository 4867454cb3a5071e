"""Bodies and rods as entities that have a pose and velocities."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3

from bilayer_core.log.messages.node_frames import NodeFrames
from bilayer_core.observed.frame import Description
from bilayer_core.simulation.simulator import Simulator
from bilayer_sim_ros.publishing.conversions import to_time

FRAME = "world"
UNKNOWN = (math.nan,) * 3
"""Of velocities and accelerations that are not computed."""


@dataclass(frozen=True)
class EntityState:
    """State of an entity at a time [s], in the world's frame."""

    time: float
    position: tuple[float, ...]
    quaternion: tuple[float, ...]  # Orientation x y z w
    velocity: tuple[float, ...]
    angular_velocity: tuple[float, ...]
    """`position`, `velocity`, `angular_velocity`: [m], [m/s], [rad/s]; NaN for what is not known."""


class Entities:
    """Bodies, and rods: the pose of a rod is that of its first node, with the material frame there.

    A rod that has the name of a body is called ``rods/<name>``.
    """

    def __init__(self, description: Description):
        self._nodes = NodeFrames(description)
        self._bodies = {body.name: index for index, body in enumerate(description.bodies)}
        self._first_nodes: dict[str, int] = {}
        for strand in description.strands:
            name = f"rods/{strand.rod}" if strand.rod in self._bodies else strand.rod
            self._first_nodes.setdefault(name, strand.nodes.start)
        self.names = [*self._bodies, *self._first_nodes]

    def states(self, simulator: Simulator, names: Iterable[str]) -> list[tuple[str, EntityState]]:
        """Return the states by name."""
        frame = simulator.frame()
        self._nodes.update(frame)
        found = []
        for name in names:
            if name in self._bodies:
                i = self._bodies[name]
                parts = frame.body_positions, frame.body_quaternions, frame.body_velocities
                values = *(part[i] for part in parts), frame.body_angular_velocities[i]
            else:
                node = self._first_nodes[name]
                slot = int(np.flatnonzero(np.asarray(self._nodes.order) == node)[0])
                values = frame.positions[node], self._nodes.quaternions[slot], frame.velocities[node], UNKNOWN
            found.append((name, EntityState(frame.time, *(tuple(map(float, value)) for value in values))))
        return found

    @staticmethod
    def to_message(state: EntityState) -> Any:
        """Return a state as a `simulation_interfaces/msg/EntityState`."""
        from simulation_interfaces.msg import EntityState as Message

        message = Message()
        message.header.frame_id, message.header.stamp = FRAME, to_time(state.time)
        message.pose.position = _point(state.position)
        x, y, z, w = state.quaternion
        message.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
        message.twist.linear, message.twist.angular = _vector(state.velocity), _vector(state.angular_velocity)
        message.acceleration.linear, message.acceleration.angular = _vector(UNKNOWN), _vector(UNKNOWN)
        return message


def _point(values: tuple[float, ...]) -> Point:
    x, y, z = values
    return Point(x=x, y=y, z=z)


def _vector(values: tuple[float, ...]) -> Vector3:
    x, y, z = values
    return Vector3(x=x, y=y, z=z)

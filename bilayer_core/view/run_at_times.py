"""A run at any time: shapes and poses between those that were recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.log.messages.node_frames import layer_rows
from bilayer_core.log.run.run_data import RunData
from bilayer_core.view.geometry import rotated, shape_extent

BESIDE = 1.5
"""Farthest that a free body is from the middle of the robot to be looked at with it, in sizes of the robot."""


@dataclass(frozen=True)
class Moment:
    """A run at one time."""

    time: float  # [s]
    positions: np.ndarray
    contact_forces: np.ndarray
    """`positions`, `contact_forces`: of every node [m, N], shape (node_count, 3)."""
    material_frames: np.ndarray  # Quaternions at the nodes of strands, shape (strand nodes, 4)
    values: tuple[np.ndarray, ...]  # What colours each layer, shape (its nodes,)
    body_positions: np.ndarray
    body_quaternions: np.ndarray
    clamp_wrenches: np.ndarray
    """`body_positions`, `body_quaternions`, `clamp_wrenches`: [m], x y z w, [N, N m], shapes (bodies, 3 | 4 | 6)."""


class Moments:
    """A run that can be looked at between its frames, on straight lines from one to the next.

    Shapes and bodies are recorded at rates of their own; so both are of exactly the time that is asked for. `values`:
    what colours each of the description's layers, shape (shapes, its nodes).
    """

    def __init__(self, run: RunData, values: list[np.ndarray]):
        self._run, self._values = run, values
        self._bodies = len(run.description.bodies)
        self.rows = layer_rows(run.description)

    def at(self, time: float) -> Moment:
        """Return the run at a time [s] within it."""
        run = self._run
        shape, frame = _between(run.shape_times, time), _between(run.times, time)
        return Moment(
            time,
            _line(run.positions, *shape),
            _line(run.contact_forces, *shape),
            _turned(run.material_frames, *shape),
            tuple(_line(values, *shape) for values in self._values),
            _line(run.body_positions, *frame),
            _turned(run.body_quaternions, *frame),
            _line(run.clamp_wrenches, *frame),
        )

    def robot_points(self, moment: Moment, metres_per_newton: float) -> np.ndarray:
        """Return the points of the rods, of the bodies that hold them and of the bodies beside them, and the tips of
        arrows that are no longer than the robot [m], shape (points, 3).
        """
        points = [self._rod_points(moment)]
        middle, size = points[0].mean(axis=0), float(np.ptp(points[0], axis=0).max())
        arrows = metres_per_newton * moment.contact_forces
        seen = (np.linalg.norm(arrows, axis=1) < size) & (np.linalg.norm(moment.positions - middle, axis=1) < size)
        points.append((moment.positions + arrows)[seen])
        for index, body in enumerate(self._run.description.bodies):
            beside = np.linalg.norm(moment.body_positions[index] - middle) <= BESIDE * size
            if body.holds_rods or beside:
                points.append(self._body_points(moment, index))
        return np.concatenate(points)

    def all_points(self, moment: Moment, metres_per_newton: float) -> np.ndarray:
        """Return the points of the rods, of all bodies and obstacles, and the tips of arrows of contact too."""
        points = [self._rod_points(moment), moment.positions + metres_per_newton * moment.contact_forces]
        points += [self._body_points(moment, index) for index in range(self._bodies)]
        points += [shape_extent(o.shape) for o in self._run.description.obstacles if o.shape.kind != "plane"]
        return np.concatenate(points)

    def _rod_points(self, moment: Moment) -> np.ndarray:
        points = []
        for layer, rows in zip(self._run.description.layers, self.rows, strict=True):
            across = 0.5 * layer.width[:, None] * rotated(moment.material_frames[rows], 1)
            points += [moment.positions[layer.nodes] + across, moment.positions[layer.nodes] - across]
        return np.concatenate(points)

    def _body_points(self, moment: Moment, index: int) -> np.ndarray:
        shape = self._run.description.bodies[index].shape
        position, quaternion = moment.body_positions[index], moment.body_quaternions[index]
        if shape is None or shape.kind == "plane":
            return position[None]
        axes = np.stack([rotated(quaternion, axis) for axis in range(3)])
        return position + shape_extent(shape) @ axes


def _between(times: np.ndarray, time: float) -> tuple[int, int, float]:
    """Return the frames before and after a time, and how far it is from one to the other."""
    after = int(np.clip(np.searchsorted(times, time), 1, len(times) - 1)) if len(times) > 1 else 0
    before = max(after - 1, 0)
    length = times[after] - times[before]
    return before, after, float(np.clip((time - times[before]) / length, 0.0, 1.0)) if length > 0.0 else 0.0


def _line(of: np.ndarray, before: int, after: int, part: float) -> np.ndarray:
    return (1.0 - part) * of[before] + part * of[after] if part else of[before].astype(float)


def _turned(of: np.ndarray, before: int, after: int, part: float) -> np.ndarray:
    """Return unit quaternions between two, along the shorter way round."""
    first, last = of[before].astype(float), of[after].astype(float)
    last = np.where((first * last).sum(axis=-1, keepdims=True) < 0.0, -last, last)
    mixed = (1.0 - part) * first + part * last
    return mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)

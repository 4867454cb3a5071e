"""What acts from outside until the next corner or jump, evaluated by loops whose steps find their own lengths."""

from __future__ import annotations

import math

from ..jit import kernel, piece
from ..jit.record import Indices, Matrix, Stack, Vector, record
from ..kinematics.turning import spin_of, turn_by
from ..model.records.status import READY
from ..model.records.step import Course


@record
class Paths:
    """Prescribed bodies that move, each between two of its keyframes; see `model.model.between_keyframes`."""

    body: Indices  # shape (n_moving,)
    begin: Vector  # time of the keyframe before [s]
    duration: Vector  # until that after it [s]
    displacement: Matrix  # at the keyframe before [m], shape (n_moving, 3)
    way: Matrix  # to the next [m]
    turn: Matrix  # rotation vector at the keyframe before [rad], shape (n_moving, 3)
    turn_way: Matrix  # to the next [rad]
    position: Matrix  # of all bodies at time 0 [m], shape (n_body, 3)
    rotation: Stack  # shape (n_body, 3, 3)


@record
class Acting:
    """Pieces of schedules (`scene.piece.Piece`), a row of `PARTS` each, and of paths."""

    stimulus: Matrix  # shape (n_channel, len(PARTS))
    load: Matrix  # shape (n_load, len(PARTS))
    paths: Paths


PARTS = ("level", "begin", "rate", "amplitude", "frequency", "phase")
LEVEL, BEGIN, RATE, AMPLITUDE, FREQUENCY, PHASE = range(len(PARTS))


@kernel
def _value(pieces, row, time):
    """`Piece.value`"""
    s = max(time - pieces[row, BEGIN], 0.0)
    value = pieces[row, LEVEL] + pieces[row, RATE] * s
    if pieces[row, AMPLITUDE] != 0.0:
        value += pieces[row, AMPLITUDE] * math.sin(pieces[row, FREQUENCY] * s + pieces[row, PHASE])
    return value


@kernel
def look_back(acting, begin, course):
    """What acts at the start of a step."""
    for c in range(acting.stimulus.shape[0]):
        course.first[0, c] = _value(acting.stimulus, c, begin)


@piece(int, Acting, Vector, float, float, Course)
def drive_step(acting, nodes, begin, h, course):
    """What acts at the stages of a step of length `h` [s] that begins at `begin` [s], as the course of one step."""
    for n in range(nodes.shape[0]):
        course.elapsed[n] = nodes[n] * h
        time = begin + nodes[n] * h
        for c in range(acting.stimulus.shape[0]):
            course.stimulus[0, n, c] = _value(acting.stimulus, c, time)
        for i in range(acting.load.shape[0]):
            course.load_factor[0, n, i] = _value(acting.load, i, time)
        _place(acting.paths, time, course.position[0, n], course.rotation[0, n], course.rates[0, n])
    return READY


@kernel
def _place(paths, time, position, rotation, rates):
    """Put bodies where their paths lead."""
    if not paths.exists:
        return
    for k in range(paths.body.shape[0]):
        b = paths.body[k]
        s = (time - paths.begin[k]) / paths.duration[k]
        part, rate = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / paths.duration[k]
        for c in range(3):
            position[b, c] = paths.position[b, c] + paths.displacement[k, c] + part * paths.way[k, c]
            rates[b, c] = rate * paths.way[k, c]
        v0 = paths.turn[k, 0] + part * paths.turn_way[k, 0]
        v1 = paths.turn[k, 1] + part * paths.turn_way[k, 1]
        v2 = paths.turn[k, 2] + part * paths.turn_way[k, 2]
        turn_by(v0, v1, v2, paths.rotation, b, rotation, b)
        u0, u1, u2 = rate * paths.turn_way[k, 0], rate * paths.turn_way[k, 1], rate * paths.turn_way[k, 2]
        rates[b, 3], rates[b, 4], rates[b, 5] = spin_of(v0, v1, v2, u0, u1, u2)

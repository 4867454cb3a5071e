"""Differences of how elements face their lights, and of what hides them, for derivatives of runs; see `contact.light`.

What hides an element is a sum over edges and surfaces. So each of them that hides some of it is moved by itself, and
the element against all of them.
"""

from __future__ import annotations

import math

from bilayer_core.contact.light import covered, covered_by_edge, covered_by_shape, face_of
from bilayer_core.engine.linear.krylov_solution import gather
from bilayer_core.engine.linear.lacking_matrix import unknown_of_edge
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Matrix, Stack
from bilayer_core.kinematics.copying import copy_matrix
from bilayer_core.kinematics.rotating import rotate_by
from bilayer_core.kinematics.vector import combine, cross, dot, row, scaled
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration


@record
class LightSlopes:
    """Derivatives of how elements face their lights, then of what part of these nothing hides, and scratch."""

    by_place: Matrix  # shape (2 n_lit, size)
    rotation: Stack  # of a body, shape (1, 3, 3)


@kernel
def _put(array, k, v):
    array[k, 0], array[k, 1], array[k, 2] = v[0], v[1], v[2]


@kernel
def _move_edge(light, e, n, step):
    """Move one of the seven unknowns of an edge, whose frame turns no more than it must."""
    t, m1 = row(light.tangent, e), row(light.director1, e)
    if n == 6:
        _put(light.director1, e, combine(math.cos(step), m1, math.sin(step), cross(t, m1)))
        return
    i = light.edge_node[e]
    light.node_position[i + n // 3, n % 3] += step
    vector = combine(1.0, row(light.node_position, i + 1), -1.0, row(light.node_position, i))
    light.length[e] = math.sqrt(dot(vector, vector))
    moved = scaled(1.0 / light.length[e], vector)
    _put(light.tangent, e, moved)
    _put(light.director1, e, combine(1.0, m1, -dot(m1, moved) / (1.0 + dot(t, moved)), combine(1.0, t, 1.0, moved)))


@kernel
def _edge(light, e):
    """Return all that `_move_edge` changes."""
    i = light.edge_node[e]
    ends = row(light.node_position, i), row(light.node_position, i + 1)
    return ends[0], ends[1], row(light.tangent, e), row(light.director1, e), light.length[e]


@kernel
def _put_edge(light, e, kept):
    """Put it back."""
    i = light.edge_node[e]
    _put(light.node_position, i, kept[0])
    _put(light.node_position, i + 1, kept[1])
    _put(light.tangent, e, kept[2])
    _put(light.director1, e, kept[3])
    light.length[e] = kept[4]


@kernel
def _by_body(p, out, k, s, f, x, toward, h, angle):
    """Write what hides element k by motions of the free body f, whose surface s does."""
    light, b, first = p.light, p.light.body[s], p.sums.gradient.shape[0] + 6 * f
    soft, found = light.softness[light.edge[k]], out.by_place[light.edge.shape[0] + k]
    for c in range(3):
        own = light.body_position[b, c]
        for side in range(-1, 2, 2):
            light.body_position[b, c] = own + side * h
            found[first + c] -= side / (2.0 * h) * covered_by_shape(light, s, x, toward, soft)
        light.body_position[b, c] = own
        copy_matrix(light.body_rotation, b, out.rotation, 0)
        for side in range(-1, 2, 2):
            turn = side * angle
            about = turn if c == 0 else 0.0, turn if c == 1 else 0.0, turn if c == 2 else 0.0
            rotate_by(about[0], about[1], about[2], out.rotation, 0, light.body_rotation, b)
            found[first + 3 + c] -= side / (2.0 * angle) * covered_by_shape(light, s, x, toward, soft)
        copy_matrix(out.rotation, 0, light.body_rotation, b)


@piece(int, Problem, Configuration, LightSlopes, float, float)
def differentiate_light(p, at, out, h, angle):
    """Write how elements face their lights, and what nothing hides of these, by all unknowns, at a configuration that
    was looked at last; places move by h, turns by an angle.
    """
    light, strands, by_place, lit = p.light, p.strands, out.by_place, p.light.edge.shape[0]
    by_place[:] = 0.0
    for k in range(lit):
        e, toward, x = light.edge[k], row(light.direction, light.source[k]), face_of(light, k, light.facing[k, 1])
        hides, soft = light.casts[light.source[k]] and light.visible[k, 1] > 0.0, light.softness[e]
        s0, s1, s2 = 0.0, 0.0, 0.0  # by the face of the element
        for side in range(-1, 2, 2) if hides else range(0):
            factor = -side / (2.0 * h)
            s0 += factor * covered(light, e, (x[0] + side * h, x[1], x[2]), toward)
            s1 += factor * covered(light, e, (x[0], x[1] + side * h, x[2]), toward)
            s2 += factor * covered(light, e, (x[0], x[1], x[2] + side * h), toward)
        kept = _edge(light, e)
        for n in range(7):
            step, column = angle if n == 6 else h, unknown_of_edge(strands, e, n)
            for side in range(-1, 2, 2):
                _move_edge(light, e, n, side * step)
                y, factor = face_of(light, k, light.facing[k, 1]), side / (2.0 * step)
                by_place[k, column] += factor * dot(row(light.director1, e), toward)
                by_place[lit + k, column] += factor * (s0 * (y[0] - x[0]) + s1 * (y[1] - x[1]) + s2 * (y[2] - x[2]))
                _put_edge(light, e, kept)
        if not hides:
            continue
        for j in range(light.blocker.shape[0]):
            other = light.blocker[j]
            if light.section[other] == light.section[e] or covered_by_edge(light, other, x, toward, soft) == 0.0:
                continue
            kept = _edge(light, other)
            for n in range(7):
                step, column = angle if n == 6 else h, unknown_of_edge(strands, other, n)
                for side in range(-1, 2, 2):
                    _move_edge(light, other, n, side * step)
                    hidden = covered_by_edge(light, other, x, toward, soft)
                    by_place[lit + k, column] -= side / (2.0 * step) * hidden
                    _put_edge(light, other, kept)
        for s in range(light.kind.shape[0]):
            f = p.bodies.free_index[light.body[s]]
            if f >= 0 and covered_by_shape(light, s, x, toward, soft) != 0.0:
                _by_body(p, out, k, s, f, x, toward, h, angle)
    for k in range(2 * lit):
        gather(p, at, by_place[k])
    return READY

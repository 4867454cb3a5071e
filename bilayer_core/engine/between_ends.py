"""States between the two ends of a step; `simulation.step_span` has the formulas, and what they are for."""

from __future__ import annotations

import math

from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Matrix, Stack, Vector
from bilayer_core.kinematics.rotating import quaternion_of, rotate_by, rotation_vector_between, spin_of
from bilayer_core.kinematics.vector import combine, combine3, cross, dot, row
from bilayer_core.model.records.parts import Bodies, Strands


@record
class Instant:
    """A state as it is seen: nodes, edges, bodies and the forces of contact."""

    position: Matrix
    velocity: Matrix
    director1: Matrix
    spin: Vector
    body_position: Matrix
    body_rotation: Stack
    body_velocity: Matrix
    body_angular_velocity: Matrix
    contact_force: Matrix
    contact_wrench: Matrix
    quaternion: Matrix


@record
class Between:
    """Where in a step a state lies."""

    part: float  # of the step that has passed
    length: float  # of the step [s]
    free: float  # by which what touches may depart from its chord [m]


@kernel
def _departure(s, first, last):
    """Return the factors of h v₀ − D and h v₁ − D in the departure of a cubic from its chord, or in its derivative."""
    return s * (1.0 - s) ** 2 * first - s**2 * (1.0 - s) * last


@kernel
def _kept(distance, free):
    """Return the part of a distance that keeps it below `free` [m]."""
    return min(1.0, free / distance) if distance > 0.0 else 1.0


@kernel
def _touches(first, last, i):
    """Return whether a row has forces at either end."""
    found = False
    for c in range(first.shape[1]):
        found |= first[i, c] != 0.0 or last[i, c] != 0.0
    return found


@kernel
def _tangent(position, a):
    """Return the unit tangent of the edge from node a to the next."""
    edge = combine(1.0, row(position, a + 1), -1.0, row(position, a))
    inverse = 1.0 / math.sqrt(dot(edge, edge))
    return edge[0] * inverse, edge[1] * inverse, edge[2] * inverse


@kernel
def _carried(director, tangent, to):
    """Return a director carried in parallel from one tangent to another."""
    part = dot(director, to) / (1.0 + dot(tangent, to))
    return combine3(1.0, director, -part, tangent, -part, to)


@kernel
def _move(before, rate_before, after, rate_after, i, of, free, radius, twist, out, rate_out):
    """Write the place and the velocity of a node or body; return the part of its departure from the chord that is
    kept, where a departure of its turn by `twist` moves its surface as well.
    """
    s, h, size = of.part, of.length, 0.0
    slope, other = (1.0 - s) * (1.0 - 3.0 * s), s * (2.0 - 3.0 * s)
    for c in range(3):
        chord = after[i, c] - before[i, c]
        first, last = h * rate_before[i, c] - chord, h * rate_after[i, c] - chord
        out[i, c] = _departure(s, first, last)
        rate_out[i, c] = slope * first - other * last
        size += out[i, c] ** 2
    part = _kept(math.sqrt(size) + radius * twist, free)
    for c in range(3):
        chord = after[i, c] - before[i, c]
        out[i, c] = before[i, c] + s * chord + part * out[i, c]
        rate_out[i, c] = (chord + part * rate_out[i, c]) / h
    return part


@piece(int, Strands, Bodies, Instant, Instant, Instant, Between)
def write_between(strands, bodies, first, last, out, of):
    """Write the state in a step, from those at its ends.

    Parameters
    ----------
    strands : Strands
    bodies : Bodies
    first, last, out : Instant
        Of `out`, forces stay as they are.
    of : Between
    """
    s, h = of.part, of.length
    for i in range(first.position.shape[0]):
        free = of.free if _touches(first.contact_force, last.contact_force, i) else math.inf
        ends = first.position, first.velocity, last.position, last.velocity
        _move(*ends, i, of, free, 0.0, 0.0, out.position, out.velocity)
    for e in range(first.director1.shape[0]):
        a = strands.edge_node[e]
        before, now, after = _tangent(first.position, a), _tangent(out.position, a), _tangent(last.position, a)
        director, end = row(first.director1, e), row(last.director1, e)
        carried = _carried(director, before, after)
        turn = math.atan2(dot(cross(carried, end), after), dot(carried, end))
        turn = s * turn + _departure(s, h * first.spin[e] - turn, h * last.spin[e] - turn)
        carried = _carried(director, before, now)
        out.director1[e, 0], out.director1[e, 1], out.director1[e, 2] = combine(
            math.cos(turn), carried, math.sin(turn), cross(now, carried)
        )
    slope, other = (1.0 - s) * (1.0 - 3.0 * s), s * (2.0 - 3.0 * s)
    for b in range(first.body_position.shape[0]):
        turn = rotation_vector_between(first.body_rotation, b, last.body_rotation, b)
        begin, spin = row(first.body_angular_velocity, b), row(last.body_angular_velocity, b)
        across = cross(turn, spin)  # the rate of the rotation vector, up to the fourth power of that
        spin = combine3(1.0, spin, -0.5, across, 1.0 / 12.0, cross(turn, across))
        begin, spin = combine(h, begin, -1.0, turn), combine(h, spin, -1.0, turn)
        twist = combine(s * (1.0 - s) ** 2, begin, -(s**2) * (1.0 - s), spin)
        free = of.free if _touches(first.contact_wrench, last.contact_wrench, b) else math.inf
        ends = first.body_position, first.body_velocity, last.body_position, last.body_velocity
        surface = bodies.bounding_radius[b], math.sqrt(dot(twist, twist))
        part = _move(*ends, b, of, free, *surface, out.body_position, out.body_velocity)
        v0, v1, v2 = combine(s, turn, part, twist)
        u0, u1, u2 = combine3(1.0 / h, turn, part * slope / h, begin, -part * other / h, spin)
        rotate_by(v0, v1, v2, first.body_rotation, b, out.body_rotation, b)
        w0, w1, w2 = spin_of(v0, v1, v2, u0, u1, u2)
        out.body_angular_velocity[b, 0], out.body_angular_velocity[b, 1], out.body_angular_velocity[b, 2] = w0, w1, w2
        m = out.body_rotation[b]
        (x, y, z), (u, v, w), (p, q, r) = row(m, 0), row(m, 1), row(m, 2)
        q0, q1, q2, q3 = quaternion_of(x, y, z, u, v, w, p, q, r)
        sign = 1.0 if q3 >= 0.0 else -1.0
        out.quaternion[b, 0], out.quaternion[b, 1] = sign * q0, sign * q1
        out.quaternion[b, 2], out.quaternion[b, 3] = sign * q2, sign * q3
    return 0

"""How the gradient where a stage has ended depends on what Newton's method holds fixed, and on the origin of the stage.

In Newton's method forces that follow hold fixed what they took from the configuration, and the Hessian knows nothing of
that. A stage ends where what they took is that of the end. So its matrix lacks ∂g/∂z ∂z/∂q, with z what they take.

A frame turns by dω about its tangent beyond what parallel transport does. The turn a of an edge since the start of the
step is counted along the way start → first guess → end, whose transport depends on where tangents are:

    da = da₀ + dω − dω₀ + Σ ½ κb·(dt₁ + dt₂),    κb = 2 t₁ × t₂/(1 + t₁·t₂) of each part of the way

Forces by turns since the origin of a stage depend on them as on that at the origin, but for the sign.
"""

from __future__ import annotations

import math

from bilayer_core.engine.linear.lacking_matrix import LackingMatrix, add_entry, clear, unknown_of_edge
from bilayer_core.engine.potential import add_forces
from bilayer_core.forces.body_drag import BodyFlow
from bilayer_core.forces.raised import director_motion
from bilayer_core.forces.turning_drag import TurningFlow
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.called import stack_matrix
from bilayer_core.jit.record import Flags, Indices, Stack, Vector
from bilayer_core.kinematics.vector import combine, cross, dot, row, scaled
from bilayer_core.model.records.parts import Flow
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage


@record
class StageMaps:
    """Derivatives of the gradient where a stage has ended: forces on all nodes, those among them that bodies hold."""

    lacking: LackingMatrix  # by motions of all nodes, what the Hessian lacks
    by_origin: LackingMatrix  # by the origin of the stage, but for what inertia, damping and viscosity have
    by_turn: Vector  # moments of edges by their turns, beyond what `by_origin` has with another sign, shape (n_edge,)
    slides: LackingMatrix  # by turns of R̃ and by ω̃ of free bodies, six columns each
    by_strain: LackingMatrix  # by strains at the origin, but for what viscosity has
    by_kept: LackingMatrix  # by what a step keeps for the next
    by_director: (
        Stack  # by drag, by directors of raised edges at the origin: of nodes and turns, shape (n_raised, 7, 3)
    )
    way: Stack  # of turns, by vectors at the start, at the first guess and at the end, shape (3, n_edge, 3)
    edge_of: Indices  # the edge that an unknown turns, or −1
    moving: Flags  # forces that see turns since the start of the stage


@piece(int, StageMaps)
def clear_maps(maps):
    """Make all maps zero."""
    clear(maps.lacking)
    clear(maps.by_origin)
    clear(maps.slides)
    clear(maps.by_strain)
    clear(maps.by_kept)
    maps.by_director[:] = 0.0
    return READY


@kernel
def _write_by_edge(at, before, after, e, c, v, out):
    """Write how drag changes as an edge beside its node moves, by its vector and its turn, with the factors c of
    directions and the speed v, shape (3, 4).
    """
    t_sum = combine(0.5, row(at.tangent, before), 0.5, row(at.tangent, after))
    size = math.sqrt(dot(t_sum, t_sum))
    t = scaled(1.0 / size, t_sum)
    m_sum = combine(0.5, row(at.director1, before), 0.5, row(at.director1, after))
    along = dot(m_sum, t)
    m_part = combine(1.0, m_sum, -along, t)
    least = math.sqrt(dot(m_part, m_part))
    m = scaled(1.0 / least, m_part)
    n = cross(t, m)
    vt, vm, vn = dot(v, t), dot(v, m), dot(v, n)
    at_, am, an = c[0] * abs(vt), c[1] * abs(vm), c[2] * abs(vn)
    share, te, m1, length = 1.0 if before == after else 0.5, row(at.tangent, e), row(at.director1, e), at.length[e]
    for w in range(4):
        if w == 3:
            of_t, of_m = (0.0, 0.0, 0.0), scaled(share, row(at.director2, e))
        else:
            unit = 1.0 if w == 0 else 0.0, 1.0 if w == 1 else 0.0, 1.0 if w == 2 else 0.0
            of_t = combine(share / (size * length), unit, -share / (size * length) * te[w], te)
            of_m = scaled(-share * m1[w] / length, te)
        of_t = combine(1.0, of_t, -dot(of_t, t), t)
        of_m = combine(1.0, combine(1.0, of_m, -dot(of_m, t) - dot(m_sum, of_t), t), -along, of_t)
        of_m = scaled(1.0 / least, combine(1.0, of_m, -dot(of_m, m), m))
        of_n = combine(1.0, cross(of_t, m), 1.0, cross(t, of_m))
        along_t, along_m, along_n = 2.0 * at_ * dot(v, of_t), 2.0 * am * dot(v, of_m), 2.0 * an * dot(v, of_n)
        for k in range(3):
            out[k, w] = along_t * t[k] + along_m * m[k] + along_n * n[k]
            out[k, w] += at_ * vt * of_t[k] + am * vm * of_m[k] + an * vn * of_n[k]


@kernel
def _add_pulled(p, at, i, r, middle, by, e, sign, matrix):
    """Add a force on a node, and `middle` of it on the director of raised edge r, by the vector and the turn of an
    edge, or by the place of the node where e is −1.
    """
    strands, k = p.strands, p.raised.edge[r] if r >= 0 else 0
    for n in range(3 if e < 0 else 7):
        w = 3 if n == 6 else n % 3
        column = strands.node_unknown[i] + n if e < 0 else unknown_of_edge(strands, e, n)
        way = -sign if e >= 0 and n < 3 else sign
        force = way * by[0, w], way * by[1, w], way * by[2, w]
        for c in range(3):
            add_entry(matrix, strands.node_unknown[i] + c, column, force[c])
        along, turn = 0.0, 0.0
        if r >= 0:
            along = middle * dot(force, row(at.tangent, k)) / at.length[k]
            turn = middle * dot(force, row(at.director2, k))
        for c in range(7 if r >= 0 else 0):
            value = turn if c == 6 else (along if c < 3 else -along) * at.director1[k, c % 3]
            add_entry(matrix, unknown_of_edge(strands, k, c), column, value)


@piece(int, Problem, Flow, StageMaps, Configuration, Stage)
def differentiate_drag(p, flow, maps, at, stage):
    """Add drag: by its directions, which are those of a configuration, and by positions and directors at the origin."""
    raised, h, u = p.raised, stage.length, flow.velocity
    by = stack_matrix(3, 4)
    for k in range(flow.node.shape[0]):
        i, r, before, after = flow.node[k], flow.raised[k], flow.edge_before[k], flow.edge_after[k]
        v = (
            (at.position[i, 0] - stage.origin_position[i, 0]) / h - u[0],
            (at.position[i, 1] - stage.origin_position[i, 1]) / h - u[1],
            (at.position[i, 2] - stage.origin_position[i, 2]) / h - u[2],
        )
        middle = raised.middle[r] if r >= 0 else 0.0
        if r >= 0:
            v = combine(1.0, v, middle / h, director_motion(raised, at, stage, r))
        c = 0.5 * flow.coefficient[k, 0], 0.5 * flow.coefficient[k, 1], 0.5 * flow.coefficient[k, 2]
        for side in range(3):
            e = before if side == 0 else after if side == 1 else -1
            if side == 1 and before == after:
                continue
            if side < 2:
                _write_by_edge(at, before, after, e, c, v, by)
            else:
                _write_by_origin(flow.direction, k, c, v, h, by)
                if r >= 0:
                    _add_by_director(p, at, i, r, middle, by, maps.by_director)
            _add_pulled(p, at, i, r, middle, by, e, 1.0, maps.lacking if side < 2 else maps.by_origin)
    return READY


@kernel
def _write_by_origin(direction, k, c, v, h, out):
    """Write how drag changes with the place of its node at the origin, shape (3, 3)."""
    for w in range(3):
        out[0, w] = out[1, w] = out[2, w] = 0.0
        for j in range(3):
            d = row(direction[k], j)
            part = -2.0 * c[j] * abs(dot(v, d)) * d[w] / h
            for i in range(3):
                out[i, w] += part * d[i]


@kernel
def _add_by_director(p, at, i, r, middle, by, out):
    """Add what the director of a raised edge at the origin does, by forces on a node of the edge."""
    k = p.raised.edge[r]
    first = 0 if i == p.strands.edge_node[k] else 3
    for w in range(3):
        force = by[0, w], by[1, w], by[2, w]
        along = middle * dot(force, row(at.tangent, k)) / at.length[k]
        for c in range(3):
            out[r, first + c, w] += middle * force[c]
            out[r, c, w] += middle * along * at.director1[k, c]
            out[r, 3 + c, w] -= middle * along * at.director1[k, c]
        out[r, 6, w] += middle * middle * dot(force, row(at.director2, k))


@piece(int, Problem, TurningFlow, BodyFlow, StageMaps, Configuration, Stage)
def differentiate_other_drag(p, turning, bodies, maps, at, stage):
    """Add the drag of edges that turn and of bodies, by the origin."""
    h, edges = stage.length, p.strands.edge_unknown
    for k in range(turning.coefficient.shape[0]):
        spin = (at.total_angle[k] - stage.origin_angle[k]) / h
        add_entry(maps.by_origin, edges[k], edges[k], -2.0 * turning.coefficient[k] * abs(spin) / h)
    for k in range(bodies.free.shape[0]):
        f, factor, u = bodies.free[k], -bodies.coefficient[k] / h, bodies.velocity
        first, v = p.sums.gradient.shape[0] + 6 * f, row(at.body_position, f)
        v = combine(1.0 / h, v, -1.0 / h, row(stage.origin_body_position, f))
        v = combine(1.0, v, -1.0, (u[0], u[1], u[2]))
        speed = math.sqrt(dot(v, v))
        for i in range(3):
            add_entry(maps.by_origin, first + i, first + i, factor * speed)
            for j in range(3 if speed > 0.0 else 0):
                add_entry(maps.by_origin, first + i, first + j, factor * v[i] * v[j] / speed)
    return READY


@kernel
def _write_way(first, second, e, of_first, of_second):
    """Add by what changes of the vector of an edge at both ends of a transport turn it, beyond what frames turn."""
    a, b = row(first.tangent, e), row(second.tangent, e)
    half = scaled(1.0 / (1.0 + dot(a, b)), cross(a, b))  # across both tangents
    for c in range(3):
        of_first[e, c] += half[c] / first.length[e]
        of_second[e, c] += half[c] / second.length[e]


@kernel
def _add_block(strands, e, u, around, by, turn, matrix):
    """Add a force on the vector of an edge: [u]× + `around` × `by` by changes of it, turn × `around` by turns."""
    a, k = strands.node_unknown[strands.edge_node[e]], strands.edge_unknown[e]
    b = strands.node_unknown[strands.edge_node[e] + 1]
    for c in range(3):
        for d in range(3):
            value = _skew(u, c, d) + around[c] * by[d]
            add_entry(matrix, a + c, a + d, -value)
            add_entry(matrix, a + c, b + d, value)
            add_entry(matrix, b + c, a + d, value)
            add_entry(matrix, b + c, b + d, -value)
        add_entry(matrix, a + c, k, turn * around[c])
        add_entry(matrix, b + c, k, -turn * around[c])


@kernel
def _skew(v, c, d):
    """Return an entry of the matrix [v]×."""
    if c == d:
        return 0.0
    return -v[3 - c - d] if (c + 1) % 3 == d else v[3 - c - d]


@kernel
def _add_turned(strands, row_, e, value, way, matrix):
    """Add what a force by the turn of an edge is by the vector at its end."""
    for n in range(6):
        add_entry(matrix, row_, unknown_of_edge(strands, e, n), (value if n >= 3 else -value) * way[e, n % 3])


@piece(int, Problem, StageMaps, Configuration, Configuration, Configuration, Stage, bool)
def differentiate_turns(p, maps, start, guess, at, stage, seen):
    """Add what the turns of edges, and their gyroscopic force, ask for, and write their ways; `seen` tells whether
    forces that follow see turns.
    """
    strands, fluid, sums, h, way = p.strands, p.fluid, p.sums, stage.length, maps.way
    for k in range(sums.selected.shape[0]):
        sums.selected[k] = maps.moving[k]
    add_forces(p, at, stage, False, False)
    for r in range(p.raised.edge.shape[0]):  # whose directors turn with frames
        k = p.raised.edge[r]
        sums.edge[k, 3] -= dot(row(sums.pull, r), row(at.director2, k))
    way[:] = 0.0
    for e in range(strands.edge_count):
        _write_way(start, guess, e, way[0], way[1])
        _write_way(guess, at, e, way[1], way[2])
    if seen:
        _add_turns(strands, maps)
    for e in range(strands.edge_count):
        i, t, length, inertia = strands.edge_node[e], row(at.tangent, e), at.length[e], strands.spin_inertia[e]
        vector = combine(1.0, row(at.position, i + 1), -1.0, row(at.position, i))
        before = combine(1.0, row(stage.origin_position, i + 1), -1.0, row(stage.origin_position, i))
        lengthened = combine(1.0, vector, -1.0, before)
        factor = inertia / (h * length) ** 2
        size, around = factor * (at.total_angle[e] - stage.origin_angle[e]), cross(t, lengthened)
        ahead = 0.5 * sums.edge[e, 3] / (length * length)  # by forces that see turns since the start of the stage
        u, by = (
            combine(size + ahead, t, -size / length, lengthened),
            combine(factor, row(way[2], e), -3.0 * size / length, t),
        )
        _add_block(strands, e, u, around, by, factor, maps.lacking)
        _add_block(strands, e, scaled(-size, t), around, (0.0, 0.0, 0.0), -factor, maps.by_origin)
        spin = inertia / stage.momentum_length + p.damping * inertia
        if fluid.exists:
            spin += fluid.mass[e, 2] / stage.momentum_length
        maps.by_turn[e] = spin / h
        _add_turned(strands, strands.edge_unknown[e], e, maps.by_turn[e], way[2], maps.lacking)
    return READY


@kernel
def _add_turns(strands, maps):
    """Add what all forces by turns at the origin are by those at the end, as far as they depend on vectors."""
    origin, way = maps.by_origin, maps.way[2]
    size, width = origin.band.shape
    reach = width // 2
    for e in range(strands.edge_count):
        column = strands.edge_unknown[e]
        for i in range(max(column - reach, 0), min(column + reach + 1, size)):
            value = origin.band[i, column - i + reach]
            if value != 0.0:
                _add_turned(strands, i, e, -value, way, maps.lacking)
    for k in range(min(origin.count[0], origin.row.shape[0])):
        e = maps.edge_of[origin.column[k]]
        if e >= 0:
            _add_turned(strands, origin.row[k], e, -origin.value[k], way, maps.lacking)


@piece(int, Problem, StageMaps, Configuration, Configuration)
def write_last_way(p, maps, start, at):
    """Write the ways of turns from the last stage of a step to its end beyond it."""
    maps.way[:] = 0.0
    for e in range(p.strands.edge_count):
        _write_way(start, at, e, maps.way[0], maps.way[1])
    return READY

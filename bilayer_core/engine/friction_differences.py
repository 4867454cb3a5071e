"""Derivatives of friction on surfaces by what its contacts freeze, and by the origin of a stage.

Each contact is frozen anew, by itself, where one of the unknowns that it sees has moved: nodes and turns of the edges
at its own node, and the bodies that touch. What follows from the changes is exact; see `forces.friction_change`.
"""

from __future__ import annotations

import math

from bilayer_core.engine.linear.lacking_matrix import LackingMatrix, add_entry, unknown_of_edge
from bilayer_core.forces.friction_change import FrozenChange, add_changed_force, add_frozen, begin_change
from bilayer_core.forces.surface_friction import (
    freeze_contact,
    freeze_surface_contacts,
    place_count,
    spread_contact,
)
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.kinematics.copying import copy_matrix, copy_row
from bilayer_core.kinematics.rotating import product_transposed
from bilayer_core.kinematics.vector import dot, row
from bilayer_core.model.records.contacts import Sliding
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage


@piece(bool, Sliding, Problem, Configuration, Stage, int, int, int, int)
def freeze_again(sliding, p, at, stage, k, slot, place, places):
    """Freeze the contact of near pair k anew, with its places; return whether there still is one."""
    n, arm = stack_vector(3), stack_vector(3)
    found = freeze_contact(sliding, p, at, stage, k, slot, n, arm)[0]
    if found and places > 0:
        spread_contact(sliding, p, at, stage, slot, place, arm, n)
    return found


@piece(int, Sliding, Problem, Configuration, Stage, int, int, int, float, FrozenChange, int)
def note_frozen(sliding, p, at, stage, slot, place, places, factor, change, first):
    """Add a multiple of what a contact and its places took where they were frozen last."""
    add_frozen(sliding, p, at, stage, slot, place, places, factor, change, first)
    return READY


@kernel
def _copy_edge(source, e, target):
    """Copy the frame of an edge."""
    target.length[e] = source.length[e]
    copy_row(source.tangent, e, target.tangent, e)
    copy_row(source.director1, e, target.director1, e)
    copy_row(source.director2, e, target.director2, e)


@kernel
def _lead_edge(at, e, x, y, z, turn, out):
    """Write the frame of an edge whose vector grows by (x, y, z), and that turns, to first order."""
    t, m1, m2, length = row(at.tangent, e), row(at.director1, e), row(at.director2, e), at.length[e]
    u = x, y, z
    along, first, second = dot(u, t), dot(u, m1) / length, dot(u, m2) / length
    out.length[e] = length + along
    for c in range(3):
        out.tangent[e, c] = t[c] + (u[c] - along * t[c]) / length
        out.director1[e, c] = m1[c] - first * t[c] + turn * m2[c]
        out.director2[e, c] = m2[c] - second * t[c] - turn * m1[c]


@kernel
def _move_node(strands, at, n, x, y, z, e0, e1, out):
    """Move a node, and with it two edges, or one if they are the same."""
    out.position[n, 0], out.position[n, 1], out.position[n, 2] = (
        at.position[n, 0] + x,
        at.position[n, 1] + y,
        at.position[n, 2] + z,
    )
    for k in range(1 if e0 == e1 else 2):
        e = e0 if k == 0 else e1
        if strands.edge_node[e] == n:
            _lead_edge(at, e, -x, -y, -z, 0.0, out)
        elif strands.edge_node[e] + 1 == n:
            _lead_edge(at, e, x, y, z, 0.0, out)


@kernel
def _copy_body(surfaces, at, b, s, i, out):
    """Copy what a contact sees of a body: its pose, and its surface s or its contact point i, if they are not −1."""
    copy_row(at.pose_position, b, out.pose_position, b)
    copy_matrix(at.rotation, b, out.rotation, b)
    if s >= 0:
        copy_row(at.surface_position, s, out.surface_position, s)
        copy_matrix(at.surface_rotation, s, out.surface_rotation, s)
    if i >= 0:
        copy_row(at.contact_point, i, out.contact_point, i)


@kernel
def _turn_about(centre, b, place, k, v, out):
    """Turn a place about that of a body."""
    arm, turned = stack_matrix(3, 3), stack_matrix(3, 3)
    for c in range(3):
        arm[c, 0], arm[c, 1], arm[c, 2] = place[k, c] - centre[b, c], 0.0, 0.0
    _rotate(v, arm, turned)
    for c in range(3):
        out[k, c] = centre[b, c] + turned[c, 0]


@kernel
def _rotate(v, matrix, out):
    """Write exp([v]×) times a matrix, for a turn about an axis of the world."""
    for c in range(3):
        if v[c] != 0.0:
            d, e, cosine, sine = (c + 1) % 3, (c + 2) % 3, math.cos(v[c]), math.sin(v[c])
            for j in range(3):
                out[c, j] = matrix[c, j]
                out[d, j] = cosine * matrix[d, j] - sine * matrix[e, j]
                out[e, j] = sine * matrix[d, j] + cosine * matrix[e, j]


@kernel
def _move_body(surfaces, at, b, s, i, way, h, out):
    """Move what a contact sees of a body along an axis of the world, or turn it about one."""
    _copy_body(surfaces, at, b, s, i, out)
    if way < 3:
        out.pose_position[b, way] += h
        if s >= 0:
            out.surface_position[s, way] += h
        if i >= 0:
            out.contact_point[i, way] += h
        return
    v = stack_vector(3)
    v[0] = v[1] = v[2] = 0.0
    v[way - 3] = h
    _rotate(v, at.rotation[b], out.rotation[b])
    if s >= 0:
        _rotate(v, at.surface_rotation[s], out.surface_rotation[s])
        _turn_about(at.pose_position, b, at.surface_position, s, v, out.surface_position)
    if i >= 0:
        _turn_about(at.pose_position, b, at.contact_point, i, v, out.contact_point)


@kernel
def _move_pose(p, stage, f, way, h):
    """Move free body f at the origin of a stage, (1 − length [ω̃]×) R̃, by a component of its position, by a turn of R̃,
    or by ω̃, of which h is that times the length.
    """
    b, c = p.bodies.body_of_free[f], way % 3
    if way < 3:
        stage.origin_pose_position[b, c] += h
        return
    length, spin, ahead, out = stage.length, stage.body_spin, stage.predicted_body_rotation, stage.origin_rotation
    d, e = (c + 1) % 3, (c + 2) % 3
    for j in range(3):
        u, v = -h * ahead[f, e, j], h * ahead[f, d, j]  # h e_c × R̃ has components d and e
        if way >= 6:
            out[b, d, j] -= u
            out[b, e, j] -= v
            continue
        out[b, d, j] += u - length * spin[f, c] * -v
        out[b, e, j] += v - length * spin[f, c] * u
        out[b, c, j] -= length * (spin[f, d] * v - spin[f, e] * u)


@kernel
def _free_of(surfaces, b):
    """Return the number of a body among the free ones, or −1."""
    return surfaces.free_index[b] if b >= 0 and surfaces.free_index.shape[0] > 0 else -1


@piece(int, Sliding, Problem, Configuration, Stage, int, int, int, FrozenChange, int, LackingMatrix, int, int)
def write_change(sliding, p, at, stage, slot, place, places, change, first, matrix, column, w):
    """Add the forces that a change of a contact makes, by the unknowns that they act on, to a column of a matrix, or
    along way w to the three of a node.
    """
    of_node, of_arms, of_bodies = stack_vector(3), stack_vector(8), stack_matrix(2, 6)
    for c in range(3):
        of_node[c] = 0.0
    for c in range(8):
        of_arms[c] = 0.0
    for c in range(6):
        of_bodies[0, c] = of_bodies[1, c] = 0.0
    for q in range(places + 1):
        k = slot if q == 0 else place + q - 1
        add_changed_force(sliding, p, at, stage, k, first + q, change, of_node, of_arms, of_bodies)
    surfaces, strands, i = p.surfaces, p.strands, sliding.node[slot]
    a, b = surfaces.contact_point_body[sliding.first[slot]], surfaces.body[sliding.surface[slot]]
    for k in range(0 if a < 0 else 17, 29):  # the node, two edges with two nodes and a turn each, two bodies
        row_, value = -1, 0.0
        if k < 3:
            row_, value = strands.node_unknown[i] + k, of_node[k]
        elif k < 17:
            side, c = (k - 3) // 7, (k - 3) % 7
            row_ = unknown_of_edge(strands, surfaces.node_edges[i, side], c)
            value = of_arms[4 * side + (3 if c == 6 else c % 3)]
            if c < 3:
                value = -value
        else:
            side, c = (k - 17) // 6, (k - 17) % 6
            f = _free_of(surfaces, a if side == 0 else b)
            if f >= 0:
                row_, value = p.sums.gradient.shape[0] + 6 * f + c, of_bodies[side, c]
        if value == 0.0:
            continue
        for c in range(1 if w < 0 else 3):
            part = value if w < 0 else value * strands.axes[w, c]
            if part != 0.0:
                add_entry(matrix, row_, column + c, part)
    return READY


@kernel
def _take_pose(sliding, at, stage, b):
    """Freeze a body as it is turned."""
    copy_matrix(at.rotation, b, sliding.back, b)
    product_transposed(stage.origin_rotation, b, sliding.back, b, sliding.origin_rotation, b)
    product_transposed(at.rotation, b, sliding.back, b, sliding.rotation, b)


@kernel
def _slip_by_origin(sliding, surfaces, strands, k, n, x, y, z, e, change, first):
    """Note how a contact slips with the place of node n at the origin along a way, or with the turn there of edge e, if
    that is not −1; nothing that it freezes changes.
    """
    begin_change(change, first, 0)
    if e < 0 and n == sliding.node[k]:
        change.slip[first, 0], change.slip[first, 1], change.slip[first, 2] = -x, -y, -z
    rate = sliding.arm_rate
    for side in range(2):
        own = surfaces.node_edges[sliding.node[k], side]
        for c in range(3):
            r, m = 4 * side, strands.edge_node[own]
            moved = rate[k, c, r] * x + rate[k, c, r + 1] * y + rate[k, c, r + 2] * z
            if e == own:
                change.slip[first, c] -= rate[k, c, r + 3]
            elif e < 0 and m == n:
                change.slip[first, c] += moved
            elif e < 0 and m + 1 == n:
                change.slip[first, c] -= moved


@kernel
def _end_of(strands, e0, e1, pick):
    """Return one of the nodes of two edges, −1 for one that was returned before."""
    first = strands.edge_node[e0]
    n = first + pick if pick < 2 else strands.edge_node[e1] + pick - 2
    return -1 if pick >= 2 and (n == first or n == first + 1) else n


@kernel
def _by_rod(sliding, p, at, trial, stage, h, k, slot, place, places, change, lacking, by_origin):
    """Add how a contact of a rod depends on nodes and turns of the edges at its node."""
    surfaces, strands, factor, ways = p.surfaces, p.strands, 1.0 / (2.0 * h), p.strands.axes
    node = sliding.node[slot]
    e0, e1 = surfaces.node_edges[node, 0], surfaces.node_edges[node, 1]
    first, last, step = 0, ways.shape[0] if p.space.exists else 0, places + 1
    for pick in range(4):
        n = _end_of(strands, e0, e1, pick)
        for w in range(ways.shape[0] if n >= 0 else 0):
            x, y, z = h * ways[w, 0], h * ways[w, 1], h * ways[w, 2]
            begin_change(change, first, places)
            for side in range(-1, 2, 2):
                _move_node(strands, at, n, side * x, side * y, side * z, e0, e1, trial)
                found = freeze_again(sliding, p, trial, stage, k, slot, place, places)
                part = side * factor if found else math.nan
                note_frozen(sliding, p, at, stage, slot, place, places, part, change, first)
            copy_row(at.position, n, trial.position, n)
            _copy_edge(at, e0, trial)
            _copy_edge(at, e1, trial)
            first += step
    for pick in range(0 if last == 0 else 1 if e0 == e1 else 2):
        e = e0 if pick == 0 else e1
        begin_change(change, first, places)
        for side in range(-1, 2, 2):
            _lead_edge(at, e, 0.0, 0.0, 0.0, side * h, trial)
            found = freeze_again(sliding, p, trial, stage, k, slot, place, places)
            part = side * factor if found else math.nan
            note_frozen(sliding, p, at, stage, slot, place, places, part, change, first)
        _copy_edge(at, e, trial)
        first += step
    freeze_again(sliding, p, at, stage, k, slot, place, places)
    first = 0
    for pick in range(4):
        n = _end_of(strands, e0, e1, pick)
        for w in range(ways.shape[0] if n >= 0 else 0):
            column = strands.node_unknown[n]
            if change.load[first] == change.load[first]:  # in reach of the barrier on both sides
                write_change(sliding, p, at, stage, slot, place, places, change, first, lacking, column, w)
            _note_origin(sliding, p, at, stage, h, k, slot, place, places, change, n, w)
            write_change(sliding, p, at, stage, slot, place, places, change, 0, by_origin, column, w)
            first += step
    for pick in range(0 if last == 0 else 1 if e0 == e1 else 2):
        e = e0 if pick == 0 else e1
        column = strands.edge_unknown[e]
        if change.load[first] == change.load[first]:
            write_change(sliding, p, at, stage, slot, place, places, change, first, lacking, column, -1)
        for q in range(step):
            own = slot if q == 0 else place + q - 1
            _slip_by_origin(sliding, surfaces, strands, own, -1, 0.0, 0.0, 0.0, e, change, q)
        write_change(sliding, p, at, stage, slot, place, places, change, 0, by_origin, column, -1)
        first += step


@kernel
def _note_origin(sliding, p, at, stage, h, k, slot, place, places, change, n, w):
    """Note how a contact changes with the place of a node at the origin along a way."""
    ways, origin = p.strands.axes, stage.origin_position
    if places == 0:
        x, y, z = ways[w, 0], ways[w, 1], ways[w, 2]
        _slip_by_origin(sliding, p.surfaces, p.strands, slot, n, x, y, z, -1, change, 0)
        return
    x, y, z, u, v, t = h * ways[w, 0], h * ways[w, 1], h * ways[w, 2], origin[n, 0], origin[n, 1], origin[n, 2]
    begin_change(change, 0, places)
    for side in range(-1, 2, 2):
        origin[n, 0], origin[n, 1], origin[n, 2] = u + side * x, v + side * y, t + side * z
        freeze_again(sliding, p, at, stage, k, slot, place, places)
        note_frozen(sliding, p, at, stage, slot, place, places, side / (2.0 * h), change, 0)
    origin[n, 0], origin[n, 1], origin[n, 2] = u, v, t
    freeze_again(sliding, p, at, stage, k, slot, place, places)


@kernel
def _by_body(sliding, p, at, trial, stage, h, k, slot, place, places, change, f, side_of, lacking, by_origin, slides):
    """Add how a contact depends on the motion of a free body, that of its point or that of its surface."""
    surfaces, factor, b = p.surfaces, 1.0 / (2.0 * h), p.bodies.body_of_free[f]
    s = sliding.surface[slot] if side_of == 1 else -1
    i = sliding.first[slot] if side_of == 0 else -1
    unknown = p.sums.gradient.shape[0] + 6 * f
    for way in range(6):
        found = True
        begin_change(change, 0, places)
        for side in range(-1, 2, 2):
            _move_body(surfaces, at, b, s, i, way, side * h, trial)
            _take_pose(sliding, trial, stage, b)
            found &= freeze_again(sliding, p, trial, stage, k, slot, place, places)
            product_transposed(at.rotation, b, sliding.back, b, sliding.rotation, b)
            note_frozen(sliding, p, at, stage, slot, place, places, side * factor, change, 0)
        _copy_body(surfaces, at, b, s, i, trial)
        _take_pose(sliding, at, stage, b)
        freeze_again(sliding, p, at, stage, k, slot, place, places)
        if found:
            write_change(sliding, p, at, stage, slot, place, places, change, 0, lacking, unknown + way, -1)
    kept = stack_matrix(4, 3)
    copy_row(stage.origin_pose_position, b, kept, 3)
    for c in range(3):
        copy_row(stage.origin_rotation[b], c, kept, c)
    for way in range(9):
        begin_change(change, 0, places)
        size = stage.length if way >= 6 else 1.0
        for side in range(-1, 2, 2):
            _move_pose(p, stage, f, way, side * h)
            _take_pose(sliding, at, stage, b)
            if places > 0:
                freeze_again(sliding, p, at, stage, k, slot, place, places)
            note_frozen(sliding, p, at, stage, slot, place, places, side * factor * size, change, 0)
            copy_row(kept, 3, stage.origin_pose_position, b)
            for c in range(3):
                copy_row(kept, c, stage.origin_rotation[b], c)
        _take_pose(sliding, at, stage, b)
        if places > 0:
            freeze_again(sliding, p, at, stage, k, slot, place, places)
        if way < 3:
            write_change(sliding, p, at, stage, slot, place, places, change, 0, by_origin, unknown + way, -1)
        else:
            write_change(sliding, p, at, stage, slot, place, places, change, 0, slides, 6 * f + way - 3, -1)


@piece(
    int,
    Problem,
    Configuration,
    Configuration,
    Stage,
    float,
    float,
    FrozenChange,
    LackingMatrix,
    LackingMatrix,
    LackingMatrix,
)
def differentiate_friction(p, at, trial, stage, far, near, change, lacking, by_origin, slides):
    """Add how friction on surfaces depends on what its contacts freeze at a configuration, on the origin of the stage,
    and there on the turns R̃ and the spins ω̃ of free bodies, six columns each, to matrices; unknowns move `far`, or
    `near` where contacts are spread.
    """
    sliding, surfaces = p.sliding, p.surfaces
    freeze_surface_contacts(sliding, p, at, stage)
    for b in range(at.rotation.shape[0]):
        product_transposed(at.rotation, b, sliding.back, b, sliding.rotation, b)
    slot, whole = 0, sliding.count[0] - sliding.places[0]
    place = whole
    for k in range(surfaces.near_count[0]):
        i, s = surfaces.near_contact_point[k], surfaces.near_surface[k]
        if slot == whole or i != sliding.first[slot] or s != sliding.surface[slot]:
            continue
        mix = surfaces.near_mix
        if sliding.part[slot, 0] != mix[k, 0] + mix[k, 1] or sliding.part[slot, 1] != mix[k, 5]:
            continue
        a, b, node = surfaces.contact_point_body[i], surfaces.body[s], surfaces.near_node[k]
        spread = a < 0 and sliding.spread[s, node] and sliding.load[slot] == 0.0
        places = place_count(sliding, surfaces, p.strands, slot) if spread else 0
        h = near if spread else far
        _copy_body(surfaces, at, b, s, -1, trial)
        if a >= 0:
            _copy_body(surfaces, at, a, -1, i, trial)
        else:
            for side in range(2):
                e = surfaces.node_edges[node, side]
                n = p.strands.edge_node[e]
                _copy_edge(at, e, trial)
                copy_row(at.position, n, trial.position, n)
                copy_row(at.position, n + 1, trial.position, n + 1)
            _by_rod(sliding, p, at, trial, stage, h, k, slot, place, places, change, lacking, by_origin)
        for side in range(2):
            f = _free_of(surfaces, a if side == 0 else b)
            if f >= 0:
                _by_body(
                    sliding, p, at, trial, stage, h, k, slot, place, places, change, f, side, lacking, by_origin,
                    slides,
                )  # fmt: skip
        slot += 1
        place += places
    return READY

"""Contact between rods in the Newton matrix.

A contact couples the edge (i, i+1) of a point with the edge (j, j+1) that it faces, which are far from each other in
the band. What moves either *side* are the unknowns of the two nodes of its edge, with friction the turn of the edge as
well, and where these have rails (`contact.rails`) those of the nodes beside them and of three edges. With r the vector
between the two places and M, κ and a as in `forces.rod_contact`, the contact adds

    ∂rᵀ M ∂r − κ (|e| ∂t)ᵀ (|e| ∂t),    ∂r = Σ w_m ∂y_m,    |e| ∂t = Σ a_m·∂y_m

of the four ends y_m, or eight of ribbons, and of these likewise across the width. The blocks of either side by itself
stay in the band, as does the curvature of arms. For those between the two, the columns of the unknowns of one of them
are moved to the border, as those of nodes that a free body holds are (`engine.linear.attachments`): with S these
unknowns and R all others,

    [ A_RR  A_RS ]        band: A_RR, rows of the identity for S
    [ A_SR  A_SS ]        border: U = A_RS,   corner: D = A_SS

Of each two strands in contact the unknowns that are fewer have such *contact columns*. So the border has columns for
some contacting nodes, and the cost stays linear in the number of nodes. Nodes where a closed rod closes have columns in
the border anyhow (`engine.linear.closed_rods`).
"""

from __future__ import annotations

from bilayer_core.contact.rails import has_arm
from bilayer_core.engine.linear.assembly import hold_unknowns
from bilayer_core.engine.linear.attachments import add_to_row, arm_jacobian
from bilayer_core.engine.linear.new_columns import add_columns, add_to_column
from bilayer_core.forces.rail_arms import touches
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY

MOST_SWEEPS = 4
"""In which columns are chosen; after as many as there are contacts, and one more, nothing changes."""
MOST_OF_SIDE = 15
"""Unknowns that move a side: of four nodes and three edges."""


@piece(int, Problem, int)
def take_rod_contacts(p, simplified):
    """Add each side's own blocks to the band, and choose the unknowns that have contact columns.

    `simplified` is 1 to leave out what is negative across the two edges, 2 to leave out all that is negative. Friction
    has nothing negative.
    """
    rods, columns = p.rod_contact, p.contact_columns
    columns.contacts = columns.unknowns = 0
    for part in range(2):
        rate = rods.rails.rate if part == 0 else rods.rails.slip_rate
        contacts = rods.contacts if part == 0 else rods.sliding
        _list_contacts(columns, rods.rails, rate, p.strands, simplified, contacts, part == 1)
    if columns.contacts > 0:
        _add_own_sides(columns, p.system.band)
        _choose_unknowns(columns)
    if rods.rails.exists and rods.contacts.count[0] > 0:
        _add_curvature(rods.rails, p.strands, p.system.band)
    return READY


@kernel
def _list_contacts(columns, rails, rate, strands, simplified, contacts, slides):
    """Append contacts to the list, with what moves their sides."""
    begin, half = columns.contacts, columns.unknown.shape[1] // 2
    normal, direction, matrix = contacts.normal, contacts.segment_direction, stack_matrix(3, 3)
    for c in range(contacts.count[0]):
        e, tangential = begin + c, contacts.tangential_stiffness[c]
        columns.node[e, 0], columns.node[e, 1] = contacts.node[c, 0], contacts.node[c, 1]
        turns = contacts.inner[c] or contacts.right[c, 1] >= 0
        columns.stiffness[e] = tangential if turns and simplified < 2 else 0.0
        for m in range(3):
            for n in range(3):
                matrix[m, n] = contacts.matrix[c, m, n]
        if simplified > 0:
            n0, n1, n2 = normal[c, 0], normal[c, 1], normal[c, 2]
            u0, u1, u2 = direction[c, 0], direction[c, 1], direction[c, 2]
            _subtract(matrix, tangential, n1 * u2 - n2 * u1, n2 * u0 - n0 * u2, n0 * u1 - n1 * u0)
            if simplified > 1:
                _subtract(matrix, tangential, u0, u1, u2)
        for side in range(contacts.node.shape[1]):
            if rails.exists:
                _list_rails(columns, rails, rate, strands, contacts, c, e, side)
            else:
                _list_nodes(columns, strands, contacts, c, e, side)
            if slides:
                _list_turn(columns, rails, strands, contacts, c, e, side)
        for a in range(2 * half):
            r0, r1, r2 = columns.rate[e, 0, a], columns.rate[e, 1, a], columns.rate[e, 2, a]
            for m in range(3):
                columns.pressed[e, m, a] = matrix[m, 0] * r0 + matrix[m, 1] * r1 + matrix[m, 2] * r2
    columns.contacts = begin + contacts.count[0]


@kernel
def _subtract(matrix, factor, v0, v1, v2):
    """Subtract factor v vᵀ from a matrix."""
    v = (v0, v1, v2)
    for m in range(3):
        for n in range(3):
            matrix[m, n] -= factor * v[m] * v[n]


@kernel
def _list_nodes(columns, strands, contacts, c, e, side):
    """List the unknowns of the nodes of one side, and what moves with them."""
    axes, dimension, half = strands.axes, strands.axes.shape[0], columns.unknown.shape[1] // 2
    begin = side * half
    for a in range(begin + 2 * dimension, begin + half):
        columns.unknown[e, a] = -1
        columns.rate[e, 0, a] = columns.rate[e, 1, a] = columns.rate[e, 2, a] = columns.foot[e, a] = 0.0
    for m in range(2):
        weight, node = contacts.weight[c, 2 * side + m], contacts.node[c, side] + m
        for x in range(dimension):
            a, along = begin + dimension * m + x, 0.0
            columns.unknown[e, a] = strands.row[node] + x
            for n in range(3):
                columns.rate[e, n, a] = weight * axes[x, n]
                along += contacts.foot_gradient[c, 2 * side + m, n] * axes[x, n]
            columns.foot[e, a] = along


@kernel
def _list_turn(columns, rails, strands, contacts, c, e, side):
    """Add to what moves with the unknowns of one side how friction's place moves with its edge."""
    axes, dimension, turn = strands.axes, strands.axes.shape[0], contacts.turn
    first, angle = side * (columns.unknown.shape[1] // 2), 2 * dimension
    if rails.exists:  # the node and the edge before come first
        first, angle = first + dimension, 3 * dimension + 1
    for n in range(3):
        for x in range(dimension):
            moved = 0.0
            for d in range(3):
                moved += turn[c, 3 * side + n, d] * axes[x, d]
            columns.rate[e, n, first + x] -= moved
            columns.rate[e, n, first + dimension + x] += moved
    if dimension == 3:
        columns.unknown[e, first + angle] = strands.edge_unknown[contacts.edge[c, side]]
        for n in range(3):
            columns.rate[e, n, first + angle] += turn[c, 3 * side + n, 3]


@kernel
def _list_rails(columns, rails, rate, strands, contacts, c, e, side):
    """List the unknowns that move the rails of one side: of the nodes before, at and after its edge and of the edges
    between these, in that order.
    """
    axes, dimension, first = strands.axes, strands.axes.shape[0], contacts.node[c, side]
    begin = side * (columns.unknown.shape[1] // 2)
    turns = begin + 4 * dimension
    own, before = rails.node_edges[first, 1], rails.node_edges[rails.node[first], 0]
    after = rails.node_edges[first + 1, 1]
    right = contacts.right[c, side]
    raised = right >= 0 or has_arm(rails, first) or has_arm(rails, first + 1)
    for k in range(4):
        row = strands.row[first + k - 1] if 0 < k < 3 else -1
        if k == 0 and raised and before != own:
            row = strands.row[strands.edge_node[before]]
        if k == 3 and raised and after != own:
            row = strands.row[strands.edge_node[after] + 1]
        for x in range(dimension):
            columns.unknown[e, begin + dimension * k + x] = row + x if row >= 0 else -1
    if dimension == 3:
        columns.unknown[e, turns] = strands.edge_unknown[before] if raised and before != own else -1
        columns.unknown[e, turns + 1] = strands.edge_unknown[own] if raised else -1
        columns.unknown[e, turns + 2] = strands.edge_unknown[after] if raised and after != own else -1
    for a in range(begin, begin + columns.unknown.shape[1] // 2):
        columns.rate[e, 0, a] = columns.rate[e, 1, a] = columns.rate[e, 2, a] = columns.foot[e, a] = 0.0
        if columns.cross.shape[1] > 0:
            columns.cross[e, a] = 0.0
    node, edges = stack_vector(3), stack_vector(8)
    rows = 5 if columns.cross.shape[1] > 0 else 4
    for m in range(2):
        for n in range(rows if columns.stiffness[e] != 0.0 else 3):
            other = right + m if right >= 0 else -1
            _gather_end(contacts, rails, rate, c, 2 * side + m, first + m, other, n, node, edges)
            _add_row(columns, e, n, begin + dimension * m, turns + m, axes, node, edges)


@kernel
def _gather_end(contacts, rails, rate, c, leg, left, right, n, node_out, edges_out):
    """Write what the rails of one end contribute to row n of what moves: by their node, and by the edges beside it."""
    for k in range(8):
        edges_out[k] = 0.0
    for x in range(3):
        node_out[x] = 0.0
    for border in range(1 if right < 0 else 2):
        r, w = (left, leg) if border == 0 else (right, 4 + leg)
        turns = has_arm(rails, r)
        for x in range(3):
            if n < 3:
                value = contacts.weight[c, w] if x == n else 0.0
            elif n == 3:
                value = contacts.foot_gradient[c, w, x]
            else:
                value = contacts.cross_gradient[c, w, x]
            if value != 0.0:
                node_out[x] += value
                if turns:
                    for k in range(8):
                        edges_out[k] += value * rate[r, x, k]


@kernel
def _add_row(columns, e, n, at, turns, axes, node, edges):
    """Add what an end contributes to row n of what moves with unknowns: those of the nodes before, at and after it,
    from `at` on, and the turns of the two edges between.
    """
    dimension = axes.shape[0]
    for x in range(dimension):
        own, back, front = 0.0, 0.0, 0.0
        for d in range(3):
            own += node[d] * axes[x, d]
            back += edges[d] * axes[x, d]
            front += edges[4 + d] * axes[x, d]
        _add_value(columns, e, n, at + x, -back)
        _add_value(columns, e, n, at + dimension + x, own + back - front)
        _add_value(columns, e, n, at + 2 * dimension + x, front)
    if dimension == 3:
        _add_value(columns, e, n, turns, edges[3])
        _add_value(columns, e, n, turns + 1, edges[7])


@kernel
def _add_value(columns, e, n, a, value):
    """Add to row n, ∂r (n < 3), |e| ∂t (3) or that across (4), of what moves with an unknown."""
    if n < 3:
        columns.rate[e, n, a] += value
    elif n == 3:
        columns.foot[e, a] += value
    else:
        columns.cross[e, a] += value


@kernel
def _entry(columns, c, a, b):
    """Return the entry of the second derivative of contact c by its unknowns a and b."""
    rate, pressed = columns.rate, columns.pressed
    value = rate[c, 0, a] * pressed[c, 0, b] + rate[c, 1, a] * pressed[c, 1, b] + rate[c, 2, a] * pressed[c, 2, b]
    if columns.cross.shape[1] > 0:
        value -= columns.stiffness[c] * columns.cross[c, a] * columns.cross[c, b]
    return value - columns.stiffness[c] * columns.foot[c, a] * columns.foot[c, b]


@kernel
def _write_entries(columns, c, a, begin, end, out):
    """Write the entries of unknown a with those from `begin` to `end`: as `_entry`, several at a time."""
    rate, pressed = columns.rate, columns.pressed
    r0, r1, r2 = rate[c, 0, a], rate[c, 1, a], rate[c, 2, a]
    for b in range(begin, end):
        out[b - begin] = r0 * pressed[c, 0, b] + r1 * pressed[c, 1, b] + r2 * pressed[c, 2, b]
    if columns.stiffness[c] == 0.0:
        return
    if columns.cross.shape[1] > 0:
        part = columns.stiffness[c] * columns.cross[c, a]
        for b in range(begin, end):
            out[b - begin] -= part * columns.cross[c, b]
    part = columns.stiffness[c] * columns.foot[c, a]
    for b in range(begin, end):
        out[b - begin] -= part * columns.foot[c, b]


@kernel
def _add_own_sides(columns, band):
    """Add the blocks of either side of each contact by itself to the band, but what is beyond it where a closed rod
    closes: `_add_far`.
    """
    half, entries = columns.unknown.shape[1] // 2, stack_vector(MOST_OF_SIDE)
    for c in range(columns.contacts):
        for side in range(columns.node.shape[1]):
            begin = side * half
            for a in range(begin, begin + half):
                row = columns.unknown[c, a]
                if row < 0:
                    continue
                _write_entries(columns, c, a, begin, a + 1, entries)
                for b in range(begin, a + 1):
                    column = columns.unknown[c, b]
                    if column >= 0 and abs(row - column) < band.shape[1]:
                        band[min(row, column), abs(row - column)] += entries[b - begin]


@kernel
def _add_curvature(rails, strands, band):
    """Add the second derivatives of arms by their edges to the band."""
    axes, dimension, block = strands.axes, strands.axes.shape[0], rails.curvature
    for e in range(block.shape[0]):
        i = strands.edge_node[e]
        if not touches(rails, strands, e):
            continue
        first, last = strands.row[i], strands.row[i + 1]
        for x in range(dimension):
            for y in range(dimension):
                value = 0.0
                for m in range(3):
                    for n in range(3):
                        value += axes[x, m] * block[e, m, n] * axes[y, n]
                if y <= x:
                    band[first + y, x - y] += value
                    band[last + y, x - y] += value
                band[first + y, last + x - first - y] -= value
            if dimension == 3:
                turn = strands.edge_unknown[e]
                value = axes[x, 0] * block[e, 0, 3] + axes[x, 1] * block[e, 1, 3] + axes[x, 2] * block[e, 2, 3]
                band[min(first + x, turn), abs(turn - first - x)] -= value
                band[min(last + x, turn), abs(turn - last - x)] += value
        if dimension == 3:
            band[strands.edge_unknown[e], 0] += block[e, 3, 3]


@kernel
def _choose_unknowns(columns):
    """Give contact columns to the smaller set of unknowns of each two strands in contact (or halves of one), of those
    that have none for other strands. The choice is made again with what all others have chosen.
    """
    mark, met = columns.mark, columns.met
    mark[:, :2] = -1
    mark[:, 2] = 0
    met[:] = 0
    for sweep in range(min(MOST_SWEEPS, columns.contacts + 1)):
        if not _choose_once(columns, sweep * columns.contacts):
            break
    chosen = 0
    for i in range(mark.shape[0]):
        columns.column[i] = -1
        if mark[i, 2] > 0:
            columns.column[i] = chosen
            columns.row[chosen] = i
            chosen += 1
    columns.unknowns = chosen


@kernel
def _choose_once(columns, first_stamp):
    """Choose one side of each two strands; return whether any choice changes.

    How many have chosen an unknown is left in `mark`, and in `met` the first contact of two strands with their side.
    """
    count, node, strand, mark, met = columns.contacts, columns.node, columns.strand, columns.mark, columns.met
    half, changes = columns.unknown.shape[1] // 2, False
    for c in range(count):
        first, second = min(node[c, 0], node[c, 1]), max(node[c, 0], node[c, 1])
        s, t, stamp = strand[first], strand[second], first_stamp + c
        before = met[s, t]
        if before > 0 and (before - 1) // 2 != c:
            continue
        lower = upper = 0
        for e in range(c, count):
            low, high = min(node[e, 0], node[e, 1]), max(node[e, 0], node[e, 1])
            if strand[low] != s or strand[high] != t:
                continue
            low_side = 0 if node[e, 0] <= node[e, 1] else 1
            if not (_has_free(columns, e, 0, half) and _has_free(columns, e, half, 2 * half)):
                continue
            lower += _mark_side(columns, e, low_side * half, half, 0, stamp)
            upper += _mark_side(columns, e, (1 - low_side) * half, half, 1, stamp)
        for i in range(mark.shape[0]):
            if before > 0 and mark[i, (before - 1) % 2] == stamp:
                mark[i, 2] -= 1
            if mark[i, 2] > 0:
                lower -= mark[i, 0] == stamp
                upper -= mark[i, 1] == stamp
        fewer = 0 if lower <= upper else 1
        for i in range(mark.shape[0]):
            if mark[i, fewer] == stamp:
                mark[i, 2] += 1
        met[s, t] = 1 + 2 * c + fewer
        changes = changes or met[s, t] != before
    return changes


@kernel
def _is_free(columns, row):
    """Return whether an unknown is in the band and in no border yet."""
    return row >= 0 and columns.attached[row] < 0 and not columns.joined[row]


@kernel
def _has_free(columns, e, begin, end):
    """Return whether any of a contact's unknowns from `begin` to `end` is free."""
    for a in range(begin, end):
        if _is_free(columns, columns.unknown[e, a]):
            return True
    return False


@kernel
def _mark_side(columns, e, begin, half, which, stamp):
    """Mark the free unknowns of a side; return how many were not."""
    mark, new = columns.mark, 0
    for a in range(begin, begin + half):
        row = columns.unknown[e, a]
        if _is_free(columns, row) and mark[row, which] != stamp:
            mark[row, which] = stamp
            new += 1
    return new


@kernel
def condense_contacts_to_bodies(columns, attachments, strands, at, border):
    """Add the blocks between the sides of contacts, of nodes that free bodies hold, to these bodies' border and corner;
    see `engine.linear.attachments`.
    """
    if not columns.exists:
        return
    axes, arm, attached, free = strands.axes, at.arm, columns.attached, attachments.free
    half = columns.unknown.shape[1] // 2
    for c in range(columns.contacts):
        for a in range(half):
            i = columns.unknown[c, a]
            first = attached[i] if i >= 0 else -1
            f = free[first] if first >= 0 else -1
            for b in range(half, 2 * half):
                j = columns.unknown[c, b]
                if i < 0 or j < 0:
                    continue
                second = attached[j]
                g = free[second] if second >= 0 else -1
                if f < 0 and g < 0:
                    continue
                value = _entry(columns, c, a, b)
                x = i - attachments.unknown[first] if f >= 0 else 0
                y = j - attachments.unknown[second] if g >= 0 else 0
                if f >= 0 and g >= 0:
                    for k in range(6):
                        for q in range(6):
                            turned = arm_jacobian(axes, arm, first, x, k) * value
                            turned *= arm_jacobian(axes, arm, second, y, q)
                            border.corner[6 * f + k, 6 * g + q] += turned
                            border.corner[6 * g + q, 6 * f + k] += turned
                elif f >= 0 and second < 0:
                    for k in range(6):
                        add_to_row(border, j, 6 * f + k, arm_jacobian(axes, arm, first, x, k) * value)
                elif g >= 0 and first < 0:
                    for k in range(6):
                        add_to_row(border, i, 6 * g + k, arm_jacobian(axes, arm, second, y, k) * value)


@piece(bool, Problem)
def move_to_border(p):
    """Move contact columns from the band to the border, and add to them what is between the sides of contacts; false if
    there is no capacity for them, but `BorderedSystem.width` is what it would be.
    """
    columns, bordered, strands = p.contact_columns, p.bordered, p.strands
    count, base = columns.unknowns, bordered.width[0]
    if columns.contacts == 0 or (count == 0 and not p.joins.exists):
        return True
    if base + count > bordered.load.shape[0]:
        bordered.width[0] = base + count
        return False
    add_columns(bordered, count)
    _move_from_band(columns, bordered, strands, base, p.system.band)
    _add_between(columns, p.joins, p.bodies.freedom, bordered, base)
    if p.joins.exists:
        _add_far(columns, p.joins, p.bodies.freedom, bordered, base, p.system.band.shape[1])
    return True


@kernel
def _move_from_band(columns, bordered, strands, base, band):
    """Move contact columns to the border and corner, those from `base` on; the band keeps those of the identity."""
    border, corner, slot = bordered.border, bordered.schur, columns.column
    bandwidth, count = strands.bandwidth, columns.unknowns
    for k in range(count):
        column, own = columns.row[k], base + k
        for c in range(base):
            corner[c, own] = corner[own, c] = border[c, column]
            border[c, column] = 0.0
        for i in range(max(0, column - bandwidth), min(strands.size, column + bandwidth + 1)):
            value = band[column, i - column] if i >= column else band[i, column - i]
            if slot[i] >= 0:
                corner[base + slot[i], own] = value
            elif value != 0.0:
                add_to_column(bordered, own, i, value)
    hold_unknowns(columns.row[:count], 1, bandwidth, band)


@kernel
def _column(columns, joins, freedom, base, row):
    """Return the border's column of a row of the band, −1 if it has none."""
    if joins.exists and joins.column[row] >= 0:
        return freedom.shape[1] + joins.column[row]
    return base + columns.column[row] if columns.column[row] >= 0 else -1


@kernel
def _add_between(columns, joins, freedom, bordered, base):
    """Add the blocks between the sides of contacts, of nodes that no body holds; one side of each has columns."""
    attached, half = columns.attached, columns.unknown.shape[1] // 2
    entries = stack_vector(MOST_OF_SIDE)
    for c in range(columns.contacts):
        begin = half  # of the side with columns: values of one are next to each other
        for a in range(half):
            row = columns.unknown[c, a]
            if row >= 0 and attached[row] < 0 and columns.column[row] >= 0:
                begin = 0
        for a in range(begin, begin + half):
            row = columns.unknown[c, a]
            if row < 0 or attached[row] >= 0:
                continue
            own = _column(columns, joins, freedom, base, row)
            _write_entries(columns, c, a, half - begin, 2 * half - begin, entries)
            for b in range(half - begin, 2 * half - begin):
                column = columns.unknown[c, b]
                if column < 0 or attached[column] >= 0:
                    continue
                other, value = _column(columns, joins, freedom, base, column), entries[b - half + begin]
                _add_twice(bordered, own, other, row, column, value)


@kernel
def _add_twice(bordered, own, other, row, column, value):
    """Add an entry and its mirror image to border and corner; at least one of the two unknowns has a column there."""
    if own >= 0 and other >= 0:
        bordered.schur[own, other] += value
        bordered.schur[other, own] += value
    elif own >= 0:
        add_to_column(bordered, own, column, value)
    else:
        add_to_column(bordered, other, row, value)


@kernel
def _add_far(columns, joins, freedom, bordered, base, beyond):
    """Add those entries of sides by themselves whose unknowns are `beyond` or more from each other in the band: where a
    closed rod closes, one of the two has a join column.
    """
    half = columns.unknown.shape[1] // 2
    for c in range(columns.contacts):
        for side in range(2):
            for a in range(side * half, (side + 1) * half):
                row = columns.unknown[c, a]
                for b in range(side * half, a):
                    column = columns.unknown[c, b]
                    if row >= 0 and column >= 0 and abs(row - column) >= beyond:
                        own = _column(columns, joins, freedom, base, row)
                        other = _column(columns, joins, freedom, base, column)
                        _add_twice(bordered, own, other, row, column, _entry(columns, c, a, b))


@kernel
def gather_columns(columns, bordered, right):
    """Move what is wanted of unknowns with contact columns from the right-hand side to `BorderedSystem.load`."""
    if not columns.exists:
        return
    base = bordered.width[0] - columns.unknowns
    for k in range(columns.unknowns):
        bordered.load[base + k] = right[columns.row[k]]
        right[columns.row[k]] = 0.0


@kernel
def scatter_columns(columns, bordered, right):
    """Move the step of unknowns with contact columns from `BorderedSystem.load` to that of all."""
    if not columns.exists:
        return
    base = bordered.width[0] - columns.unknowns
    for k in range(columns.unknowns):
        right[columns.row[k]] = bordered.load[base + k]

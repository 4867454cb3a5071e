"""Contact between rods in the Newton matrix.

A contact couples the edge (i, i+1) of a point with the edge (j, j+1) that it faces, which are far from each other in
the band. The blocks of either edge by itself stay in the band. For those between the two, the columns of the nodes of
one of them are moved to the border, as those of nodes that a free body holds are (`engine.linear.attachments`): with S
the unknowns of these nodes and R all others,

    [ A_RR  A_RS ]        band: A_RR, rows of the identity for S
    [ A_SR  A_SS ]        border: U = A_RS,   corner: D = A_SS

Of each two strands in contact the nodes that are fewer have such *contact columns*. So the border has three columns for
each of some contacting nodes, and the cost stays linear in the number of nodes. Nodes where a closed rod closes have
columns in the border anyhow (`engine.linear.closed_rods`).
"""

from __future__ import annotations

from bilayer_core.engine.linear.assembly import hold_unknowns
from bilayer_core.engine.linear.attachments import arm_jacobian
from bilayer_core.engine.linear.new_columns import add_columns
from bilayer_core.jit import kernel, piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY

CONTACTS, NODES = 0, 1
"""Places in `ContactColumns.counts`."""


@piece(int, Problem, int)
def take_rod_contacts(p, simplified):
    """Add each edge's own blocks to the band, and choose the nodes that have contact columns.

    `simplified` is 1 to leave out what is negative across the two edges, 2 to leave out all that is negative. Friction
    has nothing negative.
    """
    rods, columns = p.rod_contact, p.contact_columns
    columns.counts[CONTACTS] = columns.counts[NODES] = 0
    for part in range(2):
        _list_contacts(columns, p.strands.axes, simplified, rods.contacts if part == 0 else rods.sliding)
    if columns.counts[CONTACTS] > 0:
        _add_own_edges(columns, p.strands.row, p.system.band)
        _choose_nodes(columns, p.strands)
    return READY


@kernel
def _list_contacts(columns, axes, simplified, contacts):
    """Append contacts to the list, with components along the unknowns of nodes."""
    dimension, begin = axes.shape[0], columns.counts[CONTACTS]
    normal, direction = contacts.normal, contacts.segment_direction
    matrix, foot_gradient = contacts.matrix, contacts.foot_gradient
    for c in range(contacts.count[0]):
        e, tangential = begin + c, contacts.tangential_stiffness[c]
        columns.node[e, 0], columns.node[e, 1] = contacts.node[c, 0], contacts.node[c, 1]
        columns.stiffness[e] = tangential if contacts.inner[c] and simplified < 2 else 0.0
        n0, n1, n2 = normal[c, 0], normal[c, 1], normal[c, 2]
        u0, u1, u2 = direction[c, 0], direction[c, 1], direction[c, 2]
        v0, v1, v2 = n1 * u2 - n2 * u1, n2 * u0 - n0 * u2, n0 * u1 - n1 * u0
        for n in range(4):
            columns.weight[e, n] = contacts.weight[c, n]
        for a in range(dimension):
            a0, a1, a2 = axes[a, 0], axes[a, 1], axes[a, 2]
            for n in range(4):
                along = a0 * foot_gradient[c, n, 0] + a1 * foot_gradient[c, n, 1] + a2 * foot_gradient[c, n, 2]
                columns.foot_gradient[e, n, a] = along
            m0 = a0 * matrix[c, 0, 0] + a1 * matrix[c, 1, 0] + a2 * matrix[c, 2, 0]
            m1 = a0 * matrix[c, 0, 1] + a1 * matrix[c, 1, 1] + a2 * matrix[c, 2, 1]
            m2 = a0 * matrix[c, 0, 2] + a1 * matrix[c, 1, 2] + a2 * matrix[c, 2, 2]
            if simplified > 0:
                part = tangential * (a0 * v0 + a1 * v1 + a2 * v2)
                m0, m1, m2 = m0 - part * v0, m1 - part * v1, m2 - part * v2
            if simplified > 1:
                part = tangential * (a0 * u0 + a1 * u1 + a2 * u2)
                m0, m1, m2 = m0 - part * u0, m1 - part * u1, m2 - part * u2
            for b in range(dimension):
                columns.matrix[e, a, b] = m0 * axes[b, 0] + m1 * axes[b, 1] + m2 * axes[b, 2]
    columns.counts[CONTACTS] = begin + contacts.count[0]


@kernel
def _block(columns, c, m, n, x, y):
    """Entry of the second derivative of contact c by component x of its node m and y of its node n."""
    weight, foot_gradient = columns.weight, columns.foot_gradient
    value = weight[c, m] * weight[c, n] * columns.matrix[c, x, y]
    return value - columns.stiffness[c] * foot_gradient[c, m, x] * foot_gradient[c, n, y]


@kernel
def _add_own_edges(columns, node_row, band):
    """Add the blocks of either edge of each contact by itself to the band."""
    dimension = columns.matrix.shape[1]
    for c in range(columns.counts[CONTACTS]):
        for block in range(6):  # of the first and second edge: (0, 0), (1, 0), (1, 1)
            edge, m, n = block // 3, (block % 3 + 1) // 2, block % 3 // 2
            first = columns.node[c, edge]
            row, column = node_row[first + m], node_row[first + n]
            for x in range(dimension):
                for y in range(x + 1 if m == n else dimension):
                    band[column + y, row + x - column - y] += _block(columns, c, 2 * edge + m, 2 * edge + n, x, y)


@kernel
def _choose_nodes(columns, strands):
    """Give contact columns to the smaller set of nodes of each two strands in contact (or halves of one)."""
    count, dimension, row = columns.counts[CONTACTS], strands.dimension, strands.row
    node, strand, attached, mark, met = columns.node, columns.strand, columns.attached, columns.mark, columns.met
    joined = columns.joined
    mark[:] = -1
    met[:] = 0
    columns.column[:] = -1
    for c in range(count):
        first, second = min(node[c, 0], node[c, 1]), max(node[c, 0], node[c, 1])
        s, t = strand[first], strand[second]
        if met[s, t] == 1:
            continue
        met[s, t] = 1
        lower = upper = 0
        for e in range(c, count):
            low, high = min(node[e, 0], node[e, 1]), max(node[e, 0], node[e, 1])
            if strand[low] != s or strand[high] != t:
                continue
            for i in range(low, low + 2):
                for j in range(high, high + 2):
                    if attached[i] < 0 and attached[j] < 0 and not joined[i] and not joined[j]:
                        lower += mark[i, 0] != c
                        upper += mark[j, 1] != c
                        mark[i, 0] = mark[j, 1] = c
        fewer = 0 if lower <= upper else 1
        for i in range(mark.shape[0]):
            if mark[i, fewer] == c:
                mark[i, 2] = 1
    chosen = 0
    for i in range(mark.shape[0]):
        if mark[i, 2] == 1:
            for x in range(dimension):
                columns.column[row[i] + x] = dimension * chosen + x
            columns.row[chosen] = row[i]
            chosen += 1
    columns.counts[NODES] = chosen


@kernel
def condense_contacts_to_bodies(columns, attachments, strands, at, border):
    """Add the blocks between the edges of contacts, of nodes that free bodies hold, to these bodies' border and corner;
    see `engine.linear.attachments`.
    """
    if not columns.exists:
        return
    axes, arm, attached, free = strands.axes, at.arm, columns.attached, attachments.free
    for c in range(columns.counts[CONTACTS]):
        for pair in range(4):
            m, n = pair // 2, pair % 2
            i, j = columns.node[c, 0] + m, columns.node[c, 1] + n
            first, second = attached[i], attached[j]
            f = free[first] if first >= 0 else -1
            g = free[second] if second >= 0 else -1
            if f < 0 and g < 0:
                continue
            for x in range(axes.shape[0]):
                for y in range(axes.shape[0]):
                    value = _block(columns, c, m, 2 + n, x, y)
                    if f >= 0 and g >= 0:
                        for k in range(6):
                            for q in range(6):
                                turned = arm_jacobian(axes, arm, first, x, k) * value
                                turned *= arm_jacobian(axes, arm, second, y, q)
                                border.corner[6 * f + k, 6 * g + q] += turned
                                border.corner[6 * g + q, 6 * f + k] += turned
                    elif f >= 0 and second < 0:
                        for k in range(6):
                            turned = arm_jacobian(axes, arm, first, x, k) * value
                            border.border[strands.row[j] + y, 6 * f + k] += turned
                    elif g >= 0 and first < 0:
                        for k in range(6):
                            turned = arm_jacobian(axes, arm, second, y, k) * value
                            border.border[strands.row[i] + x, 6 * g + k] += turned


@piece(bool, Problem)
def move_to_border(p):
    """Move contact columns from the band to the border, and add to them what is between the edges of contacts; false if
    there is no capacity for them, but `BorderedSystem.width` is what it would be.
    """
    columns, bordered, strands = p.contact_columns, p.bordered, p.strands
    nodes, base = columns.counts[NODES], bordered.width[0]
    if columns.counts[CONTACTS] == 0 or (nodes == 0 and not p.joins.exists):
        return True
    if base + strands.dimension * nodes > bordered.load.shape[0]:
        bordered.width[0] = base + strands.dimension * nodes
        return False
    add_columns(bordered, strands.dimension * nodes)
    _move_from_band(columns, bordered, strands, base, p.system.band)
    _add_between(columns, p.joins, p.bodies.freedom, bordered, strands.row, base)
    return True


@kernel
def _move_from_band(columns, bordered, strands, base, band):
    """Move contact columns to the border and corner, those from `base` on; the band keeps those of the identity."""
    border, corner, slot = bordered.border, bordered.schur, columns.column
    bandwidth, nodes = strands.bandwidth, columns.counts[NODES]
    for k in range(nodes):
        for column in range(columns.row[k], columns.row[k] + strands.dimension):
            own = base + slot[column]
            for c in range(base):
                corner[c, own] = corner[own, c] = border[c, column]
                border[c, column] = 0.0
            for i in range(max(0, column - bandwidth), min(strands.size, column + bandwidth + 1)):
                value = band[column, i - column] if i >= column else band[i, column - i]
                if slot[i] >= 0:
                    corner[base + slot[i], own] = value
                else:
                    border[own, i] = value
    hold_unknowns(columns.row[:nodes], strands.dimension, bandwidth, band)


@kernel
def _column(columns, joins, freedom, base, row):
    """Return the border's column of a row of the band, −1 if it has none."""
    if joins.exists and joins.column[row] >= 0:
        return freedom.shape[1] + joins.column[row]
    return base + columns.column[row] if columns.column[row] >= 0 else -1


@kernel
def _add_between(columns, joins, freedom, bordered, node_row, base):
    """Add the blocks between the edges of contacts, of nodes that no body holds; one node of each has columns."""
    dimension, attached = columns.matrix.shape[1], columns.attached
    for c in range(columns.counts[CONTACTS]):
        for pair in range(4):
            m, n = pair // 2, pair % 2
            i, j = columns.node[c, 0] + m, columns.node[c, 1] + n
            if attached[i] >= 0 or attached[j] >= 0:
                continue
            for x in range(dimension):
                for y in range(dimension):
                    row, column = node_row[i] + x, node_row[j] + y
                    a = _column(columns, joins, freedom, base, row)
                    b = _column(columns, joins, freedom, base, column)
                    value = _block(columns, c, m, 2 + n, x, y)
                    if a >= 0 and b >= 0:
                        bordered.schur[a, b] += value
                        bordered.schur[b, a] += value
                    elif a >= 0:
                        bordered.border[a, column] += value
                    else:
                        bordered.border[b, row] += value


@kernel
def gather_columns(columns, bordered, right):
    """Move what is wanted of nodes with contact columns from the right-hand side to `BorderedSystem.load`."""
    if not columns.exists:
        return
    dimension, nodes = columns.matrix.shape[1], columns.counts[NODES]
    base = bordered.width[0] - dimension * nodes
    for k in range(nodes):
        for c in range(dimension):
            row = columns.row[k] + c
            bordered.load[base + dimension * k + c] = right[row]
            right[row] = 0.0


@kernel
def scatter_columns(columns, bordered, right):
    """Move the step of nodes with contact columns from `BorderedSystem.load` to that of all."""
    if not columns.exists:
        return
    dimension, nodes = columns.matrix.shape[1], columns.counts[NODES]
    base = bordered.width[0] - dimension * nodes
    for k in range(nodes):
        for c in range(dimension):
            right[columns.row[k] + c] = bordered.load[base + dimension * k + c]

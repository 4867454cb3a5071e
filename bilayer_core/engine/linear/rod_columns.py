"""Contact between rods in the Newton matrix.

A contact couples the edge (i, i+1) of a point with the edge (j, j+1) that it faces, which are far from each other in
the band. The blocks of either edge by itself stay in the band. For those between the two, the nodes of one of them
leave the band for the border, as those that a free body holds do (`engine.linear.attachments`): with S the unknowns
of these nodes and R all others,

    [ A_RR  A_RS ]        band: A_RR, rows of the identity for S
    [ A_SR  A_SS ]        border: U = A_RS,   corner: D = A_SS

Of each two strands in contact those nodes leave that are fewer. So the border has three columns for each of some
contacting nodes, and the cost stays linear in the number of nodes.
"""

from __future__ import annotations

from ...jit import kernel
from .assembly import hold_unknowns
from .attachments import arm_jacobian


@kernel
def take_contacts(
    axes,
    simplified,
    begin,
    count,
    node,
    weight,
    normal,
    lean,
    along,
    matrix,
    side,
    turn,
    node_out,
    weight_out,
    matrix_out,
    side_out,
    turn_out,
):
    """Append contacts to a list, with components along the unknowns of nodes.

    Parameters
    ----------
    axes : Array
        Directions of a node's unknowns, shape (dimension, 3).
    simplified : int
        1: leave out what is negative across the two edges; 2: all that is negative. Friction has nothing negative.
    begin : int
        Number of contacts in the list already.
    count, node, weight, normal, lean, along, matrix, side, turn
        See `forces.rod_contact.rod_barrier`.
    node_out, weight_out, matrix_out, side_out, turn_out : Array
        Written: as the inputs; M and a_m have components along `axes`.
    """
    dimension = axes.shape[0]
    for c in range(count):
        e = begin + c
        for n in range(2):
            node_out[e, n] = node[c, n]
        side_out[e] = side[c] if simplified < 2 else 0.0
        for n in range(4):
            weight_out[e, n] = weight[c, n]
            for a in range(dimension):
                turn_out[e, n, a] = axes[a, 0] * turn[c, n, 0] + axes[a, 1] * turn[c, n, 1] + axes[a, 2] * turn[c, n, 2]
        for a in range(dimension):
            a0, a1, a2 = axes[a, 0], axes[a, 1], axes[a, 2]
            m0 = a0 * matrix[c, 0, 0] + a1 * matrix[c, 1, 0] + a2 * matrix[c, 2, 0]
            m1 = a0 * matrix[c, 0, 1] + a1 * matrix[c, 1, 1] + a2 * matrix[c, 2, 1]
            m2 = a0 * matrix[c, 0, 2] + a1 * matrix[c, 1, 2] + a2 * matrix[c, 2, 2]
            if simplified > 0:
                n0, n1, n2 = normal[c, 0], normal[c, 1], normal[c, 2]
                u0, u1, u2 = along[c, 0], along[c, 1], along[c, 2]
                v0, v1, v2 = n1 * u2 - n2 * u1, n2 * u0 - n0 * u2, n0 * u1 - n1 * u0
                part = lean[c] * (a0 * v0 + a1 * v1 + a2 * v2)
                m0, m1, m2 = m0 - part * v0, m1 - part * v1, m2 - part * v2
                if simplified > 1:
                    part = lean[c] * (a0 * u0 + a1 * u1 + a2 * u2)
                    m0, m1, m2 = m0 - part * u0, m1 - part * u1, m2 - part * u2
            for b in range(dimension):
                matrix_out[e, a, b] = m0 * axes[b, 0] + m1 * axes[b, 1] + m2 * axes[b, 2]


@kernel
def _block(c, m, n, row, column, weight, matrix, side, turn):
    """Entry of the second derivative of contact c by component `row` of its node m and `column` of its node n."""
    value = weight[c, m] * weight[c, n] * matrix[c, row, column]
    return value - side[c] * turn[c, m, row] * turn[c, n, column]


@kernel
def add_own_edges(count, node, weight, matrix, side, turn, node_unknown, band_out):
    """Add the blocks of either edge of each contact by itself to the band."""
    for c in range(count):
        for pair in range(2):
            first = node[c, pair]
            for m in range(2):
                for n in range(m + 1):
                    row, column = node_unknown[first + m], node_unknown[first + n]
                    for x in range(matrix.shape[1]):
                        for y in range(x + 1 if m == n else matrix.shape[1]):
                            value = _block(c, 2 * pair + m, 2 * pair + n, x, y, weight, matrix, side, turn)
                            band_out[column + y, row + x - column - y] += value


@kernel
def choose_leaving(count, node, strand, attached, mark, met, node_unknown, dimension, leaving_out, place_out):
    """Of each two strands in contact (or halves of one) the nodes that are fewer leave the band; return how many do.

    Parameters
    ----------
    count, node
        Of contacts.
    strand, attached : Array
        Strand of each node, and its place among those that bodies hold, which are in the border already (−1: no body
        does), shape (n_node,).
    mark, met : Array
        Scratch, int64, shapes (n_node, 3), (n_strand, n_strand).
    node_unknown : Array
        Row of each node, shape (n_node,).
    leaving_out : Array
        Written: rows of the nodes, ascending, shape (n_node,).
    place_out : Array
        Written: number of each unknown among those that leave, −1 for others, shape (size,).
    """
    mark[:] = -1
    met[:] = 0
    place_out[:] = -1
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
                    if attached[i] < 0 and attached[j] < 0:
                        lower += mark[i, 0] != c
                        upper += mark[j, 1] != c
                        mark[i, 0] = mark[j, 1] = c
        side = 0 if lower <= upper else 1
        for i in range(mark.shape[0]):
            if mark[i, side] == c:
                mark[i, 2] = 1
    leaving = 0
    for i in range(mark.shape[0]):
        if mark[i, 2] == 1:
            for x in range(dimension):
                place_out[node_unknown[i] + x] = dimension * leaving + x
            leaving_out[leaving] = node_unknown[i]
            leaving += 1
    return leaving


@kernel
def add_to_bodies(
    axes,
    count,
    node,
    weight,
    matrix,
    side,
    turn,
    attached,
    attached_free,
    arm,
    node_unknown,
    border_out,
    corner_out,
):
    """Add the blocks between the edges of contacts, of nodes that free bodies hold, to these bodies' border and corner;
    see `engine.linear.attachments`.
    """
    dimension = axes.shape[0]
    for c in range(count):
        for m in range(2):
            for n in range(2):
                i, j = node[c, 0] + m, node[c, 1] + n
                first, second = attached[i], attached[j]
                f = attached_free[first] if first >= 0 else -1
                g = attached_free[second] if second >= 0 else -1
                if f < 0 and g < 0:
                    continue
                for x in range(dimension):
                    for y in range(dimension):
                        value = _block(c, m, 2 + n, x, y, weight, matrix, side, turn)
                        if f >= 0 and g >= 0:
                            for k in range(6):
                                for q in range(6):
                                    turned = arm_jacobian(axes, arm, first, x, k) * value
                                    turned *= arm_jacobian(axes, arm, second, y, q)
                                    corner_out[6 * f + k, 6 * g + q] += turned
                                    corner_out[6 * g + q, 6 * f + k] += turned
                        elif f >= 0 and second < 0:
                            for k in range(6):
                                turned = arm_jacobian(axes, arm, first, x, k) * value
                                border_out[node_unknown[j] + y, 6 * f + k] += turned
                        elif g >= 0 and first < 0:
                            for k in range(6):
                                turned = arm_jacobian(axes, arm, second, y, k) * value
                                border_out[node_unknown[i] + x, 6 * g + k] += turned


@kernel
def leave_band(leaving, unknown, dimension, place, half_bandwidth, size, base, border, corner, band):
    """Move nodes from the band to the border and corner, whose columns from `base` on are theirs.

    Parameters
    ----------
    leaving, unknown, place
        From `choose_leaving`.
    dimension, half_bandwidth, size, base : int
    border, corner : Array
        Before: of bodies' freedom, the first `base` columns. Changed.
    band : Array
        See `engine.linear.band`; rows and columns of nodes that leave become those of the identity.
    """
    columns = base + dimension * leaving
    for i in range(border.shape[0]):
        for c in range(base, columns):
            border[i, c] = 0.0
    for i in range(columns):
        for c in range(base, columns):
            corner[i, c] = 0.0
    for k in range(leaving):
        for column in range(unknown[k], unknown[k] + dimension):
            own = base + place[column]
            for c in range(base):
                corner[c, own] = corner[own, c] = border[column, c]
                border[column, c] = 0.0
            for i in range(max(0, column - half_bandwidth), min(size, column + half_bandwidth + 1)):
                value = band[column, i - column] if i >= column else band[i, column - i]
                if place[i] >= 0:
                    corner[base + place[i], own] = value
                else:
                    border[i, own] = value
    hold_unknowns(unknown[:leaving], dimension, half_bandwidth, band)


@kernel
def add_between(count, node, weight, matrix, side, turn, attached, node_unknown, place, base, border_out, corner_out):
    """Add the blocks between the edges of contacts, of nodes that no body holds; one node of each has left the band."""
    for c in range(count):
        for m in range(2):
            for n in range(2):
                i, j = node[c, 0] + m, node[c, 1] + n
                if attached[i] >= 0 or attached[j] >= 0:
                    continue
                for x in range(matrix.shape[1]):
                    for y in range(matrix.shape[1]):
                        row, column = node_unknown[i] + x, node_unknown[j] + y
                        a, b = place[row], place[column]
                        value = _block(c, m, 2 + n, x, y, weight, matrix, side, turn)
                        if a >= 0 and b >= 0:
                            corner_out[base + a, base + b] += value
                            corner_out[base + b, base + a] += value
                        elif a >= 0:
                            border_out[column, base + a] += value
                        else:
                            border_out[row, base + b] += value

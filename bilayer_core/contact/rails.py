"""Where rods meet other rods: along *rails*, in the middle between their faces.

The curve of a rod lies on its neutral axis; where layers differ that is not the middle of its section, which is at the
height h over it. A section that is wider than thick reaches to both sides by b = ½ (width − thickness). The rails of a
node i are at

    y_i = x_i + mean of A over the edges before and after,   A = h m1 ± b m2

(at an end the one edge), and a rod meets others with the bilinear *facets* between its rails, or with the segments
between them where there is one, half its thickness away from these: with either face where the face is. Without arms
the rails are the nodes.

**In a step** an edge e with the ends' step δe turns its frame by |ω| ≤ 1.3 |ṫ| + |δθ| (`contact.step_bound`), and |ṫ| ≤
σ/(1 − α σ) with σ = |δe|/|e| over the part α of the step. So the rail goes no farther than its node by α times its
*swing*, |A| |ω|; α is at most 1/(2 σ) of any edge with an arm.
"""

from __future__ import annotations

import math

from bilayer_core.contact.step_bound import square_of_change
from bilayer_core.jit import kernel
from bilayer_core.jit.called import flat
from bilayer_core.kinematics.vector import POSITIVE, combine, cross, dot, row

LARGEST_SLOPE = 0.5
"""Of α σ."""


@kernel
def place_rails(rails, at):
    """Write the positions of rails [m], shape (n_rail, 3)."""
    up, aside = flat(rails.by_component[0]), flat(rails.by_component[1])
    for b in range(rails.block.shape[0]):
        r, i, count = rails.block[b, 0] & POSITIVE, rails.block[b, 1] & POSITIVE, rails.block[b, 4] & POSITIVE
        before, after = rails.block[b, 2] & POSITIVE, rails.block[b, 3] & POSITIVE
        place, node = flat(rails.place[r : r + count]), flat(at.position[i : i + count])
        m1, m1_after = flat(at.director1[before : before + count]), flat(at.director1[after : after + count])
        h = up[3 * r : 3 * (r + count)]
        for n in range(3 * count):
            place[n] = node[n] + h[n] * (m1[n] + m1_after[n])
        if rails.node.shape[0] == rails.node_edges.shape[0]:  # no rod has borders
            continue
        m2, m2_after = flat(at.director2[before : before + count]), flat(at.director2[after : after + count])
        w = aside[3 * r : 3 * (r + count)]
        for n in range(3 * count):
            place[n] += w[n] * (m2[n] + m2_after[n])


@kernel
def has_arm(rails, r):
    """Return whether a rail is off its node."""
    return rails.arm[r, 0] != 0.0 or rails.arm[r, 1] != 0.0


@kernel
def _square_of_arm(rails, r):
    """Return |A|² of a rail [m²]."""
    return rails.arm[r, 0] ** 2 + rails.arm[r, 1] ** 2


@kernel
def most_of_swing(rails, strands, system, at):
    """Return the largest part of a step over which the bounds of turning hold, and a bound of all swings in it [m]."""
    steepest = slope = turn = 0.0  # squares; the last two times that of an arm
    for e in range(strands.edge_node.shape[0]):
        n = strands.edge_node[e]
        arm = max(_square_of_arm(rails, n), _square_of_arm(rails, n + 1))
        if arm > 0.0:
            own = square_of_change(strands, system, e) / (at.length[e] * at.length[e])
            steepest, slope = max(steepest, own), max(slope, arm * own)
            turn = max(turn, arm * system.angle_step[e] ** 2)
    steepest = math.sqrt(steepest)
    part = LARGEST_SLOPE / steepest if steepest > LARGEST_SLOPE else 1.0
    return part, 1.3 * math.sqrt(slope) / (1.0 - part * steepest) + math.sqrt(turn)


@kernel
def swing_of(rails, strands, system, at, part, r):
    """Return the swing of a rail in a part of a step [m]."""
    turn = 0.0
    if has_arm(rails, r):
        for side in range(2):
            e = rails.node_edges[rails.node[r], side]
            slope = math.sqrt(square_of_change(strands, system, e)) / at.length[e]
            turn = max(turn, 1.3 * slope / (1.0 - part * slope) + abs(system.angle_step[e]))
    return math.sqrt(_square_of_arm(rails, r)) * turn


@kernel
def rail_in_step(rails, strands, system, at, r, part):
    """Return where a rail is by a part of a step, as a tuple: directors go with the tangents of their edges by parallel
    transport, and turn about them.
    """
    step, i = system.node_step, rails.node[r]
    y0 = at.position[i, 0] + part * step[i, 0]
    y1 = at.position[i, 1] + part * step[i, 1]
    y2 = at.position[i, 2] + part * step[i, 2]
    if not has_arm(rails, r):
        return y0, y1, y2
    for side in range(2):
        e = rails.node_edges[i, side]
        n, t, length = strands.edge_node[e], row(at.tangent, e), at.length[e]
        m = combine(0.5 * rails.arm[r, 0], row(at.director1, e), 0.5 * rails.arm[r, 1], row(at.director2, e))
        u0 = length * t[0] + part * (step[n + 1, 0] - step[n, 0])
        u1 = length * t[1] + part * (step[n + 1, 1] - step[n, 1])
        u2 = length * t[2] + part * (step[n + 1, 2] - step[n, 2])
        size = math.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
        u = u0 / size, u1 / size, u2 / size
        scale = dot(m, u) / (1.0 + dot(t, u))
        m = m[0] - scale * (t[0] + u[0]), m[1] - scale * (t[1] + u[1]), m[2] - scale * (t[2] + u[2])
        angle = part * system.angle_step[e]
        cosine, sine, other = math.cos(angle), math.sin(angle), cross(u, m)
        y0 += cosine * m[0] + sine * other[0]
        y1 += cosine * m[1] + sine * other[1]
        y2 += cosine * m[2] + sine * other[2]
    return y0, y1, y2


@kernel
def write_rail_steps(rails, strands, system, at, part):
    """Write the mean rate of rails over a part of a step, in units of the step [m]; `place` is up to date."""
    for i in range(rails.node.shape[0]):
        y0, y1, y2 = rail_in_step(rails, strands, system, at, i, part)
        rails.step[i, 0] = (y0 - rails.place[i, 0]) / part
        rails.step[i, 1] = (y1 - rails.place[i, 1]) / part
        rails.step[i, 2] = (y2 - rails.place[i, 2]) / part

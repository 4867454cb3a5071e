"""Quadratic drag of a fluid at rest or in uniform flow, once for the whole section of a rod.

    F = −½ ρ_f Δl (w C∥ |v_t| v_t t + w C⊥ |v₁| v₁ m1 + h C⊥ |v₂| v₂ m2)        (paper, eq. 27)

v is the velocity relative to the fluid, v_t, v₁, v₂ its components along the tangent, through the thickness and
across the width; w is the width, h the thickness of the section, Δl the Voronoi length; the layers of a section share
its drag. (The paper has the width for the sideways part as well, a flat ribbon's broad face.)

With the directions held fixed each component has a convex dissipation potential in the displacement u over a stage of
length h_t, v = u/h_t − U (U the flow):

    D = h_t ρ_f A C |v·n|³/6,    ∂D/∂u = ½ ρ_f A C |v·n| (v·n) n,    ∂²D/∂u² = ρ_f A C |v·n|/h_t n nᵀ

It acts at the middle of the section. Where that is off the curve of a laminate, the halves of edges at a node each
carry half of it at y = x + z m1, and v is ẏ (`forces.raised`).

The drag is implicit: it cannot overshoot, however long the step. The directions move along with Newton's corrections
and end as those at the end of the stage, so that the drag has the integrator's order: held at the start of the step,
they made the stroke of a swimmer 6 % wrong at 1 ms with any integrator.
"""

from __future__ import annotations

import math

from bilayer_core.forces.raised import director_motion
from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.vector import add_row, add_upper_outer_sum, combine, combine3, cross, dot, row, scaled
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import Flow
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

DRAG = slot_of("drag")


@kernel
def node_directions(before, after, at):
    """Return the mean of the directions t, m1, m2 of the edges before and after a node (the same at an end),
    orthonormal.
    """
    return mixed_directions(before, 0.5, after, 0.5, at)


@kernel
def mixed_directions(before, part_before, after, part_after, at):
    """Return the directions t, m1, m2 that are mixed of those of two edges, orthonormal."""
    t = combine(part_before, row(at.tangent, before), part_after, row(at.tangent, after))
    t = scaled(1.0 / math.sqrt(dot(t, t)), t)
    m = combine(part_before, row(at.director1, before), part_after, row(at.director1, after))
    m = combine(1.0, m, -dot(m, t), t)
    m = scaled(1.0 / math.sqrt(dot(m, m)), m)
    return t, m, cross(t, m)


@piece(float, Flow, Problem, Configuration, Stage, bool)
def add_drag(flow, p, at, stage, with_hessian):
    """Add the dissipation potential of drag and its derivatives by nodes."""
    sums, h = p.sums, stage.length
    if not sums.selected[DRAG]:
        return math.inf
    node, coefficient, direction, flow_velocity = flow.node, flow.coefficient, flow.direction, flow.velocity
    position, origin, gradient, hessian = at.position, stage.origin_position, sums.node, sums.node_hessian
    energy = lost = supplied = 0.0
    u = flow_velocity[0], flow_velocity[1], flow_velocity[2]
    for k in range(node.shape[0]):
        i = node[k]
        v = (
            (position[i, 0] - origin[i, 0]) / h - flow_velocity[0],
            (position[i, 1] - origin[i, 1]) / h - flow_velocity[1],
            (position[i, 2] - origin[i, 2]) / h - flow_velocity[2],
        )
        r = flow.raised[k]
        if r >= 0:
            v = combine(1.0, v, p.raised.middle[r] / h, director_motion(p.raised, at, stage, r))
        t, m, n = row(direction[k], 0), row(direction[k], 1), row(direction[k], 2)
        vt, vm, vn = dot(v, t), dot(v, m), dot(v, n)
        ct, cm, cn = coefficient[k, 0] * abs(vt), coefficient[k, 1] * abs(vm), coefficient[k, 2] * abs(vn)
        energy += h * (ct * vt * vt + cm * vm * vm + cn * vn * vn) / 6.0
        resistance = combine3(ct * vt, t, cm * vm, m, cn * vn, n)
        lost += 0.5 * dot(resistance, v)
        supplied -= 0.5 * dot(resistance, u)
        add_row(gradient, i, 0.5, resistance)
        if r >= 0:
            add_row(sums.pull, r, 0.5 * p.raised.middle[r], resistance)
        if with_hessian:
            t_, m_, n_ = scaled(ct, t), scaled(cm, m), scaled(cn, n)
            add_upper_outer_sum(hessian, i, 1.0 / h, t_, t, m_, m, n_, n)
            if r >= 0:
                add_upper_outer_sum(sums.raised_hessian, 2 * r + flow.half[k], 1.0 / h, t_, t, m_, m, n_, n)
    sums.energy[DRAG], sums.lost[DRAG], sums.supplied[DRAG] = energy, lost, supplied
    return math.inf


@piece(bool, Flow, Problem, Configuration, Stage)
def update_directions_of_drag(flow, p, at, stage):
    """Take the directions of drag from a configuration; whether there are any."""
    direction = flow.direction
    for k in range(flow.node.shape[0]):
        t, m, n = node_directions(flow.edge_before[k], flow.edge_after[k], at)
        for c in range(3):
            direction[k, 0, c], direction[k, 1, c], direction[k, 2, c] = t[c], m[c], n[c]
    return flow.node.shape[0] > 0

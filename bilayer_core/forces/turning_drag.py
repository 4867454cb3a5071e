"""Quadratic drag of a fluid on ribbons that turn about their axis.

A point of a flat plate at y across its width w moves with ω y through the fluid and feels ½ ρ_f C |ω y| ω y per area.
The moment about the axis of a length l is

    M = −½ ρ_f C l |ω| ω ∫ |y|³ dy = −c |ω| ω,    c = ρ_f C l w⁴/64

which the layers of a section share in proportion to their thickness. The drag of the motion of the axis
(`forces.drag`) is taken as if the plate did not turn, this one as if its axis rested.

Over a stage of length h, ω = θ/h with the turn θ since its origin, it has the convex dissipation potential

    D = h c |ω|³/3,    ∂D/∂θ = c |ω| ω,    ∂²D/∂θ² = 2 c |ω|/h
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.jit import piece, record
from bilayer_core.jit.record import Vector
from bilayer_core.model.bend_faces import whole_section
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.model import Model
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

TURNING_DRAG = slot_of("turning drag")


@record
class TurningFlow:
    """Resistance of edges that turn against a fluid."""

    coefficient: Vector  # c of each edge [kg m²], shape (n_edge,)


@piece(float, TurningFlow, Problem, Configuration, Stage, bool)
def add_turning_drag(flow, p, at, stage, with_hessian):
    """Add the dissipation potential of turning edges and its derivatives by their angles."""
    sums, h, coefficient = p.sums, stage.length, flow.coefficient
    if not sums.selected[TURNING_DRAG]:
        return math.inf
    lost = 0.0
    for k in range(coefficient.shape[0]):
        spin = (at.total_angle[k] - stage.origin_angle[k]) / h
        moment = coefficient[k] * abs(spin) * spin
        lost += moment * spin
        sums.edge[k, 3] += moment
        if with_hessian:
            sums.edge_hessian[k, 3, 3] += 2.0 * coefficient[k] * abs(spin) / h
    sums.energy[TURNING_DRAG], sums.lost[TURNING_DRAG] = h * lost / 3.0, lost
    return math.inf


def turning_flow_of(model: Model) -> TurningFlow:
    """Return what turns against the fluid of a model; absent without any."""
    fluid = model.scene.fluid
    if fluid is None or fluid.drag_turning == 0.0:
        return TurningFlow.absent()
    (widest, whole), coefficient = whole_section(model), np.zeros(model.rods.edge_count)
    for strand in model.strands:
        nodes = slice(strand.first_node, strand.first_node + strand.node_count)
        share, width = strand.thickness / whole[nodes], widest[nodes]
        if strand.round:
            continue  # a round rod turns about its axis without pushing the fluid
        at_edges = [0.5 * (of[1:] + of[:-1]) for of in (share, width)]
        own = slice(strand.first_edge, strand.first_edge + strand.node_count - 1)
        coefficient[own] = at_edges[0] * at_edges[1] ** 4 * model.rods.rest_length[own]
        if strand.closed:
            coefficient[own.stop - 1] = 0.0
    return TurningFlow(coefficient=fluid.density * fluid.drag_turning / 64.0 * coefficient)

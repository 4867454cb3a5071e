"""Stretching of an edge with eigenstrain.

    S = ½ EA (ε − η)² |ē|,   ε = |e|/|ē| − 1        (paper, eqs. 3 and 4; η subtracted, weight the rest length)

With n = EA (ε − η) the axial force, t the tangent and P = I − t tᵀ:

    ∂S/∂e = n t,   ∂²S/∂e² = EA/|ē| t tᵀ + n/|e| P
"""

from __future__ import annotations

import math

from bilayer_core.forces.elements import acts_viscously
from bilayer_core.jit import piece
from bilayer_core.kinematics.vector import add_row, add_upper_outer, add_upper_projector, row
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import Space
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

STRETCHING = slot_of("stretching")


@piece(float, Space, Problem, Configuration, Stage, bool)
def add_stretching(_, p, at, stage, with_hessian):
    """Add the stretching of every edge and its derivatives by edge vectors."""
    strands, sums = p.strands, p.sums
    if not (sums.selected[STRETCHING] or acts_viscously(p)):
        return math.inf
    stiffness, rest_length, neutral = stage.axial_stiffness, strands.rest_length, stage.neutral_edge
    length, tangent, gradient, hessian = at.length, at.tangent, sums.edge, sums.edge_hessian
    energy = 0.0
    for k in range(strands.edge_count):
        strain = length[k] / rest_length[k] - 1.0 - neutral[k]
        force = stiffness[k] * strain
        energy += 0.5 * force * strain * rest_length[k]
        t = row(tangent, k)
        add_row(gradient, k, force, t)
        if with_hessian:
            add_upper_outer(hessian, k, stiffness[k] / rest_length[k], t)
            add_upper_projector(hessian, k, force / length[k], t)
    sums.energy[STRETCHING] = energy
    return math.inf

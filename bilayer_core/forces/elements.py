"""Elements of elasticity, ½ k (s − s̄)² each: their strains s, and their stiffnesses k and rest strains s̄ over a stage.

Elements are the stretching of edges, two bendings and the twist of joints, and the springs between two layers. Forces
that are not selected have the stiffness 0, and those with viscosity another stiffness and another rest strain
(`forces.viscosity`): so `start_elements` writes both at the start of every stage.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.vector import angle, combine, dot, row
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage

STRETCHING, BENDING, TWISTING, BOND, VISCOSITY = map(
    slot_of, ("stretching", "bending", "twisting", "bond", "viscosity")
)
TWO_PI = 2.0 * math.pi


@kernel
def acts_viscously(p):
    """Return whether viscosity exists and is selected."""
    return p.viscosity.exists and p.sums.selected[VISCOSITY]


@kernel
def strains_of_pair(strands, bonds, at, k):
    """Return the components of the vector between two layers along the frames of its two edges; see `forces.bond`."""
    x, position, node = bonds.joint[k], at.position, bonds.node
    a, b, wa, wb = strands.joint_a[x], strands.joint_b[x], bonds.weight[k, 0], bonds.weight[k, 1]
    above = combine(0.5, row(position, node[k, 0]), 0.5, row(position, node[k, 1]))
    below = combine(0.5, row(position, node[k, 2]), 0.5, row(position, node[k, 3]))
    p = combine(1.0, above, -1.0, below)
    return (
        wa * dot(p, row(at.director1, a)) + wb * dot(p, row(at.director1, b)),
        wa * dot(p, row(at.director2, a)) + wb * dot(p, row(at.director2, b)),
        wa * dot(p, row(at.tangent, a)) + wb * dot(p, row(at.tangent, b)),
    )


@kernel
def strains_of_joint(strands, at, k):
    """Return κ₁, κ₂ and ψ of a joint. Whole turns of ψ are those of `Configuration.joint_strain`."""
    i, j = strands.joint_a[k], strands.joint_b[k]
    a, b = row(at.tangent, i), row(at.tangent, j)
    m1a, m2a, m1b = row(at.director1, i), row(at.director2, i), row(at.director1, j)
    ic = 1.0 / (1.0 + dot(a, b))
    p1, p2, q1 = dot(b, m1a), dot(b, m2a), dot(a, m1b)
    psi = angle(dot(m1a, m1b) - p1 * q1 * ic, dot(m2a, m1b) - p2 * q1 * ic)
    psi += TWO_PI * math.floor((at.joint_strain[k, 2] - psi) / TWO_PI + 0.5)
    return (p1 - q1) * ic, (p2 - dot(a, row(at.director2, j))) * ic, psi


@kernel
def measure_strains(p, at, strain_out):
    """Write the strains of all elements: ε of edges, κ₁ − Σ b ε, κ₂ and ψ of joints, and p·m̄_α between layers; nothing
    without viscosity.

    Shape (n_edge + 3 n_joint + 3 n_pair,) or (0,).
    """
    if not p.viscosity.exists:
        return
    strands, off_axis, edges = p.strands, p.off_axis, p.strands.edge_count
    for e in range(edges):
        strain_out[e] = at.length[e] / strands.rest_length[e] - 1.0
    for k in range(strands.joint_a.shape[0]):
        kappa1, kappa2, psi = strains_of_joint(strands, at, k)
        strain_out[edges + 3 * k] = kappa1
        strain_out[edges + 3 * k + 1] = kappa2
        strain_out[edges + 3 * k + 2] = psi
    begin = edges + 3 * strands.joint_a.shape[0]
    for k in range(p.bonds.joint.shape[0]):
        first, second, third = strains_of_pair(strands, p.bonds, at, k)
        strain_out[begin + 3 * k] = first
        strain_out[begin + 3 * k + 1] = second
        strain_out[begin + 3 * k + 2] = third
    for i in range(off_axis.joint.shape[0]):
        k = off_axis.joint[i]
        for side in range(2):
            slope = off_axis.slope[i, side]
            if slope != 0.0:
                e = strands.joint_a[k] if side == 0 else strands.joint_b[k]
                strain_out[edges + 3 * k] -= slope * (at.length[e] - strands.rest_length[e])


@kernel
def slot_of_pair(strands, k, c):
    """Return the force to which component c of the vector between layers k belongs."""
    return BOND if k < strands.joint_a.shape[0] - strands.bend_count else TWISTING if c == 1 else BENDING


@kernel
def multiple_of_edge(p, stage, e):
    """Return the multiple of the stiffness of an edge; see `forces.moduli`."""
    return stage.rest_joint[p.moduli.edge[e], 0] if p.moduli.exists else 1.0


@kernel
def multiple_of_joint(p, stage, k, c):
    """Return that of component c of a joint."""
    if not p.moduli.exists:
        return 1.0
    if k < p.strands.bend_count:
        return stage.rest_joint[p.moduli.joint[k], 0]
    if c != 1:
        return 1.0
    first = multiple_of_edge(p, stage, p.strands.joint_a[k])
    second, share = multiple_of_edge(p, stage, p.strands.joint_b[k]), p.moduli.share[k]
    return first * second / (share * first + (1.0 - share) * second)


@kernel
def multiple_of_pair(p, stage, k):
    """Return that of a vector between layers."""
    return stage.rest_joint[p.moduli.pair[k], 0] if p.moduli.exists else 1.0


@kernel
def act_together(elastic, beta, rest, origin):
    """Return 1 + β for elasticity, if selected, and viscosity, and the strain from which they act together."""
    weight = beta + elastic
    if weight == 0.0:
        return 0.0, 0.0
    return weight, (elastic * rest + beta * origin) / weight


@piece(int, int, Problem, Configuration, Stage)
def start_elements(_, p, start, stage):
    """Write the stiffness of elements over a stage and their rest strains, of those forces that are selected."""
    strands, viscosity, selected, edges = p.strands, p.viscosity, p.sums.selected, p.strands.edge_count
    viscous, length = acts_viscously(p), stage.length
    beta = origin = 0.0
    for e in range(edges):
        elastic = multiple_of_edge(p, stage, e) * selected[STRETCHING]
        if viscous:
            beta, origin = viscosity.edge_time[e] / length, stage.origin_strain[e]
        weight, rest = act_together(elastic, beta, stage.rest_edge[e], origin)
        stage.axial_stiffness[e], stage.neutral_edge[e] = weight * strands.axial_stiffness[e], rest
    bends, twists, ties = 1.0 * selected[BENDING], 1.0 * selected[TWISTING], 1.0 * selected[BOND]
    for k in range(strands.joint_a.shape[0]):
        for c in range(3):
            elastic = ties if k >= strands.bend_count else twists if c == 2 else bends
            elastic *= multiple_of_joint(p, stage, k, c)
            if viscous:
                beta, origin = viscosity.joint_time[k, c] / length, stage.origin_strain[edges + 3 * k + c]
            weight, rest = act_together(elastic, beta, stage.rest_joint[k, c], origin)
            stage.joint_stiffness[k, c], stage.neutral_joint[k, c] = weight * strands.joint_stiffness[k, c], rest
    bonds, begin = p.bonds, edges + 3 * strands.joint_a.shape[0]
    for k in range(bonds.joint.shape[0]):
        for c in range(3):
            if viscous:
                beta, origin = viscosity.pair_time[k, c] / length, stage.origin_strain[begin + 3 * k + c]
            elastic = multiple_of_pair(p, stage, k) * selected[slot_of_pair(strands, k, c)]
            weight, rest = act_together(elastic, beta, bonds.rest[k, c], origin)
            stage.pair_stiffness[k, c], stage.neutral_pair[k, c] = weight * bonds.stiffness[k, c], rest
    return READY

"""Kelvin–Voigt viscosity: stress that follows the rate of strain, τ times the stiffness.

A layer of retardation time τ has the stress E (ε − η + τ ε̇), and so in bending and in twist: every element of
elasticity ½ k (s − s̄)², its strain s, has the dissipation ½ k τ ṡ² with it. The strain is the total one. What a
stimulus adds, s̄, costs no viscous stress, however fast it jumps; and a rigid motion leaves all s as they are.

Over a stage strains advance as positions do (`integrators.method`): from an origin s° = sₙ + h Σ aᵢⱼ ṡⱼ, with
ṡⱼ = (sⱼ − s°ⱼ)/(γ h) of earlier stages, by ṡ = (s − s°)/(γ h). That is the strain's own origin, not the strain of the
origin of positions, which in a rigid rotation differs from s. The stage minimises

    ½ k (s − s̄)² + ½ k β (s − s°)² = ½ k (1 + β) (s − s′)² + const,   β = τ/(γ h),   s′ = (s̄ + β s°)/(1 + β)

so viscosity needs no elements of its own: those of elasticity have another stiffness and another rest strain
(`start_elements`), and energies are told apart afterwards (`add_viscosity`). Derivatives are theirs.

Order. s(qᵢ) = sₙ + h Σ aᵢⱼ ṡⱼ defines ṡᵢ, whose difference eᵢ from the rate of s along the stage, ∂s/∂q·vᵢ, obeys
h Σ aᵢⱼ eⱼ = ½ s″ v² (cᵢ² h² − 2 h² Σ aᵢⱼ cⱼ) + O(h³). At the end of the step of a method of order 2 that bracket is
zero: so Σ bⱼ eⱼ = O(h²), momenta and positions get no more than O(h³) in a step, and the order stays.

Of a bond only the shear that the torsion of the strip needs, k_φ, is that of a material; as a series of two layers
with the shear thicknesses a and b, k ∝ a b/(a + b), its retardation time is (τ_a b + τ_b a)/(a + b). The other springs
of a bond hold the layers together, and have no viscosity; the elements at the ends of layers have that of the layer.
"""

from __future__ import annotations

import math

from ..jit import kernel, piece
from ..kinematics.vector import angle, combine, dot, row
from ..model.force_slots import slot_of
from ..model.records.problem import Problem
from ..model.records.status import READY
from ..model.records.step import Configuration, Stage

STRETCHING, BENDING, TWISTING, BOND, VISCOSITY = map(
    slot_of, ("stretching", "bending", "twisting", "bond", "viscosity")
)
TWO_PI = 2.0 * math.pi


@kernel
def acts_viscously(p):
    """Whether viscosity is there, and selected."""
    return p.viscosity.exists and p.sums.selected[VISCOSITY]


@kernel
def _of_pair(strands, bonds, at, k):
    """Components of the vector between two layers along the frames of its two edges; see `forces.bond`."""
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
def measure_strains(p, at, strain_out):
    """Strains of all elements: ε of edges, κ₁ − Σ b ε, κ₂ and ψ of joints, and p·m̄_α between layers; nothing without
    viscosity.

    Shape (n_edge + 3 n_joint + 3 n_pair,) or (0,). Whole turns of ψ are those of `Configuration.joint_strain`.
    """
    if not p.viscosity.exists:
        return
    strands, off_axis, edges = p.strands, p.off_axis, p.strands.edge_count
    for e in range(edges):
        strain_out[e] = at.length[e] / strands.rest_length[e] - 1.0
    for k in range(strands.joint_a.shape[0]):
        i, j = strands.joint_a[k], strands.joint_b[k]
        a, b = row(at.tangent, i), row(at.tangent, j)
        m1a, m2a, m1b = row(at.director1, i), row(at.director2, i), row(at.director1, j)
        ic = 1.0 / (1.0 + dot(a, b))
        p1, p2, q1 = dot(b, m1a), dot(b, m2a), dot(a, m1b)
        psi = angle(dot(m1a, m1b) - p1 * q1 * ic, dot(m2a, m1b) - p2 * q1 * ic)
        psi += TWO_PI * math.floor((at.joint_strain[k, 2] - psi) / TWO_PI + 0.5)
        strain_out[edges + 3 * k] = (p1 - q1) * ic
        strain_out[edges + 3 * k + 1] = (p2 - dot(a, row(at.director2, j))) * ic
        strain_out[edges + 3 * k + 2] = psi
    begin = edges + 3 * strands.joint_a.shape[0]
    for k in range(p.bonds.joint.shape[0]):
        first, second, third = _of_pair(strands, p.bonds, at, k)
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
def _slot_of_pair(strands, k, c):
    """The force that component c of the vector between layers k belongs to."""
    return BOND if k < strands.joint_a.shape[0] - strands.bend_count else TWISTING if c == 1 else BENDING


@kernel
def _act_together(elastic, beta, rest, origin):
    """Of elasticity, if selected, and viscosity: 1 + β, and the strain from which they act together."""
    weight = beta + elastic
    if weight == 0.0:
        return 0.0, 0.0
    return weight, (elastic * rest + beta * origin) / weight


@piece(int, int, Problem, Configuration, Stage)
def start_elements(_, p, start, stage):
    """Write the stiffness of elements over a stage and their rest strains, of those forces that are selected."""
    strands, viscosity, selected, edges = p.strands, p.viscosity, p.sums.selected, p.strands.edge_count
    viscous, length = acts_viscously(p), stage.lengths[0]
    elastic, beta, origin = 1.0 * selected[STRETCHING], 0.0, 0.0
    for e in range(edges):
        if viscous:
            beta, origin = viscosity.edge_time[e] / length, stage.origin_strain[e]
        weight, rest = _act_together(elastic, beta, stage.rest_edge[e], origin)
        stage.axial_stiffness[e], stage.neutral_edge[e] = weight * strands.axial_stiffness[e], rest
    bends, twists, ties = 1.0 * selected[BENDING], 1.0 * selected[TWISTING], 1.0 * selected[BOND]
    for k in range(strands.joint_a.shape[0]):
        for c in range(3):
            elastic = ties if k >= strands.bend_count else twists if c == 2 else bends
            if viscous:
                beta, origin = viscosity.joint_time[k, c] / length, stage.origin_strain[edges + 3 * k + c]
            weight, rest = _act_together(elastic, beta, stage.rest_joint[k, c], origin)
            stage.joint_stiffness[k, c], stage.neutral_joint[k, c] = weight * strands.joint_stiffness[k, c], rest
    bonds, begin = p.bonds, edges + 3 * strands.joint_a.shape[0]
    for k in range(bonds.joint.shape[0]):
        for c in range(3):
            if viscous:
                beta, origin = viscosity.pair_time[k, c] / length, stage.origin_strain[begin + 3 * k + c]
            elastic = 1.0 * selected[_slot_of_pair(strands, k, c)]
            weight, rest = _act_together(elastic, beta, bonds.rest[k, c], origin)
            stage.pair_stiffness[k, c], stage.neutral_pair[k, c] = weight * bonds.stiffness[k, c], rest
    return READY


@kernel
def _energies(stiffness, elastic, beta, strain, rest, origin):
    """What elasticity has less than was counted for both together, and what viscosity has [J]."""
    weight, neutral = _act_together(elastic, beta, rest, origin)
    of_elasticity = 0.5 * elastic * stiffness * (strain - rest) ** 2
    of_viscosity = 0.5 * beta * stiffness * (strain - origin) ** 2
    return of_elasticity - 0.5 * weight * stiffness * (strain - neutral) ** 2, of_viscosity


@piece(float, int, Problem, Configuration, Stage, bool)
def add_viscosity(_, p, at, stage, with_hessian):
    """Tell the energy of viscosity from those of the elements, which have counted both together."""
    viscosity, strands, sums, edges = p.viscosity, p.strands, p.sums, p.strands.edge_count
    selected, length = sums.selected, stage.lengths[0]
    if not acts_viscously(p):
        return math.inf
    lost, elastic = 0.0, 1.0 * selected[STRETCHING]
    for e in range(edges):
        beta, strain = viscosity.edge_time[e] / length, at.length[e] / strands.rest_length[e] - 1.0
        of_elasticity, of_viscosity = _energies(
            strands.axial_stiffness[e] * strands.rest_length[e],
            elastic,
            beta,
            strain,
            stage.rest_edge[e],
            stage.origin_strain[e],
        )
        sums.energy[STRETCHING] += of_elasticity
        lost += of_viscosity
    bends, twists, ties = 1.0 * selected[BENDING], 1.0 * selected[TWISTING], 1.0 * selected[BOND]
    for k in range(strands.joint_a.shape[0]):
        tied = k >= strands.bend_count
        for c in range(3):
            strain = at.joint_strain[k, c]
            if c == 0 and p.off_axis.exists:
                strain -= p.off_axis.rest[k, 0] - stage.neutral_joint[k, 0]
            of_elasticity, of_viscosity = _energies(
                strands.joint_stiffness[k, c],
                ties if tied else twists if c == 2 else bends,
                viscosity.joint_time[k, c] / length,
                strain,
                stage.rest_joint[k, c],
                stage.origin_strain[edges + 3 * k + c],
            )
            sums.energy[BOND if tied else TWISTING if c == 2 else BENDING] += of_elasticity
            lost += of_viscosity
    bonds, begin = p.bonds, edges + 3 * strands.joint_a.shape[0]
    for k in range(bonds.joint.shape[0]):
        strains = _of_pair(strands, bonds, at, k)
        for c in range(3):
            slot = _slot_of_pair(strands, k, c)
            of_elasticity, of_viscosity = _energies(
                bonds.stiffness[k, c],
                1.0 * selected[slot],
                viscosity.pair_time[k, c] / length,
                strains[c],
                bonds.rest[k, c],
                stage.origin_strain[begin + 3 * k + c],
            )
            sums.energy[slot] += of_elasticity
            lost += of_viscosity
    sums.energy[VISCOSITY], sums.lost[VISCOSITY] = lost, 2.0 * lost / length
    return math.inf

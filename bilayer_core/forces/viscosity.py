"""Kelvin–Voigt viscosity: stress that follows the rate of strain, τ times the stiffness.

A layer of retardation time τ has the stress E (ε − η + τ ε̇), and so in bending and in twist: every element of
elasticity ½ k (s − s̄)², its strain s, has the dissipation ½ k τ ṡ² with it. The strain is the total one. What a
stimulus adds, s̄, costs no viscous stress, however fast it jumps; and a rigid motion leaves all s as they are.

Over a stage strains advance as positions do (`integrators.method`): from an origin s° = sₙ + h Σ aᵢⱼ ṡⱼ, with
ṡⱼ = (sⱼ − s°ⱼ)/(γ h) of earlier stages, by ṡ = (s − s°)/(γ h). That is the strain's own origin, not the strain of the
origin of positions, which in a rigid rotation differs from s. The stage minimises

    ½ k (s − s̄)² + ½ k β (s − s°)² = ½ k (1 + β) (s − s′)² + const,   β = τ/(γ h),   s′ = (s̄ + β s°)/(1 + β)

so viscosity needs no elements of its own: those of elasticity have another stiffness and another rest strain
(`forces.elements`), and energies are told apart afterwards (`add_viscosity`). Derivatives are theirs. Only k₁₃, by
which fibres couple bending and twist, has its part by itself (`forces.flattening`); what flattens a section has none.

Order. s(qᵢ) = sₙ + h Σ aᵢⱼ ṡⱼ defines ṡᵢ, whose difference eᵢ from the rate of s along the stage, ∂s/∂q·vᵢ, obeys
h Σ aᵢⱼ eⱼ = ½ s″ v² (cᵢ² h² − 2 h² Σ aᵢⱼ cⱼ) + O(h³). At the end of the step of a method of order 2 that bracket is
zero: so Σ bⱼ eⱼ = O(h²), momenta and positions get no more than O(h³) in a step, and the order stays.

Of a bond only the shear that the torsion of the strip needs, k_φ, is that of a material; as a series of two layers
with the shear thicknesses a and b, k ∝ a b/(a + b), its retardation time is (τ_a b + τ_b a)/(a + b). The other springs
of a bond hold the layers together, and have no viscosity; the elements at the ends of layers have that of the layer.
"""

from __future__ import annotations

import math

from bilayer_core.forces.elements import (
    BENDING,
    BOND,
    STRETCHING,
    TWISTING,
    VISCOSITY,
    act_together,
    acts_viscously,
    multiple_of_edge,
    multiple_of_joint,
    multiple_of_pair,
    slot_of_pair,
    strains_of_pair,
)
from bilayer_core.forces.flattening import viscous_coupling
from bilayer_core.jit import kernel, piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage


@kernel
def _energies(stiffness, elastic, beta, strain, rest, origin):
    """Return the elastic energy less the energy counted for both together, and the viscous energy [J]."""
    weight, neutral = act_together(elastic, beta, rest, origin)
    of_elasticity = 0.5 * elastic * stiffness * (strain - rest) ** 2
    of_viscosity = 0.5 * beta * stiffness * (strain - origin) ** 2
    return of_elasticity - 0.5 * weight * stiffness * (strain - neutral) ** 2, of_viscosity


@piece(float, int, Problem, Configuration, Stage, bool)
def add_viscosity(_, p, at, stage, with_hessian):
    """Tell the energy of viscosity from those of the elements, which have counted both together."""
    viscosity, strands, sums, edges = p.viscosity, p.strands, p.sums, p.strands.edge_count
    selected, length = sums.selected, stage.length
    if not acts_viscously(p):
        return math.inf
    lost = 0.0
    for e in range(edges):
        beta, strain = viscosity.edge_time[e] / length, at.length[e] / strands.rest_length[e] - 1.0
        of_elasticity, of_viscosity = _energies(
            strands.axial_stiffness[e] * strands.rest_length[e],
            multiple_of_edge(p, stage, e) * selected[STRETCHING],
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
                multiple_of_joint(p, stage, k, c) * (ties if tied else twists if c == 2 else bends),
                viscosity.joint_time[k, c] / length,
                strain,
                stage.rest_joint[k, c],
                stage.origin_strain[edges + 3 * k + c],
            )
            sums.energy[BOND if tied else TWISTING if c == 2 else BENDING] += of_elasticity
            lost += of_viscosity
    for i in range(p.flattening.joint.shape[0]):
        k = p.flattening.joint[i]
        lag, kappa, psi = viscous_coupling(p, stage, i)
        lost += lag * (at.joint_strain[k, 0] - kappa) * (at.joint_strain[k, 2] - psi)
    bonds, begin = p.bonds, edges + 3 * strands.joint_a.shape[0]
    for k in range(bonds.joint.shape[0]):
        strains = strains_of_pair(strands, bonds, at, k)
        for c in range(3):
            slot = slot_of_pair(strands, k, c)
            of_elasticity, of_viscosity = _energies(
                bonds.stiffness[k, c],
                multiple_of_pair(p, stage, k) * selected[slot],
                viscosity.pair_time[k, c] / length,
                strains[c],
                bonds.rest[k, c],
                stage.origin_strain[begin + 3 * k + c],
            )
            sums.energy[slot] += of_elasticity
            lost += of_viscosity
    sums.energy[VISCOSITY], sums.lost[VISCOSITY] = lost, 2.0 * lost / length
    return math.inf

"""Elastic moduli that follow a stimulus: elements with the energy ½ m k (s − s̄)², and what it takes to change m.

A layer whose moduli are m times those of its material has m EA, m EI and m GJ, so each of its elements has one multiple
m = 1 + c, c the value of its law (`stiffness_change`). Rows of `Stage.rest_joint` after those of joints hold them:
a law gives c as another gives an eigenstrain, so both are evaluated, carried and logged in the same way, and a change
of m is work of the stimulus, ∂V/∂m = ½ k (s − s̄)². So it is with F of strips (`forces.flattening`).

Of a bond (`forces.bond`), translation, bending and twist only hold two layers together, and stay. Its tilt is the
torsional stiffness that bonding adds, GJ_lam − ΣGJ_r. Two thin layers have 4 w c² g₁g₂/(g₁ + g₂) of it, g = G h, so the
multiple of a bond is

    m = m₁ m₂/(σ m₁ + (1 − σ) m₂),   σ = g₁/(g₁ + g₂)

which is exact where moduli of both change alike, and where layers are thin. Half edges where a layer ends bend and
twist with the multiple of that layer. Viscosity keeps the moduli of the material.
"""

from __future__ import annotations

from bilayer_core.forces.bend_twist import bend_by_strains
from bilayer_core.forces.elements import multiple_of_edge, strains_of_joint, strains_of_pair
from bilayer_core.forces.flattening import strip_law
from bilayer_core.jit import kernel


@kernel
def pull_of_moduli(p, at, stage):
    """Write ∂V/∂m of each row of `Stage.rest_joint` that is a multiple [J]."""
    strands, bonds, off_axis, moduli = p.strands, p.bonds, p.off_axis, p.moduli
    pull, edge = moduli.pull, moduli.edge
    pull[:] = 0.0
    for e in range(strands.edge_count):
        strain = at.length[e] / strands.rest_length[e] - 1.0 - stage.rest_edge[e]
        pull[edge[e]] += 0.5 * strands.axial_stiffness[e] * strain * strain * strands.rest_length[e]
    if off_axis.exists:
        bend_by_strains(off_axis, strands, at, stage.rest_joint)
    for k in range(strands.joint_a.shape[0]):
        strains = strains_of_joint(strands, at, k)
        if k >= strands.bend_count:
            tilt = strains[1] - stage.rest_joint[k, 1]
            energy, share = 0.5 * strands.joint_stiffness[k, 1] * tilt * tilt, moduli.share[k]
            a, b = strands.joint_a[k], strands.joint_b[k]
            first, second = multiple_of_edge(p, stage, a), multiple_of_edge(p, stage, b)
            both = share * first + (1.0 - share) * second
            pull[edge[a]] += energy * (1.0 - share) * (second / both) ** 2
            pull[edge[b]] += energy * share * (first / both) ** 2
            continue
        for c in range(3):
            rest = off_axis.rest[k, 0] if c == 0 and off_axis.exists else stage.rest_joint[k, c]
            pull[moduli.joint[k]] += 0.5 * strands.joint_stiffness[k, c] * (strains[c] - rest) ** 2
    for i in range(p.flattening.joint.shape[0]):
        k = p.flattening.joint[i]
        kappa, _, psi = strains_of_joint(strands, at, k)
        energy, _, _, _, _, _, _, _ = strip_law(p.flattening, stage.rest_joint, i, k, kappa, psi, 1.0)
        pull[moduli.joint[k]] += energy
    for k in range(bonds.joint.shape[0]):
        strains = strains_of_pair(strands, bonds, at, k)
        for c in range(3):
            pull[moduli.pair[k]] += 0.5 * bonds.stiffness[k, c] * (strains[c] - bonds.rest[k, c]) ** 2

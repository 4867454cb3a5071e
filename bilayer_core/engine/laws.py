"""Formulas of scenes that kernels evaluate as well, compiled, and the eigenstrain of laws by them."""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.kinematics.copying import copy
from bilayer_core.scene import spans, transduction

value_of_span = kernel(spans.value_of_span)
lagged = kernel(transduction.lagged)
eigenstrain_of = kernel(transduction.eigenstrain_of)


@kernel
def write_strains_of_laws(drives, reached, strain_out):
    """Write the eigenstrain of each law where modes have reached some stimuli: that of the weighted sum over the modes
    of its field (`scene.diffusion_modes`).
    """
    for i in range(drives.law_gain.shape[0]):
        first, weights, filtered = drives.field_first[drives.law_field[i]], drives.law_first[i], 0.0
        for k in range(drives.law_first[i + 1] - weights):
            filtered += drives.law_weight[weights + k] * reached[first + k]
        law = drives.law_gain[i], drives.law_reference[i], drives.law_saturation[i]
        strain_out[i] = eigenstrain_of(filtered, law[0], law[1], law[2])


@kernel
def grow(drives, law_strain, rest_edge_out, rest_joint_out):
    """Write the rest strains of edges and joints, and multiples of moduli, from the strains of laws."""
    copy(drives.rest_strain, rest_edge_out)
    for k in range(drives.driven_edge.shape[0]):
        rest_edge_out[drives.driven_edge[k]] += drives.driven_weight[k] * law_strain[drives.driven_law[k]]
    copy(drives.joint_rest, rest_joint_out)
    for k in range(drives.driven_joint.shape[0]):
        bent = drives.driven_joint_weight[k] * law_strain[drives.driven_joint_law[k]]
        rest_joint_out[drives.driven_joint[k], drives.driven_joint_column[k]] += bent

"""Kinetic energy of rods and bodies."""

from __future__ import annotations

from bilayer_core.forces.raised import kinetic_energy_off_curve
from bilayer_core.jit import kernel
from bilayer_core.jit.called import stack_matrix
from bilayer_core.kinematics.rotating import inertia_tensor
from bilayer_core.kinematics.vector import row


@kernel
def kinetic_energy(p, state):
    """Return the kinetic energy of nodes, of edges about their tangents, and of free bodies [J]."""
    strands, bodies, energy = p.strands, p.bodies, 0.0
    for i in range(strands.node_mass.shape[0]):
        v0, v1, v2 = row(state.velocity, i)
        energy += 0.5 * strands.node_mass[i] * (v0 * v0 + v1 * v1 + v2 * v2)
    for e in range(strands.spin_inertia.shape[0]):
        energy += 0.5 * strands.spin_inertia[e] * state.spin[e] ** 2
    energy += kinetic_energy_off_curve(p.raised, strands, state.velocity, state.strain_rate)
    tensor = stack_matrix(3, 3)
    for f in range(bodies.mass.shape[0]):
        b = bodies.body_of_free[f]
        inertia_tensor(bodies.second_moment, f, state.body_rotation, b, tensor)
        for c in range(3):
            energy += 0.5 * bodies.mass[f] * state.body_velocity[b, c] ** 2
            for k in range(3):
                w = state.body_angular_velocity
                energy += 0.5 * tensor[c, k] * w[b, c] * w[b, k]
    return energy

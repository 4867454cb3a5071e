"""Quantities seen at the end of a step beyond the state: strains, contact, clamps, kinetic energy.

All of it is computed at once by the thread that makes steps, into one piece of memory: that costs less than to copy
for another thread what it is computed of.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.engine.kinetic import kinetic_energy
from bilayer_core.forces.added_mass import fluid_momentum, move_fluid
from bilayer_core.forces.bend_twist import bending_strain
from bilayer_core.forces.joints import Joints
from bilayer_core.forces.mechanisms import turned
from bilayer_core.jit import kernel, piece, record, shapes_of, zeros_in_one
from bilayer_core.jit.record import Flags, IndexTable, Indices, Matrix, Vector
from bilayer_core.kinematics.copying import copy
from bilayer_core.kinematics.rotating import quaternion_of
from bilayer_core.kinematics.vector import combine3, cross, row, scaled
from bilayer_core.model.model import Model
from bilayer_core.model.records.parts import Fluid
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, StateArrays
from bilayer_core.model.sizes import sizes_of

Array = np.ndarray


@record
class Observables:
    """Observables, which are in `values` in one piece, and what they are computed of beside the state."""

    voronoi_length: Vector  # of bending elements [m], shape (n_bend,)
    joint_node: Indices  # the node of each, shape (n_bend,)
    node: Indices  # of strands, shape (n,)
    edges: IndexTable  # before and after each; at an end both are its one edge, shape (n, 2)
    neighbour: IndexTable  # free ends of strands, which have no bending element, and the nodes beside, shape (n_end, 2)
    twin: IndexTable  # nodes in memory that stand for others of a closed strand, and these, shape (n_shut, 2)
    holder: Indices  # body of each attached node, shape (n_attached,)
    fluid: Fluid  # one of its own, since that of a step is scratch
    owner_of_point: Indices  # whose each contact point is, nodes first, shape (n_contact_point,)
    owner_of_surface: Indices
    touching: Indices = ("pair of owners",)  # numbers a n + b of those that touch, a ≤ b, of n owners
    touching_count: Indices = (1,)
    touched: Flags = ("owner squared",)  # scratch
    owners: int  # n of the pairs
    seen_pair: Indices  # numbers of the pairs whose forces are seen, ascending, shape (n_seen_pair,)
    mechanism_joint: Indices  # whose each mechanism is, −1 of guided bodies, shape (n_mechanism,)
    values: Vector
    strain: Vector = ("observed point",)  # of nodes, the mean of their edges', with eigenstrain; 0 at points of bodies
    curvature: Vector = ("observed point",)  # χ of nodes [1/m]
    contact_force: Matrix = ("observed point", 3)  # barrier and friction force on nodes and points of bodies [N]
    quaternion: Matrix = ("body", 4)  # x y z w, w ≥ 0
    contact_wrench: Matrix = ("body", 6)  # contact force [N] and moment about its position [N m] on every body
    clamp: Matrix = ("attached", 6)  # the part of each held node with its direction in the next
    clamp_wrench: Matrix = ("body", 6)  # of the rods that each body holds [N, N m], see `_observe_clamps`
    pair_force: Vector = ("seen pair",)  # sum of the normal forces between two owners [N]
    joint_wrench: Matrix = ("body joint", 6)  # that each exerts on its first body, about the joint [N, N m]
    motion: Vector = ("mechanism",)  # angle or way of each [rad, m]
    energy: Vector = ("force",)  # of each force, in the order of `model.force_slots` [J]
    kinetic: Vector = (2,)  # of rods and bodies, and of the fluid [J]


@piece(int, Problem, Joints, StateArrays, Configuration, Observables)
def observe(p, joints, state, at, out):
    """Write what is out of a state, which is `at`, with forces as they were evaluated last."""
    _observe_strains(p, at, out)
    _observe_contact(p, joints, out)
    _observe_clamps(p, at, out)
    _observe_touching(p, out)
    _observe_joints(p.mechanisms, joints, at, out)
    for b in range(out.quaternion.shape[0]):
        r = state.body_rotation
        x, y, z, w = quaternion_of(
            *(r[b, 0, 0], r[b, 0, 1], r[b, 0, 2]),
            *(r[b, 1, 0], r[b, 1, 1], r[b, 1, 2]),
            *(r[b, 2, 0], r[b, 2, 1], r[b, 2, 2]),
        )
        sign = 1.0 if w >= 0.0 else -1.0
        out.quaternion[b, 0], out.quaternion[b, 1] = sign * x, sign * y
        out.quaternion[b, 2], out.quaternion[b, 3] = sign * z, sign * w
    copy(p.sums.energy, out.energy)
    out.kinetic[0] = kinetic_energy(p, state)
    if out.fluid.exists:
        move_fluid(out.fluid, p.raised, state.velocity, state.strain_rate)
        copy(state.spin, out.fluid.spin)
        out.kinetic[1] = fluid_momentum(out.fluid, at)
    return READY


@kernel
def _observe_strains(p, at, out):
    """Write the strains and the curvatures [1/m] of nodes to `out`."""
    strands, strain, curvature = p.strands, out.strain, out.curvature
    for k in range(out.node.shape[0]):
        a, b = out.edges[k, 0], out.edges[k, 1]
        before, after = at.length[a] / strands.rest_length[a] - 1.0, at.length[b] / strands.rest_length[b] - 1.0
        strain[out.node[k]] = 0.5 * (before + after)
    for j in range(out.voronoi_length.shape[0]):
        bend = bending_strain(at, strands.joint_a[j], strands.joint_b[j])
        curvature[out.joint_node[j]] = bend / out.voronoi_length[j]
    for k in range(out.neighbour.shape[0]):
        curvature[out.neighbour[k, 0]] = curvature[out.neighbour[k, 1]]
    for k in range(out.twin.shape[0]):
        strain[out.twin[k, 0]] = strain[out.twin[k, 1]]
        curvature[out.twin[k, 0]] = curvature[out.twin[k, 1]]


@kernel
def _observe_contact(p, joints, out):
    """Write the contact forces on nodes and points [N] and the contact wrenches on bodies [N, N m] to `out`.

    The sums of bodies include joints and mechanisms, so these are taken out.
    """
    for i in range(out.contact_force.shape[0]):
        for c in range(3):
            out.contact_force[i, c] = -p.sums.contact_point[i, c]
    for b in range(out.contact_wrench.shape[0]):
        for c in range(6):
            out.contact_wrench[b, c] = -p.sums.contact[b, c]
    if joints.exists:
        _leave_out(joints.body, joints.gradient, out.contact_wrench)
    if p.mechanisms.exists:
        _leave_out(p.mechanisms.body, p.mechanisms.gradient, out.contact_wrench)


@kernel
def _leave_out(body, gradient, wrench):
    """Take from wrenches on bodies what something else than contact exerts."""
    for k in range(body.shape[0]):
        if body[k] < wrench.shape[0]:  # not the world
            for c in range(6):
                wrench[body[k], c] += gradient[k, c]


@kernel
def _observe_clamps(p, at, out):
    """Write the force [N] and the moment about its position [N m] that the rods which a body holds exert on it.

    They are −∂Φ/∂X and −∂Φ/∂φ of the potential Φ of the step through the nodes x = X + ρ and the fixed directions t
    that bodies hold (`engine.linear.attachments`): with the gradients g of a node and (g, g_θ) of a clamp edge

        F = −Σ g,    M = −Σ ρ × g − Σ (t × g + g_θ t)

    Φ has all that acts on what is held: elasticity, weight and inertia of half an edge, contact, drag, damping.
    """
    out.clamp_wrench[:] = 0.0
    edges = p.strands.edge_count
    for k in range(out.clamp.shape[0]):
        force, tangent = row(p.sums.attached, k), row(at.tangent, edges + k)
        of_arm, of_edge = cross(row(at.arm, k), force), cross(tangent, row(p.sums.edge, edges + k))
        moment = combine3(1.0, of_arm, 1.0, of_edge, p.sums.edge[edges + k, 3], tangent)
        out.clamp[k, 0], out.clamp[k, 1], out.clamp[k, 2] = scaled(-1.0, force)
        out.clamp[k, 3], out.clamp[k, 4], out.clamp[k, 5] = scaled(-1.0, moment)
        for c in range(6):
            out.clamp_wrench[out.holder[k], c] += out.clamp[k, c]


@kernel
def _observe_touching(p, out):
    """Write the pairs of owners that are nearer to each other than the barrier distance to `out`, each pair once, and
    the normal forces between them.
    """
    surfaces, rods, of_point, count = p.surfaces, p.rod_contact, out.owner_of_point, 0
    out.pair_force[:] = 0.0
    if surfaces.exists:
        for k in range(surfaces.near_count[0]):
            if surfaces.near_gap[k] < surfaces.d_hat:
                surface = out.owner_of_surface[surfaces.near_surface[k]]
                count = _note(of_point[surfaces.near_contact_point[k]], surface, surfaces.near_force[k], count, out)
    if rods.exists:
        for k in range(rods.contacts.count[0]):
            first, second = of_point[rods.contacts.node[k, 0]], of_point[rods.contacts.node[k, 1]]
            count = _note(first, second, rods.contacts.normal_force[k], count, out)
    for k in range(count):
        out.touched[out.touching[k]] = False
    out.touching_count[0] = count


@kernel
def _note(a, b, force, count, out):
    """Add a pair unless it is known, and the force of one of its contacts; how many pairs there are."""
    number = min(a, b) * out.owners + max(a, b)
    first, last = 0, out.seen_pair.shape[0]
    while first < last:
        middle = (first + last) // 2
        if out.seen_pair[middle] < number:
            first = middle + 1
        else:
            last = middle
    if first < out.seen_pair.shape[0] and out.seen_pair[first] == number:
        out.pair_force[first] += force
    if out.touched[number]:
        return count
    out.touched[number], out.touching[count] = True, number
    return count + 1


@kernel
def _observe_joints(mechanisms, joints, at, out):
    """Write what joints exert on the first of their bodies, and the angles and ways of mechanisms, to `out`."""
    if joints.exists:
        for k in range(out.joint_wrench.shape[0]):
            for c in range(6):
                out.joint_wrench[k, c] = -joints.gradient[2 * k, c]
    if mechanisms.exists:
        copy(mechanisms.value, out.motion)
        for i in range(out.mechanism_joint.shape[0]):
            k = out.mechanism_joint[i]
            if k >= 0:
                for c in range(6):
                    out.joint_wrench[k, c] -= mechanisms.gradient[2 * i, c]
    for k in range(out.joint_wrench.shape[0]):  # from the body's position to the joint
        arm = turned(at.rotation, joints.body[2 * k], joints.arm, 2 * k)
        moment = cross(arm, row(out.joint_wrench, k))
        for c in range(3):
            out.joint_wrench[k, 3 + c] -= moment[c]


COMPUTED = tuple(name for name in Observables.shapes if name not in ("touching", "touching_count", "touched"))
"""Names of the observables, in the order of their values."""


def observables_of(
    model: Model, owner_of_point: Array, owner_of_surface: Array, owners: int, seen_pair: Array
) -> tuple[Observables, dict[str, tuple[int, int, tuple[int, ...]]]]:
    """Return the record of a model, and the begin, end and shape of each part of its values by name.

    The owners of contact points and surfaces are numbers below `owners`.
    """
    sizes = sizes_of(model) | {"observed point": model.node_count + model.point_count}
    sizes |= {"pair of owners": owners * (owners + 1) // 2, "owner squared": owners**2}
    sizes |= {"seen pair": len(seen_pair), "body joint": len(model.scene.joints)}
    sizes |= {"mechanism": len(model.mechanisms)}
    joint_of = {joint.name: k for k, joint in enumerate(model.scene.joints)}
    values, parts = zeros_in_one(shapes_of(Observables, sizes, COMPUTED))
    ends = np.cumsum([0, *(parts[name].size for name in COMPUTED)]).tolist()
    places = {name: (*ends[k : k + 2], parts[name].shape) for k, name in enumerate(COMPUTED)}
    bends = slice(model.rods.bend_count)
    record = Observables.zeros(
        sizes,
        voronoi_length=model.voronoi_length,
        joint_node=model.joint_node[bends].astype(np.int64),
        **_tables_of(model),
        holder=model.constrained.body,
        fluid=model.fluid.allocated(sizes),
        owner_of_point=owner_of_point,
        owner_of_surface=owner_of_surface,
        owners=owners,
        seen_pair=seen_pair,
        mechanism_joint=np.array([-1 if m.is_guide else joint_of[m.owner] for m in model.mechanisms], dtype=np.int64),
        values=values,
        **parts,
    )
    return record, places


def _tables_of(model: Model) -> dict[str, Array]:
    """Return the nodes of strands with their edges, free ends with their neighbours, and nodes that stand for
    others.
    """
    nodes, edges, ends, shut = [], [], [], []
    for s in model.strands:
        first, last = s.first_node, s.first_node + s.node_count - 1
        own = s.first_edge + np.arange(s.node_count - 1)
        nodes.append(np.arange(first, last + 1))
        edges.append(np.stack([np.concatenate([own[:1], own]), np.concatenate([own, own[-1:]])], axis=1))
        shut += [(first, last - 1), (last, first + 1)] if s.closed else []
        ends += [pair for pair in ((first, first + 1), (last, last - 1)) if pair[0] not in model.constrained.node]
    return {
        "node": np.concatenate(nodes).astype(np.int64),
        "edges": np.concatenate(edges).astype(np.int64),
        "neighbour": np.array(ends, dtype=np.int64).reshape(-1, 2),
        "twin": np.array(shut, dtype=np.int64).reshape(-1, 2),
    }

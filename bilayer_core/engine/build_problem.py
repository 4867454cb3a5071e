"""From a model to the groups of arrays of its problem."""

from __future__ import annotations

from typing import Any

import numpy as np

from bilayer_core.contact.broad_phase import RodSearch
from bilayer_core.forces.restitution import damping_of
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.lit_elements import light_of
from bilayer_core.model.model import Model, PointLoads
from bilayer_core.model.records.contacts import (
    ContactColumns,
    Restitution,
    RodContact,
    RodContactList,
    RodPoints,
    Sliding,
    Slips,
    Surfaces,
)
from bilayer_core.model.records.parts import (
    Attachments,
    Bodies,
    Bonds,
    Constrained,
    Drives,
    Flow,
    Fluid,
    Joins,
    Moments,
    OffAxis,
    Plane,
    PointForces,
    Strands,
    Viscosity,
)
from bilayer_core.model.records.problem import Border, System
from bilayer_core.model.set_friction import contact_point_friction
from bilayer_core.model.unknown_order import columns
from bilayer_core.scene.config import Friction

Array = np.ndarray
NONE = np.zeros(0, dtype=np.int64)
LEAST_FALL = 0.2
"""Of the longest rod: motions of less energy than a fall of everything by so much are not watched for theirs."""
SLOWEST_APPROACH = 1.0
"""Barrier distances per second: slower approaches count as that."""
ROUNDING_STRAIN = 1e-11
"""Strain of an edge that may be rounding, at any length of edges."""


def lasting_groups(model: Model, sizes: dict[str, int]) -> dict[str, Any]:
    """Return the groups of a problem that do not change, but for that of its dimension; `sizes` as in `model.sizes`."""
    layout, scene = model.solved_layout, model.scene
    bodies, free = model.bodies, model.free_count
    return dict(
        gravity=np.array(scene.gravity, dtype=float),
        damping=float(scene.damping.mass),
        least_energy=_least_energy(model),
        strands=Strands(
            size=layout.size,
            dimension=layout.dimension,
            edge_count=model.edge_count,
            bend_count=model.bend_count,
            bandwidth=layout.half_bandwidth,
            axes=model.directions,
            row=layout.node,
            node_unknown=model.layout.node,
            edge_unknown=model.layout.edge,
            **{name: getattr(model, name) for name in Strands.names[9:]},
        ),
        viscosity=(
            Viscosity(edge_time=model.edge_time, joint_time=model.joint_time, pair_time=model.pair_time)
            if "viscosity" in model.forces
            else Viscosity.absent()
        ),
        drives=Drives(**{name: getattr(model, name) for name in Drives.names}),
        light=light_of(model),
        off_axis=OffAxis.absent() if len(model.pair_joint) else _off_axis(model, sizes),
        bonds=(
            Bonds(**{name: getattr(model, f"pair_{name}") for name in Bonds.names})
            if len(model.pair_joint)
            else Bonds.absent()
        ),
        bodies=Bodies(
            free_index=bodies.free_index,
            body_of_free=bodies.body_of_free,
            prescribed=np.flatnonzero(bodies.free_index[:-1] < 0),
            mass=bodies.mass,
            second_moment=bodies.second_moment,
            inertia=_inertia_of_bodies(model),
            freedom=bodies.freedom,
            freedom_first=6 * (np.argmax(bodies.freedom != 0.0, axis=0) // 6) if free else NONE,
            bounding_radius=bodies.bounding_radius,
            rotates=np.array(
                [f >= 0 or b.motion.turns for f, b in zip(bodies.free_index, model.scene.bodies, strict=False)],
                dtype=bool,
            ),
        ),
        border=Border.zeros(sizes) if free else Border.absent(),
        joins=_joins(model),
        constrained=_constrained(model),
        attachments=_attachments(model) if free else Attachments.absent(),
        flow=_flow(model, sizes) if scene.fluid is not None else Flow.absent(),
        fluid=fluid_of(model, sizes) if len(model.fluid_mass) else Fluid.absent(),
        loads=_forces(model, "loads", model.dead_loads) if scene.loads else PointForces.absent(),
        followers=_forces(model, "followers", model.follower_loads) if scene.loads else PointForces.absent(),
        moments=_moments(model) if scene.loads else Moments.absent(),
        has_contact=model.has_surface_contact or model.rod_surfaces is not None or "joints" in model.forces,
        system=System.zeros(sizes),
    )


def _least_energy(model: Model) -> float:
    """Return the energy of a small fall of everything, plus that of strains that are rounding [J]."""
    fall = LEAST_FALL * max(rod.path.length for rod in model.scene.rods)
    weight = (model.node_mass.sum() + model.bodies.mass.sum()) * np.linalg.norm(model.scene.gravity)
    return float(fall * weight + ROUNDING_STRAIN**2 * (model.axial_stiffness @ model.rest_length))


def plane_of(model: Model, sizes: dict[str, int], hessians: dict[str, Array]) -> Plane:
    """Return the record of the parts that only dimension 2 has, with its second derivatives."""
    plane = model.plane
    return Plane.zeros(sizes, normal=plane.normal, side=plane.side, joint_after=plane.joint_after, **hessians)


def _off_axis(model: Model, sizes: dict[str, int]) -> OffAxis:
    return OffAxis.zeros(sizes, joint=model.coupled_joint, slope=model.strain_slope)


def _attachments(model: Model) -> Attachments:
    return Attachments(
        holding=int((model.attached_free >= 0).sum()),
        unknown=model.solved_layout.attached,
        free=model.attached_free,
        of_unknown=model.solved_layout.attached_of_unknown,
        clamp_edge_free=model.clamp_edge_free,
        clamp_edge_joint=model.clamp_edge_joint,
    )


def _joins(model: Model) -> Joins:
    """Absent where no rod is closed."""
    unknowns = model.joined_unknowns(model.solved_layout)
    if not len(unknowns):
        return Joins.absent()
    column = np.full(model.solved_layout.size, -1, dtype=np.int64)
    column[unknowns] = np.arange(len(unknowns))[:, None]
    first, copy = columns(unknowns)
    return Joins(first=first, copy=copy, column=column)


def _constrained(model: Model) -> Constrained:
    return Constrained(
        node=model.attached_node,
        unknown=model.layout.attached,
        row=model.solved_layout.attached,
        body=model.attached_body,
        free=model.attached_free,
        position=model.attached_position,
        clamp_edge_body=model.clamp_edge_body,
        clamp_edge_free=model.clamp_edge_free,
        clamp_edge_tangent=model.clamp_edge_tangent,
        clamp_edge_director1=model.start_director1,
    )


def surfaces_of(model: Model, sizes: dict[str, int]) -> Surfaces:
    """With an empty list of near pairs."""
    contact_points, surfaces, contact = model.contact_points, model.surfaces, model.scene.contact
    return Surfaces.zeros(
        sizes,
        d_hat=contact.barrier_distance,
        stiffness=model.contact_stiffness,
        radius=contact_points.radius,
        weight=contact_points.weight,
        contact_point_body=contact_points.body,
        free_index=model.bodies.free_index if model.free_count else NONE,
        moved_by=contact_points.moved_by,
        node_free=contact_points.moved_by[: model.node_count] < 0,
        group=contact_points.group,
        point_position=contact_points.position,
        point_body=contact_points.body[model.node_count :][: sizes["point"]],
        node_edges=contact_points.node_edges,
        rod_points=_rod_points(model, sizes),
        arm_factor=_arm_factor(model),
        kind=surfaces.kind,
        size=surfaces.size,
        rounding=surfaces.rounding,
        bound=surfaces.bound,
        body=surfaces.body,
        position=surfaces.position,
        rotation=surfaces.rotation,
        can_collide=surfaces.can_collide,
        edge_can_cross=surfaces.edge_can_cross,
        margin=np.full(1, -1.0),  # no list yet
    )


def restitution_of(model: Model, sizes: dict[str, int]) -> Restitution:
    """Absent where no impact is damped."""
    pairs, contact = model.impact_pairs, model.scene.contact
    if not len(pairs):
        return Restitution.absent()
    row = np.full((sizes["contact_point"], sizes["surface"]), -1, dtype=np.int64)
    row[pairs[:, 0], pairs[:, 1]] = np.arange(len(pairs))
    return Restitution.zeros(
        sizes,
        damping=damping_of(contact.restitution),
        slowest=SLOWEST_APPROACH * contact.barrier_distance,
        first=model.strain_count,
        memory=np.zeros(1, dtype=np.int64),
        point=pairs[:, 0].copy(),
        surface=pairs[:, 1].copy(),
        row=row,
    )


def _rod_points(model: Model, sizes: dict[str, int]) -> RodPoints:
    points = model.contact_points
    if not len(points.rod_point_node):
        return RodPoints.absent()
    first = sizes["node"] + sizes["point"]
    longest = float(np.linalg.norm(points.rod_point_arm, axis=1).max())
    return RodPoints(first=first, node=points.rod_point_node, arm=points.rod_point_arm, longest=longest)


def _arm_factor(model: Model) -> float:
    """How many times farther than nodes, and borders of edges by a turn, a contact point of a rod moves at most.

    Its arm turns with edges, by at most the motion of one end against the other over their length, of which half is
    left at least.
    """
    points = model.contact_points
    edges = points.node_edges[points.rod_point_node]
    arm = np.linalg.norm(points.rod_point_arm, axis=1)
    slope = arm / model.rest_length[edges].min(axis=1)
    turn = arm / model.half_width[edges].min(axis=1)
    return float(np.max(1.0 + 4.0 * slope + turn, initial=1.0))


def sliding_of(model: Model, sizes: dict[str, int], law: Friction | None) -> Sliding:
    """Without contacts; by a law, the scene's or one that differs from it in coefficients."""
    contact_points = model.contact_points
    axis = np.zeros(3) if law is None or law.axis is None else np.array(law.axis)
    return Sliding.zeros(
        sizes,
        acts=law is not None and law.acts,
        threshold=law.speed_threshold if law is not None else 0.0,
        coefficient=contact_point_friction(law, contact_points.body >= 0),
        node_axis=contact_points.node_axis,
        grained=bool(axis.any() or model.surfaces.grain.any() or contact_points.grain.any()),
        along_grain=np.array(law.of_rods if law is not None else (0.0, 0.0, 0.0)),
        across_all=law.coefficient if law is not None else 0.0,
        world_axis=axis,
        surface_grain=model.surfaces.grain,
        point_grain=contact_points.grain,
    )


def slips_of(model: Model, sizes: dict[str, int]) -> Slips:
    """Absent if nothing slides against friction."""
    law = model.scene.contact.friction if model.scene.contact else None
    if law is None or not law.acts:
        return Slips.absent()
    return Slips.zeros(sizes, threshold=law.speed_threshold)


def rod_contact_of(
    model: Model,
    sizes: dict[str, int],
    search: RodSearch,
    now: RodContactList,
    old: RodContactList,
    law: Friction | None,
    **motion: Array,
) -> RodContact:
    """With contacts of now, and `old` ones of the start of a stage; `law` as for `sliding_of`, `motion` is that of the
    list of near rods.
    """
    contact, surfaces = model.scene.contact, model.rod_surfaces
    return RodContact.zeros(
        sizes,
        d_hat=contact.barrier_distance,
        stiffness=model.contact_stiffness,
        slides=law is not None and law.acts and law.coefficient > 0.0,
        coefficient=law.coefficient if law is not None else 0.0,
        threshold=law.speed_threshold if law is not None else 1.0,
        unit=contact.barrier_distance + 2.0 * float(surfaces.edge_radius.max()),
        point_weight=surfaces.point_weight,
        search=search,
        contacts=now,
        sliding=old,
        **motion,
    )


def contact_columns_of(model: Model, sizes: dict[str, int], capacity: int) -> ContactColumns:
    """With capacity for so many contacts of barrier and friction together."""
    attached = np.full(model.node_count, -1)
    attached[model.attached_node] = np.arange(len(model.attached_node))
    return ContactColumns.zeros(
        sizes | {"contact": capacity},
        strand=np.repeat(np.arange(len(model.strands)), [s.node_count for s in model.strands]),
        attached=attached,
        joined=np.isin(np.arange(model.node_count), model.joined_node),
    )


def _flow(model: Model, sizes: dict[str, int]) -> Flow:
    before, after = columns(model.drag_edge)
    return Flow.zeros(
        sizes,
        velocity=np.array(model.scene.fluid.velocity),
        node=model.drag_node,
        edge_before=before,
        edge_after=after,
        coefficient=model.drag_coefficient,
    )


def fluid_of(model: Model, sizes: dict[str, int]) -> Fluid:
    """Return the fluid of a scene in which it has inertia."""
    return Fluid.zeros(
        sizes,
        velocity=np.array(model.scene.fluid.velocity),
        edge_node=model.edge_node,
        mass=model.fluid_mass,
        joined=model.joined_node,
    )


def _forces(model: Model, name: str, loads: PointLoads) -> PointForces:
    before, after = columns(model.contact_points.node_edges[loads.nodes.target])
    return PointForces.zeros(
        {"loaded node": len(loads.nodes.target), "loaded body": len(loads.bodies.target)},
        energy_slot=slot_of(name),
        node=loads.nodes.target,
        node_load=loads.nodes.load,
        node_vector=loads.nodes.vector,
        body=loads.bodies.target,
        body_load=loads.bodies.load,
        body_vector=loads.bodies.vector,
        edge_before=before,
        edge_after=after,
    )


def _moments(model: Model) -> Moments:
    dead, following = model.dead_loads.moments, model.follower_loads.moments
    body = np.concatenate([dead.target, following.target])
    return Moments.zeros(
        {"moment": len(body)},
        dead=len(dead.target),
        body=body,
        load=np.concatenate([dead.load, following.load]),
        vector=np.concatenate([dead.vector, following.vector]),
    )


def _inertia_of_bodies(model: Model) -> Array:
    """Factor of the shift for each unknown of free bodies, m and tr(J), shape (6 n_free,)."""
    pairs = zip(model.bodies.mass, model.bodies.second_moment, strict=True)
    return np.concatenate([np.zeros(0), *(np.repeat([m, np.trace(j)], 3) for m, j in pairs)])

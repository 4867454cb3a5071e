"""From a model to the groups of arrays of its problem."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..forces.added_mass import fluid_momentum
from ..forces.friction_limit import PATH_SIZE
from ..model.force_places import place_of
from ..model.layout import columns
from ..model.model import Model, PointLoads
from ..model.records.parts import (
    Attachments,
    Bodies,
    Bonds,
    Constrained,
    ContactColumns,
    Drives,
    Flow,
    Fluid,
    Moments,
    OffAxis,
    Plane,
    PointForces,
    RodContact,
    Sliding,
    Slips,
    Space,
    Strands,
    Surfaces,
)
from ..model.records.problem import Border, BorderedSystem, System
from .allocate import NearRods, NearSurfaces, SecondDerivatives, body_masses

Array = np.ndarray
NONE = np.zeros(0, dtype=np.int64)


def lasting_groups(model: Model, second: SecondDerivatives) -> dict[str, Any]:
    """The groups of a problem that stay as they are."""
    layout, scene = model.solved_layout, model.scene
    bodies, free, plane = model.bodies, len(model.bodies.mass), model.plane
    b = layout.half_bandwidth
    return dict(
        gravity=np.array(scene.gravity, dtype=float),
        damping=float(scene.damping.mass),
        strands=Strands(
            size=layout.size,
            dimension=layout.dimension,
            edge_count=model.edge_count,
            bend_count=model.bend_count,
            bandwidth=b,
            axes=model.directions,
            row=layout.node,
            node_unknown=model.layout.node,
            edge_unknown=model.layout.edge,
            **{name: getattr(model, name) for name in Strands.names[9:]},
        ),
        drives=Drives(**{name: getattr(model, name) for name in Drives.names}),
        space=_space(model, second) if plane is None else Space.absent(),
        plane=_plane(model, second) if plane is not None else Plane.absent(),
        off_axis=OffAxis.absent() if len(model.pair_top) else _off_axis(model),
        bonds=(
            Bonds(top=model.pair_top, bottom=model.pair_bottom, stiffness=model.pair_stiffness, rest=model.pair_rest)
            if len(model.pair_top)
            else Bonds.absent()
        ),
        bodies=Bodies(
            free_index=bodies.free_index,
            body_of_free=bodies.body_of_free,
            prescribed=np.flatnonzero(bodies.free_index[:-1] < 0),
            mass=bodies.mass,
            second_moment=bodies.second_moment,
            inertia=body_masses(model),
            freedom=bodies.freedom,
            reach=bodies.reach,
            turns=np.array(
                [f >= 0 or len(r) > 0 for f, r in zip(bodies.free_index, bodies.rotations, strict=False)], dtype=bool
            ),
        ),
        border=(
            Border(border=np.zeros((layout.size + b, 6 * free)), corner=np.zeros((6 * free, 6 * free)))
            if free
            else Border.absent()
        ),
        constrained=_held(model),
        attachments=_grips(model) if free else Attachments.absent(),
        flow=_flow(model) if scene.fluid is not None else Flow.absent(),
        fluid=fluid_of(model) if len(model.fluid_mass) else Fluid.absent(),
        loads=_forces(model, "loads", model.dead_loads) if scene.loads else PointForces.absent(),
        followers=_forces(model, "followers", model.follower_loads) if scene.loads else PointForces.absent(),
        moments=_moments(model) if scene.loads else Moments.absent(),
        meets=model.meets_surfaces or model.rod_surfaces is not None,
        system=System(
            band=np.zeros((layout.size + b, b + 1)),
            right=np.zeros(layout.size + b),
            step=np.zeros(model.layout.size),
            body_step=np.zeros((free, 6)),
            node_step=np.zeros((model.node_count, 3)),
            motion=np.zeros((len(bodies.names) + 1, 6)),
            negative=np.zeros(1, dtype=np.int64),
        ),
    )


def _space(model: Model, second: SecondDerivatives) -> Space:
    return Space(
        top_hessian=second.top_hessian,
        bottom_hessian=second.bottom_hessian,
        bond_hessian=second.cross_hessian[model.bend_count :],
    )


def _plane(model: Model, second: SecondDerivatives) -> Plane:
    names = ("cross_hessian", "pair_hessian", "frame", "polar_gradient", "polar_hessian", "mixed_hessian")
    return Plane(
        normal=model.plane.normal,
        side=model.plane.side,
        joint_after=model.plane.joint_after,
        **{name: getattr(second, name) for name in names},
    )


def _off_axis(model: Model) -> OffAxis:
    return OffAxis(joint=model.coupled_joint, slope=model.strain_slope, rest=np.zeros_like(model.joint_rest))


def wide_of(model: Model, columns: int, width: Array) -> BorderedSystem:
    """A border with room for so many columns."""
    rows = model.solved_layout.size + model.solved_layout.half_bandwidth
    return BorderedSystem(
        border=np.zeros((columns, rows)),
        scaled=np.zeros((columns, rows)),
        schur=np.zeros((columns, columns)),
        load=np.zeros(columns),
        width=width,
        coupled=np.zeros(1, dtype=np.int64),
    )


def _grips(model: Model) -> Attachments:
    return Attachments(
        holding=int((model.attached_free >= 0).sum()),
        unknown=model.solved_layout.attached,
        free=model.attached_free,
        of_unknown=model.solved_layout.attached_of_unknown,
        wall_free=model.wall_free,
        wall_joint=model.wall_joint,
    )


def _held(model: Model) -> Constrained:
    return Constrained(
        node=model.attached_node,
        unknown=model.layout.attached,
        row=model.solved_layout.attached,
        body=model.attached_body,
        free=model.attached_free,
        position=model.attached_position,
        wall_body=model.wall_body,
        wall_free=model.wall_free,
        wall_tangent=model.wall_tangent,
        wall_director1=model.start_director1,
    )


def surfaces_of(model: Model, near: NearSurfaces) -> Surfaces:
    carriers, surfaces, contact = model.carriers, model.surfaces, model.scene.contact
    return Surfaces(
        d_hat=contact.barrier_distance,
        stiffness=contact.stiffness,
        radius=carriers.radius,
        weight=carriers.weight,
        carrier_body=carriers.body,
        free_index=model.bodies.free_index if model.free_count else NONE,
        follows=carriers.follows,
        node_free=near.node_free,
        group=carriers.group,
        point_position=carriers.position,
        point_body=carriers.body[model.node_count :],
        kind=surfaces.kind,
        size=surfaces.size,
        rounding=surfaces.rounding,
        bound=surfaces.bound,
        body=surfaces.body,
        position=surfaces.position,
        turn=surfaces.turn,
        meets=surfaces.meets,
        near_carrier=near.carrier,
        near_surface=near.surface,
        near_gap=near.gap,
        near_count=near.counted,
        margin=near.margin,
        extent=near.extent,
        listed_carrier=near.listed_carrier,
        listed_place=near.listed_place,
        listed_turn=near.listed_turn,
    )


def sliding_of(model: Model, room: int) -> Sliding:
    carriers, bodies, law = model.carriers, len(model.bodies.names) + 1, model.scene.contact.friction
    return Sliding(
        acts=law is not None and law.acts,
        threshold=law.speed_threshold if law is not None else 0.0,
        coefficient=carriers.friction,
        node_edges=carriers.node_edges,
        node_axis=carriers.node_axis,
        count=np.zeros(1, dtype=np.int64),
        first=np.zeros(room, dtype=np.int64),
        surface=np.zeros(room, dtype=np.int64),
        load=np.zeros(room),
        **{name: np.zeros((room, 3)) for name in ("normal", "axis", "arm", "lever")},
        **{name: np.zeros((bodies, 3, 3)) for name in ("back", "turn", "origin_turn")},
    )


def slips_of(model: Model, room: int) -> Slips:
    """Absent if nothing slides against friction."""
    law = model.scene.contact.friction if model.scene.contact else None
    if law is None or not law.acts:
        return Slips.absent()
    return Slips(threshold=law.speed_threshold, way=np.zeros((room, PATH_SIZE)))


def rod_contact_of(model: Model, rods: NearRods) -> RodContact:
    contact = model.scene.contact
    law = contact.friction
    return RodContact(
        d_hat=contact.barrier_distance,
        stiffness=contact.stiffness,
        slides=law is not None and law.acts and law.coefficient > 0.0,
        coefficient=law.coefficient if law is not None else 0.0,
        threshold=law.speed_threshold if law is not None else 1.0,
        unit=rods.unit,
        point_weight=model.rod_surfaces.point_weight,
        search=rods.pairs.search,
        last=rods.last,
        ways=rods.ways,
        no_step=rods.no_step,
        gap=np.zeros(1),
        contacts=rods.contacts.record,
        sliding=rods.sliding.record,
    )


def contact_columns_of(model: Model, capacity: int) -> ContactColumns:
    """With room for so many contacts of barrier and friction together."""
    nodes, strands, d = model.node_count, len(model.strands), model.solved_layout.dimension
    attached = np.full(nodes, -1)
    attached[model.attached_node] = np.arange(len(model.attached_node))
    return ContactColumns(
        counts=np.zeros(2, dtype=np.int64),
        node=np.zeros((capacity, 2), dtype=np.int64),
        weight=np.zeros((capacity, 4)),
        matrix=np.zeros((capacity, d, d)),
        stiffness=np.zeros(capacity),
        foot_gradient=np.zeros((capacity, 4, d)),
        strand=np.repeat(np.arange(strands), [s.node_count for s in model.strands]),
        attached=attached,
        mark=np.zeros((nodes, 3), dtype=np.int64),
        met=np.zeros((strands, strands), dtype=np.int64),
        row=np.zeros(nodes, dtype=np.int64),
        column=np.zeros(model.solved_layout.size, dtype=np.int64),
    )


def _flow(model: Model) -> Flow:
    before, after = columns(model.drag_edge)
    return Flow(
        velocity=np.array(model.scene.fluid.velocity),
        node=model.drag_node,
        edge_before=before,
        edge_after=after,
        coefficient=model.drag_coefficient,
        direction=np.zeros((len(model.drag_node), 3, 3)),
    )


def fluid_of(model: Model) -> Fluid:
    """The fluid of a scene in which it has inertia."""
    edges = model.edge_count + model.wall_count
    return Fluid(
        velocity=np.array(model.scene.fluid.velocity),
        edge_node=model.edge_node,
        mass=model.fluid_mass,
        direction1=np.zeros((edges, 3)),
        direction2=np.zeros((edges, 3)),
        shape_gradient=np.zeros((model.edge_count, 4)),
        momentum=np.zeros((model.node_count, 3)),
        node_velocity=np.zeros((model.node_count, 3)),
        spin=np.zeros(model.edge_count),
        fluid_momentum=fluid_momentum.address,
    )


def _forces(model: Model, name: str, loads: PointLoads) -> PointForces:
    before, after = columns(model.carriers.node_edges[loads.nodes.target])
    return PointForces(
        place=place_of(name),
        node=loads.nodes.target,
        node_load=loads.nodes.load,
        node_vector=loads.nodes.vector,
        body=loads.bodies.target,
        body_load=loads.bodies.load,
        body_vector=loads.bodies.vector,
        on_nodes=np.zeros((len(loads.nodes.target), 3)),
        on_bodies=np.zeros((len(loads.bodies.target), 3)),
        edge_before=before,
        edge_after=after,
    )


def _moments(model: Model) -> Moments:
    dead, following = model.dead_loads.moments, model.follower_loads.moments
    body = np.concatenate([dead.target, following.target])
    return Moments(
        dead=len(dead.target),
        body=body,
        load=np.concatenate([dead.load, following.load]),
        vector=np.concatenate([dead.vector, following.vector]),
        present=np.zeros((len(body), 3)),
    )

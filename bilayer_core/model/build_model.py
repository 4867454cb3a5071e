"""Build the records and arrays of a `Model` from a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.model.bodies import build_bodies, robot_mass
from bilayer_core.model.contact_points import build_contact
from bilayer_core.model.field_points import build_varied_fields
from bilayer_core.model.force_list import active_forces
from bilayer_core.model.immersed import build_fluid
from bilayer_core.model.impacts import stiffness_for_impacts
from bilayer_core.model.laminate import add_laminate
from bilayer_core.model.lit_elements import build_light
from bilayer_core.model.model import Model, PlacedBodies
from bilayer_core.model.planarity import require_plane
from bilayer_core.model.plane import Plane as ScenePlane
from bilayer_core.model.plate_strip import flattening_series
from bilayer_core.model.point_loads import add_point_masses, build_loads, edges_of_loads
from bilayer_core.model.raised_edges import build_raised
from bilayer_core.model.records.parts import (
    Attachments,
    Bonds,
    Constrained,
    Drives,
    Flattening,
    Joins,
    Moduli,
    OffAxis,
    Plane,
    Strands,
    Viscosity,
)
from bilayer_core.model.rod_surfaces import build_rod_surfaces
from bilayer_core.model.rods import add_bonded_rods
from bilayer_core.model.start_gaps import refuse_meeting_rods, refuse_penetration
from bilayer_core.model.strands import Collected
from bilayer_core.model.unknown_order import Layout, columns, number_unknowns
from bilayer_core.scene.config import SceneConfig

ADD_ROD = {"two_rod": add_bonded_rods, "laminate": add_laminate}
"""How each model turns a rod into strands."""


def build_model(scene: SceneConfig, model: str = "two_rod", dimension: int = 3) -> Model:
    """Build one of the models, `ADD_ROD`, of `scene`, in space or, with dimension 2, in its plane.

    Raises
    ------
    SceneError
        If the scene does not stay in a plane.
    PenetrationError
        If a node or a body starts behind a surface, or touching it; the message says which and by how much.
    """
    plane = require_plane(scene) if dimension == 2 else None
    found = Collected()
    body_index = {body.name: index for index, body in enumerate(scene.bodies)}
    for rod in scene.rods:
        ADD_ROD[model](found, scene, rod, body_index)
    add_point_masses(scene, found)
    placed, bodies = build_bodies(scene, found, plane)
    contact = build_contact(scene, found, placed, bodies.free_index, plane is not None)
    numbered = found.rods, found.node_count, found.edge_count, found.column("attached_node", np.int64)
    rod_search, rod_point_weight, rails = build_rod_surfaces(scene, found, plane is not None)
    layout = number_unknowns(*numbered, has_rails=rails.exists)
    solved = layout if plane is None else number_unknowns(*numbered, dimension=2, has_rails=rails.exists)
    forces, rods = active_forces(scene, model, dimension), _rods(found, layout, solved, plane)
    constrained = _constrained(found, bodies.free_index, layout, solved)
    drives, bonds = _drives(found), _bonds(found, rods.bend_count)
    joined_node, joined_edge = found.column("joined_node", np.int64, 2), found.column("joined_edge", np.int64, 2)
    raised, number, kept_directors = build_raised(found, edges_of_loads(scene, found), scene.fluid is not None)
    flow, fluid = build_fluid(scene.fluid, found, rods.edge_node, raised, number)
    loads, followers, moments = build_loads(scene, found, placed.names, bodies.free_index, number)
    coupled = np.argsort(found.column("coupled_joint", np.int64))
    strain_coupling = found.column("strain_coupling", width=2)[coupled]
    built = Model(
        scene=scene,
        forces=forces,
        strands=tuple(found.strands),
        layout=layout,
        solved_layout=solved,
        rods=rods,
        viscosity=_viscosity(found) if "viscosity" in forces else Viscosity.absent(),
        drives=drives,
        varied_fields=build_varied_fields(scene, found),
        light=build_light(scene, found, placed, rods, drives),
        plane=Plane.absent() if plane is None else _plane(plane, found, placed, rods),
        flattening=_flattening(found, rods),
        moduli=_moduli(found, rods, drives),
        off_axis=OffAxis.absent() if bonds.exists else _off_axis(found, rods, strain_coupling),
        bonds=bonds,
        raised=raised,
        kept_directors=kept_directors,
        free_bodies=bodies,
        constrained=constrained,
        attachments=_attachments(constrained, solved, rods) if len(bodies.mass) else Attachments.absent(),
        joins=_joins(found, solved, rails.exists),
        flow=flow,
        fluid=fluid,
        loads=loads,
        followers=followers,
        moments=moments,
        rod_search=rod_search,
        rails=rails,
        **contact,
        bodies=placed,
        robot_mass=robot_mass(scene, found, bodies),
        contact_stiffness=0.0 if scene.contact is None else scene.contact.stiffness,
        rod_point_weight=rod_point_weight,
        node_count=found.node_count,
        start_position=found.column("position", width=3),
        joined_node=joined_node,
        joined_edge=joined_edge,
        node_length=found.column("node_length"),
        joint_node=_of_joints(found, "joint_node", np.int64),
        voronoi_length=found.column("voronoi_length"),
        strain_coupling=strain_coupling,
    )
    refuse_penetration(built)
    refuse_meeting_rods(built)
    stiffness = stiffness_for_impacts(built)
    return built if stiffness == built.contact_stiffness else replace(built, contact_stiffness=stiffness)


def _of_joints(found: Collected, name: str, dtype: type = float, width: int | None = None) -> np.ndarray:
    """Return a column of all joints, those of bonds last."""
    return np.concatenate([found.column(kind + name, dtype, width) for kind in ("", "bond_")])


def _of_pairs(found: Collected, name: str, dtype: type = float, width: int | None = None) -> np.ndarray:
    """Return a column of all vectors between layers, those where a layer ends last."""
    return np.concatenate([found.column(kind + name, dtype, width) for kind in ("pair_", "end_")])


def _rods(found: Collected, layout: Layout, solved: Layout, plane: ScenePlane | None) -> Strands:
    return Strands(
        size=solved.size,
        dimension=solved.dimension,
        edge_count=found.edge_count,
        bend_count=found.joint_count,
        bandwidth=solved.half_bandwidth,
        bandwidth_apart=solved.half_bandwidth_apart,
        axes=np.eye(3) if plane is None else plane.axes,
        row=solved.node,
        node_unknown=layout.node,
        edge_unknown=layout.edge,
        edge_node=found.column("edge_node", np.int64),
        **{name: found.column(name) for name in ("node_mass", "spin_inertia", "half_width")},
        **{name: found.column(name) for name in ("rest_length", "axial_stiffness")},
        joint_a=_resolve(_of_joints(found, "joint_a", np.int64), found.edge_count),
        joint_b=_resolve(_of_joints(found, "joint_b", np.int64), found.edge_count),
        joint_stiffness=_of_joints(found, "joint_stiffness", width=3),
    )


def _viscosity(found: Collected) -> Viscosity:
    return Viscosity(
        edge_time=found.column("edge_time"),
        joint_time=_of_joints(found, "joint_time", width=3),
        pair_time=_of_pairs(found, "time", width=3),
    )


def _drives(found: Collected) -> Drives:
    lags = [np.array(of, dtype=float) for _, of, _ in found.fields]
    first = np.cumsum([0, *map(len, lags)])
    rising, falling = np.concatenate([np.zeros((0, 2)), *lags]).T.copy()
    weights = [weight for _, weight, *_ in found.laws]
    numbers = np.array([own[2:] for own in found.laws], dtype=float).reshape(-1, 3).T.copy()
    rest, strips = _of_joints(found, "joint_rest", width=3), found.column("strip_joint", np.int64)
    curled, freed = (
        len(rest) + np.searchsorted(strips, found.column(f"{of}_joint", np.int64)) for of in ("curled", "freed")
    )
    driven, twisted = (found.column(f"{name}_joint", np.int64) for name in ("driven", "twisted"))
    curled_at_rest = np.zeros((len(strips), 3))
    curled_at_rest[:, 0], curled_at_rest[:, 1] = found.column("strip_rest"), found.column("strip_free")
    multiples = np.zeros((len(found.moduli) + 1 if found.moduli else 0, 3))
    multiples[:, 0] = 1.0
    changed = len(rest) + len(strips) + np.arange(len(found.moduli))
    return Drives(
        rest_strain=found.column("rest_strain"),
        joint_rest=np.concatenate([rest, curled_at_rest, multiples]),
        driven_edge=found.column("driven_edge", np.int64),
        driven_law=found.column("driven_law", np.int64),
        driven_weight=found.column("driven_weight"),
        driven_joint=np.concatenate([driven, curled, freed, twisted, changed]),
        driven_joint_column=np.repeat([0, 0, 1, 2, 0], [*map(len, (driven, curled, freed, twisted, changed))]),
        driven_joint_law=np.concatenate([_of_driven(found, "law", np.int64), np.array(found.moduli, dtype=np.int64)]),
        driven_joint_weight=np.append(_of_driven(found, "weight"), np.ones(len(found.moduli))),
        field_channel=np.array([channel for channel, *_ in found.fields], dtype=np.int64),
        field_first=first.astype(np.int64),
        field_slowest=first[:-1] + np.array([of.max(axis=1).argmax() for of in lags], dtype=np.int64),
        mode_rising=rising,
        mode_falling=falling,
        law_field=np.array([at for at, *_ in found.laws], dtype=np.int64),
        law_first=np.cumsum([0, *map(len, weights)]).astype(np.int64),
        law_weight=np.array([part for weight in weights for part in weight], dtype=float),
        **dict(zip(("law_gain", "law_reference", "law_saturation"), numbers, strict=True)),
    )


def _of_driven(found: Collected, name: str, dtype: type = float) -> np.ndarray:
    """Return a column of κ̄₁, of κ̄y Δl, of κ̄x Δl − κ̄₁ and of ψ̄ that follow laws."""
    return np.concatenate(
        [found.column(f"{of}_{name}", dtype) for of in ("driven_joint", "curled", "freed", "twisted")]
    )


def _flattening(found: Collected, rods: Strands) -> Flattening:
    """Return the joints of strips, in order; a clamp edge is as wide and stiff as the edge that it holds."""
    joint = found.column("strip_joint", np.int64)
    if not len(joint):
        return Flattening.absent()
    edges = np.stack([rods.joint_a, rods.joint_b], axis=1)[joint]
    edges = np.where(edges < rods.edge_count, edges, edges[:, ::-1])
    width, length = 2.0 * rods.half_width[edges].mean(axis=1), found.column("voronoi_length")[joint]
    bending, offset = rods.joint_stiffness[joint, 0], found.column("strip_offset")
    membrane = found.column("strip_membrane") * rods.axial_stiffness[edges].mean(axis=1)
    row = np.ones(len(rods.joint_a) + len(joint), dtype=bool)
    row[np.setdiff1d(np.arange(len(rods.joint_a)), joint)] = False
    return Flattening.zeros(
        UNALLOCATED,
        first=len(rods.joint_a),
        joint=joint,
        row=row,
        stiffness=0.25 * (1.0 - offset**2) * width**4 * membrane / length**3,
        scale=0.5 * width**2 * np.sqrt(membrane / (found.column("strip_plate") * bending * length**3)),
        coupling=found.column("strip_coupling") * bending,
        start=found.column("strip_start") ** 2,
        series=flattening_series(offset),
        **{name: found.column(f"strip_{name}") for name in ("curl", "skew", "offset")},
    )


def _moduli(found: Collected, rods: Strands, drives: Drives) -> Moduli:
    """Return the rows with the multiples of elastic moduli; absent where none follow a stimulus."""
    if not found.moduli:
        return Moduli.absent()
    last = len(drives.joint_rest) - 1
    first = last - len(found.moduli)

    def rows(own: np.ndarray) -> np.ndarray:
        return np.where(own < 0, last, first + own)

    bonded = found.column("bond_share")
    of_joints = np.append(found.column("joint_modulus", np.int64), np.full(len(bonded), -1))
    return Moduli.zeros(
        UNALLOCATED,
        first=first,
        edge=rows(found.column("edge_modulus", np.int64)),
        joint=rows(of_joints),
        pair=rows(_of_pairs(found, "modulus", np.int64)),
        share=np.append(np.zeros(rods.bend_count), bonded),
    )


def _bonds(found: Collected, bend_count: int) -> Bonds:
    joint = _resolve(_of_pairs(found, "joint", np.int64), bend_count)
    if not len(joint):
        return Bonds.absent()
    widths = {"weight": 2, "stiffness": 3, "rest": 3}
    arrays = {name: _of_pairs(found, name, width=width) for name, width in widths.items()}
    return Bonds(joint=joint, node=_of_pairs(found, "node", np.int64, 4), **arrays)


def _off_axis(found: Collected, rods: Strands, coupling: np.ndarray) -> OffAxis:
    joint = np.sort(found.column("coupled_joint", np.int64))
    lengths = np.concatenate([rods.rest_length, np.ones(found.clamp_count)])
    slope = coupling / lengths[np.stack([rods.joint_a, rods.joint_b], axis=1)[joint]]
    return OffAxis.zeros(UNALLOCATED, joint=joint, slope=slope)


def _plane(plane: ScenePlane, found: Collected, bodies: PlacedBodies, rods: Strands) -> Plane:
    after = np.full(rods.edge_count, -1, dtype=np.int64)
    first, second = rods.joint_a[: rods.bend_count], rods.joint_b[: rods.bend_count]
    inner = np.flatnonzero((first < rods.edge_count) & (second < rods.edge_count))
    after[first[inner]] = inner
    return Plane.zeros(UNALLOCATED, normal=plane.normal, side=_sides(plane, found, bodies), joint_after=after)


def _constrained(found: Collected, free_index: np.ndarray, layout: Layout, solved: Layout) -> Constrained:
    body = found.column("attached_body", np.int64)
    free = free_index[body]
    return Constrained(
        node=found.column("attached_node", np.int64),
        unknown=layout.attached,
        row=solved.attached,
        body=body,
        free=free,
        position=found.column("attached_position", width=3),
        clamp_edge_body=body,
        clamp_edge_free=free,
        clamp_edge_tangent=found.column("clamp_edge_tangent", width=3),
        clamp_edge_director1=np.concatenate(
            [found.column(name, width=3) for name in ("director1", "clamp_edge_director1")]
        ),
    )


def _attachments(held: Constrained, solved: Layout, rods: Strands) -> Attachments:
    joints = np.empty(len(held.clamp_edge_body), dtype=np.int64)
    for edges in (rods.joint_a, rods.joint_b):
        of_clamp = np.flatnonzero(edges >= rods.edge_count)
        joints[edges[of_clamp] - rods.edge_count] = of_clamp
    return Attachments(
        holding=int((held.free >= 0).sum()),
        unknown=solved.attached,
        free=held.free,
        of_unknown=solved.attached_of_unknown,
        clamp_edge_free=held.clamp_edge_free,
        clamp_edge_joint=joints,
    )


def _joins(found: Collected, solved: Layout, has_rails: bool) -> Joins:
    """Return the unknowns that have join columns (`engine.linear.closed_rods`), each with its copy; absent without any
    closed strands.
    """
    node, edge = found.column("joined_node", np.int64, 2), found.column("joined_edge", np.int64, 2)
    if not len(node):
        return Joins.absent()
    if has_rails:
        node = np.concatenate([node, node[1::2, :1] + [[1, 1]]])
        edge = np.concatenate([edge, edge[:, :1] + [[1, 1]]])
    of_nodes = solved.node[node][:, None] + np.arange(solved.dimension)[:, None]
    of_edges = solved.edge[edge] if solved.dimension == 3 else edge[:0]
    unknowns = np.concatenate([of_nodes.reshape(-1, 2), of_edges])
    column = np.full(solved.size, -1, dtype=np.int64)
    column[unknowns] = np.arange(len(unknowns))[:, None]
    first, copy = columns(unknowns)
    return Joins(first=first, copy=copy, column=column)


def _sides(plane: ScenePlane, found: Collected, bodies: PlacedBodies) -> np.ndarray:
    """Return the sign σ of m1 = σ normal × t of edges and clamp edges, shape (n_edge + n_clamp_edge,)."""
    rotation = bodies.start_rotation[found.column("attached_body", np.int64)]
    columns = [found.column(f"clamp_edge_{name}", width=3) for name in ("tangent", "director1")]
    clamp_edges = [np.einsum("kij,kj->ki", rotation, column) for column in columns]
    tangent, director1 = (
        np.concatenate([found.column(name, width=3), of_clamp_edges])
        for name, of_clamp_edges in zip(("tangent", "director1"), clamp_edges, strict=True)
    )
    return np.sign(np.einsum("ki,ki->k", director1, cross(np.broadcast_to(plane.normal, tangent.shape), tangent)))


def _resolve(numbers: np.ndarray, count: int) -> np.ndarray:
    """Return the edges or joints; those after the first `count`, clamp edges or bonds, were entered as −1 − their own
    number because `count` was not known then.
    """
    return np.where(numbers < 0, count - 1 - numbers, numbers)

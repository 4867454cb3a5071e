"""Build the arrays of a `Model` from a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.model.bodies import build_bodies
from bilayer_core.model.contact_points import build_contact, refuse_penetration
from bilayer_core.model.force_list import active_forces
from bilayer_core.model.impacts import stiffness_for_impacts
from bilayer_core.model.laminate import add_laminate
from bilayer_core.model.model import Bodies, Model
from bilayer_core.model.planarity import require_plane
from bilayer_core.model.plane import InPlane, Plane
from bilayer_core.model.point_loads import add_point_masses, build_loads
from bilayer_core.model.rod_penetration import refuse_meeting_rods
from bilayer_core.model.rod_surfaces import build_rod_surfaces
from bilayer_core.model.rods import add_bonded_rods
from bilayer_core.model.strands import Collected
from bilayer_core.model.unknown_order import number_unknowns
from bilayer_core.scene.config import SceneConfig

ADD_ROD = {"two_rod": add_bonded_rods, "laminate": add_laminate}
"""How each model turns a rod into strands."""


def build_model(scene: SceneConfig, model: str = "two_rod", dimension: int = 3) -> Model:
    """Arrays of one of the models, `ADD_ROD`, of `scene`, in space or, with dimension 2, in its plane.

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
    edge_count, bond_joints = found.edge_count, "bond_"
    bodies = build_bodies(scene, found, plane)
    contact_points, surfaces = build_contact(scene, found, bodies, plane is not None)
    clamp_edges = found.column("clamp_edge_tangent", width=3)
    clamp_a = _resolve(found.column("joint_a", np.int64), edge_count)
    clamp_b = _resolve(found.column("joint_b", np.int64), edge_count)

    def joined(name: str, dtype=float, width: int | None = None) -> np.ndarray:
        return np.concatenate([found.column(name, dtype, width), found.column(bond_joints + name, dtype, width)])

    def pairs(name: str, dtype=float, width: int | None = None) -> np.ndarray:
        return np.concatenate([found.column(kind + name, dtype, width) for kind in ("pair_", "end_")])

    attached = found.column("attached_node", np.int64)
    numbered = found.rods, found.node_count, edge_count, attached
    laws = np.array(found.laws, dtype=float).reshape(-1, 6)
    mass_moment = found.column("mass_moment")
    arrays = Model(
        scene=scene,
        forces=active_forces(scene, model, dimension),
        strands=tuple(found.strands),
        layout=number_unknowns(*numbered),
        plane=None
        if plane is None
        else InPlane(
            axes=plane.axes,
            normal=plane.normal,
            side=_sides(plane, found, bodies),
            joint_after=_joints_after(clamp_a, clamp_b, edge_count),
            layout=number_unknowns(*numbered, dimension=2),
        ),
        bodies=bodies,
        contact_stiffness=0.0 if scene.contact is None else scene.contact.stiffness,
        contact_points=contact_points,
        surfaces=surfaces,
        dead_loads=build_loads(scene, found, bodies, "world"),
        follower_loads=build_loads(scene, found, bodies, "material"),
        rod_surfaces=build_rod_surfaces(scene, found),
        node_count=found.node_count,
        edge_count=edge_count,
        clamp_edge_count=len(clamp_edges),
        bend_count=len(clamp_a),
        start_position=found.column("position", width=3),
        start_director1=np.concatenate([found.column(name, width=3) for name in ("director1", "clamp_edge_director1")]),
        clamp_edge_tangent=clamp_edges,
        joined_node=found.column("joined_node", np.int64, 2),
        joined_edge=found.column("joined_edge", np.int64, 2),
        attached_node=attached,
        attached_body=found.column("attached_body", np.int64),
        attached_position=found.column("attached_position", width=3),
        clamp_edge_body=found.column("attached_body", np.int64),
        clamp_edge_joint=_joints_of_clamp_edges(clamp_a, clamp_b, edge_count, len(clamp_edges)),
        drag_node=found.column("drag_node", np.int64),
        drag_edge=found.column("drag_edge", np.int64, 2),
        drag_coefficient=found.column("drag_coefficient", width=3),
        fluid_mass=found.column("fluid_mass", width=3),
        node_length=found.column("node_length"),
        node_mass=found.column("node_mass"),
        mass_moment=mass_moment if mass_moment.any() else mass_moment[:0],
        spin_inertia=found.column("spin_inertia"),
        half_width=found.column("half_width"),
        edge_node=found.column("edge_node", np.int64),
        rest_length=found.column("rest_length"),
        axial_stiffness=found.column("axial_stiffness"),
        rest_strain=found.column("rest_strain"),
        driven_edge=found.column("driven_edge", np.int64),
        driven_law=found.column("driven_law", np.int64),
        driven_weight=found.column("driven_weight"),
        driven_joint=found.column("driven_joint", np.int64),
        driven_joint_law=found.column("driven_joint_law", np.int64),
        driven_joint_weight=found.column("driven_joint_weight"),
        law_channel=laws[:, 0].astype(np.int64),
        law_rising=laws[:, 1].copy(),
        law_falling=laws[:, 2].copy(),
        law_gain=laws[:, 3].copy(),
        law_reference=laws[:, 4].copy(),
        law_saturation=laws[:, 5].copy(),
        lit_law=found.column("lit_law", np.int64),
        lit_edge=found.column("lit_edge", np.int64),
        lit_side=found.column("lit_side"),
        lit_height=found.column("lit_height"),
        lit_half=found.column("lit_half"),
        lit_slenderness=found.column("lit_slenderness"),
        joint_a=np.concatenate([clamp_a, found.column("bond_joint_a", np.int64)]),
        joint_b=np.concatenate([clamp_b, found.column("bond_joint_b", np.int64)]),
        joint_stiffness=joined("joint_stiffness", width=3),
        joint_rest=joined("joint_rest", width=3),
        joint_node=joined("joint_node", np.int64),
        voronoi_length=found.column("voronoi_length"),
        coupled_joint=found.column("coupled_joint", np.int64),
        strain_coupling=found.column("strain_coupling", width=2),
        edge_time=found.column("edge_time"),
        joint_time=joined("joint_time", width=3),
        pair_time=pairs("time", width=3),
        pair_joint=_resolve(pairs("joint", np.int64), len(clamp_a)),
        pair_node=pairs("node", np.int64, 4),
        pair_weight=pairs("weight", width=2),
        pair_stiffness=pairs("stiffness", width=3),
        pair_rest=pairs("rest", width=3),
    )
    refuse_penetration(arrays)
    refuse_meeting_rods(arrays)
    stiffness = stiffness_for_impacts(arrays)
    return arrays if stiffness == arrays.contact_stiffness else replace(arrays, contact_stiffness=stiffness)


def _sides(plane: Plane, found: Collected, bodies: Bodies) -> np.ndarray:
    """Sign σ of m1 = σ normal × t of edges and clamp edges, shape (n_edge + n_clamp_edge,)."""
    rotation = bodies.start_rotation[found.column("attached_body", np.int64)]
    columns = [found.column(f"clamp_edge_{name}", width=3) for name in ("tangent", "director1")]
    clamp_edges = [np.einsum("kij,kj->ki", rotation, column) for column in columns]
    tangent, director1 = (
        np.concatenate([found.column(name, width=3), of_clamp_edges])
        for name, of_clamp_edges in zip(("tangent", "director1"), clamp_edges, strict=True)
    )
    return np.sign(np.einsum("ki,ki->k", director1, cross(np.broadcast_to(plane.normal, tangent.shape), tangent)))


def _joints_after(joint_a: np.ndarray, joint_b: np.ndarray, edge_count: int) -> np.ndarray:
    """Return the joint between each edge and the next one of its strand, −1 if there is none, shape (n_edge,)."""
    joints = np.full(edge_count, -1, dtype=np.int64)
    inner = np.flatnonzero((joint_a < edge_count) & (joint_b < edge_count))
    joints[joint_a[inner]] = inner
    return joints


def _resolve(numbers: np.ndarray, count: int) -> np.ndarray:
    """Edges or joints; those after the first `count`, clamp edges or bonds, were entered as −1 − their own number
    because `count` was not known then.
    """
    return np.where(numbers < 0, count - 1 - numbers, numbers)


def _joints_of_clamp_edges(joint_a: np.ndarray, joint_b: np.ndarray, edge_count: int, clamp_edges: int) -> np.ndarray:
    """Return the joint that each clamp edge takes part in, shape (n_clamp_edge,)."""
    joints = np.empty(clamp_edges, dtype=np.int64)
    for edges in (joint_a, joint_b):
        of_clamp = np.flatnonzero(edges >= edge_count)
        joints[edges[of_clamp] - edge_count] = of_clamp
    return joints

"""The arrays of a model: all that does not change during a run. They are read-only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.model.free_motions import Mechanism, mechanisms_of
from bilayer_core.model.plane import InPlane
from bilayer_core.model.rod_surfaces import RodSurfaces
from bilayer_core.model.shape_numbers import Shape
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.model.unknown_order import Layout, ReadOnlyArrays
from bilayer_core.scene.config import SceneConfig

Array = np.ndarray
AXES = np.eye(3)
AXES.flags.writeable = False  # as a model's arrays


@dataclass(frozen=True)
class Bodies(ReadOnlyArrays):
    """Rigid bodies, in the scene's order. *Free* bodies, guided ones among them, have unknowns, in the order in which
    they occur. After the last body comes the world, which never moves.
    """

    names: tuple[str, ...]
    free_index: Array  # index among the free bodies, −1 for a prescribed one and the world, shape (n_body + 1,)
    body_of_free: Array  # the reverse, shape (n_free,)
    start_position: Array  # [m], shape (n_body, 3)
    start_rotation: Array  # shape (n_body, 3, 3)
    start_velocity: Array  # [m/s], shape (n_body, 3)
    start_angular_velocity: Array  # [rad/s], shape (n_body, 3)
    mass: Array  # of free bodies [kg], shape (n_free,)
    isotropic: Array  # whether all axes are principal: a ball needs no gyroscopic term, shape (n_free,)
    second_moment: Array  # ∫ r rᵀ dm of free bodies, body frame [kg m²], shape (n_free, 3, 3)
    freedom: (
        Array  # motions (X, φ) that free bodies are allowed, one a column, orthonormal, shape (6 n_free, n_freedom)
    )
    bounding_radius: Array  # largest distance of what a body carries, or a radius of gyration [m], shape (n_body + 1,)
    shapes: tuple[Shape | None, ...]  # surface of each body
    controlled: Array  # prescribed bodies that controllers may move, shape (n_controlled,)
    times: tuple[Array, ...]  # keyframes of each prescribed body [s]
    displacements: tuple[Array, ...]  # and its displacements there [m], shape (n_keyframe, 3)
    rotations: tuple[Array, ...]  # and its rotation vectors [rad], shape (n_keyframe, 3)


@dataclass(frozen=True)
class ContactPoints(ReadOnlyArrays):
    """Points with a radius that feel surfaces: all nodes, then *points* of bodies (contact points of the scene; corners
    and rims of surfaces), then *centres* of balls and points of obstacles, and *rod points*, which have an arm from a
    node (`model.rod_points`).
    """

    weight: Array  # Δl of the barrier [m], 0 of a node that its rod points stand for, shape (n_contact_point,)
    radius: Array  # half the thickness, offset, or radius [m], shape (n_contact_point,)
    grain: Array  # of the surface that it belongs to, in the body's frame, 0 without one, shape (n_contact_point, 3)
    node_edges: Array  # edges before and after each node, the same at an end, shape (n_node, 2)
    node_axis: Array  # which direction counts as forward: 0 t, 1 m1, ±2 ± m2, shape (n_node,)
    body: Array  # body that takes the force, −1 for those of rods, shape (n_contact_point,)
    moved_by: Array  # body that moves it, −1 for those of rods that none holds, shape (n_contact_point,)
    position: Array  # of points and centres in the body's frame [m], shape (n_point, 3)
    rod_point_node: Array  # ascending, shape (n_rod_point,)
    rod_point_arm: Array  # along m1 and m2, means of the node's edges [m], shape (n_rod_point, 2)
    rod_point_start: Array  # position at the start [m], shape (n_rod_point, 3)
    point_count: int
    group: Array  # contact points of a group meet the same surfaces, shape (n_contact_point,)


@dataclass(frozen=True)
class Surfaces(ReadOnlyArrays):
    """Surfaces that contact points can meet: obstacles, then bodies'. See `contact.shapes` for their numbers."""

    names: tuple[str, ...]
    kind: Array  # shape (n_surface,)
    size: Array  # half sizes of what is rounded [m], shape (n_surface, 3)
    rounding: Array  # [m], shape (n_surface,)
    bound: Array  # radius of a ball about the position that holds it [m], shape (n_surface,)
    body: Array  # body that it belongs to, or the world, shape (n_surface,)
    position: Array  # in the body's frame [m], shape (n_surface, 3)
    rotation: Array  # its own axes in the body's frame, shape (n_surface, 3, 3)
    grain: Array  # forward direction of friction on it in the body's frame, 0 without one, shape (n_surface, 3)
    can_collide: Array  # whether contact points of a group can meet it, shape (n_surface, n_group)
    edge_can_cross: Array  # whether it could come between the nodes of an edge, shape (n_surface, n_edge)


@dataclass(frozen=True)
class LoadShares(ReadOnlyArrays):
    """Parts of loads, each on one node or on one free body."""

    target: Array  # node or free body, shape (n_share,)
    load: Array  # index of the load in the scene, shape (n_share,)
    vector: Array  # force [N] or moment [N m] at factor 1, shape (n_share, 3)

    def scaled(self, factor: Array) -> Array:
        """Vectors at the present factors of the loads, shape (n_load,)."""
        return factor[self.load, None] * self.vector


@dataclass(frozen=True)
class PointLoads:
    """Loads from outside, either all of fixed direction, in the world's axes, or all in those of what they act on."""

    nodes: LoadShares
    bodies: LoadShares
    moments: LoadShares  # on free bodies

    @property
    def forces(self) -> int:
        """Number of shares of forces."""
        return len(self.nodes.target) + len(self.bodies.target)


@dataclass(frozen=True)
class Model(ReadOnlyArrays):
    """Flat arrays of a scene; indices run over strands in order, and along each strand.

    Edges n_edge … n_edge + n_clamp_edge − 1 are *clamp edges*, the fixed directions of clamps. *Joints* are pairs of
    edges with a bending and twisting element: inner nodes and clamps first (`bend_count`), then the rotation bonds of
    paired edges. *Pairs* are vectors between two layers: first those between paired edges, then those where a layer
    ends (`forces.bond`).
    """

    scene: SceneConfig
    forces: tuple[str, ...]  # with an energy, that the scene needs; see `model.force_list`
    strands: tuple[StrandArrays, ...]
    layout: Layout
    plane: InPlane | None  # None in three dimensions
    bodies: Bodies
    contact_stiffness: float  # of the barrier, `contact.stiffness` or more [Pa]; 0 without contact
    contact_points: ContactPoints
    surfaces: Surfaces
    dead_loads: PointLoads  # of fixed direction
    follower_loads: PointLoads  # along path, normal and path × normal of a rod, or in the axes of a body
    rod_surfaces: RodSurfaces | None  # None where no rod can meet another or itself

    node_count: int
    edge_count: int
    clamp_edge_count: int
    bend_count: int

    start_position: Array  # of nodes [m], shape (n_node, 3)
    start_director1: (
        Array  # of edges, and of clamp edges in their bodies' frames, unit, shape (n_edge + n_clamp_edge, 3)
    )
    clamp_edge_tangent: Array  # in the frame of its body, unit, shape (n_clamp_edge, 3)
    joined_node: Array  # nodes of closed strands, each with its copy, shape (n_joined, 2); see `model.strand_arrays`
    joined_edge: Array  # likewise of edges, shape (n_joined_edge, 2)
    attached_node: Array  # nodes held by bodies, shape (n_attached,)
    attached_body: Array  # shape (n_attached,)
    attached_position: Array  # in the body's frame [m], shape (n_attached, 3)
    clamp_edge_body: Array  # body of each clamp edge, shape (n_clamp_edge,)
    clamp_edge_joint: Array  # joint of each clamp edge, shape (n_clamp_edge,)

    drag_node: Array  # nodes that carry a share of their station's drag, shape (n_drag,)
    drag_edge: Array  # edges before and after each, shape (n_drag, 2)
    drag_coefficient: Array  # ρ_f A C along t, m1, m2 [kg/m], shape (n_drag, 3)

    fluid_mass: Array  # added along m1, m2 [kg] and against spin [kg m²], shape (n_edge, 3); (0, 3) without

    node_length: Array  # half the lengths of its edges at the start [m], shape (n_node,)
    node_mass: Array  # with point masses [kg], shape (n_node,)
    mass_moment: Array  # mass × its height along m1 of each edge [kg m], shape (n_edge,); (0,) if all of it is at nodes
    spin_inertia: Array  # of edges about their tangent [kg m²], shape (n_edge,)
    half_width: Array  # of each edge [m], shape (n_edge,)

    edge_node: Array  # first node of each edge, shape (n_edge,)
    rest_length: Array  # [m], shape (n_edge,)
    axial_stiffness: Array  # EA [N], shape (n_edge,)
    rest_strain: Array  # of edges without stimuli, shape (n_edge,)
    driven_edge: Array  # edges that follow a law, once for each law, shape (n_driven,)
    driven_law: Array  # the law that each of them follows, shape (n_driven,)
    driven_weight: Array  # its part of the law's eigenstrain, shape (n_driven,)
    driven_joint: Array  # joints whose κ̄₁ follows a law, once for each law, shape (n_driven_joint,)
    driven_joint_law: Array  # likewise
    driven_joint_weight: Array  # κ̄₁ per eigenstrain of the law [rad], likewise
    law_channel: Array  # stimulus channel of each law, shape (n_law,)
    law_rising: Array  # time constant for a rising stimulus [s], shape (n_law,)
    law_falling: Array  # and for a falling one
    law_gain: Array  # eigenstrain per unit of stimulus near the reference, shape (n_law,)
    law_reference: Array  # stimulus without eigenstrain, in its unit, shape (n_law,)
    law_saturation: Array  # largest magnitude of the eigenstrain, or infinite, shape (n_law,)
    lit_law: Array  # laws that follow a light, each of an element of its own, shape (n_lit,)
    lit_edge: Array  # edge of each, likewise
    lit_side: Array  # ±1: its outer face is towards ± m1; 0: it has two, likewise
    lit_height: Array  # of that face over the strand along m1, or of the layer's middle if it has two [m], likewise
    lit_half: Array  # half the layer's thickness [m], likewise
    lit_slenderness: Array  # length over thickness of its rod, likewise

    joint_a: Array  # first edge of each joint, shape (n_joint,)
    joint_b: Array  # second edge
    joint_stiffness: Array  # k₁ k₂ k₃ [N m], shape (n_joint, 3)
    joint_rest: Array  # κ̄₁ κ̄₂ ψ̄ without stimuli [rad], shape (n_joint, 3)
    joint_node: Array  # node at which a bend acts, −1 for bonds, shape (n_joint,)
    voronoi_length: Array  # of bends and clamps [m], shape (bend_count,)
    coupled_joint: Array  # joints whose κ̄₁ depends on the strains of their edges, shape (n_coupled,)
    strain_coupling: Array  # b of either edge, 0 for a clamp edge [rad], shape (n_coupled, 2)

    edge_time: Array  # retardation times of edges [s], shape (n_edge,)
    joint_time: Array  # and of κ₁ κ₂ ψ of joints [s], shape (n_joint, 3)
    pair_time: Array  # and of vectors between layers [s], shape (n_pair, 3)

    pair_joint: Array  # whose edges' frames a vector between layers is taken in, shape (n_pair,)
    pair_node: Array  # it leads from the middle of the last two nodes to that of the first two, shape (n_pair, 4)
    pair_weight: Array  # of the frames of the joint's two edges, shape (n_pair, 2)
    pair_stiffness: Array  # along m1, m2, m3 [N/m], shape (n_pair, 3)
    pair_rest: Array  # likewise [m]

    def __repr__(self) -> str:
        counts = f"{len(self.strands)} strands, {self.node_count} nodes, {self.edge_count} edges"
        return f"Model({self.scene.name}: {counts}, {self.unknowns} unknowns; forces: {', '.join(self.forces)})"

    @property
    def strain_slope(self) -> Array:
        """b/|ē| of coupled joints [rad/m], 0 for a clamp edge, shape (n_coupled, 2): ∂κ̄₁ by lengths."""
        edges = np.stack([self.joint_a, self.joint_b], axis=1)[self.coupled_joint]
        slope = self.strain_coupling / np.concatenate([self.rest_length, np.ones(self.clamp_edge_count)])[edges]
        slope.flags.writeable = False
        return slope

    @property
    def point_count(self) -> int:
        """Number of contact points of bodies, corners and rims of their surfaces among them."""
        return self.contact_points.point_count

    @property
    def impact_pairs(self) -> Array:
        """Contact points of bodies and surfaces that they can meet, if impacts are damped, shape (n_impact, 2)."""
        if "restitution" not in self.forces:
            return np.zeros((0, 2), dtype=np.int64)
        points = np.flatnonzero(self.contact_points.body >= 0)
        pairs = np.argwhere(self.surfaces.can_collide[:, self.contact_points.group[points]].T)
        return np.stack([points[pairs[:, 0]], pairs[:, 1]], axis=1)

    @property
    def strain_count(self) -> int:
        """How many strains viscosity acts on; gaps of `impact_pairs`, then values of `mechanisms`, come after them."""
        if "viscosity" not in self.forces:
            return 0
        return self.edge_count + 3 * (len(self.joint_a) + len(self.pair_joint))

    @property
    def mechanisms(self) -> tuple[Mechanism, ...]:
        """Turns and ways of hinges, rails and joints that something resists."""
        return mechanisms_of(self.scene)

    @property
    def has_surface_contact(self) -> bool:
        """True if any contact point can meet a surface."""
        return self.scene.contact is not None and bool(self.surfaces.can_collide.any())

    @property
    def free_count(self) -> int:
        """Number of free bodies."""
        return len(self.bodies.mass)

    @property
    def unknowns(self) -> int:
        """Unknowns that are solved for: those of nodes and edges without the attached ones, and the freedom of
        bodies.
        """
        solved = self.solved_layout
        twice = len(self.joined_unknowns(solved))
        return solved.size - solved.dimension * len(self.attached_node) - twice + self.bodies.freedom.shape[1]

    def joined_unknowns(self, layout: Layout) -> Array:
        """Unknowns of nodes and edges that closed strands have twice, each with its copy, shape (n, 2)."""
        of_nodes = layout.node[self.joined_node][:, None] + np.arange(layout.dimension)[:, None]
        edges = layout.edge[self.joined_edge] if layout.dimension == 3 else self.joined_edge[:0]
        return np.concatenate([of_nodes.reshape(-1, 2), edges])

    @property
    def directions(self) -> Array:
        """Along which a node's unknowns in the matrix are, shape (3, 3), or (2, 3) in a plane."""
        return AXES if self.plane is None else self.plane.axes

    @property
    def solved_layout(self) -> Layout:
        """Order of the unknowns in the matrix."""
        return self.layout if self.plane is None else self.plane.layout

    @property
    def attached_free(self) -> Array:
        """Free body of each attached node, −1 if its body is prescribed, shape (n_attached,)."""
        return self.bodies.free_index[self.attached_body]

    @property
    def clamp_edge_free(self) -> Array:
        """Free body of each clamp edge, −1 if its body is prescribed, shape (n_clamp_edge,)."""
        return self.bodies.free_index[self.clamp_edge_body]

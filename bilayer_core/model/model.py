"""A model: the records that kernels read, and the arrays beside them. None of it changes during a run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bilayer_core.contact.broad_phase import RodSearch
from bilayer_core.model.free_motions import Mechanism, mechanisms_of
from bilayer_core.model.records.contacts import Rails, Sliding, Surfaces
from bilayer_core.model.records.light import Light
from bilayer_core.model.records.parts import (
    Attachments,
    Bodies,
    Bonds,
    Constrained,
    Drives,
    Flattening,
    Flow,
    Fluid,
    Joins,
    Moduli,
    Moments,
    OffAxis,
    Plane,
    PointForces,
    Raised,
    Strands,
    Viscosity,
)
from bilayer_core.model.records.varied_fields import VariedFields
from bilayer_core.model.shape_numbers import Shape
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.model.unknown_order import Layout, ReadOnlyArrays
from bilayer_core.scene.config import SceneConfig

Array = np.ndarray


@dataclass(frozen=True)
class PlacedBodies(ReadOnlyArrays):
    """Rigid bodies in the scene's order: where they start. Their numbers and inertia are in `records.parts.Bodies`."""

    names: tuple[str, ...]
    start_position: Array  # [m], shape (n_body, 3)
    start_rotation: Array  # shape (n_body, 3, 3)
    shapes: tuple[Shape | None, ...]  # surface of each body
    controlled: Array  # prescribed bodies that controllers may move, shape (n_controlled,)


@dataclass(frozen=True)
class Model(ReadOnlyArrays):
    """Records and arrays of a scene; indices run over strands in order, and along each strand.

    Edges n_edge … n_edge + n_clamp_edge − 1 are *clamp edges*, the fixed directions of clamps. *Joints* are pairs of
    edges with a bending and twisting element: inner nodes and clamps first (`bend_count`), then the rotation bonds of
    paired edges. *Pairs* are vectors between two layers: first those between paired edges, then those where a layer
    ends (`forces.bond`).

    A record of a part that the scene does not have is absent, and its arrays have length zero. Arrays with a declared
    shape, into which kernels write, are not allocated: each problem has its own (`engine.storage`).
    """

    scene: SceneConfig
    forces: tuple[str, ...]  # with an energy, that the scene needs; see `model.force_list`
    strands: tuple[StrandArrays, ...]
    layout: Layout  # order of the unknowns in gradients and steps, which are vectors in space
    solved_layout: Layout  # and in the matrix, the same in three dimensions

    rods: Strands
    viscosity: Viscosity
    drives: Drives
    varied_fields: VariedFields
    light: Light
    plane: Plane  # absent in three dimensions
    off_axis: OffAxis
    flattening: Flattening  # absent without strips
    moduli: Moduli
    bonds: Bonds
    raised: Raised  # absent where everything acts on the curve
    kept_directors: int  # of edges where something may act off the curve under other loads, too
    free_bodies: Bodies
    constrained: Constrained
    attachments: Attachments
    joins: Joins
    surfaces: Surfaces  # with all contact points, in scenes without contact, too; stiffness and margin come later
    sliding: Sliding  # with the friction of the scene
    flow: Flow
    fluid: Fluid
    loads: PointForces  # of fixed direction
    followers: PointForces  # along path, normal and path × normal of a rod, or in the axes of a body
    moments: Moments
    rod_search: RodSearch  # absent where no rod can meet another or itself
    rails: Rails  # absent where rods meet about their nodes

    bodies: PlacedBodies
    robot_mass: Array  # of bodies that hold rods or are joined to these, 0 of others [kg], shape (n_body,)
    contact_stiffness: float  # of the barrier, `contact.stiffness` or more [Pa]; 0 without contact
    surface_names: tuple[str, ...]
    point_count: int  # of contact points of bodies, corners and rims of their surfaces among them
    rod_point_start: Array  # position of `RodPoints` at the start [m], shape (n_rod_point, 3)
    rod_point_weight: Array  # Δl of points of rods that can meet, see `model.rod_surfaces` [m], shape (n_point,)

    node_count: int
    start_position: Array  # of nodes [m], shape (n_node, 3)
    joined_node: Array  # nodes of closed strands, each with its copy, shape (n_joined, 2); see `model.strand_arrays`
    joined_edge: Array  # likewise of edges, shape (n_joined_edge, 2)
    node_length: Array  # half the lengths of its edges at the start [m], shape (n_node,)
    joint_node: Array  # node at which a bend acts, −1 for bonds, shape (n_joint,)
    voronoi_length: Array  # of bends and clamps [m], shape (bend_count,)
    strain_coupling: Array  # b of either edge of joints of `off_axis`, 0 for a clamp edge [rad], shape (n_coupled, 2)

    def __repr__(self) -> str:
        counts = f"{len(self.strands)} strands, {self.node_count} nodes, {self.rods.edge_count} edges"
        return f"Model({self.scene.name}: {counts}, {self.unknowns} unknowns; forces: {', '.join(self.forces)})"

    @property
    def impact_pairs(self) -> Array:
        """Contact points of bodies and surfaces that they can meet, if impacts are damped, shape (n_impact, 2)."""
        if "restitution" not in self.forces:
            return np.zeros((0, 2), dtype=np.int64)
        points = np.flatnonzero(self.surfaces.contact_point_body >= 0)
        pairs = np.argwhere(self.surfaces.can_collide[:, self.surfaces.group[points]].T)
        return np.stack([points[pairs[:, 0]], pairs[:, 1]], axis=1)

    @property
    def strain_count(self) -> int:
        """How many strains viscosity acts on; gaps of `impact_pairs`, values of `mechanisms`, then kept directors come
        after them.
        """
        if "viscosity" not in self.forces:
            return 0
        return self.rods.edge_count + 3 * (len(self.rods.joint_a) + len(self.bonds.joint))

    @property
    def mechanisms(self) -> tuple[Mechanism, ...]:
        """Turns and ways of hinges, rails and joints that something resists."""
        return mechanisms_of(self.scene)

    @cached_property
    def has_surface_contact(self) -> bool:
        """True if any contact point can meet a surface."""
        return self.scene.contact is not None and bool(self.surfaces.can_collide.any())

    @property
    def free_count(self) -> int:
        """Number of free bodies."""
        return len(self.free_bodies.mass)

    @property
    def unknowns(self) -> int:
        """Unknowns that are solved for: those of nodes and edges without the attached ones, and the freedom of
        bodies.
        """
        held = self.solved_layout.dimension * len(self.constrained.node)
        twice = int(np.count_nonzero(self.joins.first != self.joins.copy))
        return self.solved_layout.size - held - twice + self.free_bodies.freedom.shape[1]

    @property
    def start_director1(self) -> Array:
        """m1 of edges at the start, unit, shape (n_edge, 3)."""
        return self.constrained.clamp_edge_director1[: self.rods.edge_count]

"""Arrays that a problem computes into, made for a model, and the capacity for what varies in number."""

from __future__ import annotations

import numpy as np

from ..model.force_list import on_nodes
from ..model.model import Model
from ..model.records.parts import RodContactList
from ..model.records.step import Place
from ..model.rod_surfaces import NearPairs

Array = np.ndarray
PAIRS_PER_POINT = 8
"""Of rods near each other: for how many there is capacity at first."""


def zeros_in_one(shapes: dict[str, tuple[int, ...]]) -> tuple[Array, dict[str, Array]]:
    """A flat array of zeros, and consecutive views of it with the given shapes: one loop clears them all."""
    sizes = [int(np.prod(shape)) for shape in shapes.values()]
    flat, ends = np.zeros(sum(sizes)), np.cumsum(sizes)
    parts = {
        name: flat[end - size : end].reshape(shape)
        for (name, shape), size, end in zip(shapes.items(), sizes, ends, strict=True)
    }
    return flat, parts


class FirstDerivatives:
    """Gradients of all forces together; `carrier` and `contact` are those of contact alone.

    Attributes
    ----------
    flat : Array
        node, edge, pair and body in one piece.
    node, edge, pair, body : Array
        ∂/∂x of nodes [N], shape (n_node, 3); ∂/∂(e, θ) of edges and walls, shape (n_edge + n_wall, 4); ∂/∂p of paired
        edges, shape (n_pair, 3); ∂/∂(X, φ) of free bodies, shape (n_free, 6).
    carrier, contact : Array
        ∂/∂x of carriers [N], shape (n_carrier, 3), of which nodes take theirs; ∂/∂(X, φ) of all bodies and of the
        world, shape (n_body + 1, 6), of which free bodies take theirs.
    unknowns, attached : Array
        Of the unknowns, zero where nodes are held, shape (size,); of held nodes before that, shape (n_attached, 3).
    """

    def __init__(self, model: Model):
        self.flat, parts = zeros_in_one(
            {
                "node": (model.node_count, 3),
                "edge": (model.edge_count + model.wall_count, 4),
                "pair": (len(model.pair_top), 3),
                "body": (model.free_count, 6),
            }
        )
        self.node, self.edge, self.pair, self.body = parts.values()
        self.carrier = np.zeros((len(model.carriers.weight), 3))
        self.contact = np.zeros((len(model.bodies.names) + 1, 6))
        self.unknowns = np.zeros(model.layout.size)
        self.attached = np.zeros((len(model.attached_node), 3))


class SecondDerivatives:
    """Hessians of edges, joints, pairs, nodes and free bodies; in a plane those by lengths and angles of edges.

    Attributes
    ----------
    flat : Array
        All of them in one piece.
    edge_hessian, cross_hessian, pair_hessian, node_hessian, body_hessian : Array
    top_hessian, bottom_hessian : Array
        In space alone.
    polar_hessian, mixed_hessian, frame, polar_gradient : Array
        In a plane alone; the last two are frames of edges and walls, shape (n_edge + n_wall, 4), and N and T there,
        shape (n_edge + n_wall, 2).
    """

    def __init__(self, model: Model):
        edges, pairs, joints = model.edge_count + model.wall_count, len(model.pair_top), len(model.joint_a)
        if model.plane is None:
            shapes = {
                "edge_hessian": (edges, 4, 4),
                "cross_hessian": (joints, 4, 4),
                "pair_hessian": (pairs, 3, 3),
                "top_hessian": (pairs, 3, 4),
                "bottom_hessian": (pairs, 3, 4),
            }
        else:
            shapes = {
                # of the fluid against spin: of no use in a plane
                "edge_hessian": (edges if len(model.fluid_mass) else 0, 4, 4),
                "polar_hessian": (edges, 3),
                "cross_hessian": (joints, 4),
                "pair_hessian": (pairs, 3),
                "mixed_hessian": (pairs, 4),
            }
            self.frame, self.polar_gradient = np.zeros((edges, 4)), np.zeros((edges, 2))
        shapes["node_hessian"] = (model.node_count if on_nodes(model.forces) else 0, 3, 3)
        shapes["body_hessian"] = (6 * model.free_count, 6 * model.free_count)
        self.flat, parts = zeros_in_one(shapes)
        vars(self).update(parts)


class NearSurfaces:
    """The list of carriers near surfaces, what it was made for, and its capacity.

    Attributes
    ----------
    counted, margin : Array
        Number of pairs, and margin of the list [m], shape (1,).
    carrier, surface, gap : Array
        The pairs, by surfaces and then by carriers, and their gaps [m] as the barrier found them last.
    node_free : Array
        Nodes that no body holds, bool.
    extent, listed_carrier, listed_place, listed_turn : Array
        Of surfaces, and where everything was when the list was made.
    """

    def __init__(self, model: Model):
        surfaces, carriers = model.surfaces, model.carriers
        self.node_free = carriers.follows[: model.node_count] < 0
        self.extent = np.zeros(len(surfaces.kind))
        self.margin = np.full(1, -1.0)  # no list yet
        self.listed_carrier = np.zeros((len(carriers.weight), 3))
        self.listed_place = np.zeros((len(surfaces.kind), 3))
        self.listed_turn = np.zeros((len(surfaces.kind), 3, 3))
        self.counted = np.zeros(1, dtype=np.int64)
        self._reserve(len(carriers.weight) if len(surfaces.kind) else 0)

    @property
    def count(self) -> int:
        """Pairs in the list."""
        return int(self.counted[0])

    @property
    def capacity(self) -> int:
        """For how many pairs there is room."""
        return len(self.carrier)

    def _reserve(self, capacity: int) -> None:
        self.carrier = np.zeros(capacity, dtype=np.int64)
        self.surface = np.zeros(capacity, dtype=np.int64)
        self.gap = np.zeros(capacity)

    def grow(self) -> None:
        """Twice the capacity; the list is empty then."""
        self._reserve(2 * max(1, self.capacity))
        self.counted[0], self.margin[0] = 0, -1.0


class RodContacts:
    """Contacts of rods; the first `count` are in use. See `forces.rod_contact`."""

    def __init__(self, capacity: int):
        self.capacity = capacity
        integers, inner = ("point", "multiplicity"), np.zeros(capacity, dtype=bool)
        floats = ("gap", "distance", "normal_force", "tangential_stiffness")
        self.record = RodContactList(
            count=np.zeros(1, dtype=np.int64),
            inner=inner,
            node=np.zeros((capacity, 2), dtype=np.int64),
            weight=np.zeros((capacity, 4)),
            matrix=np.zeros((capacity, 3, 3)),
            foot_gradient=np.zeros((capacity, 4, 3)),
            **{name: np.zeros(capacity, dtype=np.int64) for name in integers},
            **{name: np.zeros(capacity) for name in floats},
            **{name: np.zeros((capacity, 3)) for name in ("normal", "segment_direction")},
        )

    @property
    def count(self) -> int:
        """Contacts in use."""
        return int(self.record.count[0])

    def grown(self, capacity: int) -> RodContacts:
        """A copy with more capacity."""
        larger, used = RodContacts(capacity), slice(min(self.count, self.capacity))
        for name in RodContactList.names:
            getattr(larger.record, name)[used] = getattr(self.record, name)[used]
        larger.record.count[:] = self.record.count
        return larger


class NearRods:
    """The list of rods near each other, contacts, and the capacity for all of them.

    Attributes
    ----------
    pairs : NearPairs
    unit : float
        Barrier distance and thickest layer together [m].
    last, ways
        Of the list; see `contact.rod_list`.
    contacts, sliding : RodContacts
        Present ones, and those that friction took at the start of a stage.
    """

    def __init__(self, model: Model):
        surfaces = model.rod_surfaces
        self.unit = model.scene.contact.barrier_distance + 2.0 * float(surfaces.edge_radius.max())
        points = len(surfaces.point_edge)
        self.pairs = NearPairs(surfaces, model.edge_node, model.start_position, PAIRS_PER_POINT * points)
        self.last, self.no_step = np.zeros((2, model.node_count, 3))
        self.ways = np.array([0.0, -1.0, 0.0, -np.inf])
        self.contacts, self.sliding = RodContacts(points), RodContacts(points)

    @property
    def capacity(self) -> int:
        """Of pairs and contacts together: it changes whenever arrays are replaced by larger ones."""
        return self.pairs.capacity + self.contacts.capacity + self.sliding.capacity

    def grow(self) -> None:
        """Enough capacity for what was counted and not written."""
        if self.pairs.count > self.pairs.capacity:
            self.pairs.reserve(2 * self.pairs.count)
        if self.contacts.count > self.contacts.capacity:
            self.contacts = RodContacts(2 * self.contacts.count)
        if self.sliding.capacity < self.contacts.capacity:
            self.sliding = self.sliding.grown(self.contacts.capacity)


def body_masses(model: Model) -> Array:
    """Factor of the shift for each unknown of free bodies, m and tr(J), shape (6 n_free,)."""
    pairs = zip(model.bodies.mass, model.bodies.second_moment, strict=True)
    return np.concatenate([np.zeros(0), *(np.repeat([m, np.trace(j)], 3) for m, j in pairs)])


def configuration(model: Model) -> Place:
    """Arrays of a configuration, of which everything that does not move is in place."""
    edges = model.edge_count + model.wall_count
    carriers, surfaces, bodies = model.carriers, model.surfaces, len(model.bodies.names)
    carrier = np.zeros((len(carriers.weight), 3))
    at = Place(
        carrier=carrier,
        position=carrier[: model.node_count],
        point=carrier[model.node_count :],
        length=np.ones(edges),
        tangent=np.zeros((edges, 3)),
        director1=np.zeros((edges, 3)),
        director2=np.zeros((edges, 3)),
        turn=np.zeros(model.edge_count),
        angle=np.zeros(model.edge_count),
        joint_strain=np.zeros((len(model.joint_a), 3)),
        body_position=np.zeros((model.free_count, 3)),
        body_rotation=np.zeros((model.free_count, 3, 3)),
        place=np.zeros((bodies + 1, 3)),
        rotation=np.tile(np.eye(3), (bodies + 1, 1, 1)),
        surface_place=np.zeros((len(surfaces.kind), 3)),
        surface_turn=np.zeros((len(surfaces.kind), 3, 3)),
        arm=np.zeros((len(model.attached_node), 3)),
        held=np.zeros((len(model.attached_node), 3)),
        point_arm=np.zeros((len(carriers.weight) - model.node_count, 3)),
        surface_arm=np.zeros((len(surfaces.kind), 3)),
        departure=np.zeros((model.node_count, 3)),
        body_departure=np.zeros((model.free_count, 3)),
        body_turned=np.zeros((model.free_count, 3)),
    )
    if not (surfaces.body < bodies).any():
        at.surface_place[:], at.surface_arm[:], at.surface_turn[:] = surfaces.position, surfaces.position, surfaces.turn
    return at

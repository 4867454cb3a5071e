"""What compiled loops take of a model: its arrays, in groups.

A group that a scene does not need is None; then the compiler leaves out what would use it (`if group is None` on an
argument is decided when a kernel is compiled), so an absent force costs neither time nor compilation. Each set of
present groups is compiled once: what always occurs together is None together.
"""

from __future__ import annotations

import numpy as np

from .group import group

Array = np.ndarray


@group
class Strands:
    """Numbering, sections and joints of rods; see `model.Model` and `model.layout`."""

    size: int  # unknowns of the matrix
    dimension: int  # of them at each node
    edge_count: int
    first_bend: int  # elements from this one up to `bend_count` are bends and twists, the rest are bonds
    bend_count: int
    bandwidth: tuple[int, ...]  # its length is the half-bandwidth: a compile-time constant
    axes: Array  # directions of a node's unknowns in the matrix, shape (dimension, 3)
    row: Array  # first of them in the matrix, shape (n_node,)
    node_unknown: Array  # place of a node in gradients and steps, which are vectors in space
    edge_unknown: Array  # likewise of an edge
    edge_node: Array
    node_mass: Array
    spin_inertia: Array
    half_width: Array
    rest_length: Array
    axial_stiffness: Array
    joint_a: Array
    joint_b: Array
    joint_stiffness: Array


@group
class Drives:
    """What stimuli change: rest strains of edges and joints."""

    rest_strain: Array
    driven_edge: Array
    driven_law: Array
    driven_weight: Array
    joint_rest: Array
    driven_joint: Array
    driven_joint_law: Array
    driven_joint_weight: Array
    law_channel: Array
    law_rising: Array
    law_falling: Array
    law_gain: Array
    law_reference: Array
    law_saturation: Array


@group
class Space:
    """What dimension 3 has: second derivatives of bonds. None in a plane."""

    top_hessian: Array
    bottom_hessian: Array
    bond_hessian: Array  # the part of cross_hessian that belongs to bonds


@group
class Plane:
    """What dimension 2 has instead of frames and twist; see `forces.planar`."""

    normal: Array
    side: Array
    joint_after: Array
    frame: Array
    polar_gradient: Array
    polar_hessian: Array
    mixed_hessian: Array


@group
class OffAxis:
    """Joints whose natural curvature depends on the strains of their edges; see `forces.stretch_bend`."""

    joint: Array
    slope: Array
    rest_out: Array
    rest: Array  # the same, read-only


@group
class Bonds:
    """Paired edges of two layers."""

    top: Array
    bottom: Array
    stiffness: Array
    rest: Array


@group
class Bodies:
    """Rigid bodies; the last place is the world."""

    free_index: Array
    body_of_free: Array
    prescribed: Array  # bodies without unknowns, shape (n_prescribed,)
    mass: Array
    second_moment: Array
    inertia: Array  # factor of the shift for each unknown of free bodies: m and tr(J), shape (6 n_free,)
    freedom: Array
    reach: Array
    turns: Array  # whether a body can turn, bool


@group
class Held:
    """Nodes and directions that bodies hold."""

    node: Array
    unknown: Array
    row: Array
    body: Array
    free: Array
    position: Array  # in the body's frame
    wall_body: Array
    wall_free: Array
    wall_tangent: Array  # in the body's frame
    wall_director1: Array  # likewise, after the edges' own: shape (n_edge + n_wall, 3)


@group
class Grips:
    """What free bodies among them hold: how it enters the border."""

    holding: int  # how many nodes
    unknown: Array  # rows of the matrix
    free: Array
    of_unknown: Array
    wall_free: Array
    wall_joint: Array


@group
class Surfaces:
    """Carriers, surfaces, and the list of near pairs with what it was made for; see `allocate.NearSurfaces`."""

    d_hat: float
    stiffness: float
    radius: Array
    weight: Array
    carrier_body: Array
    free_index: Array | None  # places of all bodies among the free ones; None if none is free
    follows: Array
    node_free: Array
    group: Array
    point_position: Array  # of points and centres in their bodies' frames
    point_body: Array
    kind: Array
    size: Array
    rounding: Array
    bound: Array
    body: Array
    position: Array
    turn: Array
    meets: Array
    near_carrier: Array
    near_surface: Array
    near_gap: Array
    near_count: Array  # shape (1,)
    margin: Array  # shape (1,)
    extent: Array
    listed_carrier: Array
    listed_place: Array
    listed_turn: Array


@group
class Sliding:
    """Friction of the contacts at the start of a stage; see `forces.friction`."""

    acts: bool
    threshold: float
    coefficient: Array
    node_edges: Array
    node_axis: Array
    count: Array  # shape (1,)
    first: Array
    surface: Array
    load: Array
    normal: Array
    axis: Array
    arm: Array
    lever: Array
    back: Array
    turn: Array
    origin_turn: Array


@group
class Slips:
    """Slip of all lagged contacts along a Newton step; see `forces.slip`."""

    threshold: float
    way: Array


@group
class Touches:
    """Contacts of rods; see `forces.rod_contact`."""

    counted: Array  # shape (1,)
    point: Array
    edge: Array
    fraction: Array
    inner: Array
    times: Array
    gap: Array
    node: Array
    weight: Array
    normal: Array
    load: Array
    matrix: Array
    side: Array
    turn: Array
    lean: Array
    along: Array


@group
class Threads:
    """Rods that can meet: their geometry, the list of near pairs, and contacts; see `allocate.NearRods`."""

    d_hat: float
    stiffness: float
    slides: bool
    coefficient: float
    threshold: float
    unit: float  # barrier distance and thickest layer together
    start_position: Array
    edge_radius: Array
    edge_rod: Array
    edge_first: Array
    edge_arc: Array
    first_point: Array
    point_edge: Array
    point_fraction: Array
    point_arc: Array
    point_weight: Array
    rod_meets: Array
    rod_joined: Array
    rod_exclusion: Array
    box: Array  # scratch of a search, see `contact.broad_phase.scratch`
    sweep: Array
    met: Array
    base: Array
    tip: Array
    last: Array
    ways: Array  # shape (4,)
    counted: Array  # shape (1,)
    pair_point: Array
    pair_edge: Array
    pair_before: Array
    pair_after: Array
    pair_until: Array
    no_step: Array
    scratch: Array  # a gradient that nobody wants
    gap: Array  # the smallest below the barrier distance, shape (1,)
    contacts: Touches  # present ones
    sliding: Touches  # of the start of the stage


@group
class Leaving:
    """Contacts of rods in the Newton matrix, and nodes that leave the band for them; see `solve.rod_border`."""

    counts: Array  # of contacts and of nodes, shape (2,)
    node: Array
    weight: Array
    matrix: Array
    side: Array
    turn: Array
    strand: Array
    attached: Array
    mark: Array
    met: Array
    leaving: Array
    unknown: Array  # the same, read-only
    place: Array


@group
class Flow:
    """Drag."""

    velocity: Array
    node: Array
    edge_before: Array
    edge_after: Array
    coefficient: Array
    direction: Array


@group
class Fluid:
    """Added mass."""

    velocity: Array
    mass: Array
    direction1: Array
    direction2: Array
    shape_gradient: Array
    momentum: Array
    node_velocity: Array  # scratch
    still: Array


@group
class PointForces:
    """Forces of fixed direction, or that turn with what they act on (then with the edges of their nodes)."""

    node: Array
    node_load: Array
    node_vector: Array
    body: Array
    body_load: Array
    body_vector: Array
    on_nodes: Array  # the present ones
    on_bodies: Array
    edge_before: Array
    edge_after: Array
    direction: Array


@group
class Moments:
    """Moments on free bodies; the first `dead` keep their direction."""

    dead: int
    body: Array
    load: Array
    vector: Array
    present: Array

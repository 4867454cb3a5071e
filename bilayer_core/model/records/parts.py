"""Arrays that the engine takes from a model, in groups.

What a scene does not need is there with arrays of length zero, and says that it does not exist (`jit.record`): one
program serves all scenes of a dimension.
"""

from __future__ import annotations

from bilayer_core.jit.record import Flags, IndexTable, Indices, Matrix, Stack, Vector, record


@record
class Strands:
    """Numbering, sections and joints of rods; see `model.Model` and `model.unknown_order`."""

    size: int  # unknowns of the matrix
    dimension: int  # of them at each node
    edge_count: int
    bend_count: int  # the first joints bend and twist; the others, if any, are those of bonds
    bandwidth: int  # half of it, without the diagonal
    axes: Matrix  # directions of a node's unknowns in the matrix, shape (dimension, 3)
    row: Indices  # first of them in the matrix, shape (n_node,)
    node_unknown: Indices  # slot of a node in gradients and steps, which are vectors in space
    edge_unknown: Indices  # likewise of an edge
    edge_node: Indices
    node_mass: Vector
    spin_inertia: Vector
    half_width: Vector
    rest_length: Vector
    axial_stiffness: Vector
    joint_a: Indices
    joint_b: Indices
    joint_stiffness: Matrix


@record
class Viscosity:
    """Retardation times of elements [s]; absent if no material has one. See `forces.viscosity`."""

    edge_time: Vector
    joint_time: Matrix
    pair_time: Matrix


@record
class Drives:
    """Rest strains of edges and joints, which stimuli change."""

    rest_strain: Vector
    driven_edge: Indices
    driven_law: Indices
    driven_weight: Vector
    joint_rest: Matrix
    driven_joint: Indices
    driven_joint_law: Indices
    driven_joint_weight: Vector
    law_channel: Indices
    law_rising: Vector
    law_falling: Vector
    law_gain: Vector
    law_reference: Vector
    law_saturation: Vector


@record
class Space:
    """Arrays of dimension 3 only: second derivatives of bonds. Absent in a plane."""

    first_hessian: Stack = ("pair", 3, 4)  # of p and the first edge of its joint
    second_hessian: Stack = ("pair", 3, 4)


@record
class Plane:
    """Arrays of dimension 2, instead of frames and twist; see `forces.planar`."""

    normal: Vector
    side: Vector
    joint_after: Indices  # between each edge and the next, −1 at the end of a strand, shape (n_edge,)
    frame: Matrix = ("edge+clamp", 4)
    polar_gradient: Matrix = ("edge+clamp", 2)
    polar_hessian: Matrix = ("edge+clamp", 3)
    cross_hessian: Matrix = ("joint", 4)
    pair_hessian: Matrix = ("pair", 3)
    mixed_hessian: Matrix = ("pair", 4)


@record
class OffAxis:
    """Joints whose natural curvature depends on the strains of their edges; see `forces.bend_twist`."""

    joint: Indices
    slope: Matrix
    rest: Matrix = ("joint", 3)  # of all joints at the present strains [rad]


@record
class Bonds:
    """Vectors between two layers, each in the frames of the two edges of a joint; see `forces.bond`."""

    joint: Indices  # that of `Strands` with number bend_count + k for paired edges k, then those of ends of layers
    node: IndexTable
    weight: Matrix
    stiffness: Matrix
    rest: Matrix


@record
class Bodies:
    """Rigid bodies; the last one is the world."""

    free_index: Indices
    body_of_free: Indices
    prescribed: Indices  # bodies without unknowns, shape (n_prescribed,)
    mass: Vector
    second_moment: Stack
    inertia: Vector  # factor of the shift for each unknown of free bodies: m and tr(J), shape (6 n_free,)
    freedom: Matrix
    freedom_first: Indices  # the first unknown of the body that each of its columns moves, shape (n_freedom,)
    bounding_radius: Vector
    rotates: Flags  # whether a body can turn, bool


@record
class Constrained:
    """Nodes and directions that bodies hold."""

    node: Indices
    unknown: Indices
    row: Indices
    body: Indices
    free: Indices
    position: Matrix  # in the body's frame
    clamp_edge_body: Indices
    clamp_edge_free: Indices
    clamp_edge_tangent: Matrix  # in the body's frame
    clamp_edge_director1: Matrix  # likewise, after the edges' own: shape (n_edge + n_clamp_edge, 3)


@record
class Attachments:
    """Nodes, directions and clamp edges that free bodies hold: their entries in the border of the matrix."""

    holding: int  # how many nodes
    unknown: Indices  # rows of the matrix
    free: Indices
    of_unknown: Indices
    clamp_edge_free: Indices
    clamp_edge_joint: Indices


@record
class Joins:
    """Unknowns of nodes and edges that closed rods have twice; see `engine.linear.closed_rods`."""

    first: Indices  # rows of the matrix
    copy: Indices  # that move as these
    column: Indices  # of each row among the join columns, −1 without one


@record
class Mechanisms:
    """Turns and ways between two bodies that something resists; see `forces.mechanisms`."""

    first: int  # of them among strains
    memory: Indices  # where in `Problem.memory` they begin, two values each, shape (1,)
    slides: Flags  # whether it is a way along the axis, not a turn about it, shape (n_mechanism,)
    body: Indices  # A and B of each in turn, among all bodies and the world, shape (2 n_mechanism,)
    free: Indices  # likewise among the free ones, −1 for others
    arm: Matrix  # from the position of the body in its axes, A and B in turn [m], shape (2 n_mechanism, 3)
    axis: Matrix  # a in the axes of A, shape (n_mechanism, 3)
    mark: Matrix  # a direction across it in the axes of A and of B in turn, shape (2 n_mechanism, 3)
    spring: Vector  # k [N m, N/m], shape (n_mechanism,)
    rest: Vector  # [rad, m]
    damping: Vector  # c [N m s, N s/m]
    friction: Vector  # M [N m, N]
    threshold: Vector  # ε [rad/s, m/s]
    lower: Vector  # [rad, m], −∞ without
    upper: Vector  # likewise
    limit_stiffness: Vector  # K [N m, N/m]
    margin: Vector  # w over which it comes in [rad, m]
    value: Vector  # q at the last evaluation [rad, m]
    limit_slope: Vector  # ∂E/∂q of the limits there [N m, N]
    in_limits: Vector  # their energy there [J], shape (1,)
    gradient: Matrix  # ∂E/∂(X, φ) of A and B in turn [N, N m], shape (2 n_mechanism, 6)


@record
class Flow:
    """Drag."""

    velocity: Vector
    node: Indices
    edge_before: Indices
    edge_after: Indices
    coefficient: Matrix
    direction: Stack = ("dragged", 3, 3)


@record
class Fluid:
    """Added mass; see `forces.added_mass`."""

    velocity: Vector  # U [m/s], shape (3,)
    edge_node: Indices  # first node of each edge, shape (n_edge,)
    mass: Matrix  # m₁ l̄ and m₂ l̄ [kg] and j l̄ [kg m²] of each edge, shape (n_edge, 3)
    direction1: Matrix = ("edge+clamp", 3)  # m1 of edges and clamp edges at z
    direction2: Matrix = ("edge+clamp", 3)
    node_velocity: Matrix = ("node", 3)  # at which `fluid_momentum` finds the two that follow [m/s]
    spin: Vector = ("edge",)  # likewise [rad/s]
    momentum: Matrix = ("node", 3)  # P of nodes [N s]
    shape_gradient: Matrix = ("edge", 4)  # ∂T/∂(ε, θ) of edges [N, N m]
    inertia: Stack = ("node", 3, 3)  # m + ∂P/∂v of nodes [kg]
    joined: IndexTable  # nodes that closed rods have twice, each with its copy, shape (n_joined, 2)


@record
class PointForces:
    """Forces of fixed direction, or that turn with what they act on (then with the edges of their nodes)."""

    energy_slot: int  # of their energy in `Sums`
    node: Indices
    node_load: Indices
    node_vector: Matrix
    body: Indices
    body_load: Indices
    body_vector: Matrix
    on_nodes: Matrix = ("loaded node", 3)  # the present ones
    on_bodies: Matrix = ("loaded body", 3)
    edge_before: Indices
    edge_after: Indices


@record
class Moments:
    """Moments on free bodies; the first `dead` keep their direction."""

    dead: int
    body: Indices
    load: Indices
    vector: Matrix
    present: Matrix = ("moment", 3)

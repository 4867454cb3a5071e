"""Arrays that the engine takes from a model, in groups.

What a scene does not need is there with arrays of length zero, and says that it does not exist (`jit.record`): one
program serves all scenes of a dimension.
"""

from __future__ import annotations

from bilayer_core.jit.record import Flags, IndexTable, Indices, Matrix, Stack, Vector, record

TOGETHER = 64
"""Elements of a block at most, which kernels take together (`model.blocks`)."""


@record
class Strands:
    """Numbering, sections and joints of rods; see `model.model.Model` and `model.unknown_order`."""

    size: int  # unknowns of the matrix
    dimension: int  # of them at each node
    edge_count: int
    bend_count: int  # the first joints bend and twist; the others, if any, are those of bonds
    bandwidth: int  # half of it, without the diagonal
    bandwidth_apart: int  # likewise while no rods touch
    axes: Matrix  # directions of a node's unknowns in the matrix, shape (dimension, 3)
    row: Indices  # first of them in the matrix, shape (n_node,)
    node_unknown: Indices  # slot of a node in gradients and steps, which are vectors in space, shape (n_node,)
    edge_unknown: Indices  # likewise of an edge, shape (n_edge,)
    edge_node: Indices  # first node of each edge, shape (n_edge,)
    node_mass: Vector  # with point masses [kg], shape (n_node,)
    spin_inertia: Vector  # of edges about their tangent [kg m²], shape (n_edge,)
    half_width: Vector  # of each edge [m], shape (n_edge,)
    rest_length: Vector  # [m], shape (n_edge,)
    axial_stiffness: Vector  # EA [N], shape (n_edge,)
    joint_a: Indices  # first edge of each joint, shape (n_joint,)
    joint_b: Indices  # second edge
    joint_stiffness: Matrix  # k₁ k₂ k₃ [N m], shape (n_joint, 3)


@record
class Viscosity:
    """Retardation times of elements [s]; absent if no material has one. See `forces.viscosity`."""

    edge_time: Vector  # of edges, shape (n_edge,)
    joint_time: Matrix  # of κ₁ κ₂ ψ of joints, shape (n_joint, 3)
    pair_time: Matrix  # of vectors between layers, shape (n_pair, 3)


@record
class Drives:
    """Rest strains of edges and joints, which stimuli change."""

    rest_strain: Vector  # of edges without stimuli, shape (n_edge,)
    driven_edge: Indices  # edges that follow a law, once for each law, shape (n_driven,)
    driven_law: Indices  # the law that each of them follows, shape (n_driven,)
    driven_weight: Vector  # its part of the law's eigenstrain, shape (n_driven,)
    joint_rest: Matrix  # κ̄₁ κ̄₂ ψ̄ without stimuli, κ̄y Δl of strips [rad], multiples of `Moduli`, shape (n_joint rest, 3)
    driven_joint: Indices  # rows of `joint_rest` that follow a law, once for each law, shape (n_driven_joint,)
    driven_joint_column: Indices  # which of the row: 0, κ̄₁ or κ̄y Δl, or of a strip 1, κ̄x Δl − κ̄₁, or 2, ψ̄
    driven_joint_law: Indices  # likewise
    driven_joint_weight: Vector  # that value per eigenstrain of the law [rad], likewise
    field_channel: Indices  # stimulus channel of each field: what materials reach of it, by its modes, shape (n_field,)
    field_first: Indices  # first mode of each field, last the number of all, shape (n_field + 1,)
    field_slowest: Indices  # its mode with the longest time constant, shape (n_field,)
    mode_rising: Vector  # time constant of each mode for a rising stimulus [s], shape (n_mode,)
    mode_falling: Vector  # and for a falling one
    law_field: Indices  # the field that each law follows, shape (n_law,)
    law_first: Indices  # where its weights begin, last the number of all, shape (n_law + 1,)
    law_weight: Vector  # of the modes of its field in what it follows
    law_gain: Vector  # eigenstrain per unit of stimulus near the reference, shape (n_law,)
    law_reference: Vector  # stimulus without eigenstrain, in its unit, shape (n_law,)
    law_saturation: Vector  # largest magnitude of the eigenstrain, or infinite, shape (n_law,)


@record
class Space:
    """Arrays of dimension 3 only: second derivatives of bonds. Absent in a plane."""

    first_hessian: Stack = ("pair", 3, 4)  # of p and the first edge of its joint
    second_hessian: Stack = ("pair", 3, 4)


@record
class Plane:
    """Arrays of dimension 2, instead of frames and twist; see `forces.planar`."""

    normal: Vector  # of the plane, p × q of its directions `Strands.axes`, shape (3,)
    side: Vector  # σ of edges and clamp edges: m1 = σ normal × t, m2 = σ normal, shape (n_edge + n_clamp_edge,)
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

    joint: Indices  # whose κ̄₁ depends on the strains of its edges, in order, shape (n_coupled,)
    slope: Matrix  # b/|ē| of either edge, ∂κ̄₁ by its length, 0 for a clamp edge [rad/m], shape (n_coupled, 2)
    rest: Matrix = ("joint", 3)  # of all joints at the present strains [rad]


@record
class Flattening:
    """Joints of strips whose section bends; see `forces.flattening`."""

    first: int  # row of `Stage.rest_joint` with κ̄y Δl of the first of them, those of others follow
    joint: Indices  # in order, shape (n_strip_joint,)
    row: Flags  # whether a row of `Stage.rest_joint` is of a strip, shape (n_joint + n_strip_joint,)
    stiffness: Vector  # s [N m], likewise
    scale: Vector  # √Λ, likewise
    curl: Vector  # a₁, likewise
    skew: Vector  # 2 a₃, likewise
    coupling: Vector  # k₁₃ [N m], likewise
    offset: Vector  # β, likewise
    start: Vector  # θ₀² [rad²], likewise
    series: Stack  # coefficients of φ, see `model.plate_strip.flattening_series`, shape (n_strip_joint, 4, n_term)
    pull: Matrix = ("joint rest", 3)  # derivative of the energy by `Stage.rest_joint` [N m]
    slope: Vector = ("strip joint",)  # second derivative by κ̄y Δl [N m]


@record
class Moduli:
    """Elements whose stiffness follows a stimulus; absent without any. See `forces.moduli`."""

    first: int  # row of `Stage.rest_joint` with the first multiple; the last row is 1
    edge: Indices  # row with the multiple of each edge, shape (n_edge,)
    joint: Indices  # likewise of each joint of `Strands` that bends, then 1 for those of bonds, shape (n_joint,)
    pair: Indices  # likewise of each vector of `Bonds`, shape (n_pair,)
    share: Vector  # σ of the first layer of each bond, 0 for other joints, shape (n_joint,)
    pull: Vector = ("joint rest",)  # derivative of the energy by each row of `Stage.rest_joint` [J]


@record
class Bonds:
    """Vectors between two layers, each in the frames of the two edges of a joint; see `forces.bond`."""

    joint: Indices  # that of `Strands` with number bend_count + k for paired edges k, then those of ends of layers
    node: IndexTable  # it leads from the middle of the last two nodes to that of the first two, shape (n_pair, 4)
    weight: Matrix  # of the frames of the joint's two edges, shape (n_pair, 2)
    stiffness: Matrix  # along m1, m2, m3 [N/m], shape (n_pair, 3)
    rest: Matrix  # likewise [m]


@record
class Bodies:
    """Rigid bodies; the last one is the world, which never moves. *Free* bodies, guided ones among them, have unknowns,
    in the order in which they occur.
    """

    free_index: Indices  # index among the free bodies, −1 for a prescribed one and the world, shape (n_body + 1,)
    body_of_free: Indices  # the reverse, shape (n_free,)
    prescribed: Indices  # bodies without unknowns, shape (n_prescribed,)
    mass: Vector  # of free bodies [kg], shape (n_free,)
    second_moment: Stack  # ∫ r rᵀ dm of free bodies, body frame [kg m²], shape (n_free, 3, 3)
    inertia: Vector  # factor of the shift for each unknown of free bodies: m and tr(J), shape (6 n_free,)
    freedom: Matrix  # motions (X, φ) that they are allowed, a column each, orthonormal, shape (6 n_free, n_freedom)
    freedom_first: Indices  # the first unknown of the body that each of its columns moves, shape (n_freedom,)
    freedom_alone: Indices  # the unknown that a column is, −1 of one with several, likewise
    bounding_radius: Vector  # largest distance of what a body carries, or of gyration [m], shape (n_body + 1,)
    rotates: Flags  # whether a body can turn, shape (n_body,)


@record
class Constrained:
    """Nodes and directions that bodies hold."""

    node: Indices  # held by bodies, shape (n_attached,)
    unknown: Indices  # the first of each in gradients and steps, shape (n_attached,)
    row: Indices  # and in the matrix
    body: Indices  # that holds it, shape (n_attached,)
    free: Indices  # likewise among the free ones, −1 for others
    position: Matrix  # in the body's frame [m], shape (n_attached, 3)
    clamp_edge_body: Indices  # body of each clamp edge, shape (n_clamp_edge,)
    clamp_edge_free: Indices  # likewise among the free ones, −1 for others
    clamp_edge_tangent: Matrix  # in the body's frame, unit, shape (n_clamp_edge, 3)
    clamp_edge_director1: Matrix  # likewise, after those of edges at the start, shape (n_edge + n_clamp_edge, 3)


@record
class Attachments:
    """Nodes, directions and clamp edges that free bodies hold: their entries in the border of the matrix."""

    holding: int  # how many nodes
    unknown: Indices  # rows of the matrix
    free: Indices  # as in `Constrained`
    of_unknown: Indices  # attached node of each unknown of the matrix, −1 for the others, shape (n_unknown,)
    clamp_edge_free: Indices  # as in `Constrained`
    clamp_edge_joint: Indices  # joint of each clamp edge, shape (n_clamp_edge,)


@record
class Joins:
    """Unknowns of nodes and edges that closed rods have twice; see `engine.linear.closed_rods`."""

    first: Indices  # rows of the matrix
    copy: Indices  # that move as these, or the same row if it is there once
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
class Raised:
    """Edges with something that acts off the curve, at x + z m1 of a half edge; see `forces.raised`."""

    first: int  # component of kept directors among strains
    slot: Indices  # of each director among those that states keep, three strains each, shape (n_raised,)
    edge: Indices  # likewise
    first_moment: Matrix  # mass × z of the halves at the first and at the second node [kg m], shape (n_raised, 2)
    second_moment: Vector  # mass × z² of both halves [kg m²], shape (n_raised,)
    middle: Vector  # z of the middle of the section, where a fluid acts [m], shape (n_raised,)
    block: (
        IndexTable  # of edges that follow each other: first of these, its edge, node and slot; how many; shape (…, 5)
    )
    by_component: Stack  # both first moments and the second, each three times in a row, shape (3, n_raised, 3)


@record
class Flow:
    """Drag; see `forces.drag`."""

    velocity: Vector  # of the fluid [m/s], shape (3,)
    node: Indices  # that carries a share of its station's drag, shape (n_drag,)
    raised: Indices  # edge of `Raised` at whose half the share acts, −1 at the node itself, shape (n_drag,)
    half: Indices  # which half of it
    edge_before: Indices  # likewise, the same as the one after at an end
    edge_after: Indices
    coefficient: Matrix  # ρ_f A C along t, m1, m2 [kg/m], shape (n_drag, 3)
    direction: Stack = ("dragged", 3, 3)  # t, m1, m2


@record
class Fluid:
    """Added mass; see `forces.added_mass`."""

    velocity: Vector  # U [m/s], shape (3,)
    edge_node: Indices  # first node of each edge, shape (n_edge,)
    mass: Matrix  # m₁ l̄ and m₂ l̄ [kg] and j l̄ [kg m²] of each edge, shape (n_edge, 3)
    raised: Indices  # number of each edge in `Raised`, −1 of the others, shape (n_edge,)
    middle: Vector  # z of the middle of the section [m], shape (n_raised,)
    slot: Indices  # as in `Raised`
    director_rate: Matrix = ("raised", 3)  # ṁ1 at which `fluid_momentum` finds what follows [1/s]
    direction1: Matrix = ("edge+clamp", 3)  # m1 of edges and clamp edges at z
    direction2: Matrix = ("edge+clamp", 3)
    node_velocity: Matrix = ("node", 3)  # at which `fluid_momentum` finds the two that follow [m/s]
    spin: Vector = ("edge",)  # likewise [rad/s]
    momentum: Matrix = ("wet", 3)  # P of nodes [N s], then that of kept directors, z P of their edges [N m s]
    shape_gradient: Matrix = ("edge", 4)  # ∂T/∂(ε, θ) of edges [N, N m]
    inertia: Stack = ("node", 3, 3)  # m + ∂P/∂v of nodes [kg]
    joined: IndexTable  # nodes that closed rods have twice, each with its copy, shape (n_joined, 2)


@record
class PointForces:
    """Forces of fixed direction, or that turn with what they act on (then with the edges of their nodes)."""

    energy_slot: int  # of their energy in `Sums`
    node: Indices  # on which a part of a load acts, shape (n_on_node,)
    node_load: Indices  # which load, likewise
    node_vector: Matrix  # at factor 1 [N], shape (n_on_node, 3)
    body: Indices  # likewise among free bodies, shape (n_on_body,)
    body_load: Indices
    body_vector: Matrix
    on_nodes: Matrix = ("loaded node", 3)  # the present ones
    on_bodies: Matrix = ("loaded body", 3)
    edge_before: Indices  # of each loaded node; at an end the last edge, and after it the one beside that
    edge_after: Indices
    part: Matrix  # of both in the directions at the node, shape (n_on_node, 2)
    lever: Indices  # which of the forces on nodes act off the curve, once for each half edge, shape (n_lever,)
    lever_raised: Indices  # the edge of the half in `Raised`, likewise
    lever_height: Vector  # height over the curve times the part of the force at this half [m], likewise


@record
class Moments:
    """Moments on free bodies; the first `dead` keep their direction."""

    dead: int
    body: Indices  # among free bodies, shape (n_moment,)
    load: Indices  # which load, likewise
    vector: Matrix  # at factor 1 [N m], shape (n_moment, 3)
    present: Matrix = ("moment", 3)

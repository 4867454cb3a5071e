"""What a step needs: configurations, a stage, points, what acts from outside, extremes of the run."""

from __future__ import annotations

from ...jit.record import Flags, Indices, Matrix, Stack, Tensor, Vector, record


@record
class Place:
    """A configuration: positions, frames and bodies at one point of a Newton iteration."""

    carrier: Matrix  # all carriers [m], shape (n_carrier, 3); the first are the nodes, the others points of bodies
    position: Matrix  # of nodes [m], shape (n_node, 3)
    point: Matrix  # of the other carriers [m]
    length: Vector  # of edges and walls [m], shape (n_edge + n_wall,)
    tangent: Matrix  # of edges and walls, unit, shape (n_edge + n_wall, 3)
    director1: Matrix  # likewise
    director2: Matrix
    turn: Vector  # of edges about their tangents since the start of the step [rad], shape (n_edge,)
    angle: Vector  # of edges in the last move [rad], shape (n_edge,)
    joint_strain: Matrix  # κ₁ κ₂ ψ of joints, ψ unwrapped [rad], shape (n_joint, 3)
    body_position: Matrix  # of free bodies [m], shape (n_free, 3)
    body_rotation: Stack  # shape (n_free, 3, 3)
    place: Matrix  # of all bodies and last of the world [m], shape (n_body + 1, 3)
    rotation: Stack  # shape (n_body + 1, 3, 3)
    surface_place: Matrix  # of surfaces [m], shape (n_surface, 3)
    surface_turn: Stack  # their axes, shape (n_surface, 3, 3)
    arm: Matrix  # from the position of its body to each attached node [m], shape (n_attached, 3)
    held: Matrix  # of attached nodes [m], shape (n_attached, 3)
    point_arm: Matrix  # like `arm`, of points
    surface_arm: Matrix  # and of surfaces
    departure: Matrix  # of nodes from where inertia takes them, x − x̃ [m]: its digits are not those of x
    body_departure: Matrix  # of free bodies, X − X̃ [m]
    body_turned: Matrix  # vector part of the unit quaternion from R̃ to R of free bodies; see `forces.inertia`


@record
class Stage:
    """What is frozen over a stage of a step: it reads as an implicit Euler step from an origin (`integrators.method`).

    The velocity of whatever is at q is (q − origin)/(γ h).
    """

    lengths: Vector  # γ h and γ′ h [s], where p = p̄ + γ′ h × force for momenta, shape (2,)
    origin_position: Matrix  # of nodes [m], shape (n_node, 3)
    origin_turn: Vector  # of edges, counted from the start of the stage [rad], shape (n_edge,)
    origin_body_position: Matrix  # of free bodies [m], shape (n_free, 3)
    origin_place: Matrix  # of all bodies and last of the world [m], shape (n_body + 1, 3)
    origin_rotation: Stack  # likewise; R̄ is no rotation but the matrix with dR/dt = (R − R̄)/(γ h)
    origin_fluid_momentum: Matrix  # P̄ of the fluid at nodes [N s], shape (n_node, 3); (0, 3) without added mass
    predicted_position: Matrix  # x̃ of nodes [m], shape (n_node, 3)
    predicted_turn: Vector  # of edges that inertia prefers, counted from the start of the stage [rad], shape (n_edge,)
    predicted_body_position: Matrix  # X̃ of free bodies [m], shape (n_free, 3)
    predicted_body_rotation: Stack  # R̃ of free bodies, shape (n_free, 3, 3)
    twist: Vector  # of joints at the start of the stage
    rest_edge: Vector  # strains without stress
    rest_joint: Matrix  # of joints; what strains off the axis add is not in it
    load_factor: Vector
    body_turn: Matrix  # rotation vector to where inertia takes free bodies
    way: Matrix  # of nodes, from the start of the stage to where inertia takes them [m]
    body_way: Matrix  # likewise of free bodies
    body_spin: Matrix  # with which they turn there [rad/s]
    held_arm: Matrix  # of what free bodies hold, R̃ r [m], shape (n_attached, 3)
    held_lag: Matrix  # of these, by which bodies without forces would take them farther than its own inertia [m]


@record
class Point:
    """Positions and momenta at the start of a step, at the origin of a stage, or at its end.

    Positions count from the start of the step: differences of absolute ones have lost their digits where steps are
    short or motions slow.
    """

    vectors: Vector  # all but rotations, in one piece, of which the following are views
    displacement: Matrix  # of nodes [m]
    body_displacement: Matrix  # of all bodies [m]
    turn: Vector  # of edges about their tangents since the start of the step [rad]
    velocity: Matrix  # of nodes [m/s]
    spin: Vector  # of edges [rad/s]
    body_velocity: Matrix  # of free bodies [m/s]
    angular_momentum: Matrix  # of free bodies about their mass centres [N m s]
    fluid_momentum: Matrix  # of the fluid at nodes [N s]
    rotation: Stack  # of all bodies, shape (n_body, 3, 3)


@record
class Method:
    """Coefficients of an integrator; see `integrators.method`."""

    diagonal: float
    momentum_diagonal: float
    couplings: Matrix  # over the diagonal, shape (n_stage, n_stage); one row more if the end is beyond the last stage
    history: bool
    along: Vector
    momenta: Vector
    bend: float
    carry: float
    nodes: Vector  # of stages, and of an end beyond them, as parts of a step, shape (n_point,)
    estimate: float  # of the error of a step, see `engine.error_norm`; NaN without


@record
class StageInputs:
    """What acts from outside during a step, at each of its points: the ends of stages, and of the step."""

    applied: Vector  # stimuli at the end of the last step, shape (n_channel,)
    elapsed: Vector  # from the start of the step to each point [s], shape (n_point,)
    first: Vector  # stimuli at the start of the step, shape (n_channel,)
    stimulus: Matrix  # shape (n_point, n_channel)
    load_factor: Matrix  # shape (n_point, n_load)
    position: Stack  # of all bodies; those of prescribed ones count [m], shape (n_point, n_body, 3)
    rotation: Tensor  # shape (n_point, n_body, 3, 3)
    rates: Stack  # [m/s, rad/s], shape (n_point, n_body, 6)


@record
class RunExtrema:
    """Extrema over a run; see `simulation.statistics`."""

    mass_moment: Vector  # of edges along m1 [kg m], shape (n_edge,) or (0,)
    mass: float  # of all rods [kg]
    voronoi_length: Vector  # of bending elements [m], shape (n_bend,)
    figures: Vector  # highest mass centre [m], smallest gap [m], largest contact force [N], curvature [1/m], strain
    body_top: Vector  # greatest height of each body's position [m], shape (n_body,)
    nodes: Indices  # that touch each surface now, shape (n_surface,)
    most_nodes: Indices
    first_contact: Vector  # [s], NaN before, shape (n_surface,)


@record
class Work:
    """Places and points that a step needs."""

    places: Indices  # addresses of configurations, shape (3,)
    stage: Stage
    first: Point
    origin: Point  # of the stage at hand, or the end of a step beyond its last stage
    end: Point
    gained: Matrix  # by each stage over its origin, in the vectors of points, shape (n_stage, n_vectors)
    gained_turn: Stack  # likewise rotation vectors of bodies, shape (n_stage, n_body, 3)
    moved: Vector  # largest displacement in a round of statics [m], shape (1,)
    turned: Vector  # of edges, from the start of the step to that of the stage [rad]
    rotation: Stack  # scratch
    transduction: Vector  # at a stage, shape (n_law,)
    strain: Vector  # of laws at a stage, shape (n_law,)
    touched: Flags  # carriers that something pushed at the end of the last step, shape (n_carrier,)


@record
class StateArrays:
    """What of a `model.state.State` a step changes."""

    values: Vector  # all parts, these and others, in one piece
    position: Matrix
    position_low: Matrix
    velocity: Matrix
    director1: Matrix
    spin: Vector
    fluid_excess: Matrix
    twist: Vector
    body_position: Matrix
    body_position_low: Matrix
    body_rotation: Stack
    body_velocity: Matrix
    body_angular_velocity: Matrix
    kept: Vector
    acceleration: Matrix
    spin_acceleration: Vector
    body_acceleration: Matrix
    body_moment: Matrix
    fluid_force: Matrix
    transduction: Vector

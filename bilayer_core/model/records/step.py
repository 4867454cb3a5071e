"""Records of a step: configurations, a stage, points, inputs from outside, extremes of the run."""

from __future__ import annotations

from bilayer_core.jit.record import CHANGES, FlagTable, Indices, Matrix, Stack, Tensor, Vector, record

IN_MOTION, AT_REST, LOOKED_AT = 0.0, 1.0, 2.0
"""What displacements in a stage are: motion; none, where rest is looked for; motion whose stability is looked at."""


@record
class Configuration:
    """A configuration: positions, frames and bodies at one point of a Newton iteration.

    Sizes in shapes are those of `model.sizes`.
    """

    contact_point: Matrix = ("contact_point", 3)  # [m]: nodes and points of bodies
    position: Matrix = ("node", 3)  # of nodes [m]
    point: Matrix = ("point", 3)  # of contact points on bodies [m]
    length: Vector = ("edge+clamp",)  # of edges and clamp edges [m]
    tangent: Matrix = ("edge+clamp", 3)  # of edges and clamp edges, unit
    director1: Matrix = ("edge+clamp", 3)  # likewise
    director2: Matrix = ("edge+clamp", 3)
    total_angle: Vector = ("edge",)  # of edges about their tangents since the start of the step [rad]
    angle: Vector = ("edge",)  # of edges in the last move [rad]
    joint_strain: Matrix = ("joint", 3)  # κ₁ κ₂ ψ of joints, ψ unwrapped [rad]
    body_position: Matrix = ("free", 3)  # of free bodies [m]
    body_rotation: Stack = ("free", 3, 3)  # of free bodies
    pose_position: Matrix = ("body+world", 3)  # of all bodies and last of the world [m]
    rotation: Stack = ("body+world", 3, 3)  # likewise
    surface_position: Matrix = ("surface", 3)  # of surfaces [m]
    surface_rotation: Stack = ("surface", 3, 3)  # their axes
    arm: Matrix = ("attached", 3)  # from the position of its body to each attached node [m]
    attached_position: Matrix = ("attached", 3)  # of attached nodes [m]
    point_arm: Matrix = ("point", 3)  # like `arm`, of points
    surface_arm: Matrix = ("surface", 3)  # and of surfaces
    departure: Matrix = ("node", 3)  # of nodes from where inertia takes them, x − x̃ [m]: its digits are not those of x
    body_departure: Matrix = ("free", 3)  # of free bodies, X − X̃ [m]
    body_departure_quaternion: Matrix = ("free", 3)  # vector part of that from R̃ to R; see `forces.inertia`


@record
class Stage:
    """Frozen data of a stage of a step, which reads as an implicit Euler step from an origin (`integrators.method`).

    The velocity of whatever is at q is (q − origin)/(γ h).
    """

    length: float = CHANGES  # γ h [s]
    momentum_length: float = CHANGES  # γ′ h [s], where p = p̄ + γ′ h × force for momenta
    origin_position: Matrix = ("node", 3)  # of nodes [m]
    origin_angle: Vector = ("edge",)  # of edges, counted from the start of the stage [rad]
    origin_body_position: Matrix = ("free", 3)  # of free bodies [m]
    origin_pose_position: Matrix = ("body+world", 3)  # of all bodies and last of the world [m]
    origin_rotation: Stack = (
        "body+world",
        3,
        3,
    )  # likewise; R̄ is no rotation: (R − R̄)/(γ h) is dR/dt
    still: Vector = (1,)  # `IN_MOTION`, `AT_REST` or `LOOKED_AT`
    origin_fluid_momentum: Matrix = ("wet", 3)  # P̄ of the fluid as in `Fluid.momentum` [N s]; none without added mass
    predicted_director: Matrix = ("raised", 3)  # of raised edges, as a vector that inertia takes along
    predicted_position: Matrix = ("node", 3)  # x̃ of nodes [m]
    predicted_angle: Vector = ("edge",)  # of edges that inertia prefers, counted from the start of the stage [rad]
    predicted_body_position: Matrix = ("free", 3)  # X̃ of free bodies [m]
    predicted_body_rotation: Stack = ("free", 3, 3)  # R̃ of free bodies
    twist: Vector = ("joint",)  # of joints at the start of the stage
    origin_strain: Vector = ("strain",)  # of all elements; see `forces.viscosity`
    rest_edge: Vector = ("edge",)  # strains without stress
    rest_joint: Matrix = (
        "joint rest",
        3,
    )  # of joints, without what strains off the axis add; then κ̄y Δl of strips, `Moduli`
    axial_stiffness: Vector = ("edge",)  # of elasticity and viscosity together [N]
    neutral_edge: Vector = ("edge",)  # and the strain at which these balance
    joint_stiffness: Matrix = ("joint", 3)  # likewise of joints [N m]
    neutral_joint: Matrix = ("joint", 3)
    pair_stiffness: Matrix = ("pair", 3)  # and of vectors between layers [N/m]
    neutral_pair: Matrix = ("pair", 3)
    load_factor: Vector = ("load",)
    predicted_body_rotation_vector: Matrix = ("free", 3)  # rotation vector to where inertia takes free bodies
    predicted_shift: Matrix = ("node", 3)  # of nodes, from the start of the stage to where inertia takes them [m]
    predicted_body_shift: Matrix = ("free", 3)  # likewise of free bodies
    body_spin: Matrix = ("free", 3)  # with which they turn there [rad/s]
    attached_arm: Matrix = ("attached", 3)  # of what free bodies hold, R̃ r [m]
    attached_lag: Matrix = ("attached", 3)  # by which bodies without forces would take these farther than inertia [m]


@record
class Point:
    """Positions and momenta at the start of a step, at the origin of a stage, or at its end.

    Positions count from the start of the step: differences of absolute ones have lost their digits where steps are
    short or motions slow.
    """

    vectors: Vector  # all but rotations, in one piece, of which the following are views
    displacement: Matrix = ("node", 3)  # of nodes [m]
    body_displacement: Matrix = ("body", 3)  # of all bodies [m]
    angle: Vector = ("edge",)  # of edges about their tangents since the start of the step [rad]
    velocity: Matrix = ("node", 3)  # of nodes [m/s]
    spin: Vector = ("edge",)  # of edges [rad/s]
    body_velocity: Matrix = ("free", 3)  # of free bodies [m/s]
    angular_momentum: Matrix = ("free", 3)  # of free bodies about their mass centres [N m s]
    fluid_momentum: Matrix = ("wet", 3)  # of the fluid as in `Fluid.momentum` [N s]
    strain: Vector = ("strain",)  # of elements with viscosity, gaps of damped impacts, mechanisms, raised directors
    strain_rate: Vector = ("strain",)  # [1/s]
    rotation: Stack = ("body", 3, 3)  # of all bodies


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
    works: Vector  # weights of powers at the start of a step and at its stages, as parts of it, shape (n_stage + 1,)
    estimate: float  # of the error of a step, see `engine.error_norm`; NaN without


@record
class StageInputs:
    """Inputs from outside during a step, at each of its points: the ends of stages, and of the step."""

    applied: Vector = ("channel",)  # stimuli at the end of the last step
    elapsed: Vector = ("stage end",)  # from the start of the step to each point [s]
    first: Vector = ("channel",)  # stimuli at the start of the step
    stimulus: Matrix = ("stage end", "channel")
    load_factor: Matrix = ("stage end", "load")
    position: Stack = ("stage end", "body", 3)  # of all bodies; those of prescribed ones count [m]
    rotation: Tensor = ("stage end", "body", 3, 3)
    rates: Stack = ("stage end", "body", 6)  # [m/s, rad/s]


@record
class RunExtrema:
    """Extrema over a run; see `simulation.statistics`."""

    mass: float  # of the robot [kg]
    robot_mass: Vector  # of bodies that belong to it, 0 of others [kg], shape (n_body,)
    voronoi_length: Vector  # of bending elements [m], shape (n_bend,)
    faces: Matrix  # heights of both faces over the curve at bending elements [m], shape (n_bend, 2)
    thickness: Vector  # of the whole section there [m], shape (n_bend,)
    plate: Vector  # by which curvature makes 1 where a plate would be too stiff, see `model.bent_plates` [m], likewise
    free: Vector  # curvature beyond their rest that is not by loads [1/m], likewise
    height: float = CHANGES  # greatest of the robot's mass centre [m]
    least_gap: float = CHANGES  # [m]
    contact_force: float = CHANGES  # largest on a node [N]
    curvature: float = CHANGES  # [1/m]
    strain: float = CHANGES
    fibre_strain: float = CHANGES
    curvature_by_thickness: float = CHANGES
    bent_plate: float = CHANGES  # greatest product of `plate` and the curvature that loads make
    most_bent: int = CHANGES  # where
    put_in: float = CHANGES  # energy that steps supplied [J]
    taken_out: float = CHANGES  # and lost
    body_top: Vector = ("body",)  # greatest height of each body's position [m]
    nodes: Indices = ("surface",)  # that touch each surface now
    last_surface: Indices = ("node",)  # scratch
    most_nodes: Indices = ("surface",)
    first_contact: Vector = ("surface",)  # [s], NaN before


@record
class StepAccount:
    """Energy of a step; see `engine.powers`."""

    supplied: float = CHANGES  # [J]
    lost: float = CHANGES
    taken_up: float = CHANGES  # by barriers
    supplying: float = CHANGES  # power at its last stage [W]
    losing: float = CHANGES  # likewise
    taking_up: float = CHANGES
    driven: int = CHANGES  # by what
    jumped: bool = CHANGES  # whether a stimulus has


@record
class Work:
    """Places and points that a step needs."""

    configurations: Indices  # addresses of configurations, shape (3,)
    stage: Stage
    first: Point
    origin: Point  # of the stage at hand, or the end of a step beyond its last stage
    end: Point
    gained: Matrix = ("stage", "point vector")  # by each stage over its origin, in the vectors of points
    gained_rotation_vector: Stack = ("stage", "body", 3)  # likewise rotation vectors of bodies
    moved: Vector = (1,)  # largest displacement in a round of statics [m]
    start_angle: Vector = ("edge",)  # of edges, from the start of the step to that of the stage [rad]
    rotation: Stack = ("body", 3, 3)  # scratch
    transduction: Vector = ("mode",)  # at a stage
    strain: Vector = ("law",)  # of laws at a stage
    start_strain: Vector = ("law",)  # and at the start of the step, after jumps of stimuli
    start_force: Vector = ("law",)  # −∂V/∂η of laws there [J]
    mean_force: Vector = ("law",)  # likewise at the start and at stages, by their weights [J s]
    end_force: Vector = ("law",)  # and at its end
    rates: Matrix = ("body+world", 6)  # of bodies at the end of a stage [m/s, rad/s]
    spread: FlagTable = ("stage", "surface of node")  # `Sliding.spread` where each stage ended
    account: StepAccount


@record
class StateArrays:
    """Arrays of a `model.state.State` that a step changes."""

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
    memory: Vector
    has_history: Vector
    touched: Vector
    acceleration: Matrix
    spin_acceleration: Vector
    body_acceleration: Matrix
    body_moment: Matrix
    fluid_force: Matrix
    strain_rate: Vector
    strain_acceleration: Vector
    account: Vector
    law_force: Vector
    light_rate: Matrix
    transduction: Vector

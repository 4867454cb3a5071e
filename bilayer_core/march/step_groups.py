"""What a step needs: configurations, a stage, points, what acts from outside, extremes of the run."""

from __future__ import annotations

import numpy as np

from .group import group

Array = np.ndarray


@group
class Place:
    """A configuration: positions, frames and bodies at one point of a Newton iteration."""

    carrier: Array  # all carriers [m], shape (n_carrier, 3); the first are the nodes, the others points of bodies
    position: Array  # of nodes [m], shape (n_node, 3)
    point: Array  # of the other carriers [m]
    length: Array  # of edges and walls [m], shape (n_edge + n_wall,)
    tangent: Array  # of edges and walls, unit, shape (n_edge + n_wall, 3)
    director1: Array  # likewise
    director2: Array
    turn: Array  # of edges about their tangents since the start of the step [rad], shape (n_edge,)
    angle: Array  # of edges in the last move [rad], shape (n_edge,)
    joint_strain: Array  # κ₁ κ₂ ψ of joints, ψ unwrapped [rad], shape (n_joint, 3)
    body_position: Array  # of free bodies [m], shape (n_free, 3)
    body_rotation: Array  # shape (n_free, 3, 3)
    place: Array  # of all bodies and last of the world [m], shape (n_body + 1, 3)
    rotation: Array  # shape (n_body + 1, 3, 3)
    surface_place: Array  # of surfaces [m], shape (n_surface, 3)
    surface_turn: Array  # their axes, shape (n_surface, 3, 3)
    arm: Array  # from the position of its body to each attached node [m], shape (n_attached, 3)
    held: Array  # of attached nodes [m], shape (n_attached, 3)
    point_arm: Array  # like `arm`, of points
    surface_arm: Array  # and of surfaces
    departure: Array  # of nodes from where inertia takes them, x − x̃ [m]: its digits are not those of x
    body_departure: Array  # of free bodies, X − X̃ [m]
    body_turned: Array  # vector part of the unit quaternion from R̃ to R of free bodies; see `forces.body`


@group
class Stage:
    """What is frozen over a stage of a step: it reads as an implicit Euler step from an origin (`integrate.method`).

    The velocity of whatever is at q is (q − origin)/(γ h).
    """

    lengths: Array  # γ h and γ′ h [s], where p = p̄ + γ′ h × force for momenta, shape (2,)
    origin_position: Array  # of nodes [m], shape (n_node, 3)
    origin_turn: Array  # of edges, counted from the start of the stage [rad], shape (n_edge,)
    origin_body_position: Array  # of free bodies [m], shape (n_free, 3)
    origin_place: Array  # of all bodies and last of the world [m], shape (n_body + 1, 3)
    origin_rotation: Array  # likewise; R̄ is no rotation but the matrix with dR/dt = (R − R̄)/(γ h)
    origin_fluid_momentum: Array  # P̄ of the fluid at nodes [N s], shape (n_node, 3); (0, 3) without added mass
    predicted_position: Array  # x̃ of nodes [m], shape (n_node, 3)
    predicted_turn: Array  # of edges that inertia prefers, counted from the start of the stage [rad], shape (n_edge,)
    predicted_body_position: Array  # X̃ of free bodies [m], shape (n_free, 3)
    predicted_body_rotation: Array  # R̃ of free bodies, shape (n_free, 3, 3)
    twist: Array  # of joints at the start of the stage
    rest_edge: Array  # strains without stress
    rest_joint_out: Array
    rest_joint: Array  # the same, read-only
    natural: Array  # of joints, with what strains off the axis add; `rest_joint` itself where none do
    load_factor: Array
    body_turn: Array  # rotation vector to where inertia takes free bodies
    way: Array  # of nodes, from the start of the stage to where inertia takes them [m]
    body_way: Array  # likewise of free bodies
    body_spin: Array  # with which they turn there [rad/s]
    held_arm: Array  # of what free bodies hold, R̃ r [m], shape (n_attached, 3)
    held_lag: Array  # of these, by which bodies without forces would take them farther than its own inertia [m]


@group
class Point:
    """Positions and momenta at the start of a step, at the origin of a stage, or at its end.

    Positions count from the start of the step: differences of absolute ones have lost their digits where steps are
    short or motions slow.
    """

    vectors: Array  # all but rotations, in one piece, of which the following are views
    displacement: Array  # of nodes [m]
    body_displacement: Array  # of all bodies [m]
    turn: Array  # of edges about their tangents since the start of the step [rad]
    velocity: Array  # of nodes [m/s]
    spin: Array  # of edges [rad/s]
    body_velocity: Array  # of free bodies [m/s]
    angular_momentum: Array  # of free bodies about their mass centres [N m s]
    fluid_momentum: Array  # of the fluid at nodes [N s]
    rotation: Array  # of all bodies, shape (n_body, 3, 3)


@group
class Method:
    """Coefficients of an integrator; see `integrate.method`."""

    diagonal: float
    momentum_diagonal: float
    couplings: Array  # over the diagonal, shape (n_stage, n_stage), with a row more if the end is beyond the last stage
    history: bool
    along: Array
    momenta: Array
    bend: float
    carry: float
    nodes: Array  # of stages, and of an end beyond them, as parts of a step, shape (n_point,)
    estimate: float  # of the error of a step, see `march.error_estimate`; NaN without


@group
class Course:
    """What acts from outside over some steps, at each of their points: the ends of stages, and of the step."""

    time: Array  # at the end of each step [s], shape (n_step,)
    elapsed: Array  # from the start of a step to each point [s], shape (n_point,)
    first: Array  # stimuli at the start of each step, shape (n_step, n_channel)
    jumps: Array  # whether a load jumps there, shape (n_step,)
    stimulus: Array  # shape (n_step, n_point, n_channel)
    load_factor: Array  # shape (n_step, n_point, n_load)
    position: Array  # of all bodies; those of prescribed ones count, shape (n_step or 1, n_point, n_body, 3)
    rotation: Array  # shape (n_step or 1, n_point, n_body, 3, 3)
    rates: Array  # shape (n_step or 1, n_point, n_body, 6)


@group
class Tally:
    """Extremes over a run; see `integrate.statistics`."""

    mass_moment: Array  # of edges along m1 [kg m], shape (n_edge,) or (0,)
    mass: float  # of all rods [kg]
    voronoi_length: Array  # of bending elements [m], shape (n_bend,)
    figures: Array  # highest mass centre [m], smallest gap [m], largest contact force [N], curvature [1/m], strain
    body_top: Array  # greatest height of each body's position [m], shape (n_body,)
    nodes: Array  # that touch each surface now, shape (n_surface,)
    most_nodes: Array
    first_contact: Array  # [s], NaN before, shape (n_surface,)


@group
class Work:
    """Places and points that a step needs."""

    places: tuple[Place, Place, Place]
    stage: Stage
    first: Point
    origin: Point  # of the stage at hand, or the end of a step beyond its last stage
    end: Point
    gained: Array  # by each stage over its origin, in the vectors of points, shape (n_stage, n_vectors)
    gained_turn: Array  # likewise rotation vectors of bodies, shape (n_stage, n_body, 3)
    moved: Array  # largest displacement in a round of statics [m], shape (1,)
    turned: Array  # of edges, from the start of the step to that of the stage [rad]
    rotation: Array  # scratch
    transduction: Array  # at a stage, shape (n_law,)
    strain: Array  # of laws at a stage, shape (n_law,)
    touched: Array  # carriers that something pushed at the end of the last step, shape (n_carrier,)


@group
class StateArrays:
    """What of a `model.state.State` a step changes."""

    values: Array  # all parts, these and others, in one piece
    position: Array
    position_low: Array
    velocity: Array
    director1: Array
    spin: Array
    fluid_excess: Array
    twist: Array
    body_position: Array
    body_position_low: Array
    body_rotation: Array
    body_velocity: Array
    body_angular_velocity: Array
    kept: Array
    acceleration: Array
    spin_acceleration: Array
    body_acceleration: Array
    body_moment: Array
    fluid_force: Array
    transduction: Array

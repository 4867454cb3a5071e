"""What a step needs: configurations, a stage, points, what acts from outside, extremes of the run."""

from __future__ import annotations

import numpy as np

from .group import group

Array = np.ndarray


@group
class Place:
    """A configuration; see `solve.configuration.Configuration`, whose arrays these are."""

    carrier: Array
    position: Array
    point: Array
    length: Array
    tangent: Array
    director1: Array
    director2: Array
    turn: Array
    angle: Array
    joint_strain: Array
    body_position: Array
    body_rotation: Array
    place: Array
    rotation: Array
    surface_place: Array
    surface_turn: Array
    arm: Array
    held: Array
    point_arm: Array
    surface_arm: Array


@group
class Stage:
    """What is frozen over a stage; see `solve.terms.term.StepContext`. `lengths` holds γ h and γ′ h [s]."""

    lengths: Array
    origin_position: Array
    origin_turn: Array
    origin_body_position: Array
    origin_place: Array
    origin_rotation: Array
    origin_fluid_momentum: Array
    predicted_position: Array
    predicted_turn: Array
    predicted_body_position: Array
    predicted_body_rotation: Array
    twist: Array  # of joints at the start of the stage
    rest_edge: Array  # strains without stress
    rest_joint_out: Array
    rest_joint: Array  # the same, read-only
    natural: Array  # of joints, with what strains off the axis add; `rest_joint` itself where none do
    load_factor: Array
    body_turn: Array  # rotation vector to where inertia takes free bodies


@group
class Point:
    """Positions and momenta at the start of a step, at the origin of a stage, or at its end; see `integrate.stages`."""

    position: Array
    body_position: Array
    turn: Array
    velocity: Array
    spin: Array
    body_velocity: Array
    angular_momentum: Array
    fluid_momentum: Array
    rotation: Array


@group
class Method:
    """Coefficients of an integrator; see `integrate.method`."""

    diagonal: float
    momentum_diagonal: float
    couplings: Array  # over the diagonal, shape (n_stage, n_stage)
    history: bool
    along: Array
    momenta: Array
    bend: float
    carry: float
    nodes: Array  # of stages, as parts of a step, shape (n_stage,)
    estimate: float  # of the error of a step, see `march.error_estimate`; NaN without


@group
class Course:
    """What acts from outside over some steps, at the end of each of their stages."""

    time: Array  # at the end of each step [s], shape (n_step,)
    elapsed: Array  # from the start of a step to each stage [s], shape (n_stage,)
    first: Array  # stimuli at the start of each step, shape (n_step, n_channel)
    jumps: Array  # whether a load jumps there, shape (n_step,)
    stimulus: Array  # shape (n_step, n_stage, n_channel)
    load_factor: Array  # shape (n_step, n_stage, n_load)
    position: Array  # of all bodies; those of prescribed ones count, shape (n_step or 1, n_stage, n_body, 3)
    rotation: Array  # shape (n_step or 1, n_stage, n_body, 3, 3)
    rates: Array  # shape (n_step or 1, n_stage, n_body, 6)


@group
class Tally:
    """Extremes over a run; see `integrate.statistics`."""

    mass_moment: Array  # of edges along m1 [kg m], shape (n_edge,) or (0,)
    mass: float  # of all rods [kg]
    figures: Array  # greatest height of the mass centre [m], smallest gap [m], largest contact force [N]
    nodes: Array  # that touch each surface now, shape (n_surface,)
    most_nodes: Array
    first_contact: Array  # [s], NaN before, shape (n_surface,)


@group
class Work:
    """Places and points that a step needs."""

    places: tuple[Place, Place, Place]
    stage: Stage
    first: Point
    origins: tuple[Point, Point]
    ends: tuple[Point, Point]
    turned: Array
    rotation: Array
    transduction: Array  # at a stage, shape (n_law,)
    strain: Array  # of laws at a stage, shape (n_law,)
    touched: Array  # carriers that something pushed at the end of the last step, shape (n_carrier,)


@group
class StateArrays:
    """What of a `model.state.State` a step changes."""

    values: Array  # all parts, these and others, in one piece
    position: Array
    velocity: Array
    director1: Array
    spin: Array
    fluid_excess: Array
    twist: Array
    body_position: Array
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

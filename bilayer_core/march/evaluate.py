"""Evaluations that are no steps: configurations, stages, forces and their matrix, each through what steps use.

There are two functions for the interpreter, because each is compiled with all that it can call: what makes
configurations and evaluates forces, and what needs the matrix.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner, kernel
from .contact import list_pairs
from .group import group
from .inertia import DAMPING, INERTIA
from .matrix import EXACT, assemble, factorise, solve
from .newton import bound, correction_speed, look_ahead
from .place import carry_frames, measure_departure, move, take_state
from .potential import add_forces, expand, follow, start_stage
from .problem import Problem
from .slip import hold_up
from .stages import predict, stand_still, start_point
from .status import NO_ROOM_FOR_RODS, READY
from .step_groups import Point, Stage, StateArrays
from .threads import ROD_BARRIER, ROD_FRICTION, find_contacts

Array = np.ndarray


@group
class Evaluation:
    """What evaluations take and leave."""

    problem: Problem
    state: StateArrays
    stage: Stage
    point: Point  # start of a step, or origin of a stage
    turned: Array  # of edges from the start of the step to that of the stage [rad], shape (n_edge,)
    position: Array  # of prescribed bodies among all at the time of the stage [m], shape (n_body, 3)
    rotation: Array  # likewise, shape (n_body, 3, 3)
    rates: Array  # likewise [m/s, rad/s], shape (n_body, 6)


TAKE_STATE, MOVE, CARRY_FRAMES, START_POINT, PREDICT, STAND_STILL, START_STAGE, FOLLOW, FORCES, UNKNOWNS = range(10)
"""What `evaluate_at` does."""
ASSEMBLE, FACTORISE, SOLVE, SPEED, BOUND = range(5)
"""What `solve_at` does."""


@inner
def _find(p, at):
    """Have lists of pairs and contacts of rods at a configuration, however far it is from the last."""
    status, _ = list_pairs(p.surfaces, at, 0.0)
    if status == READY and not find_contacts(p.threads, p.strands, at.position):
        status = NO_ROOM_FOR_RODS
    return status


@kernel
def evaluate_at(call, operation, base, at, with_hessian):
    """Make a configuration, freeze what a stage depends on, or evaluate the selected forces.

    Parameters
    ----------
    call : Evaluation
    operation : int
        TAKE_STATE: `at` becomes that of `call.state`.
        MOVE: it becomes `base`, moved by the step in `System`.
        CARRY_FRAMES: its frames become those of `base`, carried to its own positions and turned by its own `angle`.
        START_POINT: `call.point` becomes the start of a step from `call.state`, which is `at`.
        PREDICT: the stage becomes that of the origin `call.point`, with Newton's start at `at`.
        STAND_STILL: it becomes one in which inertia asks for nothing and others see the velocities of `call.state`.
        START_STAGE: friction, and all that follows the configuration, are those of `at`.
        FOLLOW: what follows the configuration is that of `at`.
        FORCES: sums of the selected forces at `at`.
        UNKNOWNS: the same, handed on to unknowns and free bodies.
    base, at : Place
    with_hessian : bool

    Returns
    -------
    status : int
    energy : float
        Of the selected forces together [J].
    gap : float
        The smallest to a surface or another rod, as far as barriers are selected [m].
    """
    p, state, stage = call.problem, call.state, call.stage
    bodies, held, strands = p.bodies, p.held, p.strands
    status, energy, gap = READY, 0.0, math.inf
    if operation == TAKE_STATE:
        take_state(bodies, held, p.surfaces, strands, state, at)
    elif operation == MOVE:
        step, body_step = p.system.step, p.system.body_step
        move(bodies, held, p.surfaces, p.space, p.plane, strands, base, step, body_step, 1.0, stage, at)
    elif operation == CARRY_FRAMES:
        carry_frames(p.space, p.plane, strands, base, at, at.angle)
    elif operation == START_POINT:
        start_point(bodies, p.fluid, strands, state, at, call.point)
    elif operation == PREDICT:
        point, poses = call.point, (call.position, call.rotation, call.rates)
        predict(bodies, held, state, point, point, at, call.turned, poses[0], poses[1], poses[2], stage)
    elif operation == STAND_STILL:
        stand_still(bodies, p.fluid, strands, state, at, False, stage)
    elif operation == START_STAGE:
        status = start_stage(p, at, stage)
    if operation == START_STAGE or operation == FOLLOW:
        follow(p, at, stage)
    elif operation == FORCES or operation == UNKNOWNS:
        status = _find(p, at)
        measure_departure(bodies, stage, at)
        if status == READY:
            gap = add_forces(p, at, stage, with_hessian, False)
            for k in range(p.sums.energy.shape[0]):
                energy += p.sums.energy[k]
            if operation == UNKNOWNS:
                expand(p, at)
    return status, energy, gap


@inner
def _leave_out(threads, selected):
    """Leave contacts out that no selected force has; returns the numbers of those of the barrier and of friction."""
    if threads is None:
        return 0, 0
    contacts, sliding = threads.contacts.counted, threads.sliding.counted
    before = contacts[0], sliding[0]
    if not selected[ROD_BARRIER]:
        contacts[0] = 0
    if not selected[ROD_FRICTION]:
        sliding[0] = 0
    return before


@inner
def _put_back(threads, before):
    if threads is None:
        return
    threads.contacts.counted[0], threads.sliding.counted[0] = before


@kernel
def solve_at(call, operation, at):
    """What needs the matrix of the last evaluation, that of `at` with second derivatives.

    Parameters
    ----------
    call : Evaluation
    operation : int
        ASSEMBLE: leave the matrix of the selected forces in `System.band` and `Border`.
        FACTORISE: factorise that of all forces.
        SOLVE: leave minus the inverse of the factorised matrix times the gradient in `Sums` as the step in `System`.
        SPEED: of the present step.
        BOUND: of the present step; the slip of its contacts is left in `Slips`.
    at : Place

    Returns
    -------
    status : int
    first, second : float
        FACTORISE: what was added to the masses, and how far contacts of rods were simplified. SPEED: [m/s]. BOUND: the
        fraction of the step that keeps gaps open, and at which friction holds it up.
    pair : int
        Near pair that sets the bound, −1 without one.
    """
    p, stage = call.problem, call.stage
    status, first, second, pair = READY, 0.0, 0.0, -1
    if operation == ASSEMBLE:
        factor = 0.0
        if p.sums.selected[INERTIA]:
            factor += 1.0 / (stage.lengths[0] * stage.lengths[1])
        if p.sums.selected[DAMPING]:
            factor += p.damping / stage.lengths[0]
        before = _leave_out(p.threads, p.sums.selected)
        assemble(p, at, factor, EXACT)
        _put_back(p.threads, before)
    elif operation == FACTORISE:
        status, first, simplified = factorise(p, at, stage, False)
        second = float(simplified)
    elif operation == SOLVE:
        solve(p.space, p.plane, p.wide, p.leaving, p.strands, p.bodies, p.sums, p.system)
    elif operation == SPEED:
        first = correction_speed(p.strands, p.bodies, p.system, stage.lengths[0])
    elif operation == BOUND:
        slope, _ = look_ahead(p.strands, p.bodies, p.sums, p.system)
        first, pair, status = bound(p.surfaces, p.threads, p.bodies, p.held, p.strands, p.system, at)
        second = hold_up(p.slips, p.sliding, p.surfaces, p.threads, p.system, stage, at, slope, first)
    return status, first, second, pair

"""Evaluations that are no steps: configurations, stages, forces and their matrix, each through what steps use.

The interpreter asks for one of several operations, by number.
"""

from __future__ import annotations

import math

from ..forces.inertia import DAMPING, INERTIA
from ..forces.rod_contact import ROD_BARRIER, ROD_FRICTION
from ..jit import call, kernel, piece
from ..jit.record import Matrix, Stack, Vector, record
from ..model.records.outcome import ENERGY, GAP, HELD_UP, PAIR, SHIFT, SIMPLIFIED, STATUS
from ..model.records.problem import Problem
from ..model.records.status import NO_ROOM_FOR_RODS, READY
from ..model.records.step import Place, Point, Stage, StateArrays
from .configuration import measure_departure
from .linear.newton_matrix import EXACT
from .newton import correction_speed, look_ahead


@record
class Evaluation:
    """What evaluations take and leave."""

    problem: Problem
    state: StateArrays
    stage: Stage
    point: Point  # start of a step, or origin of a stage
    turned: Vector  # of edges from the start of the step to that of the stage [rad], shape (n_edge,)
    position: Matrix  # of prescribed bodies among all at the time of the stage [m], shape (n_body, 3)
    rotation: Stack  # likewise, shape (n_body, 3, 3)
    rates: Matrix  # likewise [m/s, rad/s], shape (n_body, 6)


TAKE_STATE, MOVE, CARRY_FRAMES, START_POINT, PREDICT, STAND_STILL, START_STAGE, FOLLOW, FORCES, UNKNOWNS = range(10)
"""What `evaluate_at` does."""
ASSEMBLE, FACTORISE, SOLVE, SPEED, BOUND = range(5)
"""What `solve_at` does."""


@kernel
def _find(p, at):
    """Have lists of pairs and contacts of rods at a configuration, however far it is from the last."""
    status = READY
    if p.surfaces.exists:
        status = call(p.calls.list_surface_pairs, (p.surfaces, at, 0.0))
    if status == READY and p.rod_contact.exists and not call(p.calls.find_rod_contacts, (p, at)):
        status = NO_ROOM_FOR_RODS
    return status


@piece(int, Evaluation, int, Place, Place, bool)
def evaluate_at(task, operation, base, at, with_hessian):
    """Make a configuration, freeze what a stage depends on, or evaluate the selected forces.

    Parameters
    ----------
    task : Evaluation
    operation : int
        TAKE_STATE: `at` becomes that of `task.state`.
        MOVE: it becomes `base`, moved by the step in `System`.
        CARRY_FRAMES: its frames become those of `base`, carried to its own positions and turned by its own `angle`.
        START_POINT: `task.point` becomes the start of a step from `task.state`, which is `at`.
        PREDICT: the stage becomes that of the origin `task.point`, with Newton's start at `at`.
        STAND_STILL: it becomes one in which inertia asks for nothing and others see the velocities of `task.state`.
        START_STAGE: friction, and all that follows the configuration, are those of `at`.
        FOLLOW: what follows the configuration is that of `at`.
        FORCES: sums of the selected forces at `at`.
        UNKNOWNS: the same, handed on to unknowns and free bodies.
    base, at : Place
    with_hessian : bool

    Returns
    -------
    status : int
        In `Outcome`: the energy of the selected forces together [J], and the smallest gap to a surface or another rod,
        as far as barriers are selected [m].
    """
    p, state, stage = task.problem, task.state, task.stage
    status, energy, gap = READY, 0.0, math.inf
    if operation == TAKE_STATE:
        call(p.calls.take_state, (p, state, at))
    elif operation == MOVE:
        call(p.calls.move, (p, base, 1.0, stage, at))
    elif operation == CARRY_FRAMES:
        call(p.calls.place_frames, (p, base, at, at.angle))
    elif operation == START_POINT:
        call(p.calls.start_step_point, (p, state, at, task.point))
    elif operation == PREDICT:
        point = task.point
        call(
            p.calls.predict_stage,
            (p, state, point, point, at, task.turned, task.position, task.rotation, task.rates, stage),
        )
    elif operation == STAND_STILL:
        call(p.calls.stand_still_stage, (p, state, at, False, stage))
    elif operation == START_STAGE:
        status = call(p.calls.start_stage, (p, at, stage))
    if operation == START_STAGE or operation == FOLLOW:
        call(p.calls.follow, (p, at, stage))
    elif operation == FORCES or operation == UNKNOWNS:
        status = _find(p, at)
        measure_departure(p.bodies, stage, at)
        if status == READY:
            gap = call(p.calls.add_forces, (p, at, stage, with_hessian, False))
            for k in range(p.sums.energy.shape[0]):
                energy += p.sums.energy[k]
            if operation == UNKNOWNS:
                call(p.calls.expand_to_unknowns, (p, at))
    p.outcome.figures[ENERGY], p.outcome.figures[GAP] = energy, gap
    return status


@kernel
def _leave_out(rods, selected):
    """Leave contacts out that no selected force has; returns the numbers of those of the barrier and of friction."""
    if not rods.exists:
        return 0, 0
    contacts, sliding = rods.contacts.count, rods.sliding.count
    before = contacts[0], sliding[0]
    if not selected[ROD_BARRIER]:
        contacts[0] = 0
    if not selected[ROD_FRICTION]:
        sliding[0] = 0
    return before


@kernel
def _put_back(rods, before):
    if not rods.exists:
        return
    rods.contacts.count[0], rods.sliding.count[0] = before


@piece(int, Evaluation, int, Place)
def solve_at(task, operation, at):
    """What needs the matrix of the last evaluation, that of `at` with second derivatives.

    Parameters
    ----------
    task : Evaluation
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
        In `Outcome` as `SHIFT`: by FACTORISE what was added to the masses, by SPEED the speed [m/s], by BOUND the
        fraction of the step that keeps gaps open; as `HELD_UP`: how far contacts of rods were simplified, or the
        fraction at which friction holds the step up; and the near pair that sets the bound, −1 without one.
    """
    p, stage = task.problem, task.stage
    status, first, second, pair = READY, 0.0, 0.0, -1
    if operation == ASSEMBLE:
        factor = 0.0
        if p.sums.selected[INERTIA]:
            factor += 1.0 / (stage.lengths[0] * stage.lengths[1])
        if p.sums.selected[DAMPING]:
            factor += p.damping / stage.lengths[0]
        before = _leave_out(p.rod_contact, p.sums.selected)
        call(p.calls.assemble, (p, at, factor, EXACT))
        _put_back(p.rod_contact, before)
    elif operation == FACTORISE:
        status = call(p.calls.factorise, (p, at, stage, False))
        first, second = p.outcome.figures[SHIFT], p.outcome.figures[SIMPLIFIED]
    elif operation == SOLVE:
        call(p.calls.solve, (p,))
    elif operation == SPEED:
        first = correction_speed(p.strands, p.bodies, p.system, stage.lengths[0])
    elif operation == BOUND:
        slope, _ = look_ahead(p.strands, p.bodies, p.sums, p.system)
        first = call(p.calls.bound, (p, at))
        pair, status, second = p.outcome.counts[PAIR], p.outcome.counts[STATUS], first
        if p.slips.exists:
            second = call(p.calls.where_friction_holds, (p, at, stage, slope, first))
    p.outcome.figures[SHIFT], p.outcome.figures[HELD_UP], p.outcome.counts[PAIR] = first, second, pair
    return status

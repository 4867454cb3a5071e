"""Beginnings of steps and stages that are made once more, for derivatives of runs; see `engine.step`."""

from __future__ import annotations

import math

from bilayer_core.engine.actuation import Actuation, drive_step, take_first_stimuli
from bilayer_core.engine.configuration import move, take_state
from bilayer_core.engine.evaluate import evaluate_at
from bilayer_core.engine.laws import lagged
from bilayer_core.engine.light_over_step import begin_light
from bilayer_core.engine.linear.krylov_solution import ROUNDED, Lack, solve_with_lack
from bilayer_core.engine.linear.newton_matrix import factorise, solve
from bilayer_core.engine.newton import first_guess_of
from bilayer_core.engine.potential import (
    add_forces,
    settle_forces,
    start_stage,
    update_lagged,
)
from bilayer_core.engine.stages import add_history_to_origin, predict_stage, set_origin, start_step_point
from bilayer_core.engine.step import drive_stage
from bilayer_core.engine.step_response import ElasticMaps
from bilayer_core.forces.elements import start_elements
from bilayer_core.forces.rod_contact import find_rod_contacts
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Matrix, Stack, Vector
from bilayer_core.kinematics.copying import copy_matrix, copy_row
from bilayer_core.kinematics.rotating import rotate_by, rotation_vector_between
from bilayer_core.kinematics.vector import combine, cross, dot, scaled
from bilayer_core.kinematics.vector import row as vector
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Method, Stage, StageInputs, StateArrays, Work


@record
class Driven:
    """Steps that were made, and the stimuli that act in them."""

    begin: Vector  # [s]
    length: Vector  # [s]
    first: Matrix  # at the start of each, shape (n_step, n_channel)
    stimulus: Stack  # at its stages, shape (n_step, n_stage, n_channel)


@record
class Reached:
    """Where a stage ended."""

    position: Matrix  # of nodes
    turn: Vector  # of edges from the first guess [rad]
    body_position: Matrix  # of free bodies
    body_rotation: Stack


@piece(int, Problem, StateArrays, Method, Actuation, StageInputs, Work, float, float, float, Configuration)
def begin_step(p, state, method, actuation, inputs, work, begin, h, same, start):
    """Take the start of a step of length h [s] from `begin` [s], with what acts during it."""
    take_first_stimuli(actuation, begin, same, inputs)
    drive_step(actuation, method.nodes, begin, h, same, inputs)
    take_state(p, state, start)
    start_step_point(p, state, start, work.first)
    work.stage.length, work.stage.momentum_length = method.diagonal * h, method.momentum_diagonal * h
    work.start_angle[:] = 0.0
    if p.light.exists:
        begin_light(p, state)
    return READY


@piece(int, Actuation, Method, StageInputs, Driven, int, int, float, float)
def drive_steps(actuation, method, inputs, driven, first, last, ahead, same):
    """Write the stimuli that act in steps from the first one, before the last one, as far as they reach; return at
    which they do not.
    """
    for k in range(first, last):
        begin = driven.begin[k]
        if k > first and not begin + ahead < actuation.horizon[0]:
            return k
        take_first_stimuli(actuation, begin, same, inputs)
        drive_step(actuation, method.nodes, begin, driven.length[k], same, inputs)
        for c in range(inputs.first.shape[0]):
            driven.first[k, c] = inputs.first[c]
            for n in range(method.couplings.shape[0]):
                driven.stimulus[k, n, c] = inputs.stimulus[n, c]
    return last


@piece(int, Problem, StateArrays, StageInputs, ElasticMaps, int)
def write_lags(p, state, inputs, elastic, n):
    """Write by what modes that lag reach at point n of a step what they had reached, and both stimuli."""
    drives, lag, elapsed = p.drives, elastic.lag, inputs.elapsed[n]
    for f in range(drives.field_channel.shape[0]):
        last = inputs.stimulus[n, drives.field_channel[f]]
        if p.light.exists:
            last *= p.light.seen[f, 1]
        for m in range(drives.field_first[f], drives.field_first[f + 1]):
            slower = drives.mode_rising[m] if last > state.transduction[m] else drives.mode_falling[m]
            lag[0, m] = lagged(1.0, 0.0, 0.0, slower, slower, elapsed)
            lag[1, m] = lagged(0.0, 1.0, 0.0, slower, slower, elapsed)
            lag[2, m] = lagged(0.0, 0.0, 1.0, slower, slower, elapsed)
    return READY


@piece(int, Problem, StateArrays, Method, StageInputs, Work, int, float, Configuration)
def pass_stage(p, state, method, inputs, work, n, h, start):
    """Freeze what inertia takes stage n of it to, from the configuration where the last one ended."""
    set_origin(work, method, n)
    drive_stage(p, state, inputs, n, work)
    if method.history:
        add_history_to_origin(p, state, work, method, n, h)
    predict_stage(p, state, work, inputs, n, work.first if n == 0 else work.end, start)
    return READY


@piece(int, Problem, StateArrays, Method, StageInputs, Work, int, float, Configuration, Configuration)
def begin_stage(p, state, method, inputs, work, n, h, start, guess):
    """Start stage n of it from the configuration where the last one ended, up to the first guess; return a status."""
    stage = work.stage
    pass_stage(p, state, method, inputs, work, n, h, start)
    status = start_stage(p, start, stage)
    if status != READY:
        return status
    update_lagged(p, start, stage)
    return first_guess_of(p, start, inputs.position[n], inputs.rotation[n], stage, guess, False)


@piece(int, Problem, Configuration, Stage)
def factorise_end(p, at, stage):
    """Factorise the Hessian of all forces at a configuration, whose gradient is left in `Sums`; return a status."""
    p.sums.selected[:] = True
    start_elements(0, p, at, stage)
    status = evaluate_at(p, at, stage, True, True)
    return factorise(p, at, stage, False) if status == READY else status


@piece(float, Problem, Configuration, Lack, bool, float)
def correct(p, at, lack, lacks, radius):
    """Write Newton's correction from the present gradient to `System.step`; return the largest displacement in it [m],
    with a radius for turns.
    """
    strands, system = p.strands, p.system
    if lacks:
        solve_with_lack(p, at, lack, ROUNDED, False)
        for j in range(system.step.shape[0]):
            system.step[j] = -system.step[j]
        for f in range(system.body_step.shape[0]):
            for c in range(6):
                system.body_step[f, c] = -system.body_step[f, c]
    else:
        solve(p)
    largest = 0.0
    for i in range(strands.node_unknown.shape[0]):
        for c in range(3):
            largest = max(largest, abs(system.step[strands.node_unknown[i] + c]))
    for e in range(strands.edge_unknown.shape[0]):
        largest = max(largest, radius * abs(system.step[strands.edge_unknown[e]]))
    for f in range(system.body_step.shape[0]):
        for c in range(6):
            largest = max(largest, (1.0 if c < 3 else radius) * abs(system.body_step[f, c]))
    return largest


@kernel
def _turn_between(base, k, t, director):
    """Return the angle about a unit tangent from the transported director of an edge to another one [rad]."""
    a, m = vector(base.tangent, k), vector(base.director1, k)
    factor = dot(m, t) / (1.0 + dot(a, t))
    carried = combine(1.0, m, -factor, combine(1.0, a, 1.0, t))
    return math.atan2(dot(cross(carried, director), t), dot(carried, director))


@piece(int, Problem, StateArrays, StateArrays, Method, Work, int, float, Configuration, Configuration, Reached)
def expect_end(p, start, end, method, work, n, h, first, guess, reached):
    """Write where stage n ended, as far as both ends of the step tell; its start is the configuration `first`."""
    strands, bodies, length, origin = p.strands, p.bodies, work.stage.length, work.origin
    last = n + 1 == method.couplings.shape[0]
    base = guess if last else first
    reached.turn[:] = 0.0
    for k in range(strands.edge_count if p.space.exists else 0):
        i = strands.edge_node[k]
        t = combine(1.0, vector(end.position, i + 1), -1.0, vector(end.position, i))
        t = scaled(1.0 / math.sqrt(dot(t, t)), t)
        reached.turn[k] = _turn_between(base, k, t, vector(end.director1, k))
    if last:
        for i in range(end.position.shape[0]):
            for c in range(3):
                reached.position[i, c] = end.position[i, c]
        for f in range(bodies.mass.shape[0]):
            copy_row(end.body_position, bodies.body_of_free[f], reached.body_position, f)
            copy_matrix(end.body_rotation, bodies.body_of_free[f], reached.body_rotation, f)
        return READY
    coupling = method.couplings[n + 1, n]
    if n + 1 == method.couplings.shape[1]:
        length = 0.0  # the step ends beyond its last stage
    along, bend = (method.along[n + 1] * h, method.bend * h * h) if method.history else (0.0, 0.0)
    for i in range(end.position.shape[0]):
        for c in range(3):
            moved = end.position[i, c] - start.position[i, c] - length * end.velocity[i, c]
            if method.history:
                moved -= along * start.velocity[i, c] + bend * start.acceleration[i, c]
            reached.position[i, c] = start.position[i, c] + origin.displacement[i, c] + moved / coupling
    for k in range(reached.turn.shape[0]):
        turned = reached.turn[k] - length * end.spin[k]
        if method.history:
            turned -= along * start.spin[k] + bend * start.spin_acceleration[k]
        reached.turn[k] = origin.angle[k] + turned / coupling - work.start_angle[k] - guess.total_angle[k]
    for f in range(bodies.mass.shape[0]):
        b = bodies.body_of_free[f]
        for c in range(3):
            shift = end.body_position[b, c] - start.body_position[b, c] - length * end.body_velocity[b, c]
            shift -= along * start.body_velocity[b, c]
            reached.body_position[f, c] = start.body_position[b, c] + origin.body_displacement[b, c] + shift / coupling
        v = rotation_vector_between(first.body_rotation, f, end.body_rotation, b)
        v = combine(1.0, v, -length, vector(end.body_angular_velocity, b))
        v = combine(1.0 / coupling, v, -along / coupling, vector(start.body_angular_velocity, b))
        rotate_by(v[0], v[1], v[2], origin.rotation, b, reached.body_rotation, f)
    return READY


@piece(int, Problem, Stage, Configuration, Reached, Configuration)
def go_to(p, stage, guess, reached, at):
    """Move the first guess of a stage to where it ended."""
    step, motion = p.system.step, p.system.body_step
    step[:] = 0.0
    for i in range(p.strands.node_unknown.shape[0]):
        for c in range(3):
            step[p.strands.node_unknown[i] + c] = reached.position[i, c] - guess.position[i, c]
    for k in range(p.strands.edge_unknown.shape[0]):
        step[p.strands.edge_unknown[k]] = reached.turn[k]
    for f in range(motion.shape[0]):
        v = rotation_vector_between(guess.body_rotation, f, reached.body_rotation, f)
        for c in range(3):
            motion[f, c] = reached.body_position[f, c] - guess.body_position[f, c]
            motion[f, 3 + c] = v[c]
    move(p, guess, 1.0, stage, at)
    return READY


@piece(bool, Problem, Configuration, Stage)
def follow(p, at, stage):
    """Let forces take from a configuration all that they hold fixed in the last iteration of a stage that ends there,
    contacts of friction without relaxation, after the selected ones were evaluated; return whether any does.
    """
    if p.rod_contact.exists:
        find_rod_contacts(p, at)
    add_forces(p, at, stage, False, False)
    return hold_fixed(p, at, stage)


@kernel
def hold_fixed(p, at, stage):
    """Let forces take what they hold fixed, at the configuration of the last evaluation."""
    if p.sliding.exists:
        p.sliding.relaxation[0] = 0.0
    follows = update_lagged(p, at, stage)
    return settle_forces(p, at, stage) or follows

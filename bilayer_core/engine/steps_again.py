"""Beginnings of steps and stages that are made once more, for derivatives of runs; see `engine.step`."""

from __future__ import annotations

import math

from bilayer_core.engine.actuation import Actuation, drive_step, take_first_stimuli
from bilayer_core.engine.configuration import move, take_state
from bilayer_core.engine.laws import grow
from bilayer_core.engine.linear.newton_matrix import solve
from bilayer_core.engine.newton import first_guess_of
from bilayer_core.engine.potential import (
    add_forces,
    expand_to_unknowns,
    settle_forces,
    start_stage,
    update_lagged,
)
from bilayer_core.engine.stages import add_history_to_origin, predict_stage, set_origin, start_step_point
from bilayer_core.engine.step import drive_stage
from bilayer_core.forces.added_mass import fluid_momentum
from bilayer_core.forces.contact_on_bodies import condense_contact
from bilayer_core.forces.elements import start_elements
from bilayer_core.forces.friction_change import FrozenChange, add_changed_friction, add_frozen, begin_change
from bilayer_core.forces.rod_contact import find_rod_contacts
from bilayer_core.forces.surface_friction import freeze_surface_contacts
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Flags, Indices, Matrix, Vector
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Method, Stage, StageInputs, StateArrays, Work

DIRECTOR = 1024.0
"""Change of a director over that of a position [1/m]."""


@record
class Differences:
    """Differences of gradients: by unknowns, of which those of a colour change together, and by laws."""

    colours: int  # of nodes
    ways: Matrix  # in which nodes move, shape (n_way, 3)
    node_colour: Indices
    edge_colour: Indices
    by_place: (
        Matrix  # for each colour a row for each way of nodes, a row for each colour of edges, then those of bodies
    )
    by_origin: Matrix
    by_pose: Matrix  # of free bodies at the origin: a row for each way of its place, R̃ and ω̃, shape (9 n_free, size)
    by_director: Matrix  # of raised edges at the origin: for each colour of edges a row for each component
    by_law: Matrix  # shape (n_law, size)
    pressing: Flags  # forces that are evaluated before others take anything from a configuration, shape (n_force,)
    following: Flags  # these others, but for friction on surfaces
    friction: FrozenChange  # on surfaces, absent without


@record
class Lack:
    """Entries of a matrix that a Hessian lacks, and the space of Krylov in which both are solved."""

    row: Indices
    column: Indices
    value: Vector
    basis: Matrix  # shape (n_round + 1, size)
    projected: Matrix  # H, shape (n_round, n_round + 1), a row for each vector
    turns: Matrix  # cosines and sines, shape (n_round, 2)
    rest: Vector  # shape (n_round + 1,)


@piece(int, Problem, StateArrays, Method, Actuation, StageInputs, Work, float, float, float, Configuration)
def begin_step(p, state, method, actuation, inputs, work, begin, h, same, start):
    """Take the start of a step of length h [s] from `begin` [s], with what acts during it."""
    take_first_stimuli(actuation, begin, same, inputs)
    drive_step(actuation, method.nodes, begin, h, same, inputs)
    take_state(p, state, start)
    start_step_point(p, state, start, work.first)
    work.stage.length, work.stage.momentum_length = method.diagonal * h, method.momentum_diagonal * h
    work.start_angle[:] = 0.0
    return READY


@piece(int, Problem, StateArrays, Method, StageInputs, Work, int, float, Configuration, Configuration)
def begin_stage(p, state, method, inputs, work, n, h, start, guess):
    """Start stage n of it from the configuration where the last one ended, up to the first guess; return a status."""
    stage = work.stage
    set_origin(work, method, n)
    drive_stage(p, state, inputs, n, work)
    if method.history:
        add_history_to_origin(p, state, work, method, n, h)
    predict_stage(p, state, work, inputs, n, work.first if n == 0 else work.end, start)
    status = start_stage(p, start, stage)
    if status != READY:
        return status
    update_lagged(p, start, stage)
    return first_guess_of(p, start, inputs.position[n], inputs.rotation[n], stage, guess, False)


@piece(bool, Problem, Configuration, Stage)
def follow(p, at, stage):
    """Let forces take from a configuration all that they hold fixed in the last iteration of a stage that ends there,
    contacts of friction without relaxation, after the selected ones were evaluated; return whether any does.
    """
    if p.rod_contact.exists:
        find_rod_contacts(p, at)
    add_forces(p, at, stage, False, False)
    return _take(p, at, stage)


@kernel
def _take(p, at, stage):
    """Let forces take what they hold fixed, at the configuration of the last evaluation."""
    if p.sliding.exists:
        p.sliding.relaxation[0] = 0.0
    follows = update_lagged(p, at, stage)
    return settle_forces(p, at, stage) or follows


@kernel
def _add_gradient(p, at, stage, factor, out, row):
    """Add a multiple of the gradient of the selected forces at a configuration to a row."""
    if p.rod_contact.exists:
        find_rod_contacts(p, at)
    add_forces(p, at, stage, False, False)
    _add_sums(p, at, factor, out, row)


@kernel
def _add_sums(p, at, factor, out, row):
    """Add a multiple of what forces have added up to a row, at the unknowns."""
    expand_to_unknowns(p, at)
    rods = p.sums.gradient.shape[0]
    for j in range(rods):
        out[row, j] += factor * p.sums.gradient[j]
    for f in range(p.sums.body.shape[0]):
        for c in range(6):
            out[row, rods + 6 * f + c] += factor * p.sums.body[f, c]


@kernel
def _select(flags, selected):
    for k in range(selected.shape[0]):
        selected[k] = flags[k]


@kernel
def _write_step(p, differences, row, h):
    """Write a step of all unknowns of a row of differences."""
    step, strands, ways = p.system.step, p.strands, differences.ways
    step[:] = 0.0
    p.system.body_step[:] = 0.0
    count = ways.shape[0]
    of_nodes, bodies = count * differences.colours, 6 * p.bodies.mass.shape[0]
    motion = row - (differences.by_place.shape[0] - bodies)
    if motion >= 0:
        p.system.body_step[motion // 6, motion % 6] = h
        return
    if row < of_nodes:
        for i in range(differences.node_colour.shape[0]):
            if differences.node_colour[i] == row // count:
                for c in range(3):
                    step[strands.node_unknown[i] + c] = h * ways[row % count, c]
        return
    for e in range(differences.edge_colour.shape[0]):
        if differences.edge_colour[e] == row - of_nodes:
            step[strands.edge_unknown[e]] = h


@piece(int, Problem, Differences, Configuration, Configuration, Stage, float)
def differentiate_followed(p, differences, at, trial, stage, h):
    """Write how the gradient of the forces that follow depends on what they take from a configuration (`follow`), and
    on the origin of the stage; unknowns of a colour move by h.
    """
    by_place, by_origin, selected = differences.by_place, differences.by_origin, p.sums.selected
    by_place[:] = 0.0
    by_origin[:] = 0.0
    for row in range(by_place.shape[0]):
        for side in range(-1, 2, 2):
            _write_step(p, differences, row, side * h)
            move(p, at, 1.0, stage, trial)
            _select(differences.pressing, selected)
            follow(p, trial, stage)
            _select(differences.following, selected)
            _add_gradient(p, at, stage, side / (2.0 * h), by_place, row)
    _select(differences.pressing, selected)
    follow(p, at, stage)
    _select(differences.following, selected)
    for row in range(by_origin.shape[0]):
        for side in range(-1, 2, 2):
            _write_step(p, differences, row, side * h)
            _move_origin(p, stage, 1.0)
            _take(p, at, stage)
            _add_gradient(p, at, stage, side / (2.0 * h), by_origin, row)
            _move_origin(p, stage, -1.0)
    for row in range(differences.by_director.shape[0]):
        for side in range(-1, 2, 2):
            _move_directors(p, differences, row, side * h * DIRECTOR, stage)
            _add_gradient(p, at, stage, side / (2.0 * h * DIRECTOR), differences.by_director, row)
            _move_directors(p, differences, row, -side * h * DIRECTOR, stage)
    _take(p, at, stage)
    return READY


@kernel
def _add_friction_change(p, differences, at, stage, out, row):
    """Add to a row what the change that is noted makes of friction on surfaces."""
    sums = p.sums
    sums.gradients[:] = 0.0
    add_changed_friction(p.sliding, p, at, stage, differences.friction)
    condense_contact(p.has_contact, p.bodies, sums)
    _add_sums(p, at, 1.0, out, row)


@piece(int, Problem, Differences, Configuration, Configuration, Stage, float)
def differentiate_friction(p, differences, at, trial, stage, h):
    """Add what `differentiate_followed` leaves out: friction on surfaces, and by poses of free bodies at the origin."""
    by_place, by_origin, by_pose, sliding = (
        differences.by_place,
        differences.by_origin,
        differences.by_pose,
        p.sliding,
    )
    change = differences.friction
    for row in range(by_place.shape[0]):
        begin_change(sliding, p, at, stage, change)
        for side in range(-1, 2, 2):
            _write_step(p, differences, row, side * h)
            move(p, at, 1.0, stage, trial)
            add_frozen(sliding, p, trial, at, stage, side / (2.0 * h), change)
        _add_friction_change(p, differences, at, stage, by_place, row)
    for row in range(by_origin.shape[0] + by_pose.shape[0]):
        of_body = row - by_origin.shape[0]
        begin_change(sliding, p, at, stage, change)
        if of_body < 0:
            _write_step(p, differences, row, h)
        for side in range(-1, 2, 2):
            if of_body < 0:
                _move_origin(p, stage, side)
            else:
                _move_pose(p, stage, of_body // 9, of_body % 9, side * h)
            add_frozen(sliding, p, at, at, stage, side / (2.0 * h), change)
            if of_body < 0:
                _move_origin(p, stage, -side)
            else:
                _move_pose(p, stage, of_body // 9, of_body % 9, -side * h)
        if of_body < 0:
            _add_friction_change(p, differences, at, stage, by_origin, row)
        else:
            _add_friction_change(p, differences, at, stage, by_pose, of_body)
    freeze_surface_contacts(sliding, p, at, stage)
    return READY


@kernel
def _move_pose(p, stage, f, way, h):
    """Move free body f at the origin of a stage, (1 − length [ω̃]×) R̃, by a component of its position, by a turn of R̃,
    or by ω̃, of which h is that times the length.
    """
    b, c = p.bodies.body_of_free[f], way % 3
    if way < 3:
        stage.origin_pose_position[b, c] += h
        return
    length, spin, ahead, out = stage.length, stage.body_spin, stage.predicted_body_rotation, stage.origin_rotation
    d, e = (c + 1) % 3, (c + 2) % 3
    for j in range(3):
        u, v = -h * ahead[f, e, j], h * ahead[f, d, j]  # h e_c × R̃ has components d and e
        if way >= 6:
            out[b, d, j] -= u
            out[b, e, j] -= v
            continue
        out[b, d, j] += u - length * spin[f, c] * -v
        out[b, e, j] += v - length * spin[f, c] * u
        out[b, c, j] -= length * (spin[f, d] * v - spin[f, e] * u)


@kernel
def _move_directors(p, differences, row, h, stage):
    """Move a component of those of a colour at the origin of a stage."""
    raised = p.raised
    for r in range(raised.edge.shape[0]):
        if differences.edge_colour[raised.edge[r]] == row // 3:
            stage.origin_strain[raised.first + 3 * raised.slot[r] + row % 3] += h


@piece(int, Problem, Differences, Configuration, Configuration, Stage, float)
def differentiate_momentum(p, differences, at, trial, stage, h):
    """Write to `by_place` how the fluid's momentum, that about a node in place of its unknowns, depends on a
    configuration, at the velocities of the record.
    """
    rows = differences.by_place
    rows[:] = 0.0
    for row in range(rows.shape[0]):
        for side in range(-1, 2, 2):
            _write_step(p, differences, row, side * h)
            move(p, at, 1.0, stage, trial)
            fluid_momentum(p.fluid, trial)
            for i in range(p.strands.node_unknown.shape[0]):
                for c in range(3):
                    rows[row, p.strands.node_unknown[i] + c] += side / (2.0 * h) * p.fluid.momentum[i, c]
    return READY


@piece(int, Problem, Work, Differences, Configuration, float)
def differentiate_by_laws(p, work, differences, at, change):
    """Write how the gradient of the selected forces at a configuration depends on the eigenstrain of each law."""
    strain, stage, by_law = work.strain, work.stage, differences.by_law
    by_law[:] = 0.0
    for i in range(strain.shape[0]):
        own = strain[i]
        for side in range(-1, 2, 2):
            strain[i] = own + side * change
            grow(p.drives, strain, stage.rest_edge, stage.rest_joint)
            start_elements(0, p, at, stage)
            _add_gradient(p, at, stage, side / (2.0 * change), by_law, i)
        strain[i] = own
    grow(p.drives, strain, stage.rest_edge, stage.rest_joint)
    start_elements(0, p, at, stage)
    return READY


@kernel
def _solve(p, out):
    """Write the inverse of the factorised Hessian times the present gradient, of free bodies last."""
    solve(p)
    rods = p.system.step.shape[0]
    for j in range(rods):
        out[j] = -p.system.step[j]
    for f in range(p.bodies.mass.shape[0]):
        for c in range(6):
            out[rods + 6 * f + c] = -p.system.body_step[f, c]


@kernel
def _dot(a, b):
    total = 0.0
    for j in range(a.shape[0]):
        total += a[j] * b[j]
    return total


@piece(int, Problem, Lack, float)
def solve_with_lack(p, lack, enough):
    """Write the inverse of the factorised Hessian and of what it lacks together, times the present gradient, to
    `System.step`, by GMRES with the Hessian before it; what is left over is `enough` of the whole at most.
    """
    basis, projected, turns, rest = lack.basis, lack.projected, lack.turns, lack.rest
    step, body_step, size, rods = p.system.step, p.system.body_step, basis.shape[1], p.sums.gradient.shape[0]
    _solve(p, basis[0])
    whole, count = math.sqrt(_dot(basis[0], basis[0])), 0
    step[:] = 0.0
    body_step[:] = 0.0
    if whole == 0.0:
        return READY
    rest[:] = 0.0
    rest[0] = whole
    for j in range(size):
        basis[0, j] /= whole
    while count < projected.shape[0] and abs(rest[count]) > enough * whole:
        now, after = basis[count], basis[count + 1]
        p.sums.gradient[:] = 0.0
        p.sums.body[:] = 0.0
        for m in range(lack.row.shape[0]):
            j, force = lack.row[m], lack.value[m] * now[lack.column[m]]
            if j < rods:
                p.sums.gradient[j] += force
            else:
                p.sums.body[(j - rods) // 6, (j - rods) % 6] += force
        _solve(p, after)
        for j in range(size):
            after[j] += now[j]
        row = projected[count]
        for m in range(count + 1):
            row[m] = _dot(after, basis[m])
            for j in range(size):
                after[j] -= row[m] * basis[m, j]
        last = math.sqrt(_dot(after, after))
        for j in range(size if last > 0.0 else 0):
            after[j] /= last
        for m in range(count):
            above, below = row[m], row[m + 1]
            row[m] = turns[m, 0] * above + turns[m, 1] * below
            row[m + 1] = turns[m, 0] * below - turns[m, 1] * above
        size_of_last = math.hypot(row[count], last)
        turns[count, 0], turns[count, 1] = row[count] / size_of_last, last / size_of_last
        row[count] = size_of_last
        rest[count + 1] = -turns[count, 1] * rest[count]
        rest[count] *= turns[count, 0]
        count += 1
    step[:] = 0.0
    body_step[:] = 0.0
    for k in range(count - 1, -1, -1):
        for m in range(k + 1, count):
            rest[k] -= projected[m, k] * rest[m]
        rest[k] /= projected[k, k]
        for j in range(rods):
            step[j] += rest[k] * basis[k, j]
        for j in range(rods, size):
            body_step[(j - rods) // 6, (j - rods) % 6] += rest[k] * basis[k, j]
    return READY


@kernel
def _move_origin(p, stage, sign):
    """Move the origin of a stage by ± the step in `System`."""
    step, strands = p.system.step, p.strands
    for i in range(strands.node_unknown.shape[0]):
        for c in range(3):
            stage.origin_position[i, c] += sign * step[strands.node_unknown[i] + c]
    for e in range(strands.edge_unknown.shape[0]):
        stage.origin_angle[e] += sign * step[strands.edge_unknown[e]]

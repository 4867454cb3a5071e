"""Differences of gradients where a stage of a step that is made once more has ended, for derivatives of runs."""

from __future__ import annotations

from bilayer_core.contact.gap import gap_normal
from bilayer_core.engine.configuration import move
from bilayer_core.engine.laws import grow
from bilayer_core.engine.linear.assembly import expand_gradient
from bilayer_core.engine.linear.lacking_matrix import LackingMatrix
from bilayer_core.engine.potential import (
    add_forces,
    expand_to_unknowns,
)
from bilayer_core.engine.steps_again import follow, hold_fixed
from bilayer_core.forces.added_mass import fluid_momentum
from bilayer_core.forces.elements import start_elements
from bilayer_core.forces.rod_contact import find_rod_contacts
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Flags, Indices, Matrix, Vector
from bilayer_core.kinematics.copying import copy
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage, Work

DIRECTOR = 1024.0
"""Change of a director over that of a position [1/m]."""


@record
class Differences:
    """Differences of gradients by unknowns, of which those of a colour change together."""

    colours: int  # of nodes
    ways: Matrix  # in which nodes move, shape (n_way, 3)
    node_colour: Indices
    edge_colour: Indices
    by_place: (
        Matrix  # for each colour a row for each way of nodes, a row for each colour of edges, then those of bodies
    )
    by_origin: Matrix
    by_director: Matrix  # of raised edges at the origin: for each colour of edges a row for each component
    pressing: Flags  # forces that are evaluated before others take anything from a configuration, shape (n_force,)
    following: Flags  # these others


@record
class StrainDifferences:
    """Differences of gradients by eigenstrains, and by strains at the origin, of which those of a colour change
    together.
    """

    by_law: LackingMatrix
    law_colour: Indices
    by_laws: Matrix  # a row for each colour of laws
    own: Vector  # eigenstrains of laws, as they are
    colour: Indices  # of strains, −1 for those that stay
    by_strain: Matrix  # a row for each colour


@record
class Gaps:
    """Gaps of pairs whose impacts are damped."""

    gap: Vector  # [m]
    normal: Matrix


@kernel
def _add_forces_on_nodes(p, at, stage, factor, out, row):
    """Add a multiple of the gradient of the selected forces at a configuration to a row, that by nodes which bodies
    hold in the places of these.
    """
    if p.rod_contact.exists:
        find_rod_contacts(p, at)
    add_forces(p, at, stage, False, False)
    expand_gradient(p.bonds, p.strands, p.sums)
    _add_row(p, factor, out, row)


@kernel
def _add_gradient(p, at, stage, factor, out, row):
    """Add a multiple of the gradient of the selected forces at a configuration to a row."""
    add_forces(p, at, stage, False, False)
    expand_to_unknowns(p, at)
    _add_row(p, factor, out, row)


@kernel
def _add_row(p, factor, out, row):
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
    differences.by_director[:] = 0.0
    for row in range(by_place.shape[0]):
        for side in range(-1, 2, 2):
            _write_step(p, differences, row, side * h)
            move(p, at, 1.0, stage, trial)
            _select(differences.pressing, selected)
            follow(p, trial, stage)
            _select(differences.following, selected)
            _add_forces_on_nodes(p, at, stage, side / (2.0 * h), by_place, row)
    _select(differences.pressing, selected)
    follow(p, at, stage)
    _select(differences.following, selected)
    for row in range(by_origin.shape[0]):
        for side in range(-1, 2, 2):
            _write_step(p, differences, row, side * h)
            _move_origin(p, stage, 1.0)
            hold_fixed(p, at, stage)
            _add_forces_on_nodes(p, at, stage, side / (2.0 * h), by_origin, row)
            _move_origin(p, stage, -1.0)
    for row in range(differences.by_director.shape[0]):
        for side in range(-1, 2, 2):
            _move_directors(p, differences, row, side * h * DIRECTOR, stage)
            hold_fixed(p, at, stage)
            _add_forces_on_nodes(p, at, stage, side / (2.0 * h * DIRECTOR), differences.by_director, row)
            _move_directors(p, differences, row, -side * h * DIRECTOR, stage)
    hold_fixed(p, at, stage)
    return READY


@kernel
def _move_directors(p, differences, row, h, stage):
    """Move a component of those of a colour at the origin of a stage."""
    raised = p.raised
    for r in range(raised.edge.shape[0]):
        if differences.edge_colour[raised.edge[r]] == row // 3:
            stage.origin_strain[raised.first + 3 * raised.slot[r] + row % 3] += h


@piece(int, Problem, Differences, Configuration, Configuration, Stage, float)
def differentiate_momentum(p, differences, at, trial, stage, h):
    """Write to `by_place` how the fluid's momentum depends on a configuration, at the velocities of the record: that
    about a node in place of its unknowns, that of kept directors behind all unknowns.
    """
    rows, nodes = differences.by_place, p.strands.node_unknown.shape[0]
    size = rows.shape[1] - 3 * (p.fluid.momentum.shape[0] - nodes)
    rows[:] = 0.0
    for row in range(rows.shape[0]):
        for side in range(-1, 2, 2):
            _write_step(p, differences, row, side * h)
            move(p, at, 1.0, stage, trial)
            fluid_momentum(p.fluid, trial)
            for i in range(p.fluid.momentum.shape[0]):
                place = p.strands.node_unknown[i] if i < nodes else size + 3 * (i - nodes)
                for c in range(3):
                    rows[row, place + c] += side / (2.0 * h) * p.fluid.momentum[i, c]
    return READY


@piece(int, Problem, Configuration, Gaps)
def write_gaps(p, at, out):
    """Write the gaps of pairs whose impacts are damped."""
    pairs, x = p.restitution, at.contact_point
    for k in range(out.gap.shape[0]):
        i, s = pairs.point[k], pairs.surface[k]
        found = gap_normal(p.surfaces, at, p.surfaces.radius[i], s, x[i, 0], x[i, 1], x[i, 2])
        out.gap[k] = found[0]
        out.normal[k, 0], out.normal[k, 1], out.normal[k, 2] = found[1], found[2], found[3]
    return READY


@piece(int, Problem, Work, StrainDifferences, Configuration, float)
def differentiate_by_laws(p, work, differences, at, change):
    """Write how the gradient of the selected forces, without contact, depends on the eigenstrain of each law."""
    strain, stage, own, rows = work.strain, work.stage, differences.own, differences.by_laws
    by_law, colour = differences.by_law, differences.law_colour
    rows[:] = 0.0
    copy(strain, own)
    for row in range(rows.shape[0]):
        for side in range(-1, 2, 2):
            for i in range(strain.shape[0]):
                strain[i] = own[i] + side * change if colour[i] == row else own[i]
            grow(p.drives, strain, stage.rest_edge, stage.rest_joint)
            start_elements(0, p, at, stage)
            _add_gradient(p, at, stage, side / (2.0 * change), rows, row)
    copy(own, strain)
    grow(p.drives, strain, stage.rest_edge, stage.rest_joint)
    start_elements(0, p, at, stage)
    for k in range(by_law.count[0]):
        by_law.value[k] = rows[colour[by_law.column[k]], by_law.row[k]]
    return READY


@piece(int, Problem, StrainDifferences, Configuration, Stage, float)
def differentiate_by_strains(p, differences, at, stage, change):
    """Write how the gradient of the selected forces, without contact, depends on strains at the origin."""
    rows, colour, origin = differences.by_strain, differences.colour, stage.origin_strain
    rows[:] = 0.0
    start_elements(0, p, at, stage)
    add_forces(p, at, stage, False, False)
    expand_to_unknowns(p, at)
    for row in range(rows.shape[0]):
        _add_row(p, -1.0 / change, rows, row)
    for row in range(rows.shape[0]):  # the gradient is linear in them
        for k in range(colour.shape[0]):
            if colour[k] == row:
                origin[k] += change
        start_elements(0, p, at, stage)
        _add_gradient(p, at, stage, 1.0 / change, rows, row)
        for k in range(colour.shape[0]):
            if colour[k] == row:
                origin[k] -= change
    start_elements(0, p, at, stage)
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

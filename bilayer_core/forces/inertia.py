"""Inertia, mass damping and gravity of rods and free bodies."""

from __future__ import annotations

import math

from ..jit import kernel, piece
from ..model.force_places import place_of
from ..model.records.problem import Problem
from ..model.records.step import Place, Stage
from .body import body_inertia
from .quadratic import angle_spring, departure_spring, gravity, node_spring

INERTIA, DAMPING, GRAVITY = map(place_of, ("inertia", "damping", "gravity"))


@kernel
def _add_inertia_of_bodies(border, bodies, factor, at, stage, sums, with_hessian):
    if not border.exists:
        return 0.0
    return body_inertia(
        bodies.mass,
        bodies.second_moment,
        factor,
        at.body_departure,
        at.body_turned,
        stage.predicted_body_rotation,
        sums.body,
        sums.body_hessian,
        with_hessian,
    )


@kernel
def add_inertia(gravitation, damping, border, strands, bodies, at, stage, sums, with_hessian):
    if sums.selected[INERTIA]:
        factor = 1.0 / (stage.lengths[0] * stage.lengths[1])
        energy = departure_spring(strands.node_mass, factor, at.departure, sums.node)
        energy += angle_spring(strands.spin_inertia, factor, at.turn, stage.predicted_turn, sums.edge)
        energy += _add_inertia_of_bodies(border, bodies, factor, at, stage, sums, with_hessian)
        sums.energy[INERTIA] = energy
    if damping > 0.0 and sums.selected[DAMPING]:
        factor = damping / stage.lengths[0]
        energy = node_spring(strands.node_mass, factor, at.position, stage.origin_position, sums.node)
        energy += angle_spring(strands.spin_inertia, factor, at.turn, stage.origin_turn, sums.edge)
        sums.energy[DAMPING] = energy
    falls = gravitation[0] != 0.0 or gravitation[1] != 0.0 or gravitation[2] != 0.0
    if falls and sums.selected[GRAVITY]:
        energy = gravity(strands.node_mass, gravitation, at.position, sums.node)
        energy += gravity(bodies.mass, gravitation, at.body_position, sums.body)
        sums.energy[GRAVITY] = energy


@piece(float, int, Problem, Place, Stage, bool)
def add_inertial_forces(_, p, at, stage, with_hessian):
    """Inertia, mass damping and gravity."""
    add_inertia(p.gravity, p.damping, p.border, p.strands, p.bodies, at, stage, p.sums, with_hessian)
    return math.inf

"""Inertia, mass damping and gravity of rods and free bodies."""

from __future__ import annotations

from ..forces.body import body_inertia
from ..forces.quadratic import angle_spring, departure_spring, gravity, node_spring
from ..jit import inner
from .terms import place_of

INERTIA, DAMPING, GRAVITY = map(place_of, ("inertia", "damping", "gravity"))


@inner
def _add_inertia_of_bodies(border, bodies, factor, at, stage, sums, with_hessian):
    if border is None:
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


@inner
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

"""Evaluations that are no steps, through what steps use: forces at any configuration, and how far a step may go."""

from __future__ import annotations

import math

from bilayer_core.engine.configuration import measure_departure
from bilayer_core.engine.kinetic import kinetic_energy
from bilayer_core.engine.newton import bound, correction_speed, predicted_decrease
from bilayer_core.engine.potential import add_forces, expand_to_unknowns, total_energy
from bilayer_core.engine.powers import write_forces_of_laws
from bilayer_core.forces.friction_limit import limit_by_friction
from bilayer_core.forces.rod_contact import find_rod_contacts
from bilayer_core.forces.surface_pairs import list_surface_pairs
from bilayer_core.jit import piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY, ROD_CAPACITY_EXCEEDED
from bilayer_core.model.records.step import Configuration, Stage, StateArrays, Work


@piece(int, Problem, Configuration, Stage, bool, bool)
def evaluate_at(p, at, stage, with_hessian, expands):
    """Sum the selected forces at a configuration, however far it is from the last.

    Parameters
    ----------
    p : Problem
    at : Configuration
    stage : Stage
    with_hessian : bool
    expands : bool
        Whether first derivatives are handed on to unknowns and free bodies.

    Returns
    -------
    status : int
        In `Outcome`: the energy of the selected forces together [J], and the smallest gap to a surface or another rod,
        as far as barriers are selected [m].
    """
    status, energy, gap = READY, 0.0, math.inf
    if p.surfaces.exists:
        status = list_surface_pairs(p.surfaces, at, 0.0)
    if status == READY and p.rod_contact.exists and not find_rod_contacts(p, at):
        status = ROD_CAPACITY_EXCEEDED
    if status == READY:
        measure_departure(p.bodies, stage, at)
        gap = add_forces(p, at, stage, with_hessian, False)
        energy = total_energy(p.sums)
        if expands:
            expand_to_unknowns(p, at)
    p.outcome.energy, p.outcome.gap = energy, gap
    return status


@piece(float, Problem, StateArrays)
def measure_kinetic_energy(p, state):
    """Return the kinetic energy of nodes, edges and free bodies [J]."""
    return kinetic_energy(p, state)


@piece(int, Problem, Work, Configuration)
def evaluate_laws(p, work, at):
    """Write −∂V/∂η of each law [J] at a configuration, with the rest strains of the stage, to `Work.end_force`."""
    return write_forces_of_laws(p, at, work.stage, work.end_force)


@piece(float, Problem, Stage)
def speed_of_step(p, stage):
    """Return the largest displacement of a material point in the step in `System` over the length of the stage
    [m/s].
    """
    return correction_speed(p.strands, p.bodies, p.system, stage.length)


@piece(int, Problem, Configuration, Stage)
def bound_step(p, at, stage):
    """Return how far the step in `System` may go; the slip of its contacts is left in `Slips`.

    Returns
    -------
    status : int
        In `Outcome`: the fraction that keeps gaps open, the near pair that sets it, −1 without one, and the fraction at
        which friction holds the step up.
    """
    slope, _ = predicted_decrease(p.strands, p.bodies, p.sums, p.system)
    fraction = friction_fraction = bound(p, at)
    if p.slips.exists:
        friction_fraction = limit_by_friction(p, at, stage, slope, fraction)
    p.outcome.fraction, p.outcome.friction_fraction = fraction, friction_fraction
    return p.outcome.status

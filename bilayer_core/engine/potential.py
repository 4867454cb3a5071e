"""The incremental potential: the sum of the forces that act."""

from __future__ import annotations

import math

from bilayer_core.engine.linear.assembly import expand_gradient
from bilayer_core.engine.linear.attachments import condense_gradient
from bilayer_core.forces.contact_on_bodies import condense_contact
from bilayer_core.forces.raised import pull_edges
from bilayer_core.jit import caller, kernel, piece
from bilayer_core.kinematics.copying import copy
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage

_TAKES = (int, Problem, Configuration, Stage)
"""What pieces of a force take first: the address of its own record, and what all forces see."""
call_add = caller("a force", float, *_TAKES, bool)
call_briefly = caller("the start or end of a force", int, *_TAKES)
call_update_lagged = caller("a force that follows", bool, *_TAKES)


@kernel
def _call_each(addresses, p, at, stage):
    """Call what forces have at their addresses, until one says that it cannot go on."""
    for k in range(addresses.shape[0]):
        if addresses[k] != 0:
            status = call_briefly(addresses[k], (p.forces.own[k], p, at, stage))
            if status != READY:
                return status
    return READY


@kernel
def _call_all(p, addresses, at, stage):
    """Call what forces have at their addresses; whether any has changed."""
    changed = False
    for k in range(p.forces.lasting, addresses.shape[0]):
        if addresses[k] != 0:
            changed |= call_update_lagged(addresses[k], (p.forces.own[k], p, at, stage))
    return changed


@piece(int, Problem, Configuration, Stage)
def start_stage(p, start, stage):
    """Freeze what a stage depends on: near pairs, friction's contacts, loads. Returns whether it can go on."""
    return _call_each(p.forces.start, p, start, stage)


@piece(bool, Problem, Configuration, Stage)
def update_lagged(p, at, stage):
    """Let forces take from a configuration what they hold fixed between moves; return whether any does."""
    return _call_all(p, p.forces.update_lagged, at, stage)


@piece(bool, Problem, Configuration, Stage)
def settle_forces(p, at, stage):
    """Let forces take from a minimum of the potential what they froze at the start of the stage; return whether any
    does.
    """
    return _call_all(p, p.forces.settle, at, stage)


@piece(int, Problem, Configuration, Stage)
def end_forces(p, at, stage):
    """Let forces write what they carry on to the next step, and their energies at the end of this one."""
    return _call_each(p.forces.end, p, at, stage)


@kernel
def evaluate(p, at, stage, with_hessian, again):
    """Return the potential at a configuration [J], infinite behind a surface, and the smallest gap to a surface or a
    rod [m].

    Gradients always, second derivatives on request, are left in `Sums`. The contacts of rods are those found last. With
    `again` the configuration is that of the last evaluation; only what `update_lagged` has changed since is found anew,
    without second derivatives and the gap.
    """
    gap = add_forces(p, at, stage, with_hessian, again)
    expand_to_unknowns(p, at)
    return total_energy(p.sums), gap


@kernel
def total_energy(sums):
    """Return the sum of the energies of all forces [J]."""
    energy = 0.0
    for k in range(sums.energy.shape[0]):
        energy += sums.energy[k]
    return energy


@piece(float, Problem, Configuration, Stage, bool, bool)
def add_forces(p, at, stage, with_hessian, again):
    """Add the energies and first derivatives by nodes, edges, pairs and bodies, second ones on request; parameters
    as for `evaluate`. Returns the smallest gap [m].
    """
    forces, sums = p.forces, p.sums
    count, gap = forces.add.shape[0], math.inf
    if again:
        copy(sums.lasting, sums.gradients)
    else:
        sums.energy[:] = 0.0
        sums.supplied[:] = 0.0
        sums.lost[:] = 0.0
        sums.gradients[:] = 0.0
        if with_hessian:
            sums.hessians[:] = 0.0
            sums.links[0] = sums.arms[0] = 0
    for k in range(forces.lasting if again else 0, count):
        if k == forces.lasting and not again:
            copy(sums.gradients, sums.lasting)
        gap = min(gap, call_add(forces.add[k], (forces.own[k], p, at, stage, with_hessian)))
    condense_contact(p.has_contact, p.bodies, sums)
    pull_edges(p.raised, at, sums)
    return gap


@piece(int, Problem, Configuration)
def expand_to_unknowns(p, at):
    """Carry first derivatives on from nodes, edges, pairs and bodies to the unknowns."""
    expand_gradient(p.bonds, p.strands, p.sums)
    condense_gradient(p.constrained, p.strands, at, p.sums)
    return READY

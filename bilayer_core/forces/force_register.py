"""The forces of the engine: which pieces compute those of the list (`model.force_list`), and what they take.

A force is a file with its formula in `forces/`, its line in the list, and a line here. Nothing else names it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bilayer_core.errors import ForceError
from bilayer_core.forces.added_mass import add_added_mass, update_fluid
from bilayer_core.forces.bend_twist import add_bending, add_bending_of_strips
from bilayer_core.forces.body_drag import add_body_drag, body_flow_of
from bilayer_core.forces.bond import add_bonds
from bilayer_core.forces.drag import add_drag, update_directions_of_drag
from bilayer_core.forces.elements import start_elements
from bilayer_core.forces.gyroscopic import add_gyroscopic_force, spinning_of, update_gyroscopic_force
from bilayer_core.forces.inertia import add_inertial_forces
from bilayer_core.forces.joints import add_joints, joints_of
from bilayer_core.forces.loads import add_moments, add_point_forces, start_dead_loads, update_followers, update_moments
from bilayer_core.forces.mechanisms import REMEMBERED, add_mechanisms, end_mechanisms, memory_at
from bilayer_core.forces.planar import add_elasticity_in_plane, add_elasticity_of_strips_in_plane
from bilayer_core.forces.raised import add_raised_masses
from bilayer_core.forces.restitution import add_restitution, end_restitution, start_restitution, with_memory
from bilayer_core.forces.rod_contact import (
    add_rod_barrier,
    add_rod_friction,
    settle_rod_friction,
    start_rod_barrier,
    start_rod_friction,
)
from bilayer_core.forces.stretch import add_stretching
from bilayer_core.forces.surface_barrier import add_surface_barrier, start_surface_barrier
from bilayer_core.forces.surface_friction import add_surface_friction, settle_surface_friction, start_surface_friction
from bilayer_core.forces.turning_drag import add_turning_drag, turning_flow_of
from bilayer_core.forces.viscosity import add_viscosity
from bilayer_core.jit import Record
from bilayer_core.jit.piece import Piece
from bilayer_core.model.model import Model
from bilayer_core.model.records.problem import ForceTable


@dataclass(frozen=True)
class Term:
    """Forces that are computed together.

    Attributes
    ----------
    names : tuple of str
        In the list of forces; any of them asks for the term.
    record : callable
        Its own record, from the model and from the records of a problem by name; None if it needs none, and absent if
        it does not act.
    add : Piece
        Energies and derivatives, added to `Sums`: of the own record, Problem, Configuration, Stage and
        whether second derivatives are asked for. Returns the smallest gap that it knows [m], or infinity.
    start : Piece or None
        Freezes what a stage depends on: of the own record, Problem, Configuration and Stage. Returns a status.
    update_lagged : Piece or None
        Takes from a configuration what is held fixed between the moves of Newton's method, by the same arguments.
        Returns whether there is anything.
    settle : Piece or None
        Takes from a minimum of the potential what a stage froze at its start, by the same arguments. Returns whether
        there is anything: then the potential is minimised again, until that is no more.
    end : Piece or None
        At the end of an accepted step, by the same arguments: writes its values of `Problem.memory`, and its energy
        there where that is not what `add` found. Returns a status.
    memory : callable or None
        How many values a model's force carries from step to step, per contact or otherwise; None if none. They are part
        of the state, and 0 at the start of a run. Where in `Problem.memory` they begin is given to `record` as
        ``of["memory"]``.
    """

    names: tuple[str, ...]
    record: Callable[[Model, dict[str, Any]], Record | None]
    add: Piece
    start: Piece | None = None
    update_lagged: Piece | None = None
    settle: Piece | None = None
    end: Piece | None = None
    memory: Callable[[Model], int] | None = None

    @property
    def lasts(self) -> bool:
        """True if the term stays as it is while others are made anew."""
        return self.update_lagged is None and self.settle is None


def _unless_strips(model: Model, record: Record) -> Record:
    """Return a record, absent if rods are strips: then another piece computes the term, with flattening."""
    return type(record).absent() if model.flattening.exists else record


TERMS: tuple[Term, ...] = (
    Term(("stretching",), lambda model, of: of["space"], add_stretching),
    Term(("bending", "twisting"), lambda model, of: _unless_strips(model, of["space"]), add_bending),
    Term(("flattening",), lambda model, of: of["space"], add_bending_of_strips),
    Term(("bond",), lambda model, of: of["space"], add_bonds),
    Term(
        ("stretching", "bending", "bond"),
        lambda model, of: _unless_strips(model, of["plane"]),
        add_elasticity_in_plane,
    ),
    Term(("flattening",), lambda model, of: of["plane"], add_elasticity_of_strips_in_plane),
    Term(("joints",), lambda model, of: joints_of(model), add_joints),
    Term(
        ("joints", "joint friction"),
        lambda model, of: memory_at(of["mechanisms"], of["memory"]),
        add_mechanisms,
        end=end_mechanisms,
        memory=lambda model: REMEMBERED * len(model.mechanisms),
    ),
    Term(("stretching", "viscosity"), lambda model, of: None, add_viscosity, start_elements),
    Term(("inertia", "damping", "gravity"), lambda model, of: None, add_inertial_forces),
    Term(("inertia", "damping", "gravity"), lambda model, of: of["raised"], add_raised_masses),
    Term(("loads",), lambda model, of: of["loads"], add_point_forces, start_dead_loads),
    Term(("body drag",), lambda model, of: body_flow_of(model), add_body_drag),
    Term(("turning drag",), lambda model, of: turning_flow_of(model), add_turning_drag),
    Term(("barrier", "restitution"), lambda model, of: of["surfaces"], add_surface_barrier, start_surface_barrier),
    Term(
        ("restitution",),
        lambda model, of: with_memory(of["restitution"], of["memory"]),
        add_restitution,
        start_restitution,
        end=end_restitution,
        memory=lambda model: len(model.impact_pairs),
    ),
    Term(("rod barrier",), lambda model, of: of["rod_contact"], add_rod_barrier, start_rod_barrier),
    Term(("followers",), lambda model, of: of["followers"], add_point_forces, update_lagged=update_followers),
    Term(("moments",), lambda model, of: of["moments"], add_moments, update_lagged=update_moments),
    Term(("drag",), lambda model, of: of["flow"], add_drag, update_lagged=update_directions_of_drag),
    Term(
        ("gyroscopic",),
        lambda model, of: spinning_of(model),
        add_gyroscopic_force,
        update_lagged=update_gyroscopic_force,
    ),
    Term(("added mass",), lambda model, of: of["fluid"], add_added_mass, update_lagged=update_fluid),
    Term(
        ("friction",),
        lambda model, of: of["sliding"],
        add_surface_friction,
        start_surface_friction,
        settle=settle_surface_friction,
    ),
    Term(
        ("rod friction",),
        lambda model, of: of["rod_contact"],
        add_rod_friction,
        start_rod_friction,
        settle=settle_rod_friction,
    ),
)
"""In the order of the sum; those that are made anew at a configuration come last."""


def require_computed(forces: Iterable[str]) -> None:
    """Refuse forces that a scene needs and nothing computes.

    Raises
    ------
    ForceError
    """
    computed = {name for term in TERMS for name in term.names}
    missing = [name for name in forces if name not in computed]
    if missing:
        raise ForceError(
            f"force {missing[0]!r}: is in the list, bilayer_core/model/force_list.py, and the scene needs it, but no "
            "term of bilayer_core/forces/force_register.py computes it"
        )


def _carried(term: Term, model: Model) -> int:
    return term.memory(model) if term.memory is not None and set(term.names) & set(model.forces) else 0


def memory_size(model: Model) -> int:
    """Return how many values the forces of a model carry from step to step (`Problem.memory`)."""
    return sum(_carried(term, model) for term in TERMS)


def force_table(model: Model, records: dict[str, Any]) -> ForceTable:
    """Return the terms that act in a model.

    Parameters
    ----------
    model : Model
    records : dict
        Of its problem, by name.
    """
    chosen, carried = [], 0
    for term in TERMS:
        own = term.record(model, records | {"memory": carried})
        if set(term.names) & set(model.forces) and (own is None or own.exists):
            chosen.append((term, own))
        carried += _carried(term, model)
    chosen.sort(key=lambda pair: not pair[0].lasts)

    def column(value: Callable) -> np.ndarray:
        return np.array([value(*pair) for pair in chosen], dtype=np.int64)

    table = ForceTable(
        own=column(lambda term, own: own.address if own is not None else 0),
        add=column(lambda term, own: term.add.address),
        start=column(lambda term, own: term.start.address if term.start else 0),
        update_lagged=column(lambda term, own: term.update_lagged.address if term.update_lagged else 0),
        end=column(lambda term, own: term.end.address if term.end else 0),
        settle=column(lambda term, own: term.settle.address if term.settle else 0),
        lasting=sum(term.lasts for term, _ in chosen),
    )
    table.holds = [own for _, own in chosen]  # whose addresses are in it
    return table

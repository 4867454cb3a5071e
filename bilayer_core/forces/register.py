"""The forces of the engine: which pieces compute those of the list (`model.force_list`), and what they take.

A force is a file with its formula in `forces/`, its line in the list, and a line here. Nothing else names it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..jit import Record
from ..jit.piece import Piece
from ..model.model import Model
from ..model.records.problem import ForceTable
from .elasticity import add_elasticity_in_plane, add_elasticity_in_space, start_elasticity
from .fluid_terms import add_drag_of_nodes, add_mass_of_fluid, follow_with_drag, follow_with_fluid
from .inertia import add_inertial_forces
from .load_terms import (
    add_body_moments,
    add_dead_loads,
    add_follower_loads,
    follow_with_loads,
    follow_with_moments,
    start_dead_loads,
)
from .rod_contact import add_rod_contact, start_rod_contact
from .surface_barrier import add_surface_barrier, start_surface_barrier
from .surface_friction import add_surface_friction, start_surface_friction


@dataclass(frozen=True)
class Term:
    """Forces that are computed together.

    Attributes
    ----------
    names : tuple of str
        In the list of forces; any of them asks for the term.
    record : callable
        Its own record, of the records of a problem by name; None if it needs none, and absent if it does not act.
    add : Piece
        Energies and derivatives at a configuration, added to `Sums`: of the own record, Problem, Place, Stage and
        whether second derivatives are asked for. Returns the smallest gap that it knows [m], or infinity.
    start : Piece or None
        Freezes what a stage depends on: of the own record, Problem, Place and Stage. Returns a status.
    follow : Piece or None
        Takes from a configuration what is held fixed between the moves of Newton's method, by the same arguments.
        Returns whether there is anything.
    """

    names: tuple[str, ...]
    record: Callable[[dict[str, Any]], Record | None]
    add: Piece
    start: Piece | None = None
    follow: Piece | None = None


ELASTIC = ("stretching", "bending", "twisting", "bond")
TERMS: tuple[Term, ...] = (
    Term(ELASTIC, lambda of: of["space"], add_elasticity_in_space, start_elasticity),
    Term(ELASTIC, lambda of: of["plane"], add_elasticity_in_plane, start_elasticity),
    Term(("inertia", "damping", "gravity"), lambda of: None, add_inertial_forces),
    Term(("loads",), lambda of: of["loads"], add_dead_loads, start_dead_loads),
    Term(("barrier",), lambda of: of["surfaces"], add_surface_barrier, start_surface_barrier),
    Term(("friction",), lambda of: of["sliding"], add_surface_friction, start_surface_friction),
    Term(("rod barrier", "rod friction"), lambda of: of["rod_contact"], add_rod_contact, start_rod_contact),
    Term(("followers",), lambda of: of["followers"], add_follower_loads, follow=follow_with_loads),
    Term(("moments",), lambda of: of["moments"], add_body_moments, follow=follow_with_moments),
    Term(("drag",), lambda of: of["flow"], add_drag_of_nodes, follow=follow_with_drag),
    Term(("added mass",), lambda of: of["fluid"], add_mass_of_fluid, follow=follow_with_fluid),
)
"""In the order of the sum; those that follow the configuration come last."""


def require_computed(forces: Iterable[str]) -> None:
    """Refuse forces that a scene needs and nothing computes.

    Raises
    ------
    NotImplementedError
    """
    computed = {name for term in TERMS for name in term.names}
    missing = [name for name in forces if name not in computed]
    if missing:
        raise NotImplementedError(
            f"force {missing[0]!r}: is in the list, bilayer_core/model/force_list.py, and the scene needs it, but no "
            "term of bilayer_core/forces/register.py computes it"
        )


def force_table(model: Model, records: dict[str, Any]) -> ForceTable:
    """The terms that act in a model.

    Parameters
    ----------
    model : Model
    records : dict
        Of its problem, by name.
    """
    chosen = []
    for term in TERMS:
        own = term.record(records)
        if set(term.names) & set(model.forces) and (own is None or own.exists):
            chosen.append((term, own))
    chosen.sort(key=lambda pair: pair[0].follow is not None)

    def column(value: Callable) -> np.ndarray:
        return np.array([value(*pair) for pair in chosen], dtype=np.int64)

    return ForceTable(
        own=column(lambda term, own: own.address if own is not None else 0),
        add=column(lambda term, own: term.add.address),
        start=column(lambda term, own: term.start.address if term.start else 0),
        follow=column(lambda term, own: term.follow.address if term.follow else 0),
        lasting=sum(term.follow is None for term, _ in chosen),
    )

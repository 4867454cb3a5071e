"""The arrays of a problem, and more of them where something grows in number."""

from __future__ import annotations

import numpy as np

from ..forces.register import force_table, require_computed
from ..model.force_places import NAMES
from ..model.model import Model
from ..model.records.outcome import COUNTS, FIGURES
from ..model.records.parts import ContactColumns, RodContact, Sliding, Surfaces
from ..model.records.problem import BorderedSystem, Outcome, Problem
from ..model.records.status import NO_ROOM, NO_ROOM_FOR_RODS, NO_ROOM_IN_BORDER
from .allocate import FirstDerivatives, NearRods, NearSurfaces, SecondDerivatives
from .build import contact_columns_of, lasting_groups, rod_contact_of, sliding_of, slips_of, surfaces_of, wide_of
from .dispatch import calls_of
from .workspace import sums_of

Array = np.ndarray


class Storage:
    """Owns the arrays of a model's problem.

    Attributes
    ----------
    problem : Problem
        Another object after `grow`.
    first : FirstDerivatives
        Of the last evaluation.
    outcome : Outcome
        What pieces leave beside the number that they return.
    energy : Array
        Of forces [J], in the order of `model.force_places`.
    near : NearSurfaces or None
        Pairs of carriers and surfaces near each other; None where nothing can meet a surface.
    rods : NearRods or None
        Likewise of rods.

    Raises
    ------
    ForceError
        If the scene needs a force that nothing computes.
    """

    def __init__(self, model: Model):
        require_computed(model.forces)
        self._model = model
        self.first, self._second = FirstDerivatives(model), SecondDerivatives(model)
        self.near = NearSurfaces(model) if model.meets_surfaces else None
        self.rods = NearRods(model) if model.rod_surfaces is not None else None
        self.energy = np.zeros(len(NAMES))
        self._columns, self._width = model.bodies.freedom.shape[1], np.zeros(1, dtype=np.int64)
        self._groups = lasting_groups(model, self._second)
        self.outcome = Outcome(counts=np.zeros(COUNTS, dtype=np.int64), figures=np.zeros(FIGURES))
        self._problem: Problem | None = None

    @property
    def problem(self) -> Problem:
        """Its records; the pieces that it calls are compiled, or read from the cache, when first asked for."""
        if self._problem is None:
            self._problem = self._make()
        return self._problem

    def _make(self) -> Problem:
        model, near, rods = self._model, self.near, self.rods
        capacity = near.capacity if near else 0
        of_rods = rods.contacts.capacity + rods.sliding.capacity if rods else 0
        border = rods or model.free_count
        records = dict(
            **self._groups,
            bordered=wide_of(model, self._columns, self._width) if border else BorderedSystem.absent(),
            surfaces=surfaces_of(model, near) if near else Surfaces.absent(),
            sliding=sliding_of(model, capacity) if near else Sliding.absent(),
            rod_contact=rod_contact_of(model, rods) if rods else RodContact.absent(),
            slips=slips_of(model, capacity + (rods.sliding.capacity if rods else 0)),
            contact_columns=contact_columns_of(model, of_rods) if rods else ContactColumns.absent(),
            sums=sums_of(self.first, self._second, self.energy, 2 * capacity),
        )
        return Problem(**records, calls=calls_of(model), outcome=self.outcome, forces=force_table(model, records))

    def grow(self, status: int) -> bool:
        """Have the capacity that a kernel lacked; false if that is not what it lacked.

        Contacts of friction, and which forces are selected, stay.
        """
        if status == NO_ROOM:
            self.near.grow()
        elif status == NO_ROOM_FOR_RODS:
            self.rods.grow()
        elif status == NO_ROOM_IN_BORDER:
            self._columns = 2 * int(self._width[0])
        else:
            return False
        before, self._problem = self.problem, self._make()
        self.problem.sums.selected[:] = before.sums.selected
        if before.sliding.exists:
            for name in Sliding.names:
                old, new = getattr(before.sliding, name), getattr(self.problem.sliding, name)
                if isinstance(new, np.ndarray) and new.flags.writeable:
                    new[: len(old)] = old
        return True

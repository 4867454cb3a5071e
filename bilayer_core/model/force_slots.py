"""Places of forces in `Sums.energy` and `Sums.selected`: those of the list (`model.force_list`)."""

from __future__ import annotations

from bilayer_core.model.force_list import kinds

NAMES = tuple(kinds())
"""Of forces, in the order of the sum."""


def slot_of(name: str) -> int:
    """Return the slot of a force. Only the module that computes the force may ask for it."""
    if name not in NAMES:
        raise LookupError(f"force {name!r}: is not in the list, bilayer_core/model/force_list.py: {', '.join(NAMES)}")
    return NAMES.index(name)

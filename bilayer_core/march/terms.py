"""Places of forces in `Sums.energy` and `Sums.selected`: those of the list (`model.force_list`)."""

from __future__ import annotations

from collections.abc import Iterable

from ..model.force_list import kinds

NAMES = tuple(kinds())
"""Of forces, in the order of the sum."""
_computed: set[str] = set()


def place_of(name: str) -> int:
    """Place of a force, for the module that computes it: nothing else may ask."""
    if name not in NAMES:
        raise LookupError(f"force {name!r}: is not in the list, bilayer_core/model/force_list.py: {', '.join(NAMES)}")
    _computed.add(name)
    return NAMES.index(name)


def require_computed(forces: Iterable[str]) -> None:
    """Refuse forces that a scene needs and nothing computes.

    Raises
    ------
    NotImplementedError
    """
    missing = [name for name in forces if name not in _computed]
    if missing:
        raise NotImplementedError(
            f"force {missing[0]!r}: is in the list, bilayer_core/model/force_list.py, and the scene needs it, but no "
            "module of bilayer_core/march computes it"
        )

"""Options of a compilation that are looked up fast.

Numba remembers what an overloaded function is for given types and options, and asks for it at every operation, once for
each overload of an operator. Its own options have one hash for all and compare value by value, 40 at a time.
"""

from __future__ import annotations

from types import MappingProxyType

from numba.core.compiler import Flags


class KernelFlags(Flags):
    """Options of one compilation, which may still change; what is looked up is their copy, which cannot."""

    def copy(self) -> _FixedFlags:
        """Options with the same values: one object for all that are equal."""
        fixed = _FixedFlags(self)
        values = tuple(sorted((name, repr(value)) for name, value in self.values().items()))
        return _fixed.setdefault(values, fixed)


class _FixedFlags(Flags):
    """Options that stay as they are; equal ones are the same object, and none equals those of other classes."""

    def __init__(self, copy_from: Flags):
        super().__init__(copy_from)
        self._values = MappingProxyType(self._values)

    __hash__ = object.__hash__

    def __eq__(self, other: object) -> bool:
        return self is other


_fixed: dict[tuple, _FixedFlags] = {}

"""Groups of arrays that kernels take as one argument: native structures, passed by reference.

(Named tuples of arrays are passed by value, seven words an array: a function of a hundred arrays takes a minute to
compile.)
"""

from __future__ import annotations

import sys
from typing import Any, dataclass_transform

from numba.core import types
from numba.experimental import structref

from ..jit import kernel


class _Structure(types.StructRef):
    """Type of a group; it depends on the types of its fields."""

    def preprocess_fields(self, fields):
        return tuple((name, types.unliteral(type_of_field)) for name, type_of_field in fields)


@dataclass_transform(kw_only_default=True)
def group(declared: type) -> type:
    """Make a class of annotated fields a group: an object of it is made with keywords, and read by kernels.

    Fields are arrays, numbers, tuples of one type, other groups, or None. They are not changed from Python; an array's
    values are.
    """
    names = tuple(declared.__annotations__)
    module = sys.modules[declared.__module__]
    structure = type(f"{declared.__name__}Structure", (_Structure,), {"__module__": declared.__module__})
    setattr(module, structure.__name__, structure)  # compiled kernels on disk refer to it by name
    structref.register(structure)

    def make(cls, **fields: Any):
        if set(fields) != set(names):
            raise TypeError(f"{declared.__name__}: has the fields {', '.join(names)}")
        return construct(*(fields[name] for name in names))

    proxy = type(
        declared.__name__,
        (structref.StructRefProxy,),
        {"__module__": declared.__module__, "__doc__": declared.__doc__, "__slots__": (), "fields": names},
    )
    setattr(module, declared.__name__, proxy)
    structref.define_proxy(proxy, structure, names)

    @kernel
    def construct(*values):
        return proxy(*values)

    proxy.of = classmethod(make)
    return proxy

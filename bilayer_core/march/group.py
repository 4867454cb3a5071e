"""Groups of arrays that kernels take as one argument: structures in memory, passed by address.

(Named tuples of arrays are passed by value, seven words an array: a function of a hundred arrays takes a minute to
compile. Numba's own `structref` counts references at every access, and compiles a function to make each structure:
a third of the time that the loop takes to compile.)

In memory every field begins at a multiple of eight bytes: a number takes one word, an array the words of numba's own
descriptor of it, a tuple those of its items one after another, another group one for its address, None nothing. A group
holds what its fields refer to, so its addresses are good as long as it is.
"""

from __future__ import annotations

import hashlib
from typing import Any, dataclass_transform

import numpy as np
from llvmlite import ir
from numba import typeof
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

WORD = 8


class GroupType(types.Type):
    """Type of a group in kernels: the name of its class, and name and type of every field.

    Its own name, which is part of that of every function that takes it, has the fields as a digest alone.
    """

    def __init__(self, declared: str, fields: tuple[tuple[str, types.Type], ...]):
        self.of_field, self.offset = dict(fields), {}  # types, and places in words
        offset = 0
        for name, type_of_field in fields:
            self.offset[name] = offset
            offset += _word_count(type_of_field)
        listed = ", ".join(f"{name}: {type_of_field}" for name, type_of_field in fields)
        digest = hashlib.blake2b(listed.encode(), digest_size=8).hexdigest()
        super().__init__(f"{declared}({digest})")


class Group:
    """Values by name, and in memory as kernels read them; made with keywords by subclasses from `group`.

    The fields are not changed afterwards; an array's values may be.
    """

    fields: tuple[str, ...] = ()

    def __init__(self, **values: Any):
        if set(values) != set(self.fields):
            raise TypeError(f"{type(self).__name__}: has the fields {', '.join(self.fields)}")
        self.__dict__.update(values)
        self.numba_type = _type_of_fields(type(self), [_type_of(values[name]) for name in self.fields])
        words = [word for name in self.fields for word in _words(values[name], name)]
        self._memory = np.array(words, dtype=np.int64)
        self.address = self._memory.ctypes.data


@dataclass_transform(kw_only_default=True)
def group(declared: type) -> type:
    """Make a class of annotated fields a group: an object of it is made with keywords, and read by kernels.

    Fields are arrays, numbers, tuples of one type, other groups, or None.
    """
    names = tuple(declared.__annotations__)
    body = {"__module__": declared.__module__, "__doc__": declared.__doc__, "fields": names}
    return type(declared.__name__, (Group,), body)


_array_types: dict[tuple, types.Array] = {}
_group_types: dict[tuple, GroupType] = {}


def _type_of(value: Any) -> types.Type:
    """`numba.typeof`, which takes 50 µs for an array, kept for those seen before."""
    if isinstance(value, Group):
        return value.numba_type
    if not isinstance(value, np.ndarray):
        return typeof(value)
    flags = value.flags
    key = value.dtype.num, value.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned
    if key not in _array_types:
        _array_types[key] = typeof(value)
    return _array_types[key]


def _type_of_fields(declared: type[Group], of: list[types.Type]) -> GroupType:
    """Type of a group of a class whose fields have these types."""
    key = declared, *map(id, of)
    if key not in _group_types:
        name = f"{declared.__module__}.{declared.__qualname__}"
        _group_types[key] = GroupType(name, tuple(zip(declared.fields, of, strict=True)))
    return _group_types[key]


def _words(value: Any, name: str) -> list[int]:
    """What stands in memory for a value."""
    if value is None:
        return []
    if isinstance(value, Group):
        return [value.address]
    if isinstance(value, np.ndarray):
        return [0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
    if isinstance(value, tuple):
        return [word for item in value for word in _words(item, name)]
    if isinstance(value, (bool, int)):
        return [int(value)]
    if isinstance(value, float):
        return [int(np.float64(value).view(np.int64))]
    raise TypeError(f"{name}: a {type(value).__name__} cannot stand in a group")


def _word_count(of: types.Type) -> int:
    """How many words a value of a type takes."""
    if isinstance(of, types.NoneType):
        return 0
    if isinstance(of, types.Array):
        return 5 + 2 * of.ndim
    if isinstance(of, types.BaseTuple):
        return sum(map(_word_count, of))
    return 1


@typeof_impl.register(Group)
def _type_of_group(value, context):
    return value.numba_type


@register_model(GroupType)
class _GroupModel(models.PrimitiveModel):
    """In kernels a group is its address."""

    def __init__(self, manager, of):
        super().__init__(manager, of, ir.IntType(8).as_pointer())


@unbox(GroupType)
def _unbox_group(of, value, c):
    number = c.pyapi.object_getattr_string(value, "address")
    address = c.pyapi.long_as_voidptr(number)
    c.pyapi.decref(number)
    return NativeValue(address, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@infer_getattr
class _GroupAttribute(AttributeTemplate):
    key = GroupType

    def generic_resolve(self, of, name):
        return of.of_field.get(name)


@lower_getattr_generic(GroupType)
def _read_field(context, builder, of, address, name):
    type_of_field = of.of_field[name]
    if isinstance(type_of_field, types.NoneType):
        return context.get_dummy_value()
    return _read(context, builder, type_of_field, address, of.offset[name])


def _read(context, builder, of, address, offset):
    """A value that stands `offset` words after `address`."""
    if isinstance(of, types.BaseTuple):
        items = []
        for type_of_item in of:
            items.append(_read(context, builder, type_of_item, address, offset))
            offset += _word_count(type_of_item)
        return context.make_tuple(builder, of, items)
    model = context.data_model_manager[of]
    kind = model.get_data_type()
    place = builder.gep(address, [ir.Constant(ir.IntType(64), WORD * offset)])
    value = builder.load(builder.bitcast(place, kind.as_pointer()), align=WORD)
    value.set_metadata("invariant.load", builder.module.add_metadata([]))  # fields do not change: out of loops with it
    return value if kind == model.get_value_type() else model.from_data(builder, value)

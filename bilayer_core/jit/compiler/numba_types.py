"""Numba's types for what pieces and records declare, and how kernels read and write a record."""

from __future__ import annotations

from functools import cache, cached_property
from typing import Any

from llvmlite import ir
from numba import errors, types
from numba.extending import lower_setattr_generic, models, register_model

from bilayer_core.jit.compiler.undocumented import add_attributes, add_field
from bilayer_core.jit.record import WORD, ArrayOf, Record

NUMBERS = {int: types.int64, float: types.float64, bool: types.boolean}
ITEMS = {"float64": types.float64, "float32": types.float32, "int64": types.int64, "bool": types.boolean}
"""By the names of NumPy."""
BYTES = ir.IntType(8).as_pointer()
_WORD_TYPE = ir.IntType(8 * WORD)


class RecordType(types.Type):
    """Type of a record."""

    def __init__(self, declared: type[Record]):
        self.declared, self.offset = declared, declared.layout().offset
        super().__init__(f"{declared.__module__}.{declared.__qualname__}")

    @property
    def key(self):
        """The class of its records: numba takes types with equal keys for one, and two classes may share a name."""
        return self.declared

    @cached_property
    def fields(self) -> dict[str, types.Type]:
        """Type of each field."""
        return {name: type_of(kind) for name, kind in self.declared.layout().fields.items()}


def type_of(declared: Any) -> types.Type:
    """Return the type of what annotations and pieces declare: a number, an array, or a class of records."""
    if isinstance(declared, ArrayOf):
        return types.Array(ITEMS[declared.dtype.name], declared.ndim, "C")
    return NUMBERS[declared] if declared in NUMBERS else _type_of_record(declared)


@cache
def _type_of_record(declared: type[Record]) -> RecordType:
    for name in ("exists", *declared.names):
        add_field(RecordType, name, _type_of_field, _read_field)
    return RecordType(declared)


@register_model(RecordType)
class _RecordModel(models.OpaqueModel):
    """In kernels a record is its address."""


def _type_of_field(of: RecordType, name: str) -> types.Type | None:
    return types.boolean if name == "exists" else of.fields.get(name)


def _read_field(context, builder, of: RecordType, address, name: str):
    if name == "exists":
        word = builder.load(builder.bitcast(address, _WORD_TYPE.as_pointer()))
        return builder.icmp_signed("!=", word, ir.Constant(_WORD_TYPE, 0))
    model = context.data_model_manager[of.fields[name]]
    kind = model.get_data_type()
    value = builder.load(_place(builder, of, address, name, kind), align=WORD)
    if name not in of.declared.changing:  # out of loops with it
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value if kind == model.get_value_type() else model.from_data(builder, value)


@lower_setattr_generic(RecordType)
def _write_field(context, builder, signature, arguments, name):
    of, kind = signature.args
    if name not in of.declared.changing:
        raise errors.LoweringError(f"{of.name}.{name} does not change: its declaration does not say so")
    builder.store(arguments[1], _place(builder, of, arguments[0], name, context.get_value_type(kind)), align=WORD)


def _place(builder, of: RecordType, address, name: str, kind: ir.Type):
    """Return the pointer to a field."""
    place = builder.gep(address, [ir.Constant(_WORD_TYPE, WORD * of.offset[name])])
    return builder.bitcast(place, kind.as_pointer())


add_attributes(RecordType, _type_of_field, _read_field)

"""Shorter code, before optimisation, for one element of a contiguous array.

Nearly all that kernels do is to read and write elements, and nearly all that LLVM has to read is numba's code for it:
45 instructions for `a[i, j]`, which it then brings down to 5. Here they are 12, with the same meaning: negative indices
count from the end. What is no single element of a C-contiguous array, and whatever has its bounds checked, is left to
numba. Registered through numba's extension interface, it serves all that is compiled in the process.
"""

from __future__ import annotations

import operator

from llvmlite import ir
from numba.core import types
from numba.extending import lower_builtin
from numba.np.arrayobj import getitem_array_tuple, getitem_arraynd_intp, load_item, setitem_array, store_item


@lower_builtin(operator.getitem, types.Array, types.Integer)
@lower_builtin(operator.getitem, types.Array, types.BaseTuple)
def _read(context, builder, signature, arguments):
    array_type, index_type = signature.args
    if not _is_element(context, array_type, index_type):
        whole = getitem_array_tuple if isinstance(index_type, types.BaseTuple) else getitem_arraynd_intp
        return whole(context, builder, signature, arguments)
    place = _place(context, builder, array_type, index_type, *arguments)
    return load_item(context, builder, array_type, place)


@lower_builtin(operator.setitem, types.Array, types.Integer, types.Number)
@lower_builtin(operator.setitem, types.Array, types.Integer, types.Boolean)
@lower_builtin(operator.setitem, types.Array, types.BaseTuple, types.Number)
@lower_builtin(operator.setitem, types.Array, types.BaseTuple, types.Boolean)
def _write(context, builder, signature, arguments):
    array_type, index_type, value_type = signature.args
    if not _is_element(context, array_type, index_type):
        return setitem_array(context, builder, signature, arguments)
    array, index, value = arguments
    place = _place(context, builder, array_type, index_type, array, index)
    value = context.cast(builder, value, value_type, array_type.dtype)
    store_item(context, builder, array_type, value, place)
    return context.get_dummy_value()


def _is_element(context, array_type, index_type) -> bool:
    """Whether an index denotes one number in a contiguous array."""
    indices = index_type.types if isinstance(index_type, types.BaseTuple) else (index_type,)
    return (
        array_type.layout == "C"
        and len(indices) == array_type.ndim
        and all(isinstance(of, types.Integer) for of in indices)
        and isinstance(array_type.dtype, (types.Number, types.Boolean))
        and not context.enable_boundscheck
    )


def _place(context, builder, array_type, index_type, array, index):
    """Address of an element."""
    model = context.data_model_manager[array_type]
    data = builder.extract_value(array, model.get_field_position("data"))
    shape = model.get_field_position("shape")
    if isinstance(index_type, types.BaseTuple):
        parts = [(of, builder.extract_value(index, d)) for d, of in enumerate(index_type.types)]
    else:
        parts = [(index_type, index)]
    offset = None
    for d, (of, value) in enumerate(parts):
        value = context.cast(builder, value, of, types.intp)
        literal = of.literal_value if isinstance(of, types.IntegerLiteral) else None
        if (of.signed and literal is None) or (literal is not None and literal < 0):
            from_end = builder.add(value, builder.extract_value(array, (shape, d)))
            value = builder.select(builder.icmp_signed("<", value, ir.Constant(value.type, 0)), from_end, value)
        if offset is not None:
            value = builder.add(builder.mul(offset, builder.extract_value(array, (shape, d))), value)
        offset = value
    return builder.gep(data, [offset])

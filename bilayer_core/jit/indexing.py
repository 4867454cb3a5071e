"""Shorter code, before optimisation, for one element of a contiguous array.

Nearly all that kernels do is to read and write elements, and nearly all that LLVM has to read is numba's code for it:
45 instructions for `a[i, j]`, which it then brings down to 5. Here they are 10. What is no single element of a
C-contiguous array, and whatever has its bounds checked, is left to numba. Registered through numba's extension
interface, it serves all that is compiled in the process.

Negative indices count from the end; in kernels those that are written as literals alone. To find out for each index
that is read from another array which end is meant took a tenth of the time of a step.
"""

from __future__ import annotations

import copy
import operator

from llvmlite import ir
from llvmlite.ir.instructions import InsertValue
from numba.core import types
from numba.extending import lower_builtin
from numba.np.arrayobj import getitem_array_tuple, getitem_arraynd_intp, load_item, setitem_array, store_item

from .operators import is_element


def counting_from_start(context):
    """A target context in which indices that are no literals are known not to be negative."""
    context = copy.copy(context)
    context.counts_from_start = True
    return context


def counts_from_start(context) -> bool:
    """Whether what is lowered is such code, and not that of a function of numba's own within it."""
    return getattr(context, "counts_from_start", False) and not context.fndesc.modname.startswith("numba.")


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
    return is_element(array_type, index_type) and not context.enable_boundscheck


def _place(context, builder, array_type, index_type, array, index):
    """Address of an element."""
    model = context.data_model_manager[array_type]
    data = builder.extract_value(array, model.get_field_position("data"))
    shape = model.get_field_position("shape")
    if isinstance(index_type, types.BaseTuple):
        parts = [(of, _item(builder, index, d)) for d, of in enumerate(index_type.types)]
    else:
        parts = [(index_type, index)]
    may_count_from_end = not counts_from_start(context)
    offset = None
    for d, (of, value) in enumerate(parts):
        value = context.cast(builder, value, of, types.intp)
        literal = of.literal_value if isinstance(of, types.IntegerLiteral) else None
        from_end = (of.signed and may_count_from_end) if literal is None else literal < 0
        length = builder.extract_value(array, (shape, d)) if from_end or offset is not None else None
        if from_end:
            negative = builder.icmp_signed("<", value, ir.Constant(value.type, 0))
            value = builder.select(negative, builder.add(value, length), value)
        offset = value if offset is None else builder.add(builder.mul(offset, length), value)
    return builder.gep(data, [offset])


def _item(builder, whole, d):
    """An item of a tuple: what was put there, if that was just now."""
    while isinstance(whole, InsertValue):
        if list(whole.indices) == [d]:
            return whole.operands[1]
        whole = whole.operands[0]
    return builder.extract_value(whole, d)

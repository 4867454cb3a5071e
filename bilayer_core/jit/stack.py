"""Small arrays of a known size on the stack of a kernel, in place of `np.empty`, which asks the heap at every call."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


def _on_stack(context, builder, array_type, shape):
    """Return an uninitialised C-contiguous array of floats in the frame of the function; it must not outlive it."""
    size = 1
    for n in shape:
        size *= n
    slot = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), size))
    strides = [8]
    for n in shape[:0:-1]:
        strides.insert(0, strides[0] * n)

    def words(numbers):
        return cgutils.pack_array(builder, [ir.Constant(ir.IntType(64), n) for n in numbers])

    array = context.make_array(array_type)(context, builder)
    context.populate_array(
        array,
        data=builder.bitcast(slot, ir.DoubleType().as_pointer()),
        shape=words(shape),
        strides=words(strides),
        itemsize=ir.Constant(ir.IntType(64), 8),
        meminfo=None,
    )
    return array._getvalue()


@intrinsic(prefer_literal=True)
def stack_vector(typingctx, n):
    """Return an uninitialised array of `n` floats, a literal, or as many as the tuple `n` has entries.

    The array ends with the function that requested it.
    """
    if not isinstance(n, (types.IntegerLiteral, types.UniTuple)):
        return None
    size = n.count if isinstance(n, types.UniTuple) else n.literal_value
    array_type = types.Array(types.float64, 1, "C")

    def make(context, builder, signature, arguments):
        return _on_stack(context, builder, array_type, [size])

    return array_type(n), make


@intrinsic(prefer_literal=True)
def stack_matrix(typingctx, rows, columns):
    """Return an uninitialised array of rows × columns floats, two literals.

    The array ends with the function that requested it.
    """
    if not (isinstance(rows, types.IntegerLiteral) and isinstance(columns, types.IntegerLiteral)):
        return None
    array_type = types.Array(types.float64, 2, "C")

    def make(context, builder, signature, arguments):
        return _on_stack(context, builder, array_type, [rows.literal_value, columns.literal_value])

    return array_type(rows, columns), make

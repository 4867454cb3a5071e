"""Types of the operations that kernels are made of, found at once.

For each operation numba tries all that it could mean, for a product of two numbers two dozen. Here are those of two
floats or two integers and of one element of an array, with the types that numba finds; as they are registered for the
CPU and numba's own for any target, they are tried first. The type of an index keeps which of its parts are constants.
"""

from __future__ import annotations

import operator

from numba.core import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

FLOATS, INTEGERS = (types.float64, types.float64), (types.int64, types.int64)
COMPARISONS = (operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne)
RESULTS = {
    operator.add: {FLOATS: types.float64, INTEGERS: types.int64},
    operator.sub: {FLOATS: types.float64, INTEGERS: types.int64},
    operator.mul: {FLOATS: types.float64, INTEGERS: types.int64},
    operator.truediv: {FLOATS: types.float64},
    operator.iadd: {FLOATS: types.float64, INTEGERS: types.int64},
    operator.isub: {FLOATS: types.float64, INTEGERS: types.int64},
    **{compare: {FLOATS: types.boolean, INTEGERS: types.boolean} for compare in COMPARISONS},
}
TARGET = {"target": "cpu"}


def is_element(array: types.Type, index: types.Type) -> bool:
    """Whether an index denotes one number in a contiguous array."""
    if not (isinstance(array, types.Array) and array.layout == "C"):
        return False
    indices = index.types if isinstance(index, types.BaseTuple) else (index,)
    return (
        len(indices) == array.ndim
        and all(isinstance(of, types.Integer) for of in indices)
        and isinstance(array.dtype, (types.Number, types.Boolean))
    )


def _register_binary(operation, results: dict) -> None:
    signatures = {arguments: signature(result, *arguments) for arguments, result in results.items()}

    @infer_global(operation)
    class Binary(AbstractTemplate):
        metadata = TARGET

        def generic(self, arguments, keywords):
            return signatures.get(tuple(arguments))


for _operation, _results in RESULTS.items():
    _register_binary(_operation, _results)


@infer_global(operator.getitem)
class Read(AbstractTemplate):
    """a[i, j]"""

    metadata = TARGET
    prefer_literal = True

    def generic(self, arguments, keywords):
        array, index = arguments
        return signature(array.dtype, array, index) if is_element(array, index) else None


@infer_global(operator.setitem)
class Write(AbstractTemplate):
    """a[i, j] = x"""

    metadata = TARGET
    prefer_literal = True

    def generic(self, arguments, keywords):
        array, index, value = arguments
        if not (is_element(array, index) and array.mutable and isinstance(value, (types.Number, types.Boolean))):
            return None
        return signature(types.none, array, index, value) if self.context.can_convert(value, array.dtype) else None

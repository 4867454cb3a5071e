"""Calls in kernels: of other kernels, of pieces, and of functions whose code is written here.

A call of a piece goes through its slot, the word that holds its address: where that is 0, the function `FIND` is asked.
"""

from __future__ import annotations

import ctypes
import inspect
from collections.abc import Callable
from functools import cache

from llvmlite import binding, ir
from numba import errors, types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable, typeof_impl
from numba.types import Any as AnyType
from numba.types import VarArg

from bilayer_core.jit.called import FIND, Called, slot_of
from bilayer_core.jit.compiler.numba_types import BYTES, type_of
from bilayer_core.jit.digest import CalledByName
from bilayer_core.jit.kernel import Kernel
from bilayer_core.jit.record import Record

_WORD = ir.IntType(64)


def declare_calls() -> None:
    """Tell numba of every function that kernels can call by name, and that it has not been told of."""
    binding.add_symbol(FIND, CalledByName.finder)
    for called in Called.known:
        _declare(called)


@typeof_impl.register(Kernel)
def _type_of_kernel(kernel, context):
    return types.Dispatcher(kernel.compiled)


@cache
def _declare(called: Called) -> None:
    """Tell numba which types a function takes, and how a call of it is written."""
    takes, write = (
        _declaration_of_piece(called) if isinstance(called, CalledByName) else _WAYS[called.name](*called.about)
    )
    type_callable(called)(lambda context: takes(context))
    lower_builtin(called, VarArg(AnyType))(write)


def _declaration_of_piece(piece: CalledByName) -> tuple[Callable, Callable]:
    """Call the code at the address in its slot, with the declared types."""
    parameters, symbol = inspect.signature(piece.function), slot_of(piece.name)
    declared = signature_of(piece)
    binding.add_symbol(symbol, ctypes.addressof(piece.slot))

    def takes(context):
        def check(*given, **named):
            check_types(context, piece.name, declared.args, parameters.bind(*given, **named).args)
            return declared

        check.__signature__ = parameters
        return check

    def write(context, builder, signature, arguments):
        known = builder.module.globals
        slot = known.get(symbol) or ir.GlobalVariable(builder.module, _WORD, symbol)
        find = known.get(FIND) or ir.Function(builder.module, ir.FunctionType(_WORD, [_WORD]), FIND)
        before, missing, there, after = builder.block, *(builder.append_basic_block() for _ in range(3))
        present = builder.load(slot)
        builder.cbranch(cgutils.is_not_null(builder, present), there, missing).set_weights([99, 1])
        builder.position_at_end(missing)
        found = builder.call(find, [builder.ptrtoint(slot, _WORD)])
        builder.cbranch(cgutils.is_not_null(builder, found), there, after).set_weights([99, 1])
        builder.position_at_end(there)
        target = builder.phi(_WORD)
        target.add_incoming(present, before)
        target.add_incoming(found, missing)
        result = builder.call(builder.inttoptr(target, pointer_to(context, signature)), arguments)
        builder.branch(after)
        builder.position_at_end(after)
        returned = builder.phi(result.type)
        returned.add_incoming(ir.Constant(result.type, None), missing)
        returned.add_incoming(result, there)
        return returned

    return takes, write


def _declaration_of_record_at(declared: type[Record]) -> tuple[Callable, Callable]:
    def takes(context):
        return lambda address: type_of(declared)(types.int64)

    def write(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], BYTES)

    return takes, write


def _declaration_of_call_at(description: str, result: type, *kinds: type) -> tuple[Callable, Callable]:
    called = type_of(result)(*map(type_of, kinds))

    def takes(context):
        def check(address, arguments):
            check_types(context, description, called.args, arguments.types)
            return called.return_type(address, arguments)

        return check

    def write(context, builder, signature, values):
        address, arguments = values
        items = [
            context.cast(builder, item, of, to)
            for item, of, to in zip(
                cgutils.unpack_tuple(builder, arguments, len(called.args)),
                signature.args[1].types,
                called.args,
                strict=True,
            )
        ]
        return builder.call(builder.inttoptr(address, pointer_to(context, called)), items)

    return takes, write


def _declaration_of_flat() -> tuple[Callable, Callable]:
    def takes(context):
        def check(array):
            fits = isinstance(array, types.Array) and array.layout == "C"
            return types.Array(array.dtype, 1, "C")(array) if fits else None

        return check

    def write(context, builder, signature, arguments):
        source = context.make_array(signature.args[0])(context, builder, arguments[0])
        view = context.make_array(signature.return_type)(context, builder)
        context.populate_array(
            view,
            data=source.data,
            shape=cgutils.pack_array(builder, [source.nitems]),
            strides=cgutils.pack_array(builder, [source.itemsize]),
            itemsize=source.itemsize,
            meminfo=None,
        )
        return view._getvalue()

    return takes, write


def _declaration_of_stack_vector() -> tuple[Callable, Callable]:
    def takes(context):
        def check(n):
            return (
                types.Array(types.float64, 1, "C")(n) if isinstance(n, (types.IntegerLiteral, types.UniTuple)) else None
            )

        return check

    def write(context, builder, signature, arguments):
        (n,) = signature.args
        size = n.count if isinstance(n, types.UniTuple) else n.literal_value
        return _on_stack(context, builder, signature.return_type, [size])

    return takes, write


def _declaration_of_stack_matrix() -> tuple[Callable, Callable]:
    def takes(context):
        def check(rows, columns):
            literal = isinstance(rows, types.IntegerLiteral) and isinstance(columns, types.IntegerLiteral)
            return types.Array(types.float64, 2, "C")(rows, columns) if literal else None

        return check

    def write(context, builder, signature, arguments):
        return _on_stack(context, builder, signature.return_type, [of.literal_value for of in signature.args])

    return takes, write


_WAYS: dict[str, Callable[..., tuple[Callable, Callable]]] = {
    "record_at": _declaration_of_record_at,
    "call_at": _declaration_of_call_at,
    "flat": _declaration_of_flat,
    "stack_vector": _declaration_of_stack_vector,
    "stack_matrix": _declaration_of_stack_matrix,
}


def signature_of(piece: CalledByName):
    """Return the types of a piece in kernels."""
    result, *kinds = piece.about
    return type_of(result)(*map(type_of, kinds))


def check_types(typing_context, name: str, wanted: tuple, given: tuple) -> None:
    """Raise the error of compilation of a call with other types than those declared."""
    fits = len(wanted) == len(given)
    if not fits or any(typing_context.can_convert(*kinds) is None for kinds in zip(given, wanted, strict=True)):
        listed = [", ".join(map(str, kinds)) for kinds in (wanted, given)]
        raise errors.TypingError(f"{name}: is called with ({listed[1]}); it takes ({listed[0]})")


def pointer_to(context, signature) -> ir.PointerType:
    """Return LLVM's type of the address of a function."""
    kinds = [context.get_value_type(of) for of in signature.args]
    return ir.FunctionType(context.get_value_type(signature.return_type), kinds).as_pointer()


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

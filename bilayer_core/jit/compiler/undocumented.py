"""Uses of numba beyond its documentation: three shortcuts, each with the time that it saves.

``BILAYER_JIT_PUBLIC=1`` runs without them; the tests do so once.

- The option ``_nrt=False`` (in `jit.kernel`): arrays are not counted. They belong to records, which outlive every
  kernel. With numba's counting a step of the cantilever takes 2.4 times as long, one of the gripper 1.6 times (median
  of runs with and without).
- The options ``no_cpython_wrapper`` and ``no_cfunc_wrapper`` (in `jit.kernel`), which numba sets for its own functions:
  kernels become part of pieces, and need no entries for the interpreter and for C. With them the first start takes
  a quarter more CPU.
- A template for the attributes of records, the base class that `numba.extending.infer_getattr` asks for and does not
  export. The documented way, `overload_attribute`, compiles a function for every field of every record: 29 ms each,
  some 11 s of the first start.
"""

from __future__ import annotations

from collections.abc import Callable

from numba import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, overload_attribute

from bilayer_core.jit.kernel import PUBLIC

_known: set[str] = set()


def add_attributes(of: type[types.Type], type_of: Callable, read: Callable) -> None:
    """Let kernels read the fields of records.

    Parameters
    ----------
    of : type
        Class of numba types.
    type_of : callable
        Numba type of a field, from the type of its record and its name; None if there is no such field.
    read : callable
        Its value, from the context and the builder of the code, the type and the address of its record, and its name.
    """
    if PUBLIC:
        return

    @infer_getattr
    class _Fields(AttributeTemplate):
        key = of

        def generic_resolve(self, record, name):
            return type_of(record, name)

    lower_getattr_generic(of)(read)


def add_field(of: type[types.Type], name: str, type_of: Callable, read: Callable) -> None:
    """Let kernels read the fields of this name, where `add_attributes` does nothing."""
    if not PUBLIC or name in _known:
        return
    _known.add(name)

    @intrinsic
    def load(typing_context, record):
        field = type_of(record, name)
        if field is None:
            return None

        def generate(context, builder, signature, arguments):
            return read(context, builder, record, arguments[0], name)

        return field(record), generate

    @overload_attribute(of, name)
    def _field(record):
        if type_of(record, name) is None:
            return None
        return lambda record: load(record)

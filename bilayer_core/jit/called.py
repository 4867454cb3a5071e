"""Functions that kernels call by name and the compiler writes itself: pieces, and others without Python code."""

from __future__ import annotations

from typing import Any, ClassVar

FIND = "bilayer_find_piece"
"""Symbol of the function that kernels call for the address of a piece whose slot is empty."""


def symbol_of(name: str) -> str:
    """Return the name under which a piece is in its object."""
    return f"bilayer_piece_{name}"


def slot_of(name: str) -> str:
    """Return the symbol of the word that holds the address of a piece."""
    return f"bilayer_slot_of_{name}"


class Called:
    """A function for kernels.

    Attributes
    ----------
    known : list of Called
        All that were declared, in order.
    name : str
        What it is, for the compiler; of a piece, its own.
    about : tuple
        What its code depends on beside its name: types, and text for messages.
    """

    known: ClassVar[list[Called]] = []

    def __init__(self, name: str, *about: Any):
        self.name, self.about = name, about
        self.known.append(self)

    def __call__(self, *arguments: Any) -> Any:
        """Raise an error: the interpreter has no code for it."""
        raise TypeError(f"{self.name} is for kernels only")


def record_at(declared: type) -> Called:
    """Return a function for kernels that gives the record of a class at an address."""
    return Called("record_at", declared)


def caller(description: str, result: type, *arguments: Any) -> Called:
    """Return a function for kernels that calls the code at an address, with a tuple of arguments.

    Parameters
    ----------
    description : str
        Of what is called, for messages.
    result : type
    *arguments
        As `piece` takes them.
    """
    return Called("call_at", description, result, *arguments)


stack_vector = Called("stack_vector")
"""``stack_vector(n)``: an uninitialised array of `n` floats, a literal, or as many as the tuple `n` has entries.

It is in the frame of the kernel, in place of `np.empty`, which asks the heap at every call; it ends with the function
that requested it.
"""
stack_matrix = Called("stack_matrix")
"""``stack_matrix(rows, columns)``: likewise, of rows × columns floats, two literals."""
flat = Called("flat")
"""``flat(array)``: a view of a C-contiguous array with one index; it must not outlive the array.

It does without the checks of `reshape`, which take a tenth of a microsecond each.
"""

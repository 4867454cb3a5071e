"""Records: arrays and numbers under names, which kernels take as one argument and the interpreter as an object.

A record is declared with the type of each field, so every kernel that takes one is compiled once, whatever a scene has:

    @record
    class Drag:
        "Quadratic drag of nodes."

        node: Indices  # nodes that it acts on, shape (n_drag,)
        coefficient: Matrix  # along t, m1, m2 [kg/m], shape (n_drag, 3)
        velocity: Matrix = ("node", 3)  # of the water at nodes [m/s]

A shape after an array's type, of numbers and of names of sizes, makes `Record.zeros` allocate the array.
In memory every field begins at a multiple of eight bytes: a number takes one word, an array the words of numba's own
descriptor of it, a record one for its address. The first word says whether the record `exists`: what a scene lacks is
there with arrays of length zero (`Record.absent`). A record holds what its fields refer to, so its address is good as
long as it is. Fields are not changed afterwards, but for an array's values, and for numbers that declare `CHANGES`:
kernels and the interpreter assign to these, and they begin with 0.

(Arrays passed one by one, or in tuples, are seven words each: a function of a hundred takes a minute to compile.
Numba's `structref` counts references at every access.)
"""

from __future__ import annotations

import math
import typing
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from typing import Any, dataclass_transform

import numpy as np

WORD = 8
CACHE_LINE = 64
"""At whose multiples arrays that share a block of memory begin [bytes]."""


@dataclass(frozen=True)
class ArrayOf:
    """Type of an array that is contiguous, the last index fastest."""

    dtype: np.dtype
    ndim: int


if typing.TYPE_CHECKING:  # what programs that are not compiled get
    Vector = np.ndarray
    Matrix = np.ndarray
    Stack = np.ndarray
    Tensor = np.ndarray
    DeepTensor = np.ndarray
    Indices = np.ndarray
    IndexTable = np.ndarray
    Flags = np.ndarray
    FlagTable = np.ndarray
    Singles = np.ndarray
    SingleTable = np.ndarray
else:
    Vector, Matrix, Stack, Tensor, DeepTensor = (ArrayOf(np.dtype(np.float64), n) for n in range(1, 6))
    """Arrays of floats with one to five indices."""
    Indices, IndexTable = (ArrayOf(np.dtype(np.int64), n) for n in (1, 2))
    """Arrays of integers."""
    Flags, FlagTable = (ArrayOf(np.dtype(np.bool_), n) for n in (1, 2))
    """Arrays of booleans."""
    Singles, SingleTable = (ArrayOf(np.dtype(np.float32), n) for n in (1, 2))
    """Arrays of floats of single precision, as messages have them."""
UNALLOCATED: Mapping[str, int] = defaultdict(int)
"""Sizes of a record whose arrays with a declared shape come later; see `Record.allocated`."""
CHANGES: Any = object()
"""In place of a field's shape: its number changes."""
_ADDRESS_WORD = 4
"""Of the words of an array, which one its address is."""


def _word_count(kind: Any) -> int:
    """Return the number of words that a field takes."""
    return 5 + 2 * kind.ndim if isinstance(kind, ArrayOf) else 1


class Layout:
    """Where fields of a record are in memory.

    Attributes
    ----------
    fields : dict
        Type of each field: int, float, bool, `ArrayOf`, or a class of records.
    offset : dict
        Place of each field [words].
    declared_fields : list of tuple
        Name and type of each field, and the dtype of an array.
    """

    def __init__(self, fields: dict[str, Any]):
        self.fields, self.offset = fields, {}
        offset = 1
        for name, kind in fields.items():
            self.offset[name] = offset
            offset += _word_count(kind)
        self.declared_fields = [
            (name, kind, kind.dtype if isinstance(kind, ArrayOf) else None) for name, kind in fields.items()
        ]


class _Changing:
    """A number that changes, in the memory of its record."""

    def __set_name__(self, owner: type[Record], name: str) -> None:
        self._name = name

    def _place(self, made: Record) -> tuple[np.ndarray, int]:
        """Return the words of a record, as numbers of the declared type, and which of them is the number."""
        kind = made.layout()
        words = made._memory.view(np.float64) if kind.fields[self._name] is float else made._memory
        return words, kind.offset[self._name]

    def __get__(self, made: Record, owner: type[Record]) -> float:
        words, place = self._place(made)
        return made.layout().fields[self._name](words[place])

    def __set__(self, made: Record, value: float) -> None:
        words, place = self._place(made)
        words[place] = value


class Record:
    """Base of the classes that `record` makes.

    Raises
    ------
    TypeError
        If a value is missing, unknown, or not of the declared type.
    """

    names: tuple[str, ...] = ()
    shapes: typing.ClassVar[dict[str, tuple[int | str, ...]]] = {}
    changing: typing.ClassVar[dict[str, int]] = {}

    def __init__(self, **values: Any):
        values = self.changing | values
        self._hold(values)
        words = [1]
        for name, of, dtype in self.layout().declared_fields:
            words += _words(values[name], of, dtype, (type(self).__name__, name))
        self._lie_in(np.array(words, dtype=np.int64))

    def _hold(self, values: dict[str, Any]) -> None:
        """Take the values of all fields as attributes."""
        fields = self.layout().fields
        if values.keys() != fields.keys():
            wrong = ", ".join(sorted(values.keys() ^ fields.keys()))
            raise TypeError(f"{type(self).__name__}: these fields are missing or unknown: {wrong}")
        self.__dict__.update((name, value) for name, value in values.items() if name not in self.changing)

    def _lie_in(self, memory: np.ndarray) -> None:
        self._memory, self.address = memory, _address(memory)

    @property
    def exists(self) -> bool:
        """True if the scene has the part that the record describes."""
        return bool(self._memory[0])

    @classmethod
    def absent(cls) -> typing.Self:
        """Return the absent record, with arrays of length zero and numbers that are zero: one of each class."""
        if "_absent" in cls.__dict__:
            return cls._absent
        values = {}
        for name, of in cls.layout().fields.items():
            if isinstance(of, ArrayOf):
                values[name] = np.zeros((0,) * of.ndim, of.dtype)
            else:
                values[name] = of.absent() if issubclass(of, Record) else 0
        empty = cls(**values)
        empty._memory[0] = 0
        cls._absent = empty
        return empty

    @classmethod
    def zeros(cls, sizes: Mapping[str, int], **values: Any) -> typing.Self:
        """Return a record with the given values; all other fields must declare a shape and become arrays of zeros.

        Parameters
        ----------
        sizes : mapping of str to int
            What the names in shapes stand for.
        **values
        """
        missing = tuple([name for name in cls.shapes if name not in values])
        block = _block(cls, missing, tuple([sizes[name] for name in _sizes_in(cls, missing)]))
        base, arrays = block.arrays()
        made, values = cls.__new__(cls), cls.changing | values
        made._hold(values | arrays)
        memory, kind = block.words.copy(), cls.layout()
        memory[block.addresses] += base
        for name, of, dtype in kind.declared_fields if len(arrays) < len(kind.fields) else ():
            if name not in arrays:
                words = _words(values[name], of, dtype, (cls.__name__, name))
                memory[kind.offset[name] : kind.offset[name] + len(words)] = words
        made._lie_in(memory)
        return made

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={shown(getattr(self, name))}' for name in self.names)})"

    def allocated(self, sizes: Mapping[str, int], **values: Any) -> typing.Self:
        """Return the record with arrays of its own where its class declares a shape, or itself if it is absent.

        Parameters
        ----------
        sizes : mapping of str to int
            What the names in shapes stand for.
        **values
            In place of those of this record.
        """
        lasting = {name: getattr(self, name) for name in self.names if name not in self.shapes}
        return self.zeros(sizes, **lasting | values) if self.exists else self

    @classmethod
    def layout(cls) -> Layout:
        """Return where its fields are in memory."""
        if "_layout" not in cls.__dict__:
            hints = typing.get_type_hints(cls)
            cls._layout = Layout({name: hints[name] for name in cls.names})
        return cls._layout


@dataclass_transform(kw_only_default=True)
def record(declared: type) -> type:
    """Make a class of annotated fields a record, made with keywords.

    Fields are arrays of the types above, numbers, or other records.
    """
    names = tuple(declared.__annotations__)
    body = {"__module__": declared.__module__, "__doc__": declared.__doc__, "__annotations__": declared.__annotations__}
    shapes = {name: vars(declared)[name] for name in names if name in vars(declared)}
    changing = {name: 0 for name in names if shapes.get(name) is CHANGES}
    body |= {name: _Changing() for name in changing}
    shapes = {name: shape for name, shape in shapes.items() if name not in changing}
    return type(declared.__name__, (Record,), body | {"names": names, "shapes": shapes, "changing": changing})


class Numbers:
    """Reads and resets the numbers of a record that change, all at once: each by itself takes 2 µs.

    Parameters
    ----------
    made : Record
        With the values that `reset` gives back to it.
    """

    def __init__(self, made: Record):
        layout = made.layout()
        self._made, self._memory = made, made._memory
        self._floats = self._memory.view(np.float64)
        self._start = self._memory.copy()
        self._places = [(name, layout.fields[name] is float, layout.offset[name]) for name in made.changing]

    def read(self) -> dict[str, Any]:
        """Return the numbers by their names."""
        whole, real = self._memory.tolist(), self._floats.tolist()
        return {name: real[place] if is_real else whole[place] for name, is_real, place in self._places}

    def reset(self) -> None:
        """Give all numbers the values that they had at first."""
        self._memory[:] = self._start


def shapes_of(declared: type[Record], sizes: Mapping[str, int], names: Iterable[str]) -> dict[str, tuple[int, ...]]:
    """Return the declared shapes of some fields, in numbers."""
    return {
        name: tuple(sizes[part] if isinstance(part, str) else part for part in declared.shapes[name]) for name in names
    }


def zeros_in_one(shapes: Mapping[str, tuple[int, ...]]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return a flat array of zeros, and consecutive views of it with the given shapes: one loop clears them all."""
    ends = list(accumulate(map(math.prod, shapes.values()), initial=0))
    flat = np.zeros(ends[-1])
    parts = zip(shapes.items(), ends[:-1], ends[1:], strict=True)
    return flat, {name: flat[begin:end].reshape(shape) for (name, shape), begin, end in parts}


class _Block:
    """Where arrays of a record lie in one block of memory: to ask for it once takes less than for each of them.

    Attributes
    ----------
    words : ndarray
        Of the whole record, with places in the block for addresses, and 0 for other fields.
    addresses : ndarray
        Which words are such places.
    """

    def __init__(self, declared: type[Record], shapes: Mapping[str, tuple[int, ...]]):
        kind, self._size, addresses = declared.layout(), 0, []
        self._places: list[tuple[str, tuple[int, ...], np.dtype, int]] = []
        self.words = np.zeros(1 + sum(map(_word_count, kind.fields.values())), dtype=np.int64)
        self.words[0] = 1
        for name, shape in shapes.items():
            dtype, first = kind.fields[name].dtype, kind.offset[name]
            like = np.ndarray(shape, dtype, np.zeros(math.prod(shape) * dtype.itemsize, np.uint8))
            own = [0, 0, like.size, dtype.itemsize, self._size, *shape, *like.strides]
            self.words[first : first + len(own)] = own
            addresses.append(first + _ADDRESS_WORD)
            self._places.append((name, shape, dtype, self._size))
            self._size += -(-like.nbytes // CACHE_LINE) * CACHE_LINE
        self.addresses = np.array(addresses, dtype=np.int64)

    def arrays(self) -> tuple[int, dict[str, np.ndarray]]:
        """Return the address of a block of zeros, and the arrays in it."""
        block = np.zeros(self._size, np.uint8)
        return _address(block), {
            name: np.ndarray(shape, dtype, block, first) for name, shape, dtype, first in self._places
        }


@lru_cache(maxsize=1024)  # some thirty classes of records in a model of given sizes
def _block(declared: type[Record], names: tuple[str, ...], sizes: tuple[int, ...]) -> _Block:
    """Return the block of fields that declare a shape, with the sizes that `_sizes_in` names."""
    return _Block(declared, shapes_of(declared, dict(zip(_sizes_in(declared, names), sizes, strict=True)), names))


@lru_cache(maxsize=1024)
def _sizes_in(declared: type[Record], names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of sizes in the shapes of some fields."""
    parts = (part for name in names for part in declared.shapes[name])
    return tuple(dict.fromkeys(part for part in parts if isinstance(part, str)))


def name_of(kind: Any) -> str:
    """Return the name of a type of fields and of pieces: of a class of records its own, whatever its fields are."""
    if isinstance(kind, ArrayOf):
        return f"{kind.dtype} {kind.ndim}"
    return f"{kind.__module__}.{kind.__qualname__}"


def shown(value: object) -> str:
    """Return an array as its type and shape; of several parts, how many there are."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape}"
    parts = isinstance(value, tuple) and value and not isinstance(value[0], (str, int, float))
    return f"({len(value)} x {type(value[0]).__name__})" if parts else repr(value)


def _address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]  # half the time of `ctypes.data`


def _words(value: Any, of: Any, dtype: np.dtype | None, name: tuple[str, str]) -> list[int]:
    """Return the words in memory for a value, which must be an array of type `dtype` unless that is None."""
    if dtype is not None:
        if isinstance(value, np.ndarray) and value.ndim == of.ndim and value.dtype == dtype:
            memory = value.__array_interface__
            address = memory["data"][0]
            if memory["strides"] is None and address % dtype.alignment == 0:  # no strides: contiguous
                return [0, 0, value.size, dtype.itemsize, address, *value.shape, *value.strides]
        found = f"{value.dtype}, shape {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
        raise TypeError(f"{'.'.join(name)}: {found} is not a contiguous array of {of.ndim} indices, {of.dtype}")
    if issubclass(of, Record):
        if not isinstance(value, of):
            raise TypeError(f"{'.'.join(name)}: a {type(value).__name__} is no {of.__name__}")
        return [value.address]
    return [int(np.float64(value).view(np.int64)) if of is float else int(value)]

"""Parts of a flat array by name."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.state import PARTS, State

Array = np.ndarray
Places = dict[str, tuple[int, int, tuple[int, ...]]]
"""Of each part by name where it begins and ends, and its shape."""


class Parts:
    """Parts of a flat array, as views of it, each made when it is asked for."""

    def __init__(self, flat: Array, places: Places):
        self._flat, self._places = flat, places

    def __getattr__(self, name: str) -> Array:
        try:
            begin, end, shape = self.__dict__["_places"][name]
        except KeyError:
            raise AttributeError(name) from None
        part = self.__dict__[name] = self._flat[begin:end].reshape(shape)
        return part


def places_in(state: State) -> Places:
    """Return the places of the parts of a state in its values."""
    ends = np.cumsum([0, *(getattr(state, name).size for name in PARTS)]).tolist()
    shapes = [getattr(state, name).shape for name in PARTS]
    return dict(zip(PARTS, zip(ends[:-1], ends[1:], shapes, strict=True), strict=True))

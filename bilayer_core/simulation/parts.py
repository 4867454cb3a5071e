"""Parts of a flat array by name."""

from __future__ import annotations

import numpy as np

Array = np.ndarray
Places = dict[str, tuple[int, int, tuple[int, ...]]]
"""Of each part by name where it begins and ends, and its shape."""


class Parts:
    """Parts of a flat array, as views of it, each made when it is asked for.

    Attributes
    ----------
    flat : ndarray
    places : Places
    """

    def __init__(self, flat: Array, places: Places):
        self.flat, self.places = flat, places

    def __getattr__(self, name: str) -> Array:
        try:
            begin, end, shape = self.__dict__["places"][name]
        except KeyError:
            raise AttributeError(name) from None
        part = self.__dict__[name] = self.flat[begin:end].reshape(shape)
        return part

"""Objects that views look at, and a mapping that finds views by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TypeVar

from bilayer_core.errors import UnknownName
from bilayer_core.model.model import Model
from bilayer_core.model.state import State
from bilayer_core.simulation.parts import Parts
from bilayer_core.simulation.stepper import Stepper

View = TypeVar("View")
MOST_TOLD = 12
"""Names that a mapping tells of itself."""


@dataclass(frozen=True)
class Present:
    """Objects that views look at: a model, its state, the evaluator of the forces there, and the observables."""

    model: Model
    state: State
    evaluated: Callable[[], Stepper]
    seen: Callable[[], Parts]


class ByName(Mapping[str, View]):
    """Views by name, in the order of the scene; nobody can change which there are.

    Parameters
    ----------
    kind : str
        What they are called: ``"rods"``.
    views : mapping
    """

    def __init__(self, kind: str, views: Mapping[str, View]):
        self._kind, self._views = kind, dict(views)

    def __getitem__(self, name: str) -> View:
        """Return the view of a name.

        Parameters
        ----------
        name : str

        Returns
        -------
        view

        Raises
        ------
        UnknownName
            If there is none; the message has the nearest names. It is a KeyError too.
        """
        if name in self._views:
            return self._views[name]
        near = get_close_matches(str(name), self._views, n=3, cutoff=0.5)
        known = f"did you mean {' or '.join(near)}?" if near else f"there are: {self._told() or 'none'}"
        raise UnknownName(f"{self._kind}[{name!r}]: there is none of this name; {known}")

    def __iter__(self) -> Iterator[str]:
        return iter(self._views)

    def __len__(self) -> int:
        return len(self._views)

    def __repr__(self) -> str:
        return f"{len(self)} {self._kind}: {self._told()}" if self._views else f"no {self._kind}"

    def _told(self) -> str:
        names = list(self._views)
        more = f", … ({len(names) - MOST_TOLD} more)" if len(names) > MOST_TOLD else ""
        return ", ".join(names[:MOST_TOLD]) + more

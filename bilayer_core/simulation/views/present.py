"""The present state as views see it, and a mapping that finds views by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from functools import cached_property
from typing import TypeVar

import numpy as np

from bilayer_core.errors import UnknownName
from bilayer_core.log.run.frame_values import FrameValues
from bilayer_core.log.run.quantities import Entry, entries
from bilayer_core.model.model import Model
from bilayer_core.model.state import State
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.simulation.parts import Parts
from bilayer_core.simulation.stepper import Stepper

View = TypeVar("View")
MOST_TOLD = 12
"""Names that a mapping tells of itself."""


class Present:
    """The present state of a run, and what only an evaluation of it tells.

    Parameters
    ----------
    stepper : Stepper
    started : callable
        Returns the state, once it is what the scene starts with.
    ready : callable
        Has kernels and the forces of the first state ready.
    description : callable
        Returns the description of the run.
    frame : callable
        Returns a snapshot.
    """

    def __init__(
        self,
        stepper: Stepper,
        started: Callable[[], State],
        ready: Callable[[], object],
        description: Callable[[], Description],
        frame: Callable[[], Frame],
    ) -> None:
        self._stepper, self._started, self._ready = stepper, started, ready
        self._description, self._frame = description, frame

    @property
    def state(self) -> State:
        """The state."""
        return self._started()

    @property
    def model(self) -> Model:
        """The model, with the scene that it has now."""
        return self._stepper.model

    def evaluated(self) -> Stepper:
        """Return the stepper, with forces of the present state."""
        self._ready()
        self._stepper.engine.evaluate_end()
        return self._stepper

    def quantity(self, name: str) -> np.ndarray:
        """Return a quantity of a rod, by its name in logs (`log.run.quantities`)."""
        known, values = self._of_rods
        return values.of(known[name], self._frame())

    @cached_property
    def _of_rods(self) -> tuple[dict[str, Entry], FrameValues]:
        description = self._description()
        return {entry.name: entry for entry in entries(description, (), ())}, FrameValues(description)

    def forget_model(self) -> None:
        """Forget how rods are described, as they are others."""
        vars(self).pop("_of_rods", None)

    def seen(self) -> Parts:
        """Return all observables of the present state."""
        self._ready()
        return self._stepper.observe(self.state)[0]


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

"""Where values of profiles along rods act: those that act far from each other can be changed in one model.

A value acts between the points beside its own, and on the gradient at the nodes that are stretched and bent there. So
what changes tells by its place which value changed it (Curtis, Powell and Reid). Whatever changes at no place of a
group shows that its values act elsewhere, too, as those of a path do: then each needs a model of its own.

A. R. Curtis, M. J. D. Powell and J. K. Reid, On the estimation of sparse Jacobian matrices, IMA Journal of Applied
Mathematics 13 (1974), 117-119.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bilayer_core.model.laminate import axis_parts, hold_axis
from bilayer_core.model.lit_elements import light_of
from bilayer_core.model.model import Model
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import scene_content
from bilayer_core.scene.overrides import read_overrides
from bilayer_core.simulation.gradients.parameters import SMALL, Parameter

Array = np.ndarray
VALUE = re.compile(r"(rods\.([^.]+)\..+)\.value\.(\d+)")
"""Paths of values of profiles along rods."""
REACH = 1
"""Stations beyond the points beside a value, as far as it acts: joints bend with the nodes beside them."""
GAP = 2
"""Least distance of the stations where two values of a group act: nothing may change between them."""
LOCAL = 1e-9
"""Change where no value acts, of the largest change, that is rounding."""


@dataclass(frozen=True)
class Place:
    """Where a value acts.

    Attributes
    ----------
    rod : int
        Of the scene.
    first, last : int
        Stations; they may lie beyond the ends of the rod.
    at_end : bool
        Whether these reach an end of the rod, where a free body or, of a closed rod, the other end may feel the value.
    """

    rod: int
    first: int
    last: int
    at_end: bool

    def is_apart(self, other: Place) -> bool:
        """Return whether two values can be told apart."""
        far = self.first >= other.last + GAP or other.first >= self.last + GAP
        return self.rod == other.rod and far and not (self.at_end and other.at_end)

    def nodes(self, model: Model) -> Array:
        """Return which nodes of a model these are, shape (n_node,)."""
        found = np.zeros(model.node_count, dtype=bool)
        for strand in model.strands:
            if strand.rod in model.scene.rods[self.rod].copy_names:
                first = strand.first_node - strand.first_station
                end = strand.first_node + strand.node_count
                found[max(first + self.first, strand.first_node) : min(max(first + self.last + 1, 0), end)] = True
        return found


def groups_of(scene: SceneConfig, model: Model, parameters: Sequence[Parameter]) -> list[dict[int, Place | None]]:
    """Return groups of parameters that can be changed in one model: their numbers, and where each acts, or None for
    what is in no profile and has a group of its own.
    """
    if "rod barrier" in model.forces or light_of(model).exists:  # thick rods touch others, and cast shadows on them
        return [{k: None} for k in range(len(parameters))]
    places = _places(scene, model, parameters)
    groups: list[dict[int, Place | None]] = [{k: None} for k, place in enumerate(places) if place is None]
    shared: list[dict[int, Place]] = []
    for k, place in sorted(
        ((k, place) for k, place in enumerate(places) if place is not None), key=lambda each: each[1].first
    ):
        group = next((of for of in shared if all(place.is_apart(other) for other in of.values())), None)
        if group is None:
            shared.append(group := {})
        group[k] = place
    return [*groups, *shared]


def _places(scene: SceneConfig, model: Model, parameters: Sequence[Parameter]) -> list[Place | None]:
    """Return where each parameter acts."""
    content, found, points = scene_content(scene), list[Place | None](), dict[str, Array]()
    names = {key: k for k, rod in enumerate(scene.rods) for key in (str(k), rod.name)}
    for parameter in parameters:
        told = VALUE.fullmatch(parameter.name)
        if told is None or told[2] not in names:
            found.append(None)
            continue
        path, rod, k = told[1], scene.rods[names[told[2]]], int(told[3])
        if path not in points:
            holder, place = read_overrides({f"{path}.at": 0.0})[0].find(content)
            points[path] = np.array(holder[place]) / rod.edge_length
        at = points[path]
        begin = at[k - 1] if k > 0 else 0.0
        end = at[k + 1] if k + 1 < len(at) else rod.stations
        first, last = math.floor(begin) - REACH, math.ceil(end) + REACH
        felt = rod.closed or model.free_count > 0
        found.append(Place(names[told[2]], first, last, felt and (first <= 0 or last >= rod.stations - 1)))
    return found


class ByPlace:
    """Changes by each of several values, from one model in which all of them are changed.

    The curve of a laminate lies at a mean over the whole rod: it is held in place, and what moving it changes is added.

    Parameters
    ----------
    model : Model
    scene : SceneConfig
        Of it, with the present gains.
    changes_in : callable
        Returns how a gradient by unknowns, one by free bodies and the positions of nodes differ in another scene,
        shapes (size,), (n_free, 6) and (n_node, 3).
    """

    def __init__(self, model: Model, scene: SceneConfig, changes_in: Callable[[SceneConfig], list[Array]]):
        self._model, self._scene, self._changes_in = model, scene, changes_in
        self._by_axis: dict[int, list[Array]] = {}

    def told(self, scene: SceneConfig, places: Sequence[Place]) -> list[list[Array]] | None:
        """Return what each value changes, None if that cannot be told.

        Parameters
        ----------
        scene : SceneConfig
            In which all are changed; nothing is built of it yet.
        places : sequence of Place
            Where they act, of one rod.
        """
        rod, own = places[0].rod, self._heights(self._scene, places[0].rod)
        changed = self._heights(scene, rod) - own
        height = own[0].sum() / own[1].sum()
        hold_axis(scene, scene.rods[rod], height)
        changes = [*self._changes_in(scene), *changed]
        masks = [[*self._masks(place), *[_edges(place, len(own[0]))] * 2] for place in places]
        for change, of_change in zip(changes, zip(*masks, strict=True), strict=True):
            elsewhere = change[~np.logical_or.reduce(of_change)]
            if np.abs(elsewhere).max(initial=0.0) > LOCAL * np.abs(change).max(initial=0.0):
                return None
        found = []
        for mask in masks:
            *parts, moment, weight = [np.where(here, change, 0.0) for here, change in zip(mask, changes, strict=True)]
            raised = (own[0] + moment).sum() / (own[1] + weight).sum() - height
            if raised:
                parts = [part + raised * by for part, by in zip(parts, self._by_axis_of(rod, height), strict=True)]
            found.append(parts)
        return found

    def _heights(self, scene: SceneConfig, rod: int) -> Array:
        """Return the moments and weights of edges from which the height of a rod's curve follows, shape (2, n_edge)."""
        first = scene.rods[rod].copies[0].rod
        return np.ones((2, first.stations)) if self._model.bonds.exists else np.array(axis_parts(scene, first))

    def _by_axis_of(self, rod: int, height: float) -> list[Array]:
        """Return the derivatives by the height of the curve of a rod [1/m]."""
        if rod not in self._by_axis:
            names = self._model.scene.rods[rod].copy_names
            h = SMALL * max(strand.thickness.max() for strand in self._model.strands if strand.rod in names)
            scene = self._scene.model_copy()
            hold_axis(scene, scene.rods[rod], height + h)
            self._by_axis[rod] = [change / h for change in self._changes_in(scene)]
        return self._by_axis[rod]

    def _masks(self, place: Place) -> list[Array]:
        """Return which unknowns, free bodies and positions a value may change by itself."""
        model = self._model
        nodes, layout, rods = place.nodes(model), model.layout, model.rods
        unknowns = np.zeros(layout.size, dtype=bool)
        unknowns[(layout.node[nodes][:, None] + np.arange(layout.dimension)).ravel()] = True
        unknowns[layout.edge[(nodes[rods.edge_node] & nodes[rods.edge_node + 1])[: len(layout.edge)]]] = True
        bodies = np.full((model.free_count, 6), place.at_end)
        return [unknowns, bodies, np.repeat(nodes[:, None], 3, axis=1)]


def _edges(place: Place, count: int) -> Array:
    edges = np.arange(count)
    return (edges >= place.first) & (edges < place.last)

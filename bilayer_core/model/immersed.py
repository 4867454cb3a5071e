"""Drag and added mass of rods: those of the whole section, shared by its strands."""

from __future__ import annotations

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.model.raised_edges import halves_at
from bilayer_core.model.records.parts import Flow, Fluid, Raised
from bilayer_core.model.section import outline
from bilayer_core.model.strands import Collected, Span, stations_of
from bilayer_core.model.unknown_order import columns
from bilayer_core.scene import config
from bilayer_core.scene.rod import Rod

Array = np.ndarray


def missing_wake(fluid: config.Fluid | None) -> tuple[str, ...]:
    """Return what added mass in a flow leaves out, as a line; none where nothing flows about added mass."""
    if fluid is None or fluid.added_mass is None or not any(fluid.velocity):
        return ()
    return (
        "the wake that leaves the tail of a rod: along a flow about added mass a tail diverges, where one with a wake "
        "flutters at a higher speed",
    )


def add_fluid(found: Collected, fluid: config.Fluid | None, rod: Rod, copies: list[list[Span]]) -> None:
    """Add what a fluid does to copies of a rod, each with one strand for each layer, or one for all."""
    if fluid is None:
        return
    _add_drag(found, fluid, rod, copies)
    if fluid.added_mass is not None:
        _add_added_mass(found, fluid, rod, copies)


def build_fluid(
    fluid: config.Fluid | None, found: Collected, edge_node: Array, raised: Raised, number: Array
) -> tuple[Flow, Fluid]:
    """Return the records of drag and of added mass, absent without them.

    Parameters
    ----------
    fluid : scene.config.Fluid or None
    found : Collected
    edge_node : ndarray
        As in `Strands`.
    raised : Raised
    number : ndarray
        Of each edge in `raised`, −1 of the others.
    """
    if fluid is None:
        return Flow.absent(), Fluid.absent()
    velocity = np.array(fluid.velocity)
    flow = Flow.zeros(UNALLOCATED, velocity=velocity, **_places_of_drag(found, raised, number))
    mass, joined = found.column("fluid_mass", width=3), found.column("joined_node", np.int64, 2)
    if not len(mass):
        return flow, Fluid.absent()
    return flow, Fluid.zeros(
        UNALLOCATED,
        velocity=velocity,
        edge_node=edge_node,
        mass=mass,
        raised=number,
        middle=raised.middle,
        slot=raised.slot,
        joined=joined,
    )


def _places_of_drag(found: Collected, raised: Raised, number: Array) -> dict[str, Array]:
    """Return the arrays of `Flow`: where the middle of a section is off the curve, the two halves of edges at a node
    each carry their part of its drag, with the node's directions.
    """
    node, edges = found.column("drag_node", np.int64), found.column("drag_edge", np.int64, 2)
    coefficient = found.column("drag_coefficient", width=3)
    height = np.append(raised.middle, 0.0)[number[edges]]  # −1 is the last
    split = np.flatnonzero(height.any(axis=1))
    whole = np.delete(np.arange(len(node)), split)
    of_edges, halves, parts = halves_at(found, node[split])
    share, side = columns(np.argwhere(parts > 0.0))
    index = np.concatenate([whole, split[share]])
    half_edge, none = number[of_edges[share, side]], np.full(len(whole), -1)
    before, after = columns(edges[index])
    part = np.concatenate([np.ones(len(whole)), parts[share, side]])
    return {
        "node": node[index],
        "raised": np.concatenate([none, half_edge]),
        "half": np.concatenate([0 * none, halves[share, side]]),
        "edge_before": before,
        "edge_after": after,
        "coefficient": part[:, None] * coefficient[index],
    }


def _shares(spans: list[Span], layers: Array) -> tuple[Array, Array]:
    """Return the thickness of the section [m], shape (n_place,), and the part of each strand, that of its layer in it,
    shape (n_strand, n_place).
    """
    thickness = layers.sum(axis=0)
    return thickness, layers / thickness if len(spans) == len(layers) else np.ones((1, len(thickness)))


def _add_drag(found: Collected, fluid: config.Fluid, rod: Rod, copies: list[list[Span]]) -> None:
    """Add the drag of the whole section at each station, shared by its layers in proportion to their thickness: it acts
    at the middle.
    """
    length = np.full(stations_of(rod)[1] + 1, rod.edge_length)
    length[[0, -1]] *= 0.0 if rod.closed else 0.5
    width, layers = outline(rod, np.arange(len(length)))
    thickness, shares = _shares(copies[0], layers)
    whole = np.stack([fluid.drag_along * width, fluid.drag_across * width, fluid.drag_across * thickness], axis=1)
    parts = []  # of each strand of a copy, those of one like those of another
    for (first, last, _, _), own in zip(copies[0], shares, strict=True):
        station = np.arange(last - first + 1)
        covered = slice(first, last + 1)
        share = fluid.density * length[covered] * own[covered]
        edges = np.stack([np.maximum(station - 1, 0), np.minimum(station, last - first - 1)], axis=1)
        parts.append((station, edges, share[:, None] * whole[covered]))
    for spans in copies:
        for (_, _, first_node, first_edge), (station, edges, coefficient) in zip(spans, parts, strict=True):
            found.add(drag_node=first_node + station, drag_edge=first_edge + edges, drag_coefficient=coefficient)


def _add_added_mass(found: Collected, fluid: config.Fluid, rod: Rod, copies: list[list[Span]]) -> None:
    """Add the added mass of the whole section along each edge, shared by its layers in proportion to thickness."""
    edges = stations_of(rod)[1]
    width, layers = outline(rod, np.arange(edges) + 0.5)
    thickness, shares = _shares(copies[0], layers)
    per_area, law = 0.25 * np.pi * fluid.density * rod.edge_length, fluid.added_mass
    through, sideways = law.through * width**2, law.sideways * thickness**2
    turning = law.turning * (width**2 - thickness**2) ** 2 / 32.0
    whole = per_area * np.stack([through, sideways, turning], axis=1)
    if rod.closed:
        whole[-1] = 0.0
    of_copy = [(own[:, None] * whole)[span[0] : span[1]] for span, own in zip(copies[0], shares, strict=True)]
    found.add(fluid_mass=np.concatenate(of_copy * len(copies)))

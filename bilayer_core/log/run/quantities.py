"""A run as named arrays over time, with units: to look up, to hand to pandas or xarray, to compare.

================================== ============================== =====================================================
name                               axes after time                is
================================== ============================== =====================================================
``stimulus/<channel>``                                            what acted, in the unit of the channel
``energy/<term>``                                                 energy of a term [J]
``solver/<figure>``                                               iterations, residual, substeps, min_gap, cpu_time
``com``                            axis                           mass centre of the robot [m]
``body/<body>/position``           axis                           [m]
``body/<body>/quaternion``         part                           x y z w
``body/<body>/contact_wrench``     part                           force [N] and moment [N m] of contact
``body/<body>/clamp_wrench``       part                           of the rods that it holds
``body/<body>/angle``, ``travel``                                 of a guided body that something resists [rad, m]
``joint/<joint>/wrench``           part                           on its first body, about the joint [N, N m]
``joint/<joint>/angle``                                           about its axis, with ``turning`` in the scene [rad]
``joint/<joint>/travel``                                          along its axis, with ``sliding`` [m]
``contact/<one>/<other>/force``                                   sum of the normal forces between two [N]
``rod/<rod>/position``             node, axis                     the rod's middle line: midway between its faces [m]
``rod/<rod>/contact_force``        node, axis                     [N]
``rod/<rod>/frame``                node, part                     quaternion x y z w of the axes m1 m2 m3
``rod/<rod>/strain``               node                           axial, in the middle line
``rod/<rod>/curvature``            node                           through the thickness [1/m]
``rod/<rod>/section_curvature``    node                           of a strip across its width, in the mean [1/m]
``rod/<rod>/<layer>/position``     node, axis                     the middle of a layer [m]
``rod/<rod>/<layer>/strain``       node                           axial, there
================================== ============================== =====================================================

Quantities of rods have a row for each station in both models. The model ``two_rod`` also has ``contact_force``,
``frame`` and ``curvature`` of each layer, and its rods have the weighted mean of their layers, or the sum of forces.
What stands under ``rod/`` comes at the rate of markers, all else at that of frames.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Protocol

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.messages.node_frames import node_order
from bilayer_core.log.messages.topics import CONTACT_PAIRS, JOINTS, SECTION_POINTS
from bilayer_core.log.run.middle_line import LayerMiddle, RodMiddle
from bilayer_core.observed.frame import WRENCH, Description, Strand

Array = np.ndarray
AXES, QUATERNION = ("x", "y", "z"), ("x", "y", "z", "w")
JOINT_UNITS = {"angle": "rad", "travel": "m"}
SOLVER_UNITS = {"residual": "m/s", "min_gap": "m", "cpu_time": "s"}


class Run(Protocol):
    """Whose quantities are told: a `RunData`, which has the attributes that entries name."""

    @property
    def description(self) -> Description: ...

    @property
    def times(self) -> Array: ...

    @property
    def shape_times(self) -> Array: ...

    @property
    def energy(self) -> dict[str, Array]: ...

    @property
    def solver(self) -> dict[str, Array]: ...


@dataclass(frozen=True)
class Quantity:
    """One quantity over time.

    Attributes
    ----------
    name, unit : str
        The unit is empty for what has none.
    times : ndarray
        [s], shape (n,).
    values : ndarray
        Shape (n, ...), read-only.
    axes : tuple of str
        Names of the axes after that of time: ``node``, ``axis`` or ``part``.
    labels : tuple of str
        Of the last axis, unless that is of nodes.
    """

    name: str
    unit: str
    times: Array
    values: Array
    axes: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()

    def __repr__(self) -> str:
        unit = f" [{self.unit}]" if self.unit else ""
        span = f", t = {self.times[0]:g} to {self.times[-1]:g} s" if self.times.size else ""
        return f"Quantity({self.name}{unit}, shape {self.values.shape}{span})"


@dataclass(frozen=True)
class Entry:
    """Description of a quantity and of where its values are: in a `RunData`, and in the messages of a log.

    Attributes
    ----------
    name, unit, axes, labels
        As of `Quantity`.
    attribute : str
        Of `RunData`.
    index : str or tuple
        Into that: the key of a dictionary, or the index into each row of an array.
    topic : str
        That holds it in a log, by its name in `log.messages.topics`.
    columns : tuple
        Index into the array of one message.
    derive : callable or None
        Makes the values from those that the index or the columns pick, whatever axes come before theirs.
    """

    name: str
    unit: str
    attribute: str
    index: str | tuple[Any, ...]
    topic: str
    columns: tuple[Any, ...]
    axes: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    derive: Callable[[Array], Array] | None = None

    @property
    def of_shape(self) -> bool:
        """True if the quantity comes at the rate of markers, for each node of a rod."""
        return "node" in self.axes

    def of(self, run: Run) -> Quantity:
        """Return the quantity with its values in a run.

        Parameters
        ----------
        run : Run

        Returns
        -------
        Quantity
        """
        held = getattr(run, self.attribute)
        values = held[self.index] if isinstance(held, dict) else self.taken(held, tuple(self.index))
        return self.filled(run.shape_times if self.of_shape else run.times, values)

    def taken(self, held: Array, index: tuple[Any, ...], precision: type | None = None) -> Array:
        """Return the values of the quantity in rows of an array.

        Parameters
        ----------
        held : ndarray
            The attribute of a run, or messages of the topic, shape (rows, ...).
        index : tuple
            Into each row: `index` or `columns`.
        precision : type, optional
            Of the values, and of those from which they are derived; by default that of `held`.

        Returns
        -------
        ndarray
            Shape (rows, ...).
        """
        values: Array = held[(slice(None), *index)]
        return self.derived(values if precision is None else values.astype(precision))

    def derived(self, picked: Array) -> Array:
        """Return the values of the quantity from what its index picks.

        Parameters
        ----------
        picked : ndarray
            Shape (rows, ...).

        Returns
        -------
        ndarray
            Shape (rows, ...).
        """
        return picked if self.derive is None else self.derive(picked).astype(picked.dtype, copy=False)

    def filled(self, times: Array, values: Array) -> Quantity:
        """Return the quantity with its values.

        Parameters
        ----------
        times : ndarray
            [s], shape (n,).
        values : ndarray
            In `unit`, shape (n, ...).

        Returns
        -------
        Quantity
        """
        return Quantity(self.name, self.unit, times, _read_only(values), self.axes, self.labels)


def entries(description: Description, terms: Iterable[str], figures: Iterable[str]) -> Iterator[Entry]:
    """Yield all quantities of a run with such energies and figures of the solver."""
    for k, (channel, unit) in enumerate(zip(description.channels, description.channel_units, strict=True)):
        yield Entry(f"stimulus/{channel}", unit, "stimulus", (k,), "stimulus_applied", (k,))
    for k, term in enumerate(terms):
        yield Entry(f"energy/{term}", "J", "energy", term, "energy", (k,))
    for k, figure in enumerate(figures):
        yield Entry(f"solver/{figure}", SOLVER_UNITS.get(figure, ""), "solver", figure, "solver", (k,))
    yield Entry("com", "m", "com", (), "com", (), ("axis",), AXES)
    for k, body in enumerate(description.bodies):
        of, pose = f"body/{body.name}", f"body_pose/{body.name}"
        yield Entry(f"{of}/position", "m", "body_positions", (k,), pose, (slice(0, 3),), ("axis",), AXES)
        yield Entry(f"{of}/quaternion", "", "body_quaternions", (k,), pose, (slice(3, 7),), ("part",), QUATERNION)
        for kind in ("contact", "clamp") if body.holds_rods else ("contact",):
            topic = f"{kind}_wrench/{body.name}"
            yield Entry(f"{of}/{kind}_wrench", "N, N m", f"{kind}_wrenches", (k,), topic, (), ("part",), WRENCH)
    for k, (one, other) in enumerate(description.contact_pairs):
        yield Entry(f"contact/{one}/{other}/force", "N", "pair_forces", (k,), CONTACT_PAIRS.name, (k,))
    for k, label in enumerate(description.joint_labels):
        name, _, part = label.partition(".")
        if not part:
            yield Entry(name, JOINT_UNITS[name.rpartition("/")[2]], "joint_figures", (k,), JOINTS.name, (k,))
        elif part == WRENCH[0]:
            at = (slice(k, k + len(WRENCH)),)
            yield Entry(name, "N, N m", "joint_figures", at, JOINTS.name, at, ("part",), WRENCH)
    row_of = {int(node): k for k, node in enumerate(node_order(description))}
    rods: dict[str, list[Strand]] = {}
    for strand in description.strands:
        rods.setdefault(strand.rod, []).append(strand)
    for name, strands in rods.items():
        if len(strands) == 1:
            yield from _of_strand(f"rod/{name}", strands[0], row_of)
            for layer in strands[0].layers:
                yield from _in_the_middle(f"rod/{layer.name}", layer, row_of)
        elif all(strand.first_station is not None for strand in strands):  # else of an older log
            yield from _of_both(f"rod/{name}", strands, row_of)
        for strand in strands:
            if not strand.layers:
                yield from _of_strand(f"rod/{strand.name}", strand, row_of)


_OF_AXIS, _OF_PART, _OF_NODE = (("node", "axis"), AXES), (("node", "part"), QUATERNION), (("node",), ())


def _of_strand(of: str, strand: Strand, row_of: dict[int, int]) -> Iterator[Entry]:
    nodes, frames = strand.nodes, _rows(strand, row_of)
    yield from _in_the_middle(of, strand, row_of)
    yield Entry(f"{of}/contact_force", "N", "contact_forces", (nodes,), "points", (nodes, slice(5, 8)), *_OF_AXIS)
    yield Entry(f"{of}/frame", "", "material_frames", (frames,), "nodes", (frames, slice(3, 7)), *_OF_PART)
    yield Entry(f"{of}/curvature", "1/m", "curvature", (nodes,), "points", (nodes, 4), *_OF_NODE)
    if strand.strip:
        across = f"{of}/section_curvature"
        yield Entry(across, "1/m", "section_curvature", (nodes,), SECTION_POINTS.name, (nodes, 3), *_OF_NODE)


def _in_the_middle(of: str, part: Strand, row_of: dict[int, int]) -> Iterator[Entry]:
    """Yield position and strain in the middle of a strand, or of a layer of one."""
    nodes, middle = part.nodes, LayerMiddle(part)
    if not part.offset.any():
        yield Entry(f"{of}/position", "m", "positions", (nodes,), "points", (nodes, slice(0, 3)), *_OF_AXIS)
        yield Entry(f"{of}/strain", "", "strain", (nodes,), "points", (nodes, 3), *_OF_NODE)
        return
    yield _derived(f"{of}/position", "m", "nodes", (_rows(part, row_of),), _OF_AXIS, middle.positions)
    yield _derived(f"{of}/strain", "", "points", (nodes, slice(3, 5)), _OF_NODE, middle.strain)


def _of_both(of: str, strands: list[Strand], row_of: dict[int, int]) -> Iterator[Entry]:
    """Yield the quantities of a rod of two strands."""
    nodes = np.concatenate([np.arange(strand.nodes.start, strand.nodes.stop) for strand in strands])
    frames, middle = np.concatenate([_rows(strand, row_of) for strand in strands]), RodMiddle(strands)
    for name, unit, columns, kind, derive in (
        ("position", "m", slice(0, 3), _OF_AXIS, middle.mean),
        ("strain", "", 3, _OF_NODE, middle.mean),
        ("contact_force", "N", slice(5, 8), _OF_AXIS, middle.total),
        ("curvature", "1/m", 4, _OF_NODE, middle.mean),
    ):
        yield _derived(f"{of}/{name}", unit, "points", (nodes, columns), kind, derive)
    yield _derived(f"{of}/frame", "", "nodes", (frames, slice(3, 7)), _OF_PART, middle.frame)


def _derived(
    name: str, unit: str, topic: str, columns: tuple[Any, ...], kind: tuple[Any, Any], derive: Callable[[Array], Array]
) -> Entry:
    """Return an entry of values that are not in a topic, but come of some there; runs have an array of its name."""
    return Entry(name, unit, topic, columns, topic, columns, *kind, derive)


def _rows(strand: Strand, row_of: dict[int, int]) -> Array:
    """Return where the nodes of a strand are in the topic ``nodes``."""
    return np.array([row_of[node] for node in range(strand.nodes.start, strand.nodes.stop)])


def quantities_of(run: Run) -> Iterator[Quantity]:
    """Yield all quantities of a run."""
    for entry in entries(run.description, run.energy, run.solver):
        yield entry.of(run)


def present_name(name: str, known: Collection[str]) -> str:
    """Return the present name of a quantity or a pattern; one that older versions had is told in a warning."""
    new = re.sub("^(rod/[^/]+)/laminate/", r"\1/", name)
    if new == name or name in known:
        return name
    warnings.warn(f"quantity {name!r} is now {new!r}, in the rod's middle line", FutureWarning, stacklevel=3)
    return new


def unknown_quantity(name: str, known: Iterable[str], reason: str | None = None) -> InputError:
    """Return the error for a quantity that does not exist, with the names nearest to it."""
    near = ", ".join(get_close_matches(name, known, n=3, cutoff=0.3)) or "none is like it"
    return InputError(
        f"quantity {name!r}: {reason or f'there is none; near it: {near} (`bilayer info --quantities` lists all)'}"
    )


def _read_only(values: Array) -> Array:
    view = values.view()
    view.flags.writeable = False
    return view

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
``rod/<strand>/position``          node, axis                     [m]
``rod/<strand>/contact_force``     node, axis                     [N]
``rod/<strand>/frame``             node, part                     quaternion x y z w of the axes m1 m2 m3
``rod/<strand>/strain``            node                           axial
``rod/<strand>/curvature``         node                           through the thickness [1/m]
``rod/<strand>/section_curvature`` node                           of a strip across its width, in the mean [1/m]
================================== ============================== =====================================================

A strand is ``<rod>/<layer>``. What stands under ``rod/`` comes at the rate of markers, all else at that of frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Protocol

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.messages.node_frames import node_order
from bilayer_core.log.messages.topics import SECTION_POINTS
from bilayer_core.observed.frame import Description

Array = np.ndarray
AXES, QUATERNION, WRENCH = ("x", "y", "z"), ("x", "y", "z", "w"), ("fx", "fy", "fz", "mx", "my", "mz")
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
    """

    name: str
    unit: str
    attribute: str
    index: str | tuple[Any, ...]
    topic: str
    columns: tuple[Any, ...]
    axes: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()

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
        values = held[self.index] if isinstance(held, dict) else held[(slice(None), *self.index)]
        return self.filled(run.shape_times if self.of_shape else run.times, values)

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
    row_of = {int(node): k for k, node in enumerate(node_order(description))}
    for strand in description.strands:
        of, nodes = f"rod/{strand.name}", strand.nodes
        frames = [row_of[node] for node in range(nodes.start, nodes.stop)]
        of_axis, of_part = (("node", "axis"), AXES), (("node", "part"), QUATERNION)
        yield Entry(f"{of}/position", "m", "positions", (nodes,), "points", (nodes, slice(0, 3)), *of_axis)
        yield Entry(f"{of}/contact_force", "N", "contact_forces", (nodes,), "points", (nodes, slice(5, 8)), *of_axis)
        yield Entry(f"{of}/frame", "", "material_frames", (frames,), "nodes", (frames, slice(3, 7)), *of_part)
        yield Entry(f"{of}/strain", "", "strain", (nodes,), "points", (nodes, 3), ("node",))
        yield Entry(f"{of}/curvature", "1/m", "curvature", (nodes,), "points", (nodes, 4), ("node",))
        if strand.strip:
            across = f"{of}/section_curvature"
            yield Entry(across, "1/m", "section_curvature", (nodes,), SECTION_POINTS.name, (nodes, 3), ("node",))


def quantities_of(run: Run) -> Iterator[Quantity]:
    """Yield all quantities of a run."""
    for entry in entries(run.description, run.energy, run.solver):
        yield entry.of(run)


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

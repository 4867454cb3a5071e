"""A run as named arrays over time, with units: to look up, to hand to pandas or xarray, to compare.

================================= ============================== ======================================================
name                              axes after time                is
================================= ============================== ======================================================
``stimulus/<channel>``                                           what acted, in the unit of the channel
``energy/<term>``                                                energy of a term [J]
``solver/<figure>``                                              iterations, residual, substeps, min_gap, cpu_time
``com``                           axis                           mass centre of the robot [m]
``body/<body>/position``          axis                           [m]
``body/<body>/quaternion``        part                           x y z w
``body/<body>/contact_wrench``    part                           force [N] and moment [N m] of contact
``body/<body>/clamp_wrench``      part                           of the rods that it holds
``rod/<strand>/position``         node, axis                     [m]
``rod/<strand>/contact_force``    node, axis                     [N]
``rod/<strand>/frame``            node, part                     quaternion x y z w of the axes m1 m2 m3
``rod/<strand>/strain``           node                           axial
``rod/<strand>/curvature``        node                           through the thickness [1/m]
================================= ============================== ======================================================

A strand is ``<rod>/<layer>``. What stands under ``rod/`` comes at the rate of markers, all else at that of frames.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bilayer_core.record.node_frames import node_order
from bilayer_core.simulation.frame import Description

Array = np.ndarray
AXES, QUATERNION, WRENCH = ("x", "y", "z"), ("x", "y", "z", "w"), ("fx", "fy", "fz", "mx", "my", "mz")
SOLVER_UNITS = {"residual": "m/s", "min_gap": "m", "cpu_time": "s"}


class Run(Protocol):
    """Whose quantities are told: a `RunData`."""

    description: Description
    times: Array
    stimulus: Array
    energy: dict[str, Array]
    com: Array
    body_positions: Array
    body_quaternions: Array
    contact_wrenches: Array
    clamp_wrenches: Array
    solver: dict[str, Array]
    shape_times: Array
    positions: Array
    contact_forces: Array
    material_frames: Array
    strain: Array
    curvature: Array


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


def quantities_of(run: Run) -> Iterator[Quantity]:
    """All quantities of a run."""

    def scalar(name: str, unit: str, values: Array, *, axes=(), labels=()) -> Quantity:
        return Quantity(name, unit, run.times, _read_only(values), axes, labels)

    channels = zip(run.description.channels, run.description.channel_units, strict=True)
    for k, (channel, unit) in enumerate(channels):
        yield scalar(f"stimulus/{channel}", unit, run.stimulus[:, k])
    for term, energy in run.energy.items():
        yield scalar(f"energy/{term}", "J", energy)
    for figure, values in run.solver.items():
        yield scalar(f"solver/{figure}", SOLVER_UNITS.get(figure, ""), values)
    yield scalar("com", "m", run.com, axes=("axis",), labels=AXES)
    for k, body in enumerate(run.description.bodies):
        of = f"body/{body.name}"
        yield scalar(f"{of}/position", "m", run.body_positions[:, k], axes=("axis",), labels=AXES)
        yield scalar(f"{of}/quaternion", "", run.body_quaternions[:, k], axes=("part",), labels=QUATERNION)
        yield scalar(f"{of}/contact_wrench", "N, N m", run.contact_wrenches[:, k], axes=("part",), labels=WRENCH)
        if body.holds_rods:
            yield scalar(f"{of}/clamp_wrench", "N, N m", run.clamp_wrenches[:, k], axes=("part",), labels=WRENCH)
    row_of = {int(node): k for k, node in enumerate(node_order(run.description))}
    for strand in run.description.strands:
        of, frames = f"rod/{strand.name}", [row_of[n] for n in range(strand.nodes.start, strand.nodes.stop)]
        shapes = (
            ("position", "m", run.positions[:, strand.nodes], ("node", "axis"), AXES),
            ("contact_force", "N", run.contact_forces[:, strand.nodes], ("node", "axis"), AXES),
            ("frame", "", run.material_frames[:, frames], ("node", "part"), QUATERNION),
            ("strain", "", run.strain[:, strand.nodes], ("node",), ()),
            ("curvature", "1/m", run.curvature[:, strand.nodes], ("node",), ()),
        )
        for name, unit, values, axes, labels in shapes:
            yield Quantity(f"{of}/{name}", unit, run.shape_times, _read_only(values), axes, labels)


def _read_only(values: Array) -> Array:
    view = values.view()
    view.flags.writeable = False
    return view

"""A whole run as arrays over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from bilayer_core.extras import of_notebook
from bilayer_core.log.messages.events import Event
from bilayer_core.log.messages.node_frames import node_order
from bilayer_core.log.run.frame_values import joined
from bilayer_core.log.run.quantities import Entry, Quantity, entries, quantities_of
from bilayer_core.log.run.recorded import Recorded
from bilayer_core.observed.frame import Description, Strand


@dataclass(frozen=True, repr=False)
class RunData(Recorded):
    """A run as arrays; the first axis of every array is time.

    Attributes
    ----------
    description : Description
    times : ndarray
        Of scalars and bodies [s], shape (frames,).
    stimulus : ndarray
        Shape (frames, channels).
    energy : dict
        Term -> [J], shape (frames,).
    com : ndarray
        [m], shape (frames, 3).
    body_positions, body_quaternions : ndarray
        [m], x y z w, shapes (frames, bodies, 3 | 4).
    contact_wrenches, clamp_wrenches : ndarray
        Of contact, and of the rods that a body holds [N, N m], shape (frames, bodies, 6).
    pair_forces : ndarray
        Normal forces of pairs that can touch [N], shape (frames, pairs).
    joint_figures : ndarray
        Wrenches, angles and ways of joints [N, N m, rad, m], shape (frames, figures).
    solver : dict
        Name -> shape (frames,): iterations, residual [m/s], substeps, min_gap [m], cpu_time [s].
    shape_times : ndarray
        Of the arrays below [s], shape (shapes,).
    positions, contact_forces : ndarray
        Of every node [m, N], shape (shapes, node_count, 3), float32.
    material_frames : ndarray
        Unit quaternions x y z w of the axes m1 m2 m3 at the nodes of strands, shape (shapes, strand nodes, 4), float32.
    strain, curvature : ndarray
        Of every node [1, 1/m], shape (shapes, node_count), float32.
    section_curvature : ndarray
        Across strips at every node [1/m], 0 at those of beams, shape (shapes, node_count), float32.
    events : tuple of Event
        What happened, in the order of time; empty for older logs.
    """

    description: Description
    times: np.ndarray
    stimulus: np.ndarray
    energy: dict[str, np.ndarray]
    com: np.ndarray
    body_positions: np.ndarray
    body_quaternions: np.ndarray
    contact_wrenches: np.ndarray
    clamp_wrenches: np.ndarray
    pair_forces: np.ndarray
    joint_figures: np.ndarray
    solver: dict[str, np.ndarray]
    shape_times: np.ndarray
    positions: np.ndarray
    contact_forces: np.ndarray
    material_frames: np.ndarray
    strain: np.ndarray
    curvature: np.ndarray
    section_curvature: np.ndarray
    events: tuple[Event, ...] = field(default_factory=tuple)

    @cached_property
    def quantities(self) -> Mapping[str, Quantity]:
        """All quantities by name."""
        return {quantity.name: quantity for quantity in quantities_of(self)}

    @property
    def lacks(self) -> tuple[str, ...]:
        """Topics that the run's log does not hold; what comes of them is NaN."""
        return ()

    def entries(self) -> dict[str, Entry]:
        return {entry.name: entry for entry in entries(self.description, self.energy, self.solver)}

    def __repr__(self) -> str:
        span = f"t = {self.times[0]:g} to {self.times[-1]:g} s" if self.times.size else "empty"
        names = ", ".join(list(self.quantities)[:6])
        return (
            f"RunData({self.description.scene_name}: {span}, {len(self.times)} frames, {len(self.shape_times)} shapes, "
            f"{len(self.quantities)} quantities: {names}, …)"
        )

    @property
    def points(self) -> np.ndarray:
        """Position, strain, curvature and contact force of every node, shape (shapes, node_count, 8)."""
        return joined(self.positions, self.strain[..., None], self.curvature[..., None], self.contact_forces)

    @property
    def nodes(self) -> np.ndarray:
        """Positions and material frames of the nodes of strands, shape (shapes, strand nodes, 7)."""
        return joined(self.positions[:, node_order(self.description)], self.material_frames)

    def film(self, seconds: float | None = None, **look: Any) -> Any:
        """Draw the run as a film without a screen; needs VTK and pillow.

        Parameters
        ----------
        seconds : float, optional
            How long it lasts; by default as long as the run, and 2 to 8 s.
        **look
            ``camera``, ``background``, ``colour``, ``size``, ``reactions``: words of ``bilayer render``.

        Returns
        -------
        Shown
            Notebooks play it; ``save(path)`` writes it, as WebP.
        """
        return of_notebook("film")(self, seconds, look)

    def show(self, **look: Any) -> Any:
        """Show the run in space: in rerun, where `rerun-notebook` is installed, otherwise as a picture of its end.

        Parameters
        ----------
        **look
            As of `film`.

        Returns
        -------
        object
            A notebook shows it.
        """
        return of_notebook("show")(self, look)

    def strain_of(self, layer: Strand) -> np.ndarray:
        """Return the axial strain in the middle of a layer.

        Parameters
        ----------
        layer : Strand
            One of the description's `layers`.

        Returns
        -------
        ndarray
            Strain [1], shape (shapes, its nodes).
        """
        return layer.strain_of(self.strain[:, layer.nodes], self.curvature[:, layer.nodes])

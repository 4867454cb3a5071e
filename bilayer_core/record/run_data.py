"""A whole run as arrays over time."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.record.quantities import AXES, Quantity, quantities_of
from bilayer_core.simulation.frame import Description, Strand

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, repr=False)
class RunData:
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
    solver: dict[str, np.ndarray]
    shape_times: np.ndarray
    positions: np.ndarray
    contact_forces: np.ndarray
    material_frames: np.ndarray
    strain: np.ndarray
    curvature: np.ndarray

    def __getitem__(self, name: str) -> Quantity:
        """The quantity of a name; see `record.quantities`.

        Raises
        ------
        InputError
            If there is none, with the nearest names.
        """
        known = self.quantities
        if name not in known:
            near = ", ".join(get_close_matches(name, known, n=3, cutoff=0.3)) or "none is like it"
            raise InputError(f"quantity {name!r}: there is none; near it: {near} (`.quantities` has all)")
        return known[name]

    @cached_property
    def quantities(self) -> dict[str, Quantity]:
        """All quantities by name."""
        return {quantity.name: quantity for quantity in quantities_of(self)}

    def to_dataframe(self) -> pandas.DataFrame:
        """All but shapes of rods as columns over time, such as ``body/ball/position.z``; needs pandas."""
        import pandas

        columns = {}
        for quantity in self.quantities.values():
            if "node" in quantity.axes:
                continue
            if not quantity.axes:
                columns[quantity.name] = quantity.values
            for k, label in enumerate(quantity.labels):
                columns[f"{quantity.name}.{label}"] = quantity.values[:, k]
        return pandas.DataFrame(columns, index=pandas.Index(self.times, name="time"))

    def to_xarray(self) -> xarray.Dataset:
        """All quantities with their units; those of rods are over ``shape_time`` and have nodes of their own; needs
        xarray.
        """
        import xarray

        variables = {}
        for quantity in self.quantities.values():
            of_shape = quantity.name.startswith("rod/")
            strand = quantity.name.rpartition("/")[0]
            names = {"node": f"node of {strand}", "axis": "axis", "part": f"part of {len(quantity.labels)}"}
            axes = ("shape_time" if of_shape else "time", *(names[axis] for axis in quantity.axes))
            variables[quantity.name] = (axes, quantity.values, {"units": quantity.unit})
        coordinates = {"time": self.times, "shape_time": self.shape_times, "axis": list(AXES)}
        return xarray.Dataset(variables, coordinates, {"scene": self.description.scene_name})

    def __repr__(self) -> str:
        span = f"t = {self.times[0]:g} to {self.times[-1]:g} s" if self.times.size else "empty"
        names = ", ".join(list(self.quantities)[:6])
        return (
            f"RunData({self.description.scene_name}: {span}, {len(self.times)} frames, {len(self.shape_times)} shapes, "
            f"{len(self.quantities)} quantities: {names}, …)"
        )

    def strain_of(self, layer: Strand) -> np.ndarray:
        """Axial strain in the middle of one of the description's `layers`, shape (shapes, its nodes)."""
        return layer.strain_of(self.strain[:, layer.nodes], self.curvature[:, layer.nodes])

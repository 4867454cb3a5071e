"""A whole run as arrays over time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.record.quantities import AXES, Entry, Quantity, entries, quantities_of, unknown_quantity
from bilayer_core.simulation.frame import Description, Strand

if TYPE_CHECKING:
    import pandas
    import xarray

    from bilayer_core.record.log_source import LogSource


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

    @classmethod
    def of_log(cls, source: LogSource) -> RunData:
        """The run of a log, whose arrays are read when they are asked for."""
        run = object.__new__(cls)
        run.__dict__.update(
            source=source,
            description=source.description,
            times=source.times["time"],
            shape_times=source.times["shape_time"],
        )
        return run

    def __getattr__(self, name: str) -> object:
        """Called for what is not there yet: what a log holds at one rate is read at once."""
        source = self.__dict__.get("source")
        if source is None or name not in self.__dataclass_fields__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        self.__dict__.update(source.attributes_with(name))
        return self.__dict__[name]

    def __getitem__(self, name: str) -> Quantity:
        """The quantity of a name; see `record.quantities`.

        Raises
        ------
        InputError
            If there is none, with the nearest names.
        """
        known = self.quantities
        if name not in known:
            raise unknown_quantity(name, known, self.why_not(name))
        return known[name]

    @cached_property
    def quantities(self) -> Mapping[str, Quantity]:
        """All quantities by name; those of a log are read when they are looked up."""
        source = self.__dict__.get("source")
        if source is not None:
            return _OfLog(self, source)
        return {quantity.name: quantity for quantity in quantities_of(self)}

    def entries(self) -> dict[str, Entry]:
        """What is known of each quantity beside its values, by name."""
        source = self.__dict__.get("source")
        if source is not None:
            return source.entries
        return {entry.name: entry for entry in entries(self.description, self.energy, self.solver)}

    def why_not(self, name: str) -> str | None:
        """Why a quantity that other logs have is not in this one; None if it is, or if no log has it."""
        source = self.__dict__.get("source")
        return None if source is None else source.why_not(name)

    def blocks(self, wanted: Sequence[Entry]) -> Iterator[tuple[slice, dict[str, np.ndarray]]]:
        """Values of quantities that come at one rate, in blocks of rows, by name: those of a log as they are read."""
        source = self.__dict__.get("source")
        if source is not None:
            yield from source.blocks(wanted)
        elif wanted:
            found = {entry.name: entry.of(self).values for entry in wanted}
            yield slice(0, len(found[wanted[0].name])), found

    def to_dataframe(self) -> pandas.DataFrame:
        """All but shapes of rods as columns over time, such as ``body/ball/position.z``; needs pandas."""
        import pandas

        columns = {}
        for name in [name for name in self.quantities if not name.startswith("rod/")]:
            quantity = self.quantities[name]
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


class _OfLog(Mapping):
    """The quantities of a log: names are known at once, values are read when they are looked up, and kept."""

    def __init__(self, run: RunData, source: LogSource):
        self._run, self._source = run, source
        self._read: dict[str, Quantity] = {}

    def __getitem__(self, name: str) -> Quantity:
        if name not in self._read:
            entry = self._source.entries[name]
            known = entry.attribute in self._run.__dict__
            self._read[name] = entry.of(self._run) if known else self._source.read(entry)
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return name in self._source.entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._source.entries)

    def __len__(self) -> int:
        return len(self._source.entries)

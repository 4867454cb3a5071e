"""Recorded quantities of a run, by name: from a log, or from memory."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bilayer_core.extras import of_notebook, require
from bilayer_core.log.run.quantities import AXES, Entry, Quantity, present_name, unknown_quantity
from bilayer_core.observed.frame import Description
from bilayer_core.printable import html_table

if TYPE_CHECKING:
    import pandas
    import xarray


class Recorded(ABC):
    """Quantities over time by name, with units; see `log.run.quantities` for the names."""

    description: Description
    times: np.ndarray  # Of all but shapes of rods [s], shape (frames,)
    shape_times: np.ndarray  # Of shapes of rods [s], shape (shapes,)

    @property
    @abstractmethod
    def quantities(self) -> Mapping[str, Quantity]:
        """All quantities by name."""

    @abstractmethod
    def entries(self) -> dict[str, Entry]:
        """Return the entry of each quantity, by name: all that is known of it besides its values.

        Returns
        -------
        dict of str to Entry
        """

    def why_not(self, name: str) -> str | None:
        """Explain why a quantity that other runs have is missing.

        Parameters
        ----------
        name : str

        Returns
        -------
        str or None
            The reason; None if the quantity is there, or no run has it.
        """
        return None

    def __getitem__(self, name: str) -> Quantity:
        """Return the quantity of a name.

        Parameters
        ----------
        name : str
            Such as ``body/ball/position``.

        Returns
        -------
        Quantity

        Raises
        ------
        InputError
            If there is none; the message has the nearest names.
        """
        known = self.quantities
        name = present_name(name, known)
        if name not in known:
            raise unknown_quantity(name, known, self.why_not(name))
        return known[name]

    def blocks(self, wanted: Sequence[Entry]) -> Iterator[tuple[slice, dict[str, np.ndarray]]]:
        """Yield the values of quantities that come at one rate, in blocks of rows.

        Parameters
        ----------
        wanted : sequence of Entry

        Yields
        ------
        rows : slice
            Of all frames.
        values : dict of str to ndarray
            By name of the quantity, in its unit, shape (rows, ...).
        """
        if wanted:
            found = {entry.name: self.quantities[entry.name].values for entry in wanted}
            yield slice(0, len(found[wanted[0].name])), found

    def plot(self, *quantities: str, node: int | None = None, width: str | float = "single") -> Any:
        """Draw quantities over time, those of one unit in a panel; needs matplotlib.

        Parameters
        ----------
        *quantities : str
            Names or patterns, with a component or without: ``com.z``, ``energy/*``.
        node : int, optional
            Station of a rod; by default the last one.
        width : str or float
            ``single`` or ``double`` column, or a width [mm].

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        InputError
            If there is no such quantity, component or node.
        """
        return of_notebook("plot")(self, quantities, node, width)

    def _repr_html_(self) -> str:
        """Return the run as a table for notebooks."""
        units = {name: f"{entry.unit or '1'}" for name, entry in self.entries().items()}
        groups: dict[str, list[str]] = {}
        for name, unit in units.items():
            groups.setdefault(name.rpartition("/")[0] or name, []).append(f"{name.rpartition('/')[2]} [{unit}]")
        span = f"{self.times[0]:g} to {self.times[-1]:g} s, {len(self.times)} frames" if self.times.size else "empty"
        rows = {"time": span} | {name: ", ".join(held) for name, held in groups.items()}
        return html_table(f"{type(self).__name__.removeprefix('Logged')} of {self.description.scene_name}", rows)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return all but shapes of rods as columns over time, such as ``body/ball/position.z``; needs pandas.

        Returns
        -------
        pandas.DataFrame
            Its index is the time [s].
        """
        require("to_dataframe", "pandas")
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
        """Return all quantities with their units; needs xarray.

        Quantities of rods are over ``shape_time`` and have nodes of their own.

        Returns
        -------
        xarray.Dataset
        """
        require("to_xarray", "xarray")
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

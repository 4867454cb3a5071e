"""Measured data of a fit: quantities of a run at some times, from a csv file or from arrays.

A column is named as `log.run.quantities` names its quantity, with the component and the node where it has several, and
perhaps a unit: ``com.z [mm]``, ``body/wall/clamp_wrench.fx``, ``rod/strip/position[-1].x [mm]``,
``rod/strip/curvature[20]``. Nodes count from 0 at the start of the rod, and from −1 at its end. The column
``time`` is in seconds unless it says otherwise. A column ``com.z.sigma`` has the standard deviations of ``com.z``.
Empty cells (NaN in arrays) are data that are missing.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.run.quantities import QUATERNION, Entry, present_name, unknown_quantity
from bilayer_core.log.run.tables import component_unit
from bilayer_core.printable import shortened
from bilayer_core.scene.faults import listed
from bilayer_core.scene.limits import LARGEST_TABLE, read_text
from bilayer_core.scene.units import parse_quantity

Array = np.ndarray
TIME, SIGMA = "time", ".sigma"
NOT_COMPARED: dict[str | tuple[str, ...], str] = {
    "solver": "is a figure of the solver, which no measurement has",
    QUATERNION: "is a quaternion, whose sign means nothing; take positions",
}
"""Quantities that cannot be data, by their attributes in a frame or their labels, and why."""
_HEADING = re.compile(
    r"\s*(?P<name>[^\[\].]+?)(?:\[(?P<node>-?\d+)\])?(?:\.(?!sigma\b)(?P<label>\w+))?(?P<sigma>\.sigma)?\s*"
    r"(?:\[(?P<unit>[^\[\]]*)\])?\s*"
)


@dataclass(frozen=True, eq=False)
class Column:
    """One quantity over time.

    Attributes
    ----------
    name : str
        Of the quantity, with component and node.
    entry : Entry
        What it is in a frame.
    place : tuple
        Node and component in the values of the entry.
    unit : str
        Its SI unit.
    shown_unit : str
        The unit of the data.
    factor : float
        SI units in that.
    values : ndarray
        [`unit`], shape (times,), NaN where data are missing.
    sigma : ndarray or None
        Standard deviation of each value [`unit`], shape (times,), if it is known.
    """

    name: str
    entry: Entry
    place: tuple[int, ...]
    unit: str
    shown_unit: str
    factor: float
    values: Array
    sigma: Array | None = None


@dataclass(frozen=True, eq=False)
class Data:
    """Columns over common times.

    Attributes
    ----------
    source : str
        File, or ``data``.
    times : ndarray
        [s], shape (times,), increasing.
    columns : tuple of Column
    """

    source: str
    times: Array
    columns: tuple[Column, ...]

    @property
    def observed(self) -> Array:
        """All values in SI units, shape (times, columns), NaN where data are missing."""
        return np.stack([column.values for column in self.columns], axis=1)

    @property
    def present(self) -> Array:
        """Which are there, shape (times, columns)."""
        return np.isfinite(self.observed)

    @property
    def sigma(self) -> Array | None:
        """Standard deviations, shape (times, columns), if they are known."""
        known = [column.sigma for column in self.columns if column.sigma is not None]
        return np.stack(known, axis=1) if known else None


def read_data(
    data: str | Path | Mapping[str, Any], known: Mapping[str, Entry], nodes: Mapping[str, int], duration: float
) -> Data:
    """Read data and find what they are of.

    Parameters
    ----------
    data : str, Path or mapping
        A csv file, or arrays by the names of their columns.
    known : mapping
        The quantities of the scene by name.
    nodes : mapping
        How many nodes each of those has that are of nodes.
    duration : float
        Of the scene [s], beyond which there can be no data.

    Raises
    ------
    InputError
        Names the file, the line and the column, what was found and what is allowed.
    """
    source, lines, cells = _read_file(data) if isinstance(data, str | Path) else _read_arrays(data)
    times: Array | None = None
    columns: dict[str, Column] = {}
    sigmas: list[tuple[str, str, str | None, Array]] = []
    for heading, values in cells.items():
        match = _HEADING.fullmatch(heading)
        if match is None:
            wanted = "must be named like com.z, com.z [mm] or rod/arm/curvature[4]"
            raise InputError(f"{source}: column {heading!r}: {wanted}")
        if match["name"] == TIME and not match["label"] and not match["sigma"] and match["node"] is None:
            if times is not None:
                raise InputError(f"{source}: column {heading!r}: there is a column of times already")
            times = _times(source, lines, values * _factor(source, heading, match["unit"], "s"), duration)
        elif match["sigma"]:
            sigmas.append((heading, _name(match), match["unit"], values))
        else:
            column = _column(source, heading, match, values, known, nodes)
            if column.name in columns:
                raise InputError(f"{source}: column {heading!r}: there is a column of {column.name} already")
            columns[column.name] = column
    if times is None:
        raise InputError(f"{source}: must have a column {TIME}; its columns are {listed(cells) or 'none'}")
    if not columns:
        raise InputError(f"{source}: must have a column of a quantity beside {TIME}, such as com.z")
    for heading, name, unit, values in sigmas:
        if name not in columns:
            raise InputError(f"{source}: column {heading}: there is no column {name} that it could be of")
        column = columns[name]
        factor = column.factor if unit is None else _factor(source, heading, unit, column.unit)
        columns[column.name] = replace(column, sigma=_checked_sigma(source, lines, heading, column, values * factor))
    return Data(source, times, tuple(columns.values()))


def with_sigma(data: Data, sigma: Sequence[str] | Mapping[str, float | str]) -> Data:
    """Return data with the standard deviations that a user gives for whole columns, after checking them.

    Parameters
    ----------
    data : Data
    sigma : sequence of str or mapping
        ``QUANTITY=VALUE`` texts, or values by quantities, which may be patterns such as ``rod/*``. A text may have a
        unit; without one it is in the unit of the column, as a number is.

    Raises
    ------
    InputError
        If there is no such column, a value is none, some columns have one and others not, or columns of several units
        have none, by which they could be weighed against each other.
    """
    if isinstance(sigma, Mapping):
        pairs = [(str(name), value) for name, value in sigma.items()]
    else:
        pairs = [_pair(text) for text in sigma]
    columns = {column.name: column for column in data.columns}
    for name, value in pairs:
        escaped = name.replace("[", "[[]")
        matching = [known for known in columns if known == name] or [k for k in columns if fnmatchcase(k, escaped)]
        if not matching:
            raise InputError(f"sigma {name}: {data.source} has no such column; it has {listed(columns)}")
        for known in matching:
            one = _sigma(name, value, columns[known])
            columns[known] = replace(columns[known], sigma=np.full(data.times.size, one))
    without = [name for name, column in columns.items() if column.sigma is None]
    if without and len(without) < len(columns):
        raise InputError(f"sigma: is given for some columns and not for {listed(without)}; give it for all or for none")
    units = list(dict.fromkeys(column.unit for column in columns.values()))
    if without and len(units) > 1:
        shown = ", ".join(unit or "1" for unit in units)
        raise InputError(
            f"sigma: is needed for every column, since {data.source} has several units ({shown}), which are weighed "
            f"against each other by it; give --sigma QUANTITY=VALUE or columns such as {without[0]}{SIGMA}"
        )
    return replace(data, columns=tuple(columns.values()))


def _read_file(path: str | Path) -> tuple[str, list[str], dict[str, Array]]:
    source = str(path)
    try:
        rows = list(csv.reader(io.StringIO(read_text(Path(path), LARGEST_TABLE), newline=""), strict=True))
    except csv.Error as error:
        raise InputError(f"{source}: must be csv: {error}") from None
    except ValueError as error:
        raise InputError(f"{source}: {error}") from None
    if not rows:
        raise InputError(f"{source}: is empty; its first line must name its columns, such as time,com.z")
    headings = [heading.strip() for heading in rows[0]]
    for heading, count in Counter(headings).items():
        if not heading or count > 1:
            wrong = f"{shortened(heading)!r} is there twice" if heading else "one is without a name"
            raise InputError(f"{source}: line 1 must name each column once; {wrong}")
    cells: dict[str, list[float]] = {heading: [] for heading in headings}
    lines = []
    for number, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(headings):
            raise InputError(f"{source}: line {number}: has {len(row)} cells, must have {len(headings)} as line 1 has")
        lines.append(f"line {number}")
        for heading, cell in zip(headings, row, strict=True):
            cells[heading].append(_number(source, lines[-1], heading, cell))
    if not lines:
        raise InputError(f"{source}: must hold one line or more below the names of its columns")
    return source, lines, {heading: np.array(values) for heading, values in cells.items()}


def _number(source: str, line: str, heading: str, cell: str) -> float:
    if not cell.strip():
        return math.nan
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        wanted = "must be a finite number; leave the cell empty where there is no value"
        raise InputError(f"{source}: {line}, column {heading}: found {shortened(cell.strip(), 40)!r}; {wanted}")
    return number


def _read_arrays(data: Any) -> tuple[str, list[str], dict[str, Array]]:
    source = "data"
    if not hasattr(data, "items"):
        raise InputError(f"{source}: found {type(data).__name__}; must be a csv file, or arrays by names of columns")
    cells: dict[str, Array] = {}
    for heading, values in data.items():
        try:
            cells[str(heading)] = np.array(values, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"{source}: column {heading}: must be numbers, NaN where there is no value") from None
        if cells[str(heading)].ndim != 1:
            raise InputError(f"{source}: column {heading}: must have one axis, has shape {cells[str(heading)].shape}")
        if np.isinf(cells[str(heading)]).any():
            raise InputError(f"{source}: column {heading}: must be finite, NaN where there is no value")
    sizes = {values.size for values in cells.values()}
    if len(sizes) != 1 or sizes == {0}:
        raise InputError(f"{source}: columns must have one length above 0, have {sorted(sizes) or 'none'}")
    return source, [f"row {k}" for k in range(sizes.pop())], cells


def _times(source: str, lines: list[str], times: Array, duration: float) -> Array:
    for k, time in enumerate(times):
        if not math.isfinite(time):
            raise InputError(f"{source}: {lines[k]}: has no time")
        if time < 0.0:
            raise InputError(f"{source}: {lines[k]}: the time {time:g} s is before the start of the run, 0 s")
        if k and time <= times[k - 1]:
            raise InputError(f"{source}: {lines[k]}: times must increase, found {time:g} s after {times[k - 1]:g} s")
        if time > duration:
            raise InputError(
                f"{source}: {lines[k]}: the time {time:g} s is beyond the end of the scene, {duration:g} s; "
                f"lengthen that with --set duration={time:g}"
            )
    return times


def _column(
    source: str, heading: str, match: re.Match[str], values: Array, known: Mapping[str, Entry], nodes: Mapping[str, int]
) -> Column:
    of, name = f"{source}: column {heading}", present_name(match["name"].strip(), known)
    if name not in known:
        raise InputError(f"{of}: {unknown_quantity(name, known)}")
    entry = known[name]
    if reason := NOT_COMPARED.get(entry.attribute) or NOT_COMPARED.get(entry.labels):
        raise InputError(f"{of}: {reason}")
    place: tuple[int, ...] = ()
    node, label = match["node"], match["label"]
    if entry.of_shape:
        count = nodes[name]
        if node is None or not -count <= int(node) < count:
            raise InputError(f"{of}: needs one of its nodes, 0 to {count - 1} or -1 for the last: {name}[-1]")
        place += (int(node),)
    elif node is not None:
        raise InputError(f"{of}: {name} is not of nodes, so there is no [{node}]")
    unit = entry.unit
    if entry.labels:
        if label not in entry.labels:
            raise InputError(f"{of}: must name a component, {', '.join('.' + one for one in entry.labels)}")
        place += (entry.labels.index(label),)
        unit = component_unit(unit, label)
    elif label is not None:
        raise InputError(f"{of}: {name} has no components")
    if not np.isfinite(values).any():
        raise InputError(f"{of}: has no value")
    factor = _factor(source, heading, match["unit"], unit)
    shown = unit if match["unit"] is None else match["unit"].strip()
    return Column(_name(match), entry, place, unit, shown, factor, values * factor)


def _factor(source: str, heading: str, written: str | None, unit: str) -> float:
    """Return SI units in the unit of a heading."""
    if written is None:
        return 1.0
    if written.strip() == unit:
        return 1.0
    try:
        return parse_quantity(f"1 {written.strip()}", _si(unit))
    except ValueError as error:
        wanted = f"the unit must be one like {unit or '1'}, found {written!r}, {error}"
        raise InputError(f"{source}: column {heading}: {wanted}") from None


def _si(unit: str) -> str:
    """Return a unit of quantities as `scene.units` writes it."""
    return unit.replace("N m", "N*m") or "1"


def _name(match: re.Match[str]) -> str:
    """Return the name of the quantity with node and component, without the unit."""
    node, label = match["node"], match["label"]
    return match["name"].strip() + (f"[{node}]" if node is not None else "") + (f".{label}" if label else "")


def _checked_sigma(source: str, lines: list[str], heading: str, column: Column, sigma: Array) -> Array:
    for k in np.flatnonzero(np.isfinite(column.values)):
        if not sigma[k] > 0.0:
            raise InputError(f"{source}: {lines[k]}, column {heading}: must be above 0 where {column.name} has a value")
    return sigma


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.rpartition("=")
    if not (equals and name.strip() and value.strip()):
        raise InputError(f"sigma {shortened(text)}: must be QUANTITY=VALUE, such as com.z=0.5mm")
    return name.strip(), value.strip()


def _sigma(name: str, value: float | str, column: Column) -> float:
    allowed = f"must be a number [{column.unit or '1'}] above 0, such as 0.5 or with a unit"
    try:
        number = float(value) * column.factor
    except (TypeError, ValueError):
        try:
            number = parse_quantity(str(value), _si(column.unit))
        except ValueError as error:
            raise InputError(f"sigma {name}: found {shortened(str(value), 40)}, {error}; {allowed}") from None
    if not (math.isfinite(number) and number > 0.0):
        raise InputError(f"sigma {name}: found {value}; {allowed}")
    return number

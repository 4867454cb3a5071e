"""Quantities as columns of tables: over time, and for rods a row for each node at each time (tidy data)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.run.log_source import SHAPE_TIME, TIME, LogSource
from bilayer_core.log.run.quantities import Entry, present_name, unknown_quantity

Array = np.ndarray
Column = tuple[str, str]
"""Name and unit."""
PATTERN = set("*?[")
"""What makes a name one of several quantities."""


def chosen(source: LogSource, names: Sequence[str]) -> list[Entry]:
    """Return the quantities of some names, such as ``com`` or ``energy/*``; all of a log by default.

    Raises InputError if there is none of a name, with those near it.
    """
    if not names:
        return list(source.entries.values())
    found = {
        known: source.entries[known] for name in names for known in chosen_names(source.entries, name, source.why_not)
    }
    return list(found.values())


def chosen_names(known: Iterable[str], name: str, why_not: Callable[[str], str | None]) -> list[str]:
    """Return the names that match a pattern such as ``energy/*``, or the name itself.

    `why_not`: why a name that other logs have is not known here, if that is so.
    """
    known = list(known)
    name = present_name(name, known)
    if name in known:
        return [name]
    matching = [one for one in known if fnmatchcase(one, name)] if PATTERN & set(name) else []
    if not matching:
        raise unknown_quantity(name, known, why_not(name))
    return matching


def component_unit(unit: str, label: str) -> str:
    """Return the unit of one component. Of a wrench, ``N, N m``, forces have the first unit and moments the second."""
    force, comma, moment = unit.partition(", ")
    return (moment if label.startswith("m") else force) if comma else unit


def strand_of(entry: Entry) -> str:
    """Return the name of the strand that a quantity of nodes is of; empty for others."""
    return entry.name.removeprefix("rod/").rpartition("/")[0] if entry.of_shape else ""


class Table:
    """Quantities with the same rows: over time, or over time and the nodes of one strand.

    Parameters
    ----------
    entries : iterable of Entry
    own : bool
        The table is of one quantity, and its name is left out of those of its columns.

    Attributes
    ----------
    entries : list of Entry
    columns : list of (str, str)
        Name and unit of each: ``time``, for a strand ``node``, then components such as ``com.z``.
    """

    def __init__(self, entries: Iterable[Entry], own: bool = False):
        self.entries = list(entries)
        self.of_shape = self.entries[0].of_shape
        prefix = f"rod/{strand_of(self.entries[0])}/"
        self.columns: list[Column] = [("time", "s")]
        if self.of_shape:
            self.columns.append(("node", ""))
        for entry in self.entries:
            name = entry.name.removeprefix(prefix)
            if own and entry.labels:
                self.columns += [(label, component_unit(entry.unit, label)) for label in entry.labels]
            elif entry.labels:
                self.columns += [(f"{name}.{label}", component_unit(entry.unit, label)) for label in entry.labels]
            else:
                self.columns.append((name.rpartition("/")[2] if own else name, entry.unit))

    def arrays(self, times: Array, block: dict[str, Array]) -> list[Array]:
        """Return the columns of some rows of time."""
        found = [times]
        if self.of_shape:
            nodes = block[self.entries[0].name].shape[1]
            found = [np.repeat(times, nodes), np.tile(np.arange(nodes), len(times))]
        for entry in self.entries:
            values = block[entry.name]
            if entry.labels:
                found += [np.ascontiguousarray(values[..., k]).ravel() for k in range(len(entry.labels))]
            else:
                found.append(np.ascontiguousarray(values).ravel())
        return found


def one_table(entries: list[Entry], path: str) -> Table:
    """Return all quantities as one table. Raises InputError if they have no rows in common."""
    kinds = {strand_of(entry) for entry in entries}
    if len(kinds) > 1:
        told = ", ".join(sorted(kind and f"rod/{kind}/…" or "those over time alone" for kind in kinds))
        raise InputError(
            f"{path}: is one table, and the quantities have other rows ({told}); name those of one kind, "
            "or give the name of a directory, for a file of each"
        )
    return Table(entries)


def time_of(source: LogSource, table: Table) -> Array:
    """Return the times of a table's rows [s]."""
    return source.times[SHAPE_TIME if table.of_shape else TIME]

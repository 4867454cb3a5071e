"""A stimulus that was measured or computed elsewhere, from a csv file."""

from __future__ import annotations

import csv
import io
import math
from itertools import pairwise
from pathlib import Path
from typing import Literal

from bilayer_core.scene.faults import one_of, refuse_all
from bilayer_core.scene.limits import LARGEST_TABLE, longest, read_text, refused_file_name
from bilayer_core.scene.part import Part


class TableFile(Part):
    """Values at given times from two columns of a csv file, whose first line names its columns.

    It is read when the scene is, and is a `Table` from then on.
    """

    type: Literal["csv"]
    file: str
    """Relative to the scene file."""
    time_column: str = "time"
    """Name of the column of times, in seconds."""
    value_column: str
    """Name of the column of values, in the unit of the channel."""


class CsvFile:
    """A csv file of numbers, whose first line names its columns.

    Parameters
    ----------
    title : str
        Of the mapping that names the file, for the faults, which stand at its key `file`.
    file : str
        Its name.
    directory : str or Path
        Where relative file names begin.

    Raises
    ------
    ValidationError
        If the file cannot be read, or lacks a column, or holds what is no table; says in which line.
    """

    def __init__(self, title: str, file: str, directory: str | Path):
        self._title, self.name = title, file
        outside = refused_file_name(file)
        if outside:
            self.refuse(outside)
        try:
            reader = csv.DictReader(io.StringIO(read_text(Path(directory, file), LARGEST_TABLE), newline=""))
            self._rows = [(reader.line_num, row) for row in reader]
            self.columns = list(reader.fieldnames or [])
        except csv.Error as error:
            self.refuse(f"must be csv: {error}")
        except ValueError as error:
            self.refuse(f"must be a readable csv file; it {error}")

    def refuse(self, demand: str) -> None:
        """Raise the fault that the file does not meet a demand."""
        refuse_all(self._title, [(("file",), self.name, demand)])

    @property
    def lines(self) -> list[int]:
        """Number of the line of each row."""
        return [line for line, _ in self._rows]

    def numbers(self, column: str) -> list[float]:
        """Return the numbers of a column."""
        if column not in self.columns:
            self.refuse(f"must have a column {column}; its columns are {longest(self.columns) or 'none'}")
        if not self._rows:
            self.refuse("must hold one line or more below the names of its columns")
        return [self._number(line, row[column], column) for line, row in self._rows]

    def _number(self, line: int, text: str | None, column: str) -> float:
        try:
            number = float(text or "")
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            self.refuse(f'must have a number in each line of {column}, line {line} has "{text or ""}"')
        return number


def read_table_file(source: TableFile, directory: str | Path) -> tuple[list[float], list[float]]:
    """Return the times [s] and values of a csv file; relative file names begin at `directory`.

    Raises
    ------
    ValidationError
        As `CsvFile` does, and if times do not increase from 0 or later.
    """
    table = CsvFile("TableFile", source.file, directory)
    for key, name in (("time_column", source.time_column), ("value_column", source.value_column)):
        if name not in table.columns:
            refuse_all("TableFile", [((key,), name, one_of(f"columns of {source.file}", name, table.columns))])
    times, values = (table.numbers(name) for name in (source.time_column, source.value_column))
    lines = table.lines
    if times[0] < 0.0:
        table.refuse(f"must not begin before 0 s, line {lines[0]} has {times[0]:g} s")
    for line, (before, after) in zip(lines[1:], pairwise(times), strict=True):
        if after <= before:
            table.refuse(f"must have increasing times, line {line} has {after:g} s after {before:g} s")
    return times, values

"""A stimulus that was measured or computed elsewhere, from a csv file."""

from __future__ import annotations

import csv
import math
from itertools import pairwise
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from bilayer_core.scene.faults import one_of, refuse_all


class TableFile(BaseModel):
    """Values at given times from two columns of a csv file, whose first line names its columns.

    It is read when the scene is, and is a `Table` from then on.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    type: Literal["csv"]
    file: str
    """Relative to the scene file."""
    time_column: str = "time"
    """Name of the column of times, in seconds."""
    value_column: str
    """Name of the column of values, in the unit of the channel."""


def read_table_file(source: TableFile, directory: str | Path) -> tuple[list[float], list[float]]:
    """Times [s] and values of a csv file; `directory` is where relative file names begin.

    Raises
    ------
    ValidationError
        If the file cannot be read, or lacks a column, or holds what is no table; says in which line.
    """
    try:
        with open(Path(directory, source.file), newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            rows = [(reader.line_num, row) for row in reader]
            columns = reader.fieldnames or []
    except OSError as error:
        _refuse("file", source.file, f"must be a readable file: {error.strerror}")
    except (UnicodeDecodeError, csv.Error) as error:
        _refuse("file", source.file, f"must be csv in UTF-8: {error}")
    for key, name in (("time_column", source.time_column), ("value_column", source.value_column)):
        if name not in columns:
            _refuse(key, name, one_of(f"columns of {source.file}", name, columns))
    if not rows:
        _refuse("file", source.file, "must hold one line or more below the names of its columns")
    times, values = (
        [_number(source, line, row[name], name) for line, row in rows]
        for name in (source.time_column, source.value_column)
    )
    if times[0] < 0.0:
        _refuse("file", source.file, f"must not begin before 0 s, line {rows[0][0]} has {times[0]:g} s")
    for (line, _), (before, after) in zip(rows[1:], pairwise(times), strict=True):
        if after <= before:
            _refuse("file", source.file, f"must have increasing times, line {line} has {after:g} s after {before:g} s")
    return times, values


def _number(source: TableFile, line: int, text: str | None, column: str) -> float:
    try:
        number = float(text or "")
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        _refuse("file", source.file, f'must have a number in each line of {column}, line {line} has "{text or ""}"')
    return number


def _refuse(key: str, found: str, demand: str) -> None:
    refuse_all("TableFile", [((key,), found, demand)])

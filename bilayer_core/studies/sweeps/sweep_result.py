"""Results of a sweep: rows in memory, and a table for other tools."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bilayer_core.errors import InputError
from bilayer_core.extras import require
from bilayer_core.log.file.output_paths import draft_of
from bilayer_core.studies.sweeps.job import Outcome, Row
from bilayer_core.studies.sweeps.journal import Journal

if TYPE_CHECKING:
    import pandas

TABLE = "results.parquet"
MOST_VALUES, LARGEST_HEAD = 20_000_000, 20_000_000
"""Values of a table that is read, and its description [bytes]: packed well, gigabytes of them fit into a small file."""
ROWS_AT_ONCE = 1000
ABOUT = b"bilayer_sweep"
"""Key of the table's metadata under which `Columns` are, as JSON."""


@dataclass(frozen=True)
class Columns:
    """Parameters and metrics in the columns of results, with their units and objectives.

    Attributes
    ----------
    parameters, metrics : tuple of str
        Names.
    units : dict
        Of parameters and metrics that have one; metrics are in SI units.
    objectives : dict
        ``maximise`` or ``minimise``, of metrics.
    logarithmic : tuple of str
        Parameters whose neighbours have the same ratio.
    title : str
    """

    parameters: tuple[str, ...]
    metrics: tuple[str, ...]
    units: dict[str, str] = field(default_factory=dict)
    objectives: dict[str, str] = field(default_factory=dict)
    logarithmic: tuple[str, ...] = ()
    title: str = ""

    @classmethod
    def from_text(cls, text: str | bytes) -> Columns:
        """Return the columns that a JSON text describes."""
        content = json.loads(text)
        names = {key: tuple(content[key]) for key in ("parameters", "metrics", "logarithmic")}
        return cls(**content | names)


class SweepResult:
    """Result of a sweep.

    Parameters
    ----------
    rows : iterable of Row
        In the order of runs.
    about : Columns

    Attributes
    ----------
    about : Columns
    outcomes : dict
        How many runs ended how.
    """

    def __init__(self, rows: Iterable[Row], about: Columns):
        self.about = about
        self._rows = list(rows)
        counted = Counter(row.outcome for row in self._rows)
        self.outcomes = {outcome.value: counted[outcome] for outcome in Outcome if counted[outcome]}

    def __repr__(self) -> str:
        told = ", ".join(f"{count} {outcome}" for outcome, count in self.outcomes.items()) or "no runs"
        varied, measured = ", ".join(self.about.parameters), ", ".join(self.about.metrics) or "nothing"
        return f"SweepResult({told}; varied {varied}; measured {measured})"[:1500]

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def rows(self) -> tuple[Row, ...]:
        """All rows in the order of runs. Summaries of runs are in the files of results alone, where there are some."""
        return tuple(self._rows)

    def column(self, name: str) -> list[Any]:
        """Return all values of a column, in the order of runs.

        Parameters
        ----------
        name : str
            A parameter, a metric, or an attribute of `Row`.

        Returns
        -------
        list

        Raises
        ------
        InputError
            If there is none of this name.
        """
        found = [row.columns() for row in self._rows]
        if found and name not in found[0]:
            raise InputError(f"column {name!r}: there is none; there are {', '.join(found[0])}")
        return [row[name] for row in found]

    def best(self, metric: str, largest: bool = True) -> Row:
        """Return the row with the largest, or least, value of a metric.

        Parameters
        ----------
        metric : str
        largest : bool
            False for the least value.

        Returns
        -------
        Row

        Raises
        ------
        InputError
            If no run has a value.
        """
        known = [row for row in self._rows if isinstance(row.metrics.get(metric), int | float)]
        if not known:
            there = ", ".join(self.about.metrics) or "none"
            raise InputError(f"metric {metric!r}: no run has a value of it; metrics are {there}")
        return (max if largest else min)(known, key=lambda row: row.metrics[metric])

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a table with a row for each run; needs pandas.

        Returns
        -------
        pandas.DataFrame
        """
        require("to_dataframe", "pandas")
        import pandas

        return pandas.DataFrame([row.columns() for row in self._rows])


def rows_of(journal: Journal, keys: set[str]) -> Iterator[Row]:
    """Yield the rows of some runs in a journal; without their summaries if it is a file."""
    for row in journal.rows(keys):
        if journal.path is not None:
            row.summary = {}
        yield row


def read_results(path: str | Path) -> SweepResult:
    """Read the results of a sweep from its table.

    Parameters
    ----------
    path : str or Path
        The directory of results, or its ``results.parquet``.

    Returns
    -------
    SweepResult

    Raises
    ------
    InputError
        If there is no such table.
    """
    parquet = _parquet()
    path = Path(path) / TABLE if Path(path).is_dir() else Path(path)
    try:
        declared = parquet.ParquetFile(path).metadata
        if declared.num_rows * declared.num_columns > MOST_VALUES or declared.serialized_size > LARGEST_HEAD:
            raise InputError(f"{path}: has more than {MOST_VALUES:,} values, the most that are read")
        table = parquet.read_table(path)
        about = Columns.from_text(table.schema.metadata[ABOUT])
        return SweepResult([_row(content, about) for content in table.drop_columns(["summary"]).to_pylist()], about)
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        told = " ".join(str(error).split())[:200]
        raise InputError(f"{path}: is no table of a sweep that can be read: {told}") from None


def _row(content: dict[str, Any], about: Columns) -> Row:
    parameters = {name: content.pop(name) for name in about.parameters}
    metrics = {name: content.pop(name) for name in about.metrics}
    return Row.from_content(content | {"parameters": parameters, "metrics": metrics})


def write_table(journal: Journal, keys: set[str], about: Columns, directory: Path) -> Path:
    """Write rows as Parquet, with summaries as JSON; in bounded memory.

    Raises
    ------
    InputError
        If pyarrow is not installed.
    OutputError
        If it cannot be written; a table that was there stays.
    """
    parquet = _parquet()
    import pyarrow

    kinds: dict[str, set[type]] = {}
    for row in journal.rows(keys):
        for name, value in row.columns().items():
            kinds.setdefault(name, set()).add(type(value))
    if not kinds:
        empty = Row(0, "", dict.fromkeys(about.parameters), "", "", metrics=dict.fromkeys(about.metrics))
        kinds = {name: {type(value)} for name, value in empty.columns().items()}
    fields = [pyarrow.field(name, _kind(pyarrow, found)) for name, found in kinds.items()]
    schema = pyarrow.schema([*fields, pyarrow.field("summary", pyarrow.string())], {ABOUT: json.dumps(asdict(about))})
    path = directory / TABLE
    with (
        draft_of(path, force=True) as draft,
        draft.open("wb") as file,  # whose errors say more than those of pyarrow
        parquet.ParquetWriter(file, schema) as writer,
    ):
        block: list[dict[str, Any]] = []
        for row in journal.rows(keys):
            block.append(_fitting(pyarrow, schema, row))
            if len(block) == ROWS_AT_ONCE:
                writer.write_table(pyarrow.Table.from_pylist(block, schema))
                block.clear()
        writer.write_table(pyarrow.Table.from_pylist(block, schema))
    return path


def _parquet() -> Any:
    require("tables of results", "pyarrow")
    from pyarrow import parquet

    return parquet


def _kind(pyarrow: Any, found: set[type]) -> Any:
    found = found - {type(None)}
    if found == {bool}:
        return pyarrow.bool_()
    if found == {int}:
        return pyarrow.int64()
    if found and found <= {int, float, bool}:
        return pyarrow.float64()
    return pyarrow.string()


def _fitting(pyarrow: Any, schema: Any, row: Row) -> dict[str, Any]:
    """Return the columns of a row in the types of the table."""
    content = row.columns()
    for of in schema:
        value = content.get(of.name)
        if value is None:
            continue
        if of.type == pyarrow.string() and not isinstance(value, str):
            content[of.name] = json.dumps(value)
        elif of.type == pyarrow.float64():
            content[of.name] = float(value)
    return content | {"summary": json.dumps(row.summary) if row.summary else None}

"""A log as files that other tools read: csv, parquet, npz. Some megabytes of it are in memory, however long it is.

Names of quantities come from the log, which may be a stranger's: `file_names` makes names of files and members of them.
"""

from __future__ import annotations

import csv
import json
import os
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.extras import require
from bilayer_core.log.file.file_names import file_names
from bilayer_core.log.file.output_paths import check_output_path, draft_of, move, unwritable
from bilayer_core.log.file.private_directory import private_directory
from bilayer_core.log.run.csv_cells import text_cell
from bilayer_core.log.run.log_source import SHAPE_TIME, TIME, LogSource
from bilayer_core.log.run.quantities import Entry
from bilayer_core.log.run.tables import Column, Table, chosen, one_table, time_of

CSV, PARQUET, NPZ = ".csv", ".parquet", ".npz"
TABLES_AT_ONCE = 100
"""Files that are written in one pass through the log: a process may have 1024 open."""


def export(path: str | Path, out: str | Path, kind: str, names: Sequence[str] = (), force: bool = False) -> list[str]:
    """Write quantities of a log.

    Parameters
    ----------
    path : str or Path
    out : str or Path
        For csv and parquet a file that ends so, for one table, or a directory, for a file of each quantity. For npz a
        file.
    kind : str
        `CSV`, `PARQUET` or `NPZ`.
    names : sequence of str
        Of quantities, such as ``com`` or ``energy/*``; by default all, and in one table all but those of nodes.
    force : bool
        Replace what is there.

    Returns
    -------
    list of str
        Names of what was written.

    Raises
    ------
    InputError
        If there is no such quantity, `out` cannot be written, or pyarrow is missing.
    OutputError
        If writing fails.
    """
    out, source = Path(out), LogSource(path)
    if kind == PARQUET:
        require("--parquet", "pyarrow")
    if out.name in ("", "-"):
        raise InputError(f"{kind[1:]}: {str(out)!r} is not allowed; it must be the name of a file or a directory")
    wanted = chosen(source, names)
    if not wanted:
        raise InputError(f"{path}: holds no quantity to export")
    if kind == NPZ:
        check_output_path(out, force, NPZ)
        with draft_of(out, force) as draft:
            _write_npz(source, wanted, draft)
    elif out.suffix.lower() == kind:
        table = one_table(wanted if names else [entry for entry in wanted if not entry.of_shape], str(out))
        check_output_path(out, force, kind)
        with draft_of(out, force) as draft:
            _write_tables(source, {draft: table})
        wanted = table.entries
    else:
        if out.suffix.lower() in (CSV, PARQUET, NPZ):
            raise InputError(f"{out}: must end in {kind}, or be the name of a directory")
        with _draft_of_directory(out, force) as directory:
            paths = file_names(entry.name for entry in wanted)
            _write_tables(
                source, {directory / f"{paths[entry.name]}{kind}": Table([entry], own=True) for entry in wanted}
            )
    return [entry.name for entry in wanted]


def _write_tables(source: LogSource, tables: dict[Path, Table]) -> None:
    """Write tables, those with the same times in one pass through the log."""
    for of_shape in (False, True):
        group = [(path, table) for path, table in tables.items() if table.of_shape is of_shape]
        for first in range(0, len(group), TABLES_AT_ONCE):
            with ExitStack() as open_files:
                some = group[first : first + TABLES_AT_ONCE]
                writers = [open_files.enter_context(_writer(path, table.columns)) for path, table in some]
                every = [entry for _, table in some for entry in table.entries]
                for rows, block in source.blocks(every):
                    for (path, table), write in zip(some, writers, strict=True):
                        with _named(path):
                            write(table.arrays(time_of(source, table)[rows], block))


@contextmanager
def _writer(path: Path, columns: list[Column]) -> Iterator[Callable[[list[np.ndarray]], None]]:
    """Yield a function that takes arrays of the columns, for a file that is closed afterwards."""
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = _csv_writer if path.suffix.lower() == CSV else _parquet_writer
    with _named(path), writer(path, columns) as write:
        yield write


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Let an OSError that names no file name this one."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


@contextmanager
def _csv_writer(path: Path, columns: list[Column]) -> Iterator[Callable[[list[np.ndarray]], None]]:
    with path.open("w", encoding="utf-8", newline="") as file:
        header = (f"{name} [{unit}]" if unit else name for name, unit in columns)
        csv.writer(file, lineterminator="\n").writerow(map(text_cell, header))

        def write(arrays: list[np.ndarray]) -> None:
            row = ",".join(map(_digits, arrays)) + "\n"
            file.writelines(map(row.__mod__, zip(*(array.tolist() for array in arrays), strict=True)))

        yield write


def _digits(array: np.ndarray) -> str:
    """Return the format of numbers that reads back to the last bit."""
    return "%.9g" if array.dtype == np.float32 else "%r"


@contextmanager
def _parquet_writer(path: Path, columns: list[Column]) -> Iterator[Callable[[list[np.ndarray]], None]]:
    import pyarrow
    from pyarrow import parquet

    with path.open("wb") as file, ExitStack() as closing:  # whose errors say more than those of pyarrow
        opened: list[parquet.ParquetWriter] = []
        units = {name: unit for name, unit in columns}

        def write(arrays: list[np.ndarray]) -> None:
            held = list(map(pyarrow.array, arrays))
            if not opened:
                fields = [
                    pyarrow.field(name, of.type, metadata={"unit": unit})
                    for (name, unit), of in zip(columns, held, strict=True)
                ]
                schema = pyarrow.schema(fields, metadata={"units": json.dumps(units)})
                opened.append(closing.enter_context(parquet.ParquetWriter(file, schema)))
            opened[0].write_table(pyarrow.Table.from_arrays(held, schema=opened[0].schema))

        yield write
        if not opened:  # a log of no frame
            write([np.empty(0)] * len(columns))


def _write_npz(source: LogSource, wanted: list[Entry], path: Path) -> None:
    """Write arrays by the names of their quantities, the two times, ``units`` and ``labels``."""
    texts = {
        "units": [(entry.name, entry.unit) for entry in wanted],
        "labels": [(entry.name, " ".join(entry.labels)) for entry in wanted if entry.labels],
    }
    arrays = {name: np.array(rows, str).reshape(len(rows), 2) for name, rows in texts.items()}
    arrays |= {TIME: source.times[TIME], SHAPE_TIME: source.times[SHAPE_TIME]}
    members = file_names((entry.name for entry in wanted), taken=arrays)
    with (
        private_directory(path.parent) as parts,
        zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=True) as archive,
    ):
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, array, allow_pickle=False)
        for of_shape in (False, True):
            group = [entry for entry in wanted if entry.of_shape is of_shape]
            count = len(source.times[SHAPE_TIME if of_shape else TIME])
            for first in range(0, len(group), TABLES_AT_ONCE):
                some = group[first : first + TABLES_AT_ONCE]
                _write_parts(source, some, count, parts)
                for k, entry in enumerate(some):
                    archive.write(parts / f"{k}.npy", f"{members[entry.name]}.npy")


def _write_parts(source: LogSource, wanted: list[Entry], count: int, directory: Path) -> None:
    """Write the array of each quantity to a file of its own, which grows while the log is read."""
    with ExitStack() as open_files:
        files = [open_files.enter_context((directory / f"{k}.npy").open("wb")) for k in range(len(wanted))]
        begun = False
        for _, block in source.blocks(wanted):
            for entry, file in zip(wanted, files, strict=True):
                values = np.ascontiguousarray(block[entry.name])
                if not begun:
                    _write_head(file, values.dtype, (count, *values.shape[1:]))
                file.write(values.data)
            begun = True
        if not begun:
            for file in files:
                _write_head(file, np.dtype(float), (0,))


def _write_head(file, dtype: np.dtype, shape: tuple[int, ...]) -> None:
    head = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_2_0(file, head)


@contextmanager
def _draft_of_directory(out: Path, force: bool) -> Iterator[Path]:
    """Yield a directory whose files are moved to `out` when all are written."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; choose another name for a directory")
    if out.is_dir() and any(out.iterdir()) and not force:
        raise InputError(f"{out}: holds files already; choose another name, or replace them with --force")
    parent = out.resolve().parent
    if not parent.is_dir():
        raise InputError(f"{out}: cannot be written: there is no directory {parent}")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"{out}: cannot be written: no permission to write in {parent}")
    draft = None
    try:
        with private_directory(parent) as draft:
            yield draft
            out.mkdir(exist_ok=True)
            for file in sorted(path for path in draft.rglob("*") if path.is_file()):
                target = out / file.relative_to(draft)
                _make_parents(target, out)
                move(file, target, force)
    except OSError as error:
        path = Path(error.filename or out)
        raise unwritable(out / path.relative_to(draft) if draft in path.parents else path, error) from error


def _make_parents(target: Path, out: Path) -> None:
    """Make the directories of a file below `out`; InputError if a link is among them."""
    directory = out
    for part in target.relative_to(out).parts[:-1]:
        directory /= part
        if directory.is_symlink():
            raise InputError(f"{directory}: is a link, and exported files must stay in {out}; remove the link")
        directory.mkdir(exist_ok=True)

"""A log as files that other tools read: csv, parquet, npz. Some megabytes of it are in memory, however long it is."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.record.log_source import SHAPE_TIME, TIME, LogSource
from bilayer_core.record.paths import check_output_path, draft_of, unwritable
from bilayer_core.record.quantities import Entry
from bilayer_core.record.tables import Column, Table, chosen, one_table, time_of

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
    if kind != NPZ and importlib.util.find_spec("pyarrow") is None:
        raise InputError(f"{kind[1:]} is written by pyarrow; install it with: pip install 'bilayer_sim_ros[export]'")
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
            _write_tables(source, {directory / f"{entry.name}{kind}": Table([entry], own=True) for entry in wanted})
    return [entry.name for entry in wanted]


def _write_tables(source: LogSource, tables: dict[Path, Table]) -> None:
    """Write tables, those with the same times in one pass through the log."""
    for of_shape in (False, True):
        group = [(path, table) for path, table in tables.items() if table.of_shape is of_shape]
        for first in range(0, len(group), TABLES_AT_ONCE):
            with ExitStack() as open_files:
                some = group[first : first + TABLES_AT_ONCE]
                writers = [(table, open_files.enter_context(_writer(path, table.columns))) for path, table in some]
                every = [entry for table, _ in writers for entry in table.entries]
                for rows, block in source.blocks(every):
                    for table, write in writers:
                        write(table.arrays(time_of(source, table)[rows], block))


@contextmanager
def _writer(path: Path, columns: list[Column]) -> Iterator:
    """A function that takes arrays of the columns, for a file that is closed afterwards."""
    import pyarrow
    from pyarrow import csv, parquet

    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() == CSV:
        header = ",".join(f"{name} [{unit}]" if unit else name for name, unit in columns)
        with path.open("wb") as file:
            file.write(f"{header}\n".encode())
            options = csv.WriteOptions(include_header=False)

            def write(arrays):
                csv.write_csv(pyarrow.Table.from_arrays(list(map(pyarrow.array, arrays)), names), file, options)

            names = [name for name, _ in columns]
            yield write
        return
    with ExitStack() as closing:
        opened: list[parquet.ParquetWriter] = []
        units = {name: unit for name, unit in columns}

        def write(arrays):
            held = list(map(pyarrow.array, arrays))
            if not opened:
                fields = [
                    pyarrow.field(name, of.type, metadata={"unit": unit})
                    for (name, unit), of in zip(columns, held, strict=True)
                ]
                schema = pyarrow.schema(fields, metadata={"units": json.dumps(units)})
                opened.append(closing.enter_context(parquet.ParquetWriter(path, schema)))
            opened[0].write_table(pyarrow.Table.from_arrays(held, schema=opened[0].schema))

        yield write
        if not opened:  # a log of no frame
            write([np.empty(0)] * len(columns))


def _write_npz(source: LogSource, wanted: list[Entry], path: Path) -> None:
    """Arrays by the names of their quantities, the two times, ``units`` and ``labels``."""
    texts = {
        "units": [(entry.name, entry.unit) for entry in wanted],
        "labels": [(entry.name, " ".join(entry.labels)) for entry in wanted if entry.labels],
    }
    arrays = {name: np.array(rows, str).reshape(len(rows), 2) for name, rows in texts.items()}
    arrays |= {TIME: source.times[TIME], SHAPE_TIME: source.times[SHAPE_TIME]}
    with (
        tempfile.TemporaryDirectory(prefix=".bilayer-", dir=path.parent) as parts,
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
                _write_parts(source, some, count, Path(parts))
                for k, entry in enumerate(some):
                    archive.write(Path(parts) / f"{k}.npy", f"{entry.name}.npy")


def _write_parts(source: LogSource, wanted: list[Entry], count: int, directory: Path) -> None:
    """The array of each quantity as a file of its own, which grows as the log is read."""
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
    """A directory whose files are moved to `out` when all are written."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; choose another name for a directory")
    if out.is_dir() and any(out.iterdir()) and not force:
        raise InputError(f"{out}: holds files already; choose another name, or replace them with --force")
    parent = out.resolve().parent
    if not parent.is_dir():
        raise InputError(f"{out}: cannot be written: there is no directory {parent}")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"{out}: cannot be written: no permission to write in {parent}")
    draft = Path(tempfile.mkdtemp(prefix=".bilayer-", dir=parent))
    try:
        yield draft
        for file in sorted(draft.rglob("*")):
            if file.is_file():
                target = out / file.relative_to(draft)
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(file, target)
    except OSError as error:
        raise unwritable(out, error) from error
    finally:
        shutil.rmtree(draft, ignore_errors=True)

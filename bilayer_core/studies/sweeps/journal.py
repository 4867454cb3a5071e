"""Results on disk as they come, in a SQLite database that survives a program that is killed."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

from bilayer_core.errors import InputError, OutputError
from bilayer_core.log.file.lock import open_alone
from bilayer_core.scene.faults import shortened
from bilayer_core.studies.sweeps.job import Row

FILE, LOCK = "results.sqlite", ".lock"
SCHEMA = """
CREATE TABLE IF NOT EXISTS head (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS rows (key TEXT PRIMARY KEY, number INTEGER NOT NULL, row TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS by_number ON rows (number);
"""
MOST_SHOWN = 4
"""Keys of a sweep file that are named when it has changed."""


class Journal:
    """The results of a directory, or in memory.

    Parameters
    ----------
    directory : Path or None
        Made if it is not there; None keeps results in memory.
    content : dict
        The sweep file, to which results belong.
    resume : bool
        Go on with those that are there.
    force : bool
        Replace those that are there.

    Raises
    ------
    InputError
        If results are there that are neither to be continued nor replaced, there is nothing to resume, the sweep file
        has changed since, another program writes there, or the directory cannot be made.
    """

    def __init__(self, directory: Path | None, content: dict[str, Any], *, resume: bool = False, force: bool = False):
        self.path = None if directory is None else directory / FILE
        if resume:
            self._refuse_missing()
        self._lock = None if directory is None else _locked(directory)
        try:
            self._refuse_others(resume, force)
            if self.path is not None and force and not resume:
                for suffix in ("", "-wal", "-shm"):
                    Path(f"{self.path}{suffix}").unlink(missing_ok=True)
            with self._writing():
                self._base = sqlite3.connect(self.path or ":memory:")
                self._base.execute("PRAGMA trusted_schema=OFF")  # the file may be somebody else's
                self._base.execute("PRAGMA journal_mode=WAL")
                self._base.execute("PRAGMA synchronous=NORMAL")
                self._base.executescript(SCHEMA)
            if resume:
                self._refuse_changed(content)
            with self._writing():
                self._base.execute("INSERT OR REPLACE INTO head VALUES ('sweep', ?)", (_text(content),))
                self._base.commit()
        except BaseException:
            if self._lock is not None:
                self._lock.close()
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Keep what there is, in one file."""
        self._base.close()
        if self._lock is not None:
            self._lock.close()

    def _refuse_missing(self) -> None:
        if self.path is not None and not self.path.exists():
            raise InputError(f"--resume: {self.path}: no results are there to go on with")

    def _refuse_others(self, resume: bool, force: bool) -> None:
        if self.path is not None and self.path.exists() and not resume and not force:
            raise InputError(
                f"{self.path}: results are there already; go on with them (--resume), replace them (--force), or "
                "choose another directory (--out)"
            )

    def _refuse_changed(self, content: dict[str, Any]) -> None:
        try:
            found = self._base.execute("SELECT value FROM head WHERE name = 'sweep'").fetchone()
            if found is None:  # killed between the first two writes, before any row
                return
            before, now = dict(json.loads(found[0])), json.loads(_text(content))
        except (sqlite3.DatabaseError, ValueError, TypeError, RecursionError) as error:
            raise InputError(f"--resume: {self.path}: is damaged or no journal of a sweep: {error}") from None
        changed = [key for key in {**before, **now} if before.get(key) != now.get(key)]
        if changed:
            more = f" and {len(changed) - MOST_SHOWN} more" if len(changed) > MOST_SHOWN else ""
            raise InputError(
                f"--resume: the sweep has changed since its results were begun, in {', '.join(changed[:MOST_SHOWN])}"
                f"{more}; put that back, or take another --out directory for the new one"
            )

    def keys(self) -> set[str]:
        """Return the keys of the runs whose rows are here."""
        return {key for (key,) in self._base.execute("SELECT key FROM rows")}

    def add(self, rows: Iterable[Row]) -> None:
        """Keep rows, on disk before this returns.

        Raises
        ------
        OutputError
            If they cannot be written; those of before are kept.
        """
        with self._writing():
            self._base.executemany(
                "INSERT OR REPLACE INTO rows VALUES (?, ?, ?)", [(row.key, row.number, row.text()) for row in rows]
            )
            self._base.commit()

    def rows(self, keys: set[str] | None = None) -> Iterator[Row]:
        """Yield all rows in the order of their runs, read as they are asked for; with `keys` those alone.

        Raises
        ------
        InputError
            If one is damaged.
        """
        for key, text in self._base.execute("SELECT key, row FROM rows ORDER BY number"):
            if keys is not None and key not in keys:
                continue
            try:
                yield Row.from_text(text)
            except (ValueError, TypeError) as error:
                told = shortened(str(error))
                raise InputError(f"{self.path}: the row with the key {key!r} is damaged: {told}") from None

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            raise OutputError(f"{self.path}: cannot be written: {error}") from error
        except sqlite3.DatabaseError as error:
            raise InputError(f"{self.path}: is damaged or no journal of a sweep: {error}") from None


def _locked(directory: Path) -> Any:
    """Return the lock of a directory; create the directory if it does not exist."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"out: {directory}: cannot be made a directory: {error.strerror or error}") from error
    for path in (directory / LOCK, directory / FILE):
        if path.is_symlink():
            raise InputError(f"{path}: is a link, and results must stay in {directory}; remove the link")
    try:
        return open_alone(directory / LOCK, force=True)
    except OSError as error:
        raise OutputError(f"{directory}: cannot be written: {error.strerror or error}") from error


def _text(content: dict[str, Any]) -> str:
    return json.dumps(content, sort_keys=True, default=str)

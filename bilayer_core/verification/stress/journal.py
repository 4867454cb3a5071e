"""Results on disk as they come: a line of json for each case, after one that says what they are results of."""

from __future__ import annotations

import hashlib
import json
import subprocess
from pathlib import Path

from bilayer_core.errors import InputError
from bilayer_core.log.file.output_paths import unwritable
from bilayer_core.verification.bench import machine
from bilayer_core.verification.stress.stress_case import Record, StressCase

FILE = "results.jsonl"


def head_of(cases: dict[str, StressCase]) -> dict[str, object]:
    """Return the origin of results: the cases, the machine, the versions, the commit if there is one, the date."""
    return {"cases": digest(cases), "machine": machine.record(), "commit": commit(), **machine.now()}


def digest(cases: dict[str, StressCase]) -> str:
    """Return a digest of the cases, which changes whenever a case changes."""
    content = {name: [case.scene(), case.most_steps] for name, case in cases.items()}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def commit() -> str | None:
    """Return the commit of the checkout that the package is run from; None without one."""
    here = Path(__file__).resolve().parent
    found = subprocess.run(["git", "-C", str(here), "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    return found.stdout.strip() or None


class Journal:
    """The results of a directory.

    Parameters
    ----------
    directory : Path
        That exists.
    head : dict
        From `head_of`.
    resume : bool
        Go on with those that are there; otherwise they are replaced.

    Raises
    ------
    InputError
        If there is nothing to resume, or what is there is of other cases; nothing is changed then.
    """

    def __init__(self, directory: Path, head: dict[str, object], resume: bool):
        self.path, self.head = directory / FILE, head
        self.records: dict[str, Record] = {}  # By name of the case
        if resume:
            self._read()
        if not resume:
            self._write("w", json.dumps(head))

    def _read(self) -> None:
        if not self.path.exists():
            raise InputError(f"--resume: {self.path}: no results are there to go on with")
        first, *lines = self.path.read_text(encoding="utf-8").splitlines()
        found = json.loads(first)
        if found["cases"] != self.head["cases"]:
            raise InputError(
                f"--resume: {self.path}: holds results of other cases ({found['cases']}, now {self.head['cases']}); "
                "take another --out directory"
            )
        self.head = found  # That of the first run, if it is continued
        for line in lines:
            try:
                record = Record.from_line(line)
            except ValueError:  # the last line of a run that was killed
                continue
            self.records[record.name] = record

    def add(self, record: Record) -> None:
        """Keep a result, on disk before this returns."""
        self.records[record.name] = record
        self._write("a", record.line())

    def _write(self, mode: str, line: str) -> None:
        try:
            with open(self.path, mode, encoding="utf-8") as file:
                file.write(line + "\n")
        except OSError as error:
            raise unwritable(self.path, error) from error

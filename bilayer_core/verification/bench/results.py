"""All that a benchmark has measured, in one json file that is written anew after every measurement."""

from __future__ import annotations

import json
from pathlib import Path

from bilayer_core.errors import InputError
from bilayer_core.log.file.output_paths import write_text
from bilayer_core.verification.bench import machine

SCHEMA = 1
PARTS = ("work_precision", "cantilever", "scaling", "start", "commands")
"""Each a list of records in the file."""
FILE_NAME = "bench.json"


class Results:
    """The file DIR/bench.json.

    Parameters
    ----------
    directory : Path
        Exists.
    quick : bool
        Whether these are the reduced problems.
    resume, force : bool
        What to do with a file that is there: go on with it, or begin anew.

    Raises
    ------
    InputError
        If the file is there and neither is asked for, or it cannot be gone on with.
    """

    def __init__(self, directory: Path, quick: bool, resume: bool = False, force: bool = False):
        self.path = directory / FILE_NAME
        here = machine.record()
        self.content = {"schema": SCHEMA, "quick": quick, "machine": here, "began": machine.now()}  # As in the file
        self.content |= {part: [] for part in PARTS}
        if not self.path.exists():
            return
        if not (resume or force):
            raise InputError(
                f"{self.path}: exists already; go on with it with --resume, replace it with --force, "
                "or name another directory with --out"
            )
        if resume:
            self.content = self._read(quick, here)

    def _read(self, quick: bool, here: dict) -> dict:
        try:
            content = json.loads(self.path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{self.path}: cannot be read: {error}; replace it with --force") from error
        for key, wanted in (("schema", SCHEMA), ("quick", quick), ("machine", here)):
            if content.get(key) != wanted:
                raise InputError(
                    f"{self.path}: {key} is {content.get(key)!r} there and {wanted!r} now: not to be mixed; "
                    "replace it with --force, or name another directory with --out"
                )
        return content

    def find(self, part: str, identity: dict) -> dict | None:
        """Return the record of a part that has these values."""
        records = self.content[part]
        return next((r for r in records if all(r.get(key) == value for key, value in identity.items())), None)

    def add(self, part: str, record: dict) -> None:
        """Keep a record, and write the file."""
        self.content[part].append(record)
        self.write()

    def write(self) -> None:
        """Replace the file as a whole: an interruption leaves the old one or the new one."""
        self.content["ended"] = machine.now()
        write_text(self.path, json.dumps(self.content, indent=1, allow_nan=False) + "\n", force=True)

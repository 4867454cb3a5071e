"""Records as csv files."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from bilayer_core.log.file.output_paths import draft_of


def write_rows(path: Path, records: Sequence[dict[str, object]]) -> None:
    """Write a table with a line for each record and a column for each key that any of them has."""
    with draft_of(path, force=True) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(dict.fromkeys(key for record in records for key in record)))
        table.writeheader()
        table.writerows(records)

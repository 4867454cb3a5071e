"""Results as json, csv and a page."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from bilayer_core.log.file.output_paths import write_text
from bilayer_core.verification.csv_files import write_rows
from bilayer_core.verification.validate.validation_case import Result

NOTHING = 1e-8


def as_json(results: Sequence[Result]) -> str:
    """Return ``{"cases": [{case, computed, reference, error, limit, pass, …}, …]}``."""
    return json.dumps({"cases": [result.record() for result in results]}, indent=2, allow_nan=False)


def write_json(results: Sequence[Result], path: Path) -> None:
    """Write the results as JSON to a file."""
    write_text(path, as_json(results) + "\n", force=True)


def write_csv(results: Sequence[Result], path: Path) -> None:
    """Write the results as csv, a line each."""
    write_rows(path, [result.record() for result in results])


def write_page(results: Sequence[Result], path: Path) -> None:
    """Write tables in Markdown, one a family."""
    write_text(path, page(results), force=True)


def page(results: Sequence[Result]) -> str:
    """Return the text that `write_page` writes.

    Errors are rounded up to one digit, so that the page says the same on every machine. What a case is held against
    stands once in a row of cases.
    """
    lines = []
    for family, members in groupby(results, lambda result: result.case.family):
        lines += [
            f"### {family}",
            "",
            "| case | against | computed | reference | error below | limit |",
            "|---" * 6 + "|",
        ]
        before = ""
        for result in members:
            lines.append(_row(result, result.case.against if result.case.against != before else ""))
            before = result.case.against
        lines.append("")
    return "\n".join(lines)


def _row(result: Result, against: str) -> str:
    case = result.case
    unit = "" if case.unit == "1" else f" {case.unit}"
    numbers = (f"{shown(result.computed)}{unit}", f"{shown(result.reference)}{unit}", shown_error(result.error))
    limit = f"{case.limit:g}{'' if result.passed else ', **missed**'}"
    return f"| {' | '.join((case.name.split('/', 1)[1], against, *numbers, limit))} |"


def shown(value: float) -> str:
    """Return five digits; what is smaller than `NOTHING` is rounding, and another on each machine."""
    if not math.isfinite(value):
        return "–"
    return f"{value:.5g}" if value == 0.0 or abs(value) >= NOTHING else f"< {NOTHING:g}"


def shown_error(error: float) -> str:
    """Return the next power of ten above an error, `NOTHING` at least."""
    if not math.isfinite(error):
        return "–"
    return f"1e{math.ceil(math.log10(max(error, NOTHING))):d}"

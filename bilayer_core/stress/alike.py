"""Runs cases one after the other, as far as they end as they did before: what `stress.mutations` starts in a copy.

    python -m bilayer_core.stress.alike EXPECTED RESULTS

EXPECTED has the name of a case in each line, or the record of one, which the new one is compared with; RESULTS gets
the new records.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from .case import Outcome, Record
from .cases import all_cases
from .execute import execute


def differs(before: Record, now: Record) -> bool:
    """Whether a case shows that something is wrong: it failed, or is in the region and no longer accurate."""
    if before.outcome is Outcome.FAILED:
        return False
    was_accurate = before.inside and before.outcome is Outcome.ACCURATE
    return now.outcome is Outcome.FAILED or was_accurate and now.outcome is not Outcome.ACCURATE


def main(expected: str, results: str) -> None:
    """Run the cases of the one file, and write what comes of them to the other."""
    cases = all_cases()
    with open(results, "w", encoding="utf-8") as file:
        for line in Path(expected).read_text(encoding="utf-8").splitlines():
            before = Record.from_line(line) if line.startswith("{") else None
            now = execute(cases[before.name if before else line])
            file.write(now.line() + "\n")
            file.flush()
            if before is not None and differs(before, now):
                print(json.dumps({"case": now.name, "before": before.outcome, "now": now.outcome, "why": now.reason}))
                return


if __name__ == "__main__":
    main(*sys.argv[1:])

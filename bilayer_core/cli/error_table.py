"""The global error of a run as a table."""

from __future__ import annotations

from typing import Any

from bilayer_core.cli.terminal import print_table, say
from bilayer_core.studies.converge.order import ROUNDING
from bilayer_core.studies.converge.quantities import unit_of
from bilayer_core.studies.converge.study import BASE, FINER_STEP, FINEST_STEP, Row, Study

NO_ORDER = "none seen"


def errors_of(study: Study) -> dict[str, Any]:
    """Return the global error as it stands in the summary, in SI units; an order that was not seen is None."""
    figures = {
        row.name: {
            "value": row.values[BASE],
            "finer": row.values[FINER_STEP],
            "error": row.time.bar,
            "order": row.time.order,
            **({"finest": row.values[FINEST_STEP]} if FINEST_STEP in row.values else {}),
        }
        for row in study.rows
    }
    return {"figures": figures, "missing": study.missing, "unseen": list(study.unseen)}


def print_errors(study: Study) -> None:
    """Print it, one line a figure."""
    finest = any(FINEST_STEP in row.values for row in study.rows)
    levels = (BASE, FINER_STEP, FINEST_STEP) if finest else (BASE, FINER_STEP)

    def texts(row: Row) -> tuple[str, ...]:
        unit, factor = unit_of(row.name)
        values = (f"{factor * row.values[run]:.6g} {unit}" for run in levels)
        return row.name, *values, f"± {factor * row.time.bar:.2g} {unit}", _order(row)

    print_table(("global error", "value", *levels[1:], "error", "order"), map(texts, study.rows))
    for name, reason in study.missing.items():
        say(f"  {name}: {reason}")
    say("  Of the time steps alone; `bilayer converge` adds the mesh. Contact begins and ends within a step.")
    for text in study.unseen:
        say(f"  Not seen: {text}.")
    if any(_order(row) == NO_ORDER for row in study.rows):
        say(
            "  Where no order is seen, runs at twice, once and half the step do not close in on a limit: the error is\n"
            "  six times their last change, and no bound where motion is chaotic or can go two ways."
        )


def _order(row: Row) -> str:
    if row.time.order is not None:
        return f"{row.time.order:.2f}"
    return NO_ORDER if abs(row.time.change) > ROUNDING else "–"

"""The energy budget of a run as a table."""

from __future__ import annotations

from typing import Any

from bilayer_core.cli.terminal import print_table

GROUPS = ("supplied", "stored", "lost")
SHARE_SHOWN = 1e-9  # of the largest row: what is smaller is rounding, and left out


def print_budget(budget: dict[str, Any]) -> None:
    """Print what `Simulator.budget` found, rows of nothing left out; shares are those of the largest row."""
    largest = max(abs(value) for group in GROUPS for value in budget[group].values())
    rows: list[tuple[str, float]] = []
    for group in GROUPS:
        rows.append((group, sum(budget[group].values())))
        rows += [(f"  {name}", of) for name, of in budget[group].items() if abs(of) > SHARE_SHOWN * largest]
    rows.append(("residual", budget["residual"]))
    texts = ((name, f"{of:.4e}", f"{100.0 * of / largest if largest > 0.0 else 0.0:.3g} %") for name, of in rows)
    print_table(("energy budget", "energy [J]", "of the largest"), texts)

"""The energy budget of a run as a table."""

from __future__ import annotations

from typing import Any

GROUPS = ("supplied", "stored", "lost")
SHARE_SHOWN = 1e-9  # of the largest row: what is smaller is rounding, and left out


def print_budget(budget: dict[str, Any]) -> None:
    """Print what `Simulator.budget` found, rows of nothing left out; shares are those of the largest row."""
    from rich.console import Console
    from rich.table import Table

    largest = max(abs(value) for group in GROUPS for value in budget[group].values())
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("energy budget")
    table.add_column("energy [J]", justify="right")
    table.add_column("of the largest", justify="right")

    def add(name: str, value: float) -> None:
        share = 100.0 * value / largest if largest > 0.0 else 0.0
        table.add_row(name, f"{value:.4e}", f"{share:.3g} %")

    for group in GROUPS:
        add(group, sum(budget[group].values()))
        for name, value in budget[group].items():
            if abs(value) > SHARE_SHOWN * largest:
                add(f"  {name}", value)
    add("residual", budget["residual"])
    Console(width=120).print(table)

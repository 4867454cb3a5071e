"""Output of verbs: their own words, with names and texts from files in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import click

from bilayer_core.printable import printable


def say(text: object, err: bool = False) -> None:
    """Print text in which a terminal finds nothing to obey; see `bilayer_core.printable`."""
    click.echo(printable(str(text)), err=err)


def say_start(time: float, asked: float) -> None:
    """Say at which logged step a run begins that was to begin at another time [s], if it is another."""
    if f"{time:.9g}" != f"{asked:.9g}":
        say(f"begins at t = {time:.9g} s, where the last logged step before t = {asked:.9g} s ended", err=True)


def print_table(titles: Sequence[str], rows: Iterable[Sequence[str]], width: int = 120) -> None:
    """Print a table without a frame: texts in the first column, numbers in the others."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for place, title in enumerate(titles):
        table.add_column(title, justify="right" if place else "left")
    for row in rows:
        table.add_row(*row)
    Console(width=width).print(table)

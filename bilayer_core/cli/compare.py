"""The verb ``compare``."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from bilayer_core.cli.options import Verb

WIDTHS = (44, 18, 14)
"""Of the table's columns but the last."""


@click.command(cls=Verb)
@click.argument("first", metavar="A.mcap")
@click.argument("second", metavar="B.mcap")
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
@click.option("--all", "everything", is_flag=True, help="Also quantities that are equal.")
def compare(first: str, second: str, as_json: bool, everything: bool) -> None:
    """Say what two runs differ by: the largest difference of each quantity, and when.

    Logs with other times are compared over the time that both have, the second one interpolated.
    """
    from bilayer_core.record.compare import compare, rows

    found = compare(first, second)
    if as_json:
        click.echo(json.dumps({"equal": found.equal, **asdict(found)}, indent=2))
        return
    click.echo(f"t = {found.span[0]:g} to {found.span[1]:g} s, {len(found.differences)} quantities")
    for run, names in zip((first, second), found.only, strict=True):
        if names:
            click.echo(f"only in {run}: {', '.join(names)}")
    told = [row for row in rows(found) if everything or float(row[2]) > 0.0]
    if not told:
        click.echo("equal to the last bit of the logs")
        return
    for row in (("quantity", "largest difference", "part of range", "at"), *told):
        click.echo("  ".join(f"{text:{width}}" for text, width in zip(row, (*WIDTHS, 0), strict=True)).rstrip())

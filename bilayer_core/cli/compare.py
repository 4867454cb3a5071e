"""The verb ``compare``."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from bilayer_core.cli.json_output import STANDARD_OUTPUT, json_option, json_to
from bilayer_core.cli.options import DIFFERS, Verb, say_renamed
from bilayer_core.cli.terminal import say

if TYPE_CHECKING:
    from bilayer_core.log.run.compare import Comparison

WIDTHS = (44, 18, 14)
"""Of the table's columns but the last."""


class Compare(Verb):
    """Takes ``--json`` without a value too, as earlier releases did."""

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Give ``--json`` without a value the one that it meant."""
        arguments = list(args)
        for place, argument in enumerate(arguments):
            following = arguments[place + 1 : place + 2]
            bare = not following or following[0].lower().endswith(".mcap")
            if argument == "--json" and (bare or following[0].startswith("--")):
                say_renamed("--json without a value", "--json -")
                arguments.insert(place + 1, STANDARD_OUTPUT)
                break
        return super().parse_args(context, arguments)


@click.command(cls=Compare)
@click.argument("first", metavar="A.mcap|BAG")
@click.argument("second", metavar="B.mcap|BAG")
@json_option("Write all differences")
@click.option("--all", "everything", is_flag=True, help="Also quantities that are equal.")
def compare(first: str, second: str, json_file: str | None, everything: bool) -> int:
    """Say what two runs differ by: the largest difference of each quantity, and when.

    Logs with other times are compared over the time that both have, the second one interpolated. Exit code 1 if
    anything differs, or one run is longer.
    """
    from bilayer_core.log.run.compare import compare, rows

    with json_to(json_file) as write_json:
        found = compare(first, second)
        write_json(json.dumps({"equal": found.equal, **asdict(found)}, indent=2))
        _tell(found, first, second, rows(found), everything)
    return 0 if found.equal else DIFFERS


def _tell(found: Comparison, first: str, second: str, all_rows: list, everything: bool) -> None:
    say(f"t = {found.span[0]:g} to {found.span[1]:g} s, {len(found.differences)} quantities")
    for run, (begin, end) in zip((first, second), found.spans, strict=True) if not found.as_long else ():
        say(f"{run} has t = {begin:g} to {end:g} s")
    for run, names in zip((first, second), found.only, strict=True):
        if names:
            say(f"only in {run}: {', '.join(names)}")
    told = [row for row in all_rows if everything or float(row[2]) > 0.0]
    if not told:
        say("equal to the last bit of the logs" + ("" if found.as_long else ", as far as both go"))
        return
    for row in (("quantity", "largest difference", "part of range", "at"), *told):
        say("  ".join(f"{text:{width}}" for text, width in zip(row, (*WIDTHS, 0), strict=True)).rstrip())

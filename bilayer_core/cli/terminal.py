"""Output of verbs: their own words, with names and texts from files in them."""

from __future__ import annotations

import click

from bilayer_core.printable import printable


def say(text: object, err: bool = False) -> None:
    """Print text in which a terminal finds nothing to obey; see `bilayer_core.printable`."""
    click.echo(printable(str(text)), err=err)

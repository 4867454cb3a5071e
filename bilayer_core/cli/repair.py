"""The verb ``repair``."""

from __future__ import annotations

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.terminal import say


@click.command(cls=Verb)
@click.argument("log", metavar="LOG.mcap")
@click.argument("new", metavar="NEW.mcap")
@click.option("--force", is_flag=True, help="Replace an existing file.")
def repair(log: str, new: str, force: bool) -> None:
    """Make a log that every reader opens of one that was cut off or is damaged.

    All that is whole is kept; says what was kept and what was lost. A whole log is copied as it is.
    """
    from bilayer_core.log.file.repair import repair

    say(repair(log, new, force))
    say(f"log  {new}")

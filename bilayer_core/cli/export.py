"""The verb ``export``."""

from __future__ import annotations

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.terminal import say
from bilayer_core.errors import InputError

TABLE = "A table FILE{0} of all but nodes of rods, or a directory with a file of each quantity."


@click.command(cls=Verb)
@click.argument("log", metavar="LOG.mcap|BAG")
@click.argument("quantities", metavar="[QUANTITY]...", nargs=-1)
@click.option("--csv", metavar="OUT", help=TABLE.format(".csv"))
@click.option("--parquet", metavar="OUT", help=TABLE.format(".parquet"))
@click.option("--npz", metavar="OUT.npz", help="Arrays by name, with `time`, `shape_time`, `units` and `labels`.")
@click.option("--force", is_flag=True, help="Replace existing files.")
def export(
    log: str, quantities: tuple[str, ...], csv: str | None, parquet: str | None, npz: str | None, force: bool
) -> None:
    """Write quantities of a log for other tools: all, or those named, such as com or 'energy/*'.

    Units stand in the first line of csv files (com.z [m]), in the metadata of parquet files, and in npz under `units`.
    What is of the nodes of a rod has a row for each node at each time.
    """
    from bilayer_core.log.run.export import CSV, NPZ, PARQUET, export

    wanted = {CSV: csv, PARQUET: parquet, NPZ: npz}
    if not any(wanted.values()):
        raise InputError("export: say what to write: --csv OUT, --parquet OUT or --npz OUT.npz")
    for kind, out in wanted.items():
        if out:
            names = export(log, out, kind, quantities, force)
            told = names[0] if len(names) == 1 else f"{len(names)} quantities"
            say(f"{kind[1:]:9}{out}  ({told})")

"""The verb ``sweep``."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.watch import compile_kernels, runs_bar

DEFAULT_DIRECTORY = "runs/sweep"


def workers_option(function: Any) -> Any:
    """The options ``--workers`` and ``--scheduler``."""
    function = click.option(
        "--scheduler", metavar="ADDRESS", help="Run on the workers of a Dask cluster: tcp://host:8786."
    )(function)
    return click.option("--workers", type=click.IntRange(1), help="Processes of this machine; default: one a core.")(
        function
    )


def _list_bundled(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if not wanted:
        return
    from bilayer_core.cli.scenes import titles
    from bilayer_core.scene.bundled import bundled_sweeps

    click.echo(titles(bundled_sweeps()))
    context.exit()


@click.command(cls=Verb)
@click.argument("file", metavar="SWEEP")
@click.option("--out", metavar="DIR", default=DEFAULT_DIRECTORY, show_default=True, help="Where results are written.")
@workers_option
@click.option("--resume", is_flag=True, help="Make the runs that are missing in DIR, and none twice.")
@click.option("--force", is_flag=True, help="Replace the results in DIR.")
@click.option("--plot", "plotted", is_flag=True, help="Draw the results, as well as those that are there already.")
@click.option("--list", "listed", is_flag=True, help="Show the runs, and make none.")
@click.option(
    "--bundled",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_list_bundled,
    help="List the sweeps that come with the simulator.",
)
@click.option("--quiet", is_flag=True, help="No progress.")
def sweep(
    file: str,
    out: str,
    workers: int | None,
    scheduler: str | None,
    resume: bool,
    force: bool,
    plotted: bool,
    listed: bool,
    quiet: bool,
) -> None:
    """Make many runs of a scene with other values, as SWEEP says: a file, or the name of a bundled one.

    Writes DIR/results.sqlite as results come, then DIR/results.parquet: a row for each run, also for one that could
    not go on, with its reason. Killed at any moment, --resume makes what is missing.
    """
    from bilayer_core.extras import require
    from bilayer_core.sweeps.design import count_of
    from bilayer_core.sweeps.journal import Journal
    from bilayer_core.sweeps.result import write_table
    from bilayer_core.sweeps.run import read_sweep, run_missing

    refuse_both(workers, scheduler)
    directory = Path(out)
    read = read_sweep(file, directory)
    if listed:
        _list(read)
        return
    require("sweep", "dask", "distributed", "pyarrow", *(["matplotlib"] if plotted else []))
    compile_kernels(quiet)
    with Journal(directory, read.content, resume=resume, force=force) as journal:
        keys = read.keys()
        there = len(journal.keys() & keys)
        if resume and not quiet:
            click.echo(f"{there} of {len(keys)} runs are there", err=True)
        try:
            with ExitStack() as stack, runs_bar(count_of(read.spec), there, quiet) as show:
                for rows in run_missing(read, journal, stack, workers, scheduler, teller(quiet)):
                    for row in rows:
                        show(row.outcome.value)
        finally:
            table = write_table(journal, keys, read.about, directory)
        result = read.result(journal)
        click.echo(", ".join(f"{count} {outcome}" for outcome, count in result.outcomes.items()) or "no runs")
        for line in reasons(result):
            click.echo(f"  {line}")
        click.echo(f"wrote {table}")
        if plotted:
            from bilayer_core.sweeps.plots import draw

            for path in draw(result, directory):
                click.echo(f"wrote {path}")


def refuse_both(workers: int | None, scheduler: str | None) -> None:
    """Raise UsageError if processes of this machine and those of a cluster are asked for."""
    if workers is not None and scheduler is not None:
        raise click.UsageError("--workers counts processes of this machine; a cluster (--scheduler) has its own")


def teller(quiet: bool) -> Any:
    """What tells the user where runs are made."""

    def tell(engine: Any) -> None:
        if not quiet:
            dashboard = f"; dashboard {engine.dashboard}" if engine.dashboard else ""
            click.echo(f"{engine.where}, {engine.threads} runs side by side{dashboard}", err=True)

    return tell


def _list(read: Any) -> None:
    names = [name + (f" [{read.job.units[name]}]" if name in read.job.units else "") for name in read.job.paths]
    click.echo("\t".join(["number", *names]))
    for point in read.points():
        click.echo("\t".join([str(point.number), *(f"{value}" for value in point.parameters.values())]))


def reasons(result: Any, most: int = 5) -> list[str]:
    """Lines about runs that are not done: the commonest reasons, each with how many."""
    from collections import Counter

    counted: Counter[str] = Counter()
    numbers: dict[str, int] = {}
    for row in result.rows:
        if row.outcome != "done":
            text = f"{row.outcome.value}: {row.reason.splitlines()[0] if row.reason else ''}"[:160]
            counted[text] += 1
            numbers.setdefault(text, row.number)
    told = [f"{count} times, first run {numbers[text]}: {text}" for text, count in counted.most_common(most)]
    return [*told, f"and {len(counted) - most} other reasons"] if len(counted) > most else told

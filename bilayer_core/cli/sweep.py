"""The verb ``sweep``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.terminal import say
from bilayer_core.cli.watch import compile_kernels, runs_bar
from bilayer_core.printable import shortened

DEFAULT_DIRECTORY = "runs/sweep"


PROCESSES = (
    click.option("--workers", type=click.IntRange(1), help="Processes of this machine; default: one a core."),
    click.option("--dashboard", is_flag=True, help="Serve Dask's dashboard on 127.0.0.1, to any user of this machine."),
    click.option("--scheduler", metavar="ADDRESS", help="Run on the workers of a Dask cluster: tls://host:8786."),
    click.option("--tls-ca-file", metavar="FILE", help="Certificate of the authority that the cluster trusts (PEM)."),
    click.option("--tls-cert", metavar="FILE", help="Own certificate for the cluster (PEM)."),
    click.option("--tls-key", metavar="FILE", help="Its private key (PEM), unless the file of --tls-cert has it."),
)


def processes_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say where runs are made; the function gets them as the mapping `processes`.

    Its keys are those arguments of `bilayer_core.sweep` that say where runs are made.
    """

    @wraps(function)
    def wrapper(
        *,
        workers: int | None,
        dashboard: bool,
        scheduler: str | None,
        tls_ca_file: str | None,
        tls_cert: str | None,
        tls_key: str | None,
        **others: Any,
    ) -> Any:
        certificates = tls_ca_file, tls_cert, tls_key
        _refuse_contradictions(workers, dashboard, scheduler, certificates)
        processes = {"workers": workers, "scheduler": scheduler, "dashboard": dashboard}
        if any(certificates):
            processes["security"] = _security_of(*certificates)
        return function(processes=processes, **others)

    for option in reversed(PROCESSES):
        wrapper = option(wrapper)
    return wrapper


def _refuse_contradictions(
    workers: int | None, dashboard: bool, scheduler: str | None, certificates: tuple[str | None, ...]
) -> None:
    if workers is not None and scheduler is not None:
        raise click.UsageError("--workers counts processes of this machine; a cluster (--scheduler) has its own")
    if dashboard and scheduler is not None:
        raise click.UsageError("--dashboard is for processes of this machine; a cluster (--scheduler) has its own")
    if any(certificates) and scheduler is None:
        raise click.UsageError("--tls-ca-file, --tls-cert and --tls-key are for a cluster (--scheduler)")


def _security_of(*certificates: str | None) -> Any:
    from bilayer_core.studies.sweeps.certificates import security_of

    return security_of(*certificates)


def _list_bundled(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if not wanted:
        return
    from bilayer_core.cli.scenes import titles
    from bilayer_core.scene.bundled import bundled_sweeps

    say(titles(bundled_sweeps()))
    context.exit()


@click.command(cls=Verb)
@click.argument("file", metavar="SWEEP")
@click.option("--out", metavar="DIR", default=DEFAULT_DIRECTORY, show_default=True, help="Where results are written.")
@processes_options
@click.option("--resume", is_flag=True, help="Make the runs that are missing in DIR, and none twice.")
@click.option("--force", is_flag=True, help="Replace the results in DIR.")
@click.option("--plot", "plotted", is_flag=True, help="Draw the results, as well as those that are there already.")
@click.option("--list", "listed", is_flag=True, help="Show the runs, and make none; runs no Python code.")
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
    processes: dict[str, Any],
    resume: bool,
    force: bool,
    plotted: bool,
    listed: bool,
    quiet: bool,
) -> None:
    """Make many runs of a scene with other values, as SWEEP says: a file, or the name of a bundled one.

    SWEEP is a program: this runs the Python files that it names. Look at those of others first; --list runs none.

    Writes DIR/results.sqlite as results come, then DIR/results.parquet: a row for each run, also for one that could
    not go on, with its reason. Killed at any moment, --resume makes what is missing.
    """
    from bilayer_core.extras import require
    from bilayer_core.studies.sweeps.design import count_of
    from bilayer_core.studies.sweeps.journal import Journal
    from bilayer_core.studies.sweeps.open_processes import Processes
    from bilayer_core.studies.sweeps.run_sweep import read_sweep, run_missing
    from bilayer_core.studies.sweeps.sweep_result import TABLE

    directory = Path(out)
    read = read_sweep(file, directory, run_code=not listed)
    if listed:
        _list(read)
        return
    require("sweep", "dask", "distributed", "pyarrow", *(["matplotlib"] if plotted else []))
    compile_kernels(quiet)
    with Journal(directory, read.content, resume=resume, force=force) as journal:
        keys = read.keys()
        there = len(journal.keys() & keys)
        if resume and not quiet:
            say(f"{there} of {len(keys)} runs are there", err=True)
        with runs_bar(count_of(read.spec), there, quiet) as show:
            result = run_missing(
                read, journal, directory, Processes(**processes), lambda row: show(row.outcome.value), teller(quiet)
            )
        say(", ".join(f"{count} {outcome}" for outcome, count in result.outcomes.items()) or "no runs")
        for line in reasons(result):
            say(f"  {line}")
        say(f"wrote {directory / TABLE}")
        if plotted:
            from bilayer_core.studies.sweeps.plots import draw

            for path in draw(result, directory):
                say(f"wrote {path}")


def teller(quiet: bool) -> Any:
    """Return what tells the user where runs are made, and who else can get there."""

    def tell(engine: Any) -> None:
        if not quiet:
            dashboard = f"; dashboard {engine.dashboard}" if engine.dashboard else ""
            say(f"{engine.where}, {engine.threads} runs side by side{dashboard}", err=True)
        for notice in engine.notices:
            say(notice, err=True)

    return tell


def _list(read: Any) -> None:
    names = [name + (f" [{read.job.units[name]}]" if name in read.job.units else "") for name in read.job.paths]
    click.echo("\t".join(["number", *map(shortened, names)]))
    for point in read.points():
        click.echo("\t".join([str(point.number), *(shortened(f"{value}") for value in point.parameters.values())]))


def reasons(result: Any, most: int = 5) -> list[str]:
    """Return the lines about runs that are not done: the commonest reasons, each with how many."""
    counted: Counter[str] = Counter()
    numbers: dict[str, int] = {}
    for row in result.rows:
        if row.outcome != "done":
            text = f"{row.outcome.value}: {row.reason.splitlines()[0] if row.reason else ''}"[:160]
            counted[text] += 1
            numbers.setdefault(text, row.number)
    told = [f"{count} times, first run {numbers[text]}: {text}" for text, count in counted.most_common(most)]
    return [*told, f"and {len(counted) - most} other reasons"] if len(counted) > most else told

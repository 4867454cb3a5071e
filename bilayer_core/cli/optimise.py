"""The verb ``optimise``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.sweep import processes_options, teller
from bilayer_core.cli.terminal import say
from bilayer_core.cli.watch import compile_kernels, runs_bar

DEFAULT_DIRECTORY = "runs/optimise"
NOT_CONFIRMED = 1


@click.command(cls=Verb)
@click.argument("file", metavar="SWEEP")
@click.option("--maximise", metavar="METRIC", help="Search for its largest value.")
@click.option("--minimise", metavar="METRIC", help="Search for its least value.")
@click.option(
    "--method",
    type=click.Choice(["search", "gradients"]),
    default="search",
    show_default=True,
    help="How values are chosen: by Optuna, or along derivatives of runs.",
)
@click.option("--trials", type=click.IntRange(1), default=100, show_default=True, help="Runs, resumed ones included.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the search.")
@click.option("--out", metavar="DIR", default=DEFAULT_DIRECTORY, show_default=True, help="Where results are written.")
@processes_options
@click.option("--resume", is_flag=True, help="Continue with the runs in DIR.")
@click.option("--force", is_flag=True, help="Replace the results in DIR.")
@click.option("--plot", "plotted", is_flag=True, help="Draw the results.")
@click.option("--quiet", is_flag=True, help="No progress.")
def optimise(
    file: str,
    maximise: str | None,
    minimise: str | None,
    out: str,
    processes: dict[str, Any],
    plotted: bool,
    quiet: bool,
    **settings: Any,
) -> int:
    """Search for the values of the parameters of SWEEP with the best METRIC (docs/sweeps.md).

    SWEEP is a file, or the name of a bundled one: `bilayer sweep --bundled` lists them. SWEEP is a program: this
    runs the Python files that it names. Look at those of others first; `bilayer sweep SWEEP --list` runs none.

    The best run is made again at a tenth of the tolerance: exit code 1 if its metric differs by more than 2 %. Writes
    results as `bilayer sweep` does, and DIR/best.yaml, a scene for `bilayer run`.
    """
    from bilayer_core.extras import require
    from bilayer_core.studies.sweeps import optimise as search
    from bilayer_core.studies.sweeps.plots import draw
    from bilayer_core.studies.sweeps.sweep_result import read_results

    if (maximise is None) == (minimise is None):
        raise click.UsageError("give --maximise METRIC or --minimise METRIC")
    chooser = ["optuna"] if settings["method"] == "search" else []
    require("optimise", "dask", "distributed", *chooser, "pyarrow", *(["matplotlib"] if plotted else []))
    compile_kernels(quiet)
    with runs_bar(settings["trials"], 0, quiet) as show:
        optimum = search.optimise(
            file,
            maximise or minimise or "",
            largest=maximise is not None,
            out=out,
            **processes,
            **settings,
            progress=lambda row: show(row.outcome.value),
            tell=teller(quiet),
        )
    for line in lines(optimum):
        say(line)
    say(f"wrote {Path(out) / search.BEST}")
    say(f"wrote {Path(out) / 'results.parquet'}")
    if plotted:
        for path in draw(read_results(out), Path(out)):
            say(f"wrote {path}")
    return 0 if optimum.is_confirmed else NOT_CONFIRMED


def lines(optimum: Any) -> list[str]:
    """Return the result of a search as lines of text."""
    told = [f"best of {optimum.trials} runs: {optimum.metric} {optimum.value:.6g} (run {optimum.best.number})"]
    if optimum.start is not None:
        ratio = f", {optimum.value / optimum.start:.3g} times that" if optimum.start > 0.0 < optimum.value else ""
        told[0] += f"; at the start {optimum.start:.6g}{ratio}"
    for name, value in optimum.best.parameters.items():
        shown = f"{value:.6g}" if isinstance(value, float) else f"{value}"
        end = ", at an end of its range: a wider one may have better" if name in optimum.at_end else ""
        told.append(f"  {name} {shown} {optimum.units.get(name, '')}".rstrip() + end)
    if optimum.confirmed is None:
        told.append("NOT confirmed: the run with finer steps could not be made")
    else:
        word = "confirmed" if optimum.is_confirmed else "NOT confirmed"
        told.append(f"{word} with finer steps: {optimum.confirmed:.6g} ({100.0 * optimum.difference:+.2g} %)")
    return told

"""The verb ``bench``."""

from __future__ import annotations

import click

from bilayer_core.cli.options import Verb, output_directory
from bilayer_core.cli.watch import count_bar

DEFAULT_DIRECTORY = "runs/bench"


@click.command(cls=Verb)
@click.option("--quick", is_flag=True, help="Fewer problems, meshes and steps: about 3 minutes.")
@click.option("--out", metavar="DIR", default=DEFAULT_DIRECTORY, show_default=True, help="Where results are written.")
@click.option(
    "--only", multiple=True, metavar="NAME", help="A problem, peers, scaling, start or commands; may be repeated."
)
@click.option("--list", "listing", is_flag=True, help="List the parts, and measure nothing.")
@click.option("--resume", is_flag=True, help="Continue in DIR, on the same machine with the same versions.")
@click.option("--force", is_flag=True, help="Replace what is in DIR.")
@click.option("--references", is_flag=True, help="Compute converged references of the problems and store them.")
@click.option("--quiet", is_flag=True, help="No progress.")
def bench(
    quick: bool,
    out: str,
    only: tuple[str, ...],
    listing: bool,
    resume: bool,
    force: bool,
    references: bool,
    quiet: bool,
) -> None:
    """Measure run time against error: models, integrators, steps and meshes, and other programs beside them.

    Writes DIR/bench.json, and tables (csv, Markdown) and plots (png) beside it. CPU times are those of one thread,
    without compilation; other work on the machine disturbs them, so its load is recorded.
    """
    from bilayer_core.extras import require
    from bilayer_core.verification.bench import run_benchmark
    from bilayer_core.verification.bench.results import Results

    chosen = run_benchmark.chosen_names(only, quick)
    if listing:
        _list(chosen)
        return
    if references:
        _make_references(run_benchmark.chosen_problems(chosen))
        return
    require("bench", "matplotlib")
    directory = output_directory(out)
    results = Results(directory, quick, resume, force)
    with count_bar(run_benchmark.count(chosen, quick), quiet) as show:
        skipped = run_benchmark.measure(chosen, results, quick, show)
    for line in skipped:
        click.echo(line)
    for path in run_benchmark.write(results, directory):
        click.echo(f"wrote {path}")
    _conclude(results.content)


def _list(chosen: list[str]) -> None:
    from bilayer_core.verification.bench.problems import PROBLEMS

    titles = {problem.name: problem.title for problem in PROBLEMS} | {
        "peers": "The cantilever by programs that install from PyPI",
        "scaling": "CPU time of a step against nodes",
        "start": "First step of a new process, kernels compiled and from the cache",
        "commands": "Robots under a controller that acts every 40 ms",
    }
    for name in chosen:
        click.echo(f"{name:12}{titles[name]}")


def _make_references(problems: list) -> None:
    from bilayer_core.verification.bench import converged_answers
    from bilayer_core.verification.bench.configurations import shapes

    for problem in problems:
        for model in dict.fromkeys(model for model, _ in shapes(problem.config())):
            entry = converged_answers.make(problem, model, lambda text: click.echo(f"  {text}", err=True))
            checks = ", ".join(f"{name} {difference:.1e} away" for name, difference in entry["checks"].items())
            click.echo(f"{problem.name}, {model}: order {entry['order']}, error bar {entry['bar']:.1e}; {checks}")
    click.echo(f"wrote {converged_answers.FILE}")


def _conclude(content: dict) -> None:
    if content["recommended"]:
        choice = content["recommended"]
        click.echo(f"recommended: {choice['model']} {choice['dimension']}-D, {choice['integrator']}")
    for name, slope in content["slopes"].items():
        click.echo(f"scaling of {name}: slope {slope:.2f}")

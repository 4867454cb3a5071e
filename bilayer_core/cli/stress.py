"""The verb ``stress``."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click

from bilayer_core.cli.options import Verb
from bilayer_core.cli.watch import compile_kernels
from bilayer_core.errors import InputError

FAILED = 1


@click.command(cls=Verb)
@click.option("--quick", is_flag=True, help="A seeded choice of 100 short cases, in about three minutes.")
@click.option("--only", multiple=True, metavar="PATTERN", help="Cases of this name, such as 'torture/*' or 'dt/*/drop/*'.")
@click.option("--list", "listed", is_flag=True, help="Name the cases, and why those outside the region of validity are.")
@click.option("--resume", is_flag=True, help="Go on with the results in --out.")
@click.option("--out", metavar="DIR", default="runs/stress", show_default=True, help="Results, report and figures.")
@click.option("--json", "json_file", metavar="FILE.json", help="Write all results.")
@click.option("--workers", type=click.IntRange(1), help="Processes; default: one a core.")
@click.option("--no-shrink", is_flag=True, help="Do not make failures smaller.")
@click.option("--quiet", is_flag=True, help="No progress.")
def stress(
    quick: bool,
    only: tuple[str, ...],
    listed: bool,
    resume: bool,
    out: str,
    json_file: str | None,
    workers: int | None,
    no_shrink: bool,
    quiet: bool,
) -> None:
    """Run hard cases and judge every step of them; exit code 1 if one fails."""
    from bilayer_core.record.paths import check_output_path
    from bilayer_core.stress import report
    from bilayer_core.stress.cases import all_cases, quick_names
    from bilayer_core.stress.journal import Journal, head_of
    from bilayer_core.stress.pool import run_cases

    cases = all_cases()
    names = _chosen(only, quick_names() if quick else cases.keys(), list(cases))
    if listed:
        for name in names:
            click.echo(f"{name}  {'; '.join(cases[name].outside)}".rstrip())
        return 0
    if json_file:
        check_output_path(json_file, force=True)
    journal = Journal(Path(out), head_of({name: cases[name] for name in names}), resume)
    left = [name for name in names if name not in journal.records]
    compile_kernels(quiet)
    with _Progress(len(left), quiet) as progress:

        def done(record) -> None:
            journal.add(record)
            progress.tell(record)

        run_cases(left, workers or len(os.sched_getaffinity(0)), done)
    return _finish(journal, Path(out), json_file, shrink=not no_shrink)

"""The verb ``stress``."""

from __future__ import annotations

import json
from typing import Any

import click

from bilayer_core.cli.json_output import json_option, json_to
from bilayer_core.cli.options import Verb, output_directory
from bilayer_core.cli.terminal import say
from bilayer_core.cli.watch import compile_kernels, count_bar

FAILED = 1
DEFAULT_DIRECTORY = "runs/stress"


@click.command(cls=Verb)
@click.option("--quick", is_flag=True, help="A seeded choice of 100 short cases: about three minutes.")
@click.option("--only", multiple=True, metavar="PATTERN", help="Cases of this name: 'torture/*', 'dt/*/drop/*'.")
@click.option("--scene", "scenes", multiple=True, metavar="FILE.yaml", help="Judge a scene of your own instead.")
@click.option("--list", "listed", is_flag=True, help="Name the cases and why they are outside the region of validity.")
@click.option("--resume", is_flag=True, help="Continue with the results in DIR.")
@click.option("--out", metavar="DIR", default=DEFAULT_DIRECTORY, show_default=True, help="Where results are written.")
@json_option("Write all results to one file")
@click.option("--workers", type=click.IntRange(1), help="Cases side by side; default: one a core.")
@click.option("--shrink/--no-shrink", default=True, show_default=True, help="Make the scenes of failures smaller.")
@click.option("--quiet", is_flag=True, help="No progress.")
def stress(
    quick: bool,
    only: tuple[str, ...],
    scenes: tuple[str, ...],
    listed: bool,
    resume: bool,
    out: str,
    json_file: str | None,
    workers: int | None,
    shrink: bool,
    quiet: bool,
) -> int:
    """Run hard cases, and judge every step of them.

    Each case ends accurate, stable, refused with a reason, or FAILED. Writes DIR/results.jsonl as results come, then
    a report (stability.md), figures, and the scenes of failures and of the worst cases. Exit code 1 if one fails.
    """
    from bilayer_core.extras import require
    from bilayer_core.processes import usable_cores
    from bilayer_core.verification.stress import stability_page
    from bilayer_core.verification.stress.journal import Journal, head_of
    from bilayer_core.verification.stress.stress_test import chosen_cases, measure, write

    workers = workers or usable_cores()
    cases = chosen_cases(only, quick, scenes)
    if listed:
        _list(cases)
        return 0
    require("stress", "matplotlib")
    directory = output_directory(out)
    journal = Journal(directory, head_of(cases), resume)
    with json_to(json_file) as write_json:
        compile_kernels(quiet)
        with count_bar(len(cases) - len(journal.records), quiet) as show:
            measure(cases, journal, workers, lambda record: _tell(record, show))
        for path in write(cases, journal, directory, shrink):
            say(f"wrote {path}")
        records = list(journal.records.values())
        write_json(_as_json(journal))
        for line in stability_page.summary_lines(records):
            say(line)
        for line in stability_page.shortfalls(records):
            say(line)
    return FAILED if any(record.outcome == "FAILED" for record in records) else 0


def _tell(record: Any, show: Any) -> None:
    show(record.name)
    if record.outcome == "FAILED":
        say(f"FAILED  {record.name}: {record.reason.splitlines()[0]}")


def _list(cases: dict) -> None:
    for name, case in cases.items():
        say(f"{name}  [outside: {'; '.join(case.outside)}]" if case.outside else name)


def _as_json(journal: Any) -> str:
    content = journal.head | {"results": [json.loads(record.line()) for record in journal.records.values()]}
    return json.dumps(content, indent=1)

"""The verb ``validate``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from bilayer_core.cli.json_output import json_option, json_to
from bilayer_core.cli.options import Verb, output_directory
from bilayer_core.cli.watch import compile_kernels

if TYPE_CHECKING:
    from bilayer_core.verification.validate.validation_case import Result

FAILED = 1
"""Exit code if a case fails."""
WIDTHS = (52, 13, 13, 9, 7, 6)
"""Of the table's columns; it is written line by line."""


@click.command(cls=Verb)
@click.option("--out", metavar="DIR", help="Write table (json, csv, Markdown) and figures into a directory.")
@json_option("Write the table")
@click.option("--only", metavar="PATTERN", help="Cases with this in their name; * and ? stand for anything.")
@click.option("--quick", is_flag=True, help="Leave out the cases that take long.")
@click.option("--list", "listing", is_flag=True, help="Say what each case is checked against, and compute nothing.")
def validate(out: str | None, json_file: str | None, only: str | None, quick: bool, listing: bool) -> int:
    """Compute the paper's validations and every other case with a known answer; exit code 1 if one fails."""
    from bilayer_core.extras import require
    from bilayer_core.verification.validate import case_register, case_report, paper_figures

    cases = case_register.select(only, quick)
    if listing:
        for case in cases:
            click.echo(f"{case.name:{WIDTHS[0]}}  {case.against}")
        return 0
    directory = None if out is None else output_directory(out)
    if directory is not None:
        require("--out: figures", "matplotlib")
    with json_to(json_file) as write_json:
        compile_kernels(quiet=False)
        _print_line(("case", "computed", "reference", "error", "limit", ""), "bold")
        results = case_register.run(cases, _print_result)
        write_json(case_report.as_json(results))
        if directory is not None:
            case_report.write_json(results, directory / "validation.json")
            case_report.write_csv(results, directory / "validation.csv")
            case_report.write_page(results, directory / "validation.md")
            for path in paper_figures.draw(cases, directory):
                click.echo(f"wrote {path}")
        failed = sum(not result.passed for result in results)
        cpu_time = sum(result.cpu_time for result in results)
        click.echo(f"{len(results)} cases, {failed} failed; {cpu_time:.1f} s of CPU, compilation included")
    return FAILED if failed else 0


def _print_result(result: Result) -> None:
    unit = "" if result.case.unit == "1" else f" {result.case.unit}"
    error = f"{result.error:.1e}" if math.isfinite(result.error) else "-"
    numbers = (f"{result.computed:.6g}{unit}", f"{result.reference:.6g}{unit}", error, f"{result.case.limit:g}")
    word = "pass" if result.passed else "FAIL"
    _print_line((result.case.name, *numbers, word), "green" if result.passed else "bold red")
    if result.message:
        click.echo(f"  {result.message}")


def _print_line(columns: tuple[str, ...], style: str) -> None:
    """Print the first column at the left, numbers at the right, and the last column in colour if this is a terminal."""
    from rich.console import Console
    from rich.text import Text

    first, *numbers, last = columns
    line = Text(f"{first:{WIDTHS[0]}}")
    for number, width in zip(numbers, WIDTHS[1:], strict=False):
        line.append(f"  {number:>{width}}")
    line.append(f"  {last}", style)
    Console(width=max(120, len(line) + 1), highlight=False).print(line, soft_wrap=True)

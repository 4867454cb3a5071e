"""JSON of verbs that tell something else as well: to a file, or to standard output, which then has nothing else."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout

import click

STANDARD_OUTPUT = "-"


def json_option(help: str) -> Callable:
    """Return the option ``--json``, which gives the argument `json_file`."""
    text = f"{help}; - is standard output, and all else goes to standard error."
    return click.option("--json", "json_file", metavar="FILE.json|-", help=text)


@contextmanager
def json_to(path: str | None, force: bool = True) -> Iterator[Callable[[str], None]]:
    """Yield a function that takes the text, once. If `path` is ``-``, all prints meanwhile go to standard error.

    Raises InputError at once if the file cannot be written, or is there and `force` is not given.
    """
    from bilayer_core.log.file.output_paths import check_output_path, write_text

    if path == STANDARD_OUTPUT:
        kept: list[str] = []
        try:
            with redirect_stdout(sys.stderr):
                yield kept.append
        finally:
            for text in kept:
                click.echo(text)
        return
    if path is not None:
        check_output_path(path, force, ".json")
    yield lambda text: None if path is None else write_text(path, text + "\n", force)

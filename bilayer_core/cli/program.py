"""The program itself: its verbs, and how each way of ending becomes an exit code and at most one message."""

from __future__ import annotations

import atexit
import gc
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import click

from bilayer_core.cli.bench import bench
from bilayer_core.cli.check import check
from bilayer_core.cli.compare import compare
from bilayer_core.cli.converge import converge
from bilayer_core.cli.design import design
from bilayer_core.cli.export import export
from bilayer_core.cli.fit import fit
from bilayer_core.cli.info import info
from bilayer_core.cli.new import new
from bilayer_core.cli.optimise import optimise
from bilayer_core.cli.options import Settings, VerbGroup
from bilayer_core.cli.plot import plot
from bilayer_core.cli.render import render
from bilayer_core.cli.repair import repair
from bilayer_core.cli.replay import replay
from bilayer_core.cli.run import run
from bilayer_core.cli.scenes import scenes, schema
from bilayer_core.cli.signals import Signals
from bilayer_core.cli.stress import stress
from bilayer_core.cli.sweep import sweep
from bilayer_core.cli.terminal import say
from bilayer_core.cli.validate import validate
from bilayer_core.cli.view import view
from bilayer_core.errors import BilayerError
from bilayer_core.extras import is_optional, missing_library

INTERNAL_ERROR = 70
"""A fault of this program and not of its input; what sysexits.h calls EX_SOFTWARE."""
OBJECTS_BETWEEN_COLLECTIONS = 50_000
"""New objects after which Python looks for garbage. Libraries make 200,000 when they are imported, and hardly any is
garbage: with Python's own 700, that took a tenth of a start."""


def _show_version(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from bilayer_core import DISTRIBUTION, __version__

        click.echo(f"{DISTRIBUTION} {__version__}")
        context.exit()


@click.group(cls=VerbGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--version", is_flag=True, is_eager=True, expose_value=False, callback=_show_version, help="The version.")
def program() -> None:
    """Simulate bilayer soft robots.

    SCENE is a scene file, or the name of a bundled scene (bilayer scenes lists them).

    Exit codes: 0 done, 1 a check failed, 2 bad input, 3 the simulation could not go on or an output could not be
    written, 130 interrupted (SIGINT), 143 ended (SIGTERM).
    """


SIMULATES = (scenes, new, schema, check, run, converge, validate, bench, stress)
MANY = (sweep, fit, optimise, design)
OF_LOGS = (info, repair, export, compare, plot, replay, view, render)

for verb in (*SIMULATES, *MANY, *OF_LOGS):
    program.add_command(verb)


@contextmanager
def _seldom_collected() -> Iterator[None]:
    """Leave little time to the garbage collector while this lasts. At the end of the process, which frees all memory
    anyway, it takes none: there it went through all objects several times, which took as long as a third of a warm
    start.
    """
    before = gc.get_threshold()
    gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS, *before[1:])
    atexit.register(gc.freeze)
    try:
        yield
    finally:
        gc.set_threshold(*before)


@_seldom_collected()
def run_program(arguments: Sequence[str] | None, signals: Signals) -> int:
    """Run the command line, by default that of the process; return its exit code."""
    settings = Settings()
    try:
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_: say(f"warning: {message}", err=True)
            return program.main(arguments, prog_name="bilayer", standalone_mode=False, obj=settings) or 0
    except click.ClickException as error:
        error.show()
        return BilayerError.exit_code
    except SystemExit:
        return 0  # by which click tells that the reader of our output, such as `head`, has gone
    except BilayerError as error:
        _explain(settings, "\n  then ".join([str(error), *getattr(error, "__notes__", [])]))
        return error.exit_code
    except Exception as error:
        if signals.behind(error) is not None:
            raise
        if isinstance(error, ModuleNotFoundError) and is_optional(error.name or ""):
            _explain(settings, str(missing_library("this command", error.name)))
            return BilayerError.exit_code
        text = " ".join(f"{type(error).__name__}: {error}".split())
        _explain(settings, f"internal error: {text}\nPlease report it, with what the same command prints with --debug.")
        return INTERNAL_ERROR


def _explain(settings: Settings, message: str) -> None:
    """Print the message, after the traceback of the current exception if the user asked for it."""
    if settings.debug:
        traceback.print_exc()
    say(f"bilayer: {message}", err=True)

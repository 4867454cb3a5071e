"""Parts that the verbs share: the option --debug, types of times, directories of results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from bilayer_core.errors import InputError

DIFFERS = 1
"""Exit code if a run does not come out as it is in the log, two runs differ, or a log is not whole."""


@dataclass
class Settings:
    """Settings of the whole program."""

    debug: bool = False


def _remember_debug(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    settings = context.find_object(Settings)
    settings.debug = settings.debug or wanted
    if wanted:
        import logging

        logging.basicConfig(level=logging.INFO)


def _debug_option() -> click.Option:
    return click.Option(
        ["--debug"], is_flag=True, is_eager=True, expose_value=False, callback=_remember_debug, help="Show tracebacks."
    )


class Verb(click.Command):
    """A command that takes --debug after its name too.

    `old_spellings`: options of earlier releases that are not in the help, such as ``"--time"`` to ``"--at"``; they work
    on for this one, with a note.
    """

    def __init__(self, *arguments: Any, old_spellings: Mapping[str, str] | None = None, **settings: Any):
        super().__init__(*arguments, **settings)
        self.params.append(_debug_option())
        self._old_spellings = old_spellings or {}

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Replace old spellings, up to ``--``."""
        args = list(args)
        for place, argument in enumerate(args):
            if argument == "--":
                break
            name, equals, value = argument.partition("=")
            if name in self._old_spellings:
                new = self._old_spellings[name]
                say_renamed(name, new)
                args[place] = f"{new}{equals}{value}"
        return super().parse_args(context, args)


class VerbGroup(click.Group):
    """The program: verbs in the order in which they were added, and --debug before the verb."""

    def __init__(self, *arguments: Any, **settings: Any):
        super().__init__(*arguments, **settings)
        self.params.append(_debug_option())

    def list_commands(self, context: click.Context) -> list[str]:
        """Return the names of the verbs."""
        return list(self.commands)


class Rate(click.ParamType):
    """A rate above zero, in Hz or with a unit."""

    name = "rate"

    def convert(self, value: Any, param: click.Parameter | None, context: click.Context | None) -> float:
        """Return the rate [Hz]."""
        from pydantic import TypeAdapter, ValidationError

        from bilayer_core.scene.units import PositiveRate

        try:
            return TypeAdapter(PositiveRate).validate_python(value)
        except ValidationError as error:
            self.fail(f"found {value!r}; {error.errors()[0]['msg']}", param, context)


class Duration(click.ParamType):
    """A time above zero, in seconds or with a unit; with `from_zero` zero as well."""

    name = "time"

    def __init__(self, from_zero: bool = False):
        self._from_zero = from_zero

    def convert(self, value: Any, param: click.Parameter | None, context: click.Context | None) -> float:
        """Return the time [s]."""
        from pydantic import TypeAdapter, ValidationError

        from bilayer_core.scene.units import NonNegativeTime, PositiveTime

        try:
            return TypeAdapter(NonNegativeTime if self._from_zero else PositiveTime).validate_python(value)
        except ValidationError as error:
            fault = error.errors()[0]
            note = f", {fault['ctx']['note']}" if fault["ctx"]["note"] else ""
            self.fail(f"found {value!r}{note}; {fault['msg']}", param, context)


def say_renamed(old: str, new: str) -> None:
    """Tell on standard error that a spelling of earlier releases works for this one more."""
    click.echo(f"bilayer: {old} is {new} now; the old spelling goes with the next release", err=True)


def output_directory(out: str) -> Path:
    """Return the directory of ``--out``; create it if it does not exist. Raises InputError if it cannot be created."""
    directory = Path(out)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out: {out}: cannot be made a directory: {error.strerror or error}") from error
    return directory


scene_argument = click.argument("scene", metavar="SCENE")
set_option = click.option(
    "--set", "overrides", multiple=True, metavar="PATH=VALUE", help="Change a value of the scene: rods.arm.stations=100"
)


def named_numbers(option: str, texts: tuple[str, ...]) -> dict[str, float | None]:
    """Return the numbers by name, None where the schedule is to act."""
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            found[name] = None if value == "null" else float(value)
        except ValueError:
            equals = ""
        if not (equals and name):
            raise InputError(f"{option}: {text!r} is not allowed; it must be NAME=NUMBER or NAME=null")
    return found

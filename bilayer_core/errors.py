"""Exceptions that reach the user, each with the exit code of the command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from bilayer_core.printable import printable


class BilayerError(Exception):
    """Base of all errors raised on purpose by this package.

    Its message may quote a file, a topic or a file's name: as text it has no character that a terminal obeys.
    """

    exit_code = 2

    def __str__(self) -> str:
        return printable(Exception.__str__(self))  # a KeyError, which some are too, would show it as a literal


class SceneError(BilayerError):
    """A scene file, or an override of one of its values, is not acceptable.

    The message names the file, the key path, the value found and what is allowed.
    """


class InputError(BilayerError):
    """Another input is not acceptable: a path, a command-line value, a stimulus, a saved state."""


class UnknownName(InputError, KeyError):
    """There is nothing of this name; the message has the nearest names. As a KeyError it is what mappings raise."""


@contextmanager
def naming(source: object) -> Iterator[None]:
    """Let errors about what a file holds begin with its name; `source` is its path."""
    try:
        yield
    except BilayerError as error:
        if error.exit_code != BilayerError.exit_code or str(error).startswith(printable(f"{source}: ")):
            raise
        raise InputError(f"{source}: {error}") from error


class OutputError(BilayerError):
    """An output that could be begun could not be written: the disk is full, or fails."""

    exit_code = 3


class EngineError(BilayerError):
    """The processes that were to run simulations are gone, or are none that could."""

    exit_code = 3


class PenetrationError(SceneError):
    """A scene starts with a node behind a surface, or nearer to it than can be resolved."""


class ForceError(BilayerError):
    """A scene needs a force that is planned and that no term of the engine computes."""


@dataclass(frozen=True)
class Remedy:
    """Change that a user can make for a run to go on.

    Attributes
    ----------
    text : str
        In words.
    changes : dict
        New values by key paths of the scene, None for a key to leave out; empty where that is not for a program to do.
    """

    text: str
    changes: dict[str, float | str | None] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.text

    def overrides(self) -> tuple[str, ...]:
        """Return the changes as ``KEY=VALUE`` for ``--set``."""
        return tuple(f"{key}={'null' if value is None else value}" for key, value in self.changes.items())


class SimulationError(BilayerError):
    """The simulation could not go on; the last accepted state is kept.

    Attributes
    ----------
    reason : str
        What failed.
    time : float
        Simulated time of the last accepted step [s].
    remedy : Remedy or None
        What to change.
    """

    exit_code = 3

    def __init__(self, reason: str, time: float, remedy: Remedy | None = None):
        super().__init__(f"stopped at t = {time:.6g} s: {reason}{f'; remedy: {remedy}' if remedy else ''}")
        self.reason = reason
        self.time = time
        self.remedy = remedy

    def __reduce__(self) -> tuple[Any, ...]:
        """Reduce the error to what makes it again in another process."""
        return type(self), (self.reason, self.time, self.remedy)

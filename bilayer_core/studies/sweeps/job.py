"""Data that travel to the processes that run, and rows that come back."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any

from pydantic import TypeAdapter

from bilayer_core.scene.units import in_si
from bilayer_core.studies.sweeps.spec import Condition, Metric

DIGITS = 20
"""Of keys."""


class Outcome(StrEnum):
    """How a run ended; the value is what results have."""

    DONE = "done"
    STOPPED = "stopped"
    """The simulation could not go on."""
    REFUSED = "refused"
    """The scene with these values is not acceptable."""
    OVER_TIME = "over_time"
    """It took longer than it may."""
    KILLED = "killed"
    """Its process died, or was killed at its limits, each time that it was tried."""
    ERROR = "error"
    """A function of the sweep, or this program, has a fault."""


@dataclass(frozen=True)
class Code:
    """A Python function of a file, which travels as the text of that file.

    Attributes
    ----------
    name : str
    file, text : str
        Path of the file, for messages, and its content.
    """

    name: str
    file: str
    text: str


@dataclass(frozen=True)
class Job:
    """Data that all runs of a sweep have in common.

    Attributes
    ----------
    scene : str
        Content of the scene as JSON: complete, with the tables of csv files, in SI units.
    paths : dict
        Key paths that take the value of a parameter, by its name.
    units : dict
        In which the numbers of a parameter are written, by its name.
    metrics : dict
        By name.
    codes : dict
        Functions, by how the sweep file names them.
    change : str
        That of these which changes the content of the scene; empty if none does.
    quantities : tuple of str
        That are recorded.
    rate : float
        Of the recording [Hz].
    logs : str or dict
        ``none``, ``all``, or conditions by column.
    directory : str
        For logs, the same for all; empty for none.
    wall_time : float or None
        That a run may take [s].
    expected : dict
        Versions by name, which those of who runs must be.
    slope_of : str
        Metric whose derivatives by the parameters a search asks for; empty for none.
    """

    scene: str
    paths: dict[str, tuple[str, ...]]
    units: dict[str, str]
    metrics: dict[str, Metric]
    codes: dict[str, Any]
    change: str
    quantities: tuple[str, ...]
    rate: float
    logs: str | dict[str, Condition]
    directory: str
    wall_time: float | None
    expected: dict[str, str]
    slope_of: str = ""

    @cached_property
    def scene_hash(self) -> str:
        """Hash of the scene as it is before parameters are varied."""
        return digest(self.scene)

    @cached_property
    def _common(self) -> str:
        """Hash of everything that keys depend on besides parameters."""
        change = repr(self.codes.get(self.change)) if self.change else ""
        return digest(json.dumps([self.scene, self.paths, self.units, change, self.expected], sort_keys=True))

    def key_of(self, parameters: dict[str, Any]) -> str:
        """Return the key of a run.

        It depends on the scene, solver settings, the function that changes the scene, parameters and version.
        """
        return digest(self._common + json.dumps(parameters, sort_keys=True, default=str))

    def in_si(self, parameters: dict[str, Any]) -> dict[str, Any]:
        """Return the parameters of a run in SI units, as scenes and figures of runs are."""
        return {name: in_si(of, self.units[name]) if name in self.units else of for name, of in parameters.items()}


@dataclass(frozen=True)
class Point:
    """One run to be made: its number, its key and the values of what is varied."""

    number: int
    key: str
    parameters: dict[str, Any]


@dataclass
class Row:
    """Result of a run.

    Attributes
    ----------
    number, key, parameters
        As of its `Point`.
    scene_hash, version : str
        Of the scene without what is varied, and of this package.
    outcome : Outcome
    reason, remedy : str
        Why it is not done, and what to change; empty if it is.
    metrics : dict
        Values by name; None where there is none.
    summary : dict
        That of the run, as far as it came; empty if it did not begin.
    cpu_time, wall_time : float
        Of the steps and of all of it [s].
    log : str
        Name of its log below the directory of results; empty without one.
    slopes : dict
        Derivatives of `Job.slope_of` by the parameters, in their units; empty if there are none.
    """

    number: int
    key: str
    parameters: dict[str, Any]
    scene_hash: str
    version: str
    outcome: Outcome = Outcome.DONE
    reason: str = ""
    remedy: str = ""
    metrics: dict[str, Any] = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)
    cpu_time: float = 0.0
    wall_time: float = 0.0
    log: str = ""
    slopes: dict[str, float] = field(default_factory=dict)

    def columns(self) -> dict[str, Any]:
        """Return one value for each column: varied parameters, metrics, and the rest except the summary.

        Returns
        -------
        dict
        """
        rest = asdict(self)
        for name in ("parameters", "metrics", "summary", "slopes"):
            del rest[name]
        rest["outcome"] = self.outcome.value
        return {"number": rest.pop("number"), **self.parameters, **self.metrics, **rest}

    def text(self) -> str:
        """Return the row as one line of JSON.

        Returns
        -------
        str
        """
        return json.dumps(asdict(self), allow_nan=True)

    @classmethod
    def from_content(cls, content: Any) -> Row:
        """Return the row that a mapping describes.

        Parameters
        ----------
        content : mapping

        Returns
        -------
        Row

        Raises
        ------
        ValueError
            If it describes none: results may have come from somebody else, or be damaged.
        """
        return _ROWS.validate_python(content)

    @classmethod
    def from_text(cls, text: str) -> Row:
        """Return the row of a line of JSON.

        Parameters
        ----------
        text : str

        Returns
        -------
        Row

        Raises
        ------
        ValueError
            If the line describes none.
        """
        try:
            return cls.from_content(json.loads(text))
        except RecursionError:
            raise ValueError("is nested too deeply") from None


_ROWS = TypeAdapter(Row)


def digest(text: str) -> str:
    """Return a short name of a text, which differs for every other text."""
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]

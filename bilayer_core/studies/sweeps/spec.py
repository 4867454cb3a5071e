"""Sweep files: which scene, what is varied and how, what is measured, what is kept."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationError
from pydantic_core import PydanticCustomError

from bilayer_core.errors import InputError, SceneError
from bilayer_core.scene.bundled import bundled_sweep, is_file_name
from bilayer_core.scene.faults import Fault, one_of, refuse, tell
from bilayer_core.scene.limits import LARGEST_FILE, read_text
from bilayer_core.scene.part import Name, Part
from bilayer_core.scene.text import read_yaml
from bilayer_core.scene.units import PlainNumber, PositiveRate, PositiveTime, in_si, parse_quantity, real
from bilayer_core.scene.units import whole as count_from

MOST_RUNS = 1_000_000
"""Of one sweep."""
RESERVED = ("number", "key", "outcome", "reason", "remedy", "cpu_time", "wall_time", "log", "summary", "version")
"""Columns of results that are there anyway."""
_WITH_UNIT = re.compile(r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\s\d].*?)?\s*")


class Bound(Part):
    """A number as it is written: `value` in `unit`, which is empty for a plain one."""

    value: float
    unit: str = ""


def _read_bound(value: Any) -> Any:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return {"value": value}
    found = _WITH_UNIT.fullmatch(value) if isinstance(value, str) else None
    if found is None:
        raise refuse("must be a number, with or without a unit, such as 55 mm")
    return {"value": float(found["number"]), "unit": found["unit"] or ""}


def _bound_or_none(value: Any) -> Bound | None:
    try:
        return Bound(**_read_bound(value)) if isinstance(value, str) else None
    except PydanticCustomError:
        return None


Limit = Annotated[Bound, BeforeValidator(_read_bound)]
Function = Annotated[str, Field(pattern=r"^[^:]+:[A-Za-z_][A-Za-z0-9_]*$", max_length=500)]
"""``FILE.py:NAME``, the file beside the sweep file."""
MemorySize = Annotated[float, *real("a memory size", "byte", "2 GB", above=0.0)]


NEAR_END = 0.01
"""Part of its range by which a value is at an end of it."""


class Parameter(Part):
    """Quantity that a sweep varies: by `values`, or over a range."""

    path: str | list[str] | None = None
    """Key path of the scene, or several that take the same value; none for what `change` alone looks at."""
    values: list[Any] | None = Field(None, max_length=MOST_RUNS)
    """Each as a scene file has it."""
    from_: Limit | None = Field(None, alias="from")
    """The least value, with or without a unit."""
    to: Limit | None = None
    """The largest value, in the same unit."""
    count: Annotated[int, *count_from(1, MOST_RUNS)] | None = None
    """Of the values from one to the other, both included; for a grid or a list."""
    spacing: Literal["linear", "log"] = "linear"
    """Whether neighbours have the same difference or the same ratio."""
    start: Limit | None = None
    """A value that is known to work, with which `bilayer optimise` begins."""
    whole: bool = False
    """Rounded to whole numbers, such as counts of stations."""

    @property
    def paths(self) -> tuple[str, ...]:
        """All its key paths."""
        return () if self.path is None else (self.path,) if isinstance(self.path, str) else tuple(self.path)

    @cached_property
    def unit(self) -> str:
        """In which its numbers are: that of the first one; empty for plain numbers and for what is no number."""
        if self.from_ is not None:
            return self.from_.unit
        found = [_bound_or_none(value) for value in self.values or ()]
        return found[0].unit if found and all(of is not None and of.unit for of in found) else ""

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Ends of its range, in its unit."""
        return self.from_.value, self.in_unit(self.to)

    def is_end(self, value: Any) -> bool:
        """Return whether a value is at an end of the range, or nearer to it than a hundredth of the range."""
        if self.values is not None:
            return False
        begin, end = self.ends
        return min(abs(value - begin), abs(value - end)) <= NEAR_END * abs(end - begin)

    @cached_property
    def levels(self) -> list[Any] | None:
        """Its values; as numbers in its unit, if it has one."""
        if self.values is None or not self.unit:
            return self.values
        return [self.in_unit(_bound_or_none(value)) for value in self.values]

    def in_unit(self, of: Bound) -> float:
        """Return a number in the unit of this parameter; raise ValueError if it is of another kind."""
        if of.unit == self.unit:
            return of.value
        return parse_quantity(f"{of.value!r} {of.unit}", self.unit)

    def _faults(self) -> list[Fault]:
        ranged = self.from_ is not None or self.to is not None
        if (self.values is None) != ranged:
            return [(("values",), self.values, "must be given, or `from` and `to` instead of it")]
        try:
            in_si(1.0, self.unit)
        except ValueError as error:
            return [
                (("values" if self.from_ is None else "from",), self.unit, f"must have a unit that is known; {error}")
            ]
        if self.values is not None:
            try:
                return [] if self.levels else [(("values",), [], "must have at least one value")]
            except ValueError as error:
                return [(("values",), self.values, f"must have units of one kind; one is {error}")]
        if self.from_ is None or self.to is None:
            return [(("to" if self.to is None else "from",), None, "must be given: a range has two ends")]
        alike = bool(self.from_.unit) == bool(self.to.unit)
        try:
            begin, end = self.ends
        except ValueError:
            alike = False
        if not alike:
            unit = self.from_.unit or "none"
            return [(("to",), f"{self.to.value:g} {self.to.unit}".strip(), f"must have a unit as `from` has ({unit})")]
        if begin >= end:
            return [(("to",), end, f"must be above `from` ({begin:g}): the range is empty")]
        if self.spacing == "log" and begin <= 0.0:
            return [(("from",), begin, "must be above 0 where the spacing is log")]
        if self.count == 1:
            return [(("count",), 1, "must be at least 2: both ends are among the values")]
        return []


class Repeats(Part):
    """Every run several times, each with a seed of its own: 0, 1, 2, …"""

    path: str
    """Key path of the seed."""
    count: Annotated[int, *count_from(1, MOST_RUNS)]
    """How often."""


class OfSummary(Part):
    """A value of the summary, by its keys: ``bodies.ball.first_contact``."""

    summary: str


class OfQuantity(Part):
    """A number of a quantity over time, such as the largest height of the mass centre."""

    quantity: str
    """As ``bilayer plot`` has it: ``com.z``, ``body/ball/contact_wrench.fz``."""
    take: Literal["first", "last", "change", "min", "max", "mean", "range", "largest_magnitude"]
    """Which number; `change` is the last less the first, such as how far a robot went."""
    node: int | None = None
    """Of a quantity of nodes, which one: 0 is the first, -1 the last."""
    after: Annotated[float, *real("a time", "s", "0.5 s", at_least=0.0)] = 0.0
    """Simulated time before which nothing is looked at."""


class OfFunction(Part):
    """Metric that a Python function computes of a run, which it gets as a `FinishedRun`."""

    function: Function
    unit: str = Field("", max_length=40)
    """Of what it returns, for pictures: ``N``."""


def _read_metric(value: Any) -> Any:
    return {"summary": value} if isinstance(value, str) else value


def _kind_of_metric(value: Any) -> Any:
    value = _read_metric(value)
    if isinstance(value, Part):
        return value
    kinds: dict[str, type[Part]] = {"summary": OfSummary, "quantity": OfQuantity, "function": OfFunction}
    found = [kind for kind in kinds if isinstance(value, dict) and kind in value]
    if len(found) != 1:
        raise refuse("must be a key of the summary, or a mapping with one of `summary`, `quantity`, `function`")
    return kinds[found[0]].model_validate(value)


Metric = Annotated[OfSummary | OfQuantity | OfFunction, BeforeValidator(_kind_of_metric)]


class Condition(Part):
    """Condition that a column of a row has to meet."""

    above: PlainNumber | None = None
    below: PlainNumber | None = None
    equals: str | float | bool | None = None

    def holds(self, value: Any) -> bool:
        """Return whether a value meets the condition; a missing value does not."""
        if self.equals is not None and value != self.equals:
            return False
        if self.above is None and self.below is None:
            return True
        if value is None or isinstance(value, str):
            return False
        return (self.above is None or value > self.above) and (self.below is None or value < self.below)


class Recording(Part):
    """Quantities of each run to keep while it lasts, for metrics that are functions."""

    quantities: list[str] = []
    """Names or patterns, such as ``body/*/position``."""
    rate: PositiveRate = 50.0
    """Frames in each simulated second; also for metrics of quantities."""


class RunLimits(Part):
    """Limits of one run: wall time and memory."""

    wall_time: PositiveTime | None = None
    """Then it is stopped between two steps, and is a row with that outcome; one that hangs is killed."""
    memory: MemorySize | None = None
    """Of a worker process of this machine, which is killed beyond it. Workers of a cluster have limits of their own."""


class SweepSpec(Part):
    """A sweep file."""

    schema_version: Literal[1] = Field(alias="schema")
    """Of the format: 1."""
    scene: str
    """A bundled scene, or a scene file relative to this one."""
    title: str = Field("", max_length=1000)
    """For pictures."""
    set: dict[str, Any] = {}
    """Values of the scene that all runs have, by key path."""
    parameters: dict[Name, Parameter] = Field(max_length=50)
    """What is varied, by the name of its column."""
    design: Literal["grid", "list", "sobol", "latin_hypercube"] = "grid"
    """``grid``: each value with each; ``list``: first values together, then second ones, and so on; the others spread
    `samples` runs evenly."""
    samples: Annotated[int, *count_from(1, MOST_RUNS)] | None = None
    """Runs of ``sobol`` (best a power of two) and ``latin_hypercube``."""
    seed: Annotated[int, *count_from(0)] = 0
    """Of these two."""
    repeats: Repeats | None = None
    """Each run with several seeds; the column is `seed`."""
    change: Function | None = None
    """A Python function that takes the content of the scene and the parameters by name, and returns the content: for
    geometry that no key path says."""
    metrics: dict[Name, Metric] = {}
    """Columns of results, by name."""
    objectives: dict[Name, Literal["maximise", "minimise"]] = {}
    """Which metrics should be large and which small: for pictures of what cannot be had at once, and `bilayer
    optimise`."""
    record: Recording = Recording()
    logs: Literal["none", "all"] | dict[str, Condition] = "none"
    """Which runs leave a log: those whose columns meet all conditions."""
    limits: RunLimits = RunLimits()

    def _faults(self) -> list[Fault]:
        faults: list[Fault] = []
        if not self.parameters:
            faults.append((("parameters",), {}, "must have at least one: what is varied"))
        sampled = self.design in ("sobol", "latin_hypercube")
        if sampled and self.samples is None:
            faults.append((("samples",), None, f"must be given for the design {self.design}: how many runs"))
        if not sampled and self.samples is not None:
            faults.append((("samples",), self.samples, f"must be left out for the design {self.design}"))
        for name, parameter in self.parameters.items():
            faults += self._faults_of(name, parameter, sampled)
        lengths = {name: len(of.values) if of.values is not None else of.count for name, of in self.parameters.items()}
        if self.design == "list" and len(set(lengths.values())) > 1:
            told = ", ".join(f"{name} {length}" for name, length in lengths.items())
            faults.append((("parameters",), told, "must have the same number of values each for the design list"))
        taken = {*self.parameters, *({"seed"} if self.repeats else ())}
        for name in self.metrics:
            if name in taken or name in RESERVED:
                faults.append((("metrics", name), name, "must be a name that no parameter and no other column has"))
        for name in self.objectives:
            if name not in self.metrics:
                faults.append((("objectives", name), name, one_of("metrics", name, self.metrics)))
        if isinstance(self.logs, dict):
            columns = [*taken, *self.metrics, *RESERVED]
            for name in self.logs:
                if name not in columns:
                    faults.append((("logs", name), name, f"must be a column of results ({', '.join(columns)})"))
        return faults

    def uncounted(self) -> list[str]:
        """Return the parameters of a grid or a list that have a range and do not say how many values."""
        if self.samples is not None:
            return []
        return [name for name, of in self.parameters.items() if of.values is None and of.count is None]

    def _faults_of(self, name: str, parameter: Parameter, sampled: bool) -> list[Fault]:
        where, faults = ("parameters", name), []
        if name in RESERVED or (name == "seed" and self.repeats):
            faults.append((where, name, f"must be another name: {name} is a column of results anyway"))
        if parameter.path is None and self.change is None:
            faults.append(((*where, "path"), None, "must be given: a key path of the scene (or `change`, a function)"))
        if sampled and parameter.count is not None:
            faults.append(((*where, "count"), parameter.count, f"must be left out for the design {self.design}"))
        return faults


def read_spec(spec: str | Path | Mapping[str, Any], is_search: bool = False) -> tuple[SweepSpec, Path, str]:
    """Read and validate a sweep file.

    Parameters
    ----------
    spec : str, Path or mapping
        A file, the name of a bundled sweep, or content; files that content names are relative to the working directory.
    is_search : bool
        Whether the ranges are searched, so that nobody needs to say how many values they have.

    Returns
    -------
    SweepSpec
    directory : Path
        To which the files that it names are relative.
    source : str
        What begins messages about it.

    Raises
    ------
    InputError
        One line for each fault: file, key path, the value found, what is allowed.
    """
    directory, source, content = Path(), "sweep", spec
    if isinstance(spec, str | Path):
        try:
            path = Path(spec) if is_file_name(spec) else bundled_sweep(str(spec))
            # A link stands for the file that it leads to: colcon's symlink install links each file by itself.
            directory, source = (path.resolve() if path.is_symlink() else path).parent, str(path)
            content = read_yaml(read_text(path, LARGEST_FILE), source)
        except ValueError as error:
            raise InputError(f"{source!r}: {error}" if "\0" in source else f"{source}: {error}") from None
        except SceneError as error:
            raise InputError(str(error)) from None
    if not isinstance(content, Mapping):
        kind = "nothing" if content is None else type(content).__name__
        raise InputError(f"{source}: found {kind}; must be a mapping of keys to values, see docs/sweeps.md")
    try:
        read = SweepSpec.model_validate(dict(content))
    except ValidationError as error:
        raise InputError(tell(error, SweepSpec, content, source)) from None
    if not is_search and (uncounted := read.uncounted()):
        told = f"count: found null; must be given for the design {read.design}: how many values"
        raise InputError("\n".join(f"{source}: parameters.{name}.{told}" for name in uncounted))
    return read, directory, source

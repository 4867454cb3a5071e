"""Runs made again from their logs: the same one, to compare it bit for bit, or another one from an instant on.

A log holds the scene, what the steps were to be, the state of the last step before every frame, and all that acted from
outside with the step from which on it acted (`observed.inputs`). That is all that a run depends on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bilayer_core.errors import InputError, SimulationError, naming
from bilayer_core.jit.library import origin
from bilayer_core.log.file.chain import STATE, Wholeness, check_chain
from bilayer_core.log.file.log_chunks import LogFile
from bilayer_core.log.file.log_head import Head
from bilayer_core.log.messages.cdr import NANOSECONDS, decoded, nanoseconds, read_float64_multi_array
from bilayer_core.log.messages.encoders import decode_input
from bilayer_core.log.messages.topics import INPUTS
from bilayer_core.log.run.log_reader import read_head, read_messages, read_state
from bilayer_core.model.set_friction import COEFFICIENTS
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.observed.inputs import FRICTION, LOAD, RESET, STIMULUS, UNTIL, Input
from bilayer_core.observed.system import machine, versions
from bilayer_core.printable import shortened
from bilayer_core.runs.derived import DerivedComparison
from bilayer_core.scene.loader import parse_scene
from bilayer_core.simulation.simulator import Simulator

Array = np.ndarray
Shape = tuple[int, ...]
SEAL = "seal"
"""Part of a state that sums up the others."""
MOST_INPUTS = 2_000_000
"""Of a log that is replayed."""
FAR = 1e9
"""Later than any state [s]."""
TIME_ROUNDING = 1e-9
"""Part of a time that may be rounding."""
MOMENT = 1e-9
"""Times that differ by less are the same in logs [s]."""


@dataclass(frozen=True)
class Difference:
    """A value that came out otherwise."""

    time: float  # [s]
    step: int
    quantity: str  # Part of the state, such as ``position``
    where: str  # Node and rod, edge and rod, or body
    logged: float
    replayed: float

    @property
    def size(self) -> float:
        """How much it differs by."""
        return abs(self.replayed - self.logged)

    def __str__(self) -> str:
        of = f" of {self.where}" if self.where else ""
        return (
            f"t = {self.time:.9g} s (step {self.step}): {self.quantity}{of} is {self.replayed!r}, "
            f"logged is {self.logged!r} ({self.size:.3g} off)"
        )


@dataclass
class Verification:
    """Result of making a run again."""

    tolerance: float | None
    """Part of the longest rod by which positions may differ; None: every value is to be equal bit for bit."""
    wholeness: Wholeness  # Whether the log still holds all states and inputs that were written
    states: int = 0  # That were compared
    inputs: int = 0  # That acted
    first: Difference | None = None
    largest: Difference | None = None
    """`first`, `largest`: the first difference, and the largest of positions."""
    stopped: str = ""  # Why the run could not be made to the end of the log; empty if it could
    changed: dict[str, tuple[str, str]] = field(default_factory=dict)
    """What differs between the machine and versions of the log and the present ones: name to (then, now)."""
    last_time: float = math.nan  # Of the last state that was compared [s]
    derived: int | None = None  # Derived messages that were compared; None if that was not asked for
    first_derived: str = ""  # The first of them that differs; empty if none does
    not_compared: tuple[str, ...] = ()  # Topics of the log that were not compared

    @property
    def equal(self) -> bool:
        """True if everything that was compared came out as it is in the log."""
        return self.first is None and not self.stopped and not self.first_derived

    @property
    def passed(self) -> bool:
        """True if the run came out as it is in the log, and the log is whole, or too old to tell."""
        return self.equal and (self.wholeness.whole or not self.wholeness.hashed)


def verify(path: str | Path, tolerance: float | None = None, derived: bool = False) -> Verification:
    """Simulate a log's run again, compare every state in it, and check that no state and no input is missing.

    Parameters
    ----------
    path : str or Path
    tolerance : float, optional
        Part of the longest rod by which positions of nodes and bodies may differ, for logs of other machines; without
        one all values are to be the same bit for bit.
    derived : bool
        Compare derived messages as well, byte by byte, as long as states are equal; not with a tolerance.

    Raises
    ------
    InputError
        If the file is no log, or an old one that does not hold what acted.
    """
    path = Path(path)
    with naming(path):
        refuse_without_inputs(path)
        found = _verified(path, tolerance, derived)
        if not found.states:
            raise InputError(f"{path}: holds no state; nothing can be compared")
        return found


def _verified(path: Path, tolerance: float | None, derived: bool) -> Verification:
    simulator = simulator_of(path)
    longest = max(rod.path.length for rod in simulator.scene.rods)
    comparison = _Comparison(simulator.description, None if tolerance is None else tolerance * longest)
    look = _Look(simulator.description)
    file, head = LogFile(path), read_head(path)
    messages = DerivedComparison(head.description, file) if derived else None
    compared = {STATE, INPUTS.full_name(), *(messages.topics if messages else ())}
    result, until, waiting = Verification(tolerance, check_chain(path, head.description)), math.inf, []
    result.changed, result.not_compared = _changed(head), tuple(sorted(file.topics.keys() - compared))
    for event in _events(path):
        if isinstance(event, Input):
            waiting.append(event)
            result.inputs += event.kind != UNTIL
            if event.kind == RESET:  # what was set, and steps since the last state, no longer matter
                simulator.reset()
                until, waiting = math.inf, []
            continue
        time = float(event[0])
        if result.states == 0:
            simulator.load_state(event)  # with all that was set before the log began
            for observer in (look, *([messages] if messages else ())):
                simulator.attach(observer)
        else:
            if tolerance is not None or result.first is not None:
                look.due = time
            try:
                until = _advance(simulator, time, until, waiting, look.due == time)
            except SimulationError as failure:
                result.stopped = failure.reason
                break
        until = _apply(simulator, waiting, until)
        result.states += 1
        result.last_time = time
        comparison.add(event, look.taken_into(simulator.save_state(), time), result)
    if messages:
        if result.equal:
            messages.finish(result.wholeness.whole)
        result.derived, result.first_derived = messages.count, messages.first
    return result


def simulator_of(path: str | Path, overrides: Sequence[str] = ()) -> Simulator:
    """Return a simulator of the scene in a log at the scene's start, with the step settings of the log's run.

    `overrides`: changes to the scene, ``KEY=VALUE``; those of ``solver`` come before what the run used.
    """
    head = read_head(Path(path))
    settings = {key: head.settings.get(key, "") for key in ("model", "dimension", "integrator", "dt", "tolerance")}
    scene = parse_scene(head.description.scene_text, str(path), overrides)
    asked = {of.partition("=")[0] for of in overrides}
    tolerance = settings["tolerance"]
    used: dict[str, Any] = {
        "model": settings["model"],
        "dimension": int(_number(path, settings, "dimension")),
        "integrator": settings["integrator"],
        "dt": _number(path, settings, "dt"),
        "tolerance": None if tolerance == "none" else _number(path, settings, "tolerance"),
    }
    if asked & {"solver.dt", "solver.tolerance"}:
        del used["dt"], used["tolerance"]
    with naming(path):
        return Simulator(scene, **{key: value for key, value in used.items() if f"solver.{key}" not in asked})


def _number(path: str | Path, settings: Mapping[str, str], key: str) -> float:
    """Return a setting of a log's run as a number."""
    try:
        number = float(settings[key])
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{path}: settings: {key}: found {shortened(settings[key])!r}; must be a finite number")
    return number


def branch(
    path: str | Path,
    time: float,
    overrides: Sequence[str] = (),
    stimuli: Mapping[str, float | None] | None = None,
    loads: Mapping[str, float | None] | None = None,
) -> tuple[Simulator, list[Input]]:
    """Continue a run from an instant of its log, with changes.

    Parameters
    ----------
    path : str or Path
    time : float
        The last state at or before it [s] is gone on from.
    overrides : sequence of str
        Changes to the scene, ``KEY=VALUE``: of schedules, loads, gravity, contact, friction, damping, drag, steps.
    stimuli, loads : mapping, optional
        Channel to value, and load to factor, from that instant on; None: its schedule.

    Returns
    -------
    simulator : Simulator
        At that instant.
    inputs : list of Input
        What acted later in the log's run, but for those channels and loads; for `Simulator.run`.
    """
    stimuli, loads = stimuli or {}, loads or {}
    refuse_without_inputs(Path(path))
    simulator, state = simulator_of(path, overrides), read_state(path, time)[0]
    with naming(path):
        simulator.load_state(state)
    set_from_outside(simulator, stimuli, loads)
    changed = {(STIMULUS, channel) for channel in stimuli} | {(LOAD, name) for name in loads}
    asked = _friction_in(overrides) if simulator.friction else COEFFICIENTS
    for key in asked if simulator.friction else ():
        simulator.set_friction(None, key)
    changed |= {(FRICTION, key) for key in asked}
    return simulator, [told for told in inputs_after(path, state) if (told.kind, told.name) not in changed]


def set_from_outside(
    simulator: Simulator, stimuli: Mapping[str, float | None], loads: Mapping[str, float | None]
) -> None:
    """Set channels and loads, None for their schedules."""
    for channel, value in stimuli.items():
        simulator.set_stimulus(channel, value)
    for name, factor in loads.items():
        simulator.set_load(name, factor)


def _friction_in(overrides: Sequence[str]) -> list[str]:
    """Return the coefficients that changes to a scene are about, which then act instead of those set in a log's run."""
    asked = {of.partition("=")[0] for of in overrides}
    whole = bool(asked & {"contact", "contact.friction"})
    return [key for key in COEFFICIENTS if whole or f"contact.friction.{key}" in asked]


def inputs_after(path: str | Path, state: Array) -> list[Input]:
    """Return the inputs that acted in a log's run after one of its states, without ends of steps."""
    found, passed = [], False
    for event in _events(Path(path)):
        if not isinstance(event, Input):
            passed = passed or (event[0] == state[0] and event[1] == state[1])
        elif passed and event.kind != UNTIL:
            found.append(event)
    return found


def refuse_without_inputs(path: Path) -> None:
    """Raise InputError if a log does not say what acted."""
    topics = {topic for topic, _, _, data in read_messages(path, {INPUTS.full_name()}) if data is None}
    if not topics:
        writer = read_head(path).versions.get("bilayer_sim_ros", "unknown")
        raise InputError(
            f"{path}: does not hold what acted on the run ({INPUTS.full_name()}), as version {writer} wrote it; "
            "its states can be gone on from (`bilayer run --from-state`), but it cannot be replayed"
        )


def _events(path: Path) -> Iterator[Array | Input]:
    """Yield states, as flat arrays, and inputs in the order in which they came."""
    size = sum(math.prod(shape) for _, shape in read_head(path).description.state_layout)
    inputs = 0
    for topic, _, time, data in read_messages(path, {STATE, INPUTS.full_name()}):
        if data is None:
            continue
        if topic != STATE:
            inputs += 1
            if inputs > MOST_INPUTS:
                raise InputError(f"{path}: has more than {MOST_INPUTS:,} inputs, the most that are replayed")
            yield decoded(path, topic, time, data, decode_input)
            continue
        state = decoded(path, topic, time, data, read_float64_multi_array)[1].copy()
        if state.size != size or not abs(state[0]) < FAR or nanoseconds(float(state[0])) != time:
            raise InputError(f"{path}: the state at t = {time / NANOSECONDS:.9g} s is damaged, or of another scene")
        yield state


def _advance(simulator: Simulator, time: float, until: float, waiting: list[Input], loose: bool) -> float:
    """Make steps up to a time, each with what acts from it on; returns until when adaptive steps may go.

    Steps of another machine are not those of the log: when they are `loose`, they end where something acts.
    """
    while simulator.time < time * (1.0 - TIME_ROUNDING if loose else 1.0):
        until = _apply(simulator, waiting, until)
        simulator.advance(min(until, waiting[0].time) if loose and waiting else until)
    return until


def _apply(simulator: Simulator, waiting: list[Input], until: float) -> float:
    """Let act what is to act from here on."""
    while waiting and waiting[0].time <= simulator.time:
        told = waiting.pop(0)
        if told.kind == UNTIL:
            until = told.values[0]
        told.apply(simulator)
    return until


class _Look:
    """Observer that keeps the places of nodes and bodies at one time: steps of another machine do not end there."""

    rate = math.inf

    def __init__(self, description: Description):
        self.due = math.inf
        self._frame: Frame | None = None
        ends = np.cumsum([0, *(math.prod(shape) for _, shape in description.state_layout)]).tolist()
        self._parts = {name: slice(*ends[k : k + 2]) for k, (name, _) in enumerate(description.state_layout)}

    def start(self, description: Description) -> None:
        pass

    def observe(self, frame: Frame) -> None:
        if abs(frame.time - self.due) < MOMENT:
            self.due, self._frame = math.inf, frame

    def close(self, complete: bool, termination: str = "") -> None:
        pass

    def taken_into(self, state: Array, time: float) -> Array:
        """Return a flat state with the places that were seen at a time, if they were."""
        if self._frame is not None and abs(self._frame.time - time) < MOMENT:
            for name, of in (("position", self._frame.positions), ("body_position", self._frame.body_positions)):
                part = self._parts[name]
                state[part] = of.ravel()[: part.stop - part.start]
        self.due, self._frame = math.inf, None
        return state


def _changed(head: Head) -> dict[str, tuple[str, str]]:
    """Return versions and parts of the machine that are not those of the log."""
    then, now = head.versions | head.machine, versions() | machine() | origin()
    return {key: (then[key], now[key]) for key in now if key in then and then[key] != now[key]}


class _Comparison:
    """Compares states with those of a log: bit for bit, or positions within a distance [m]."""

    def __init__(self, description: Description, tolerance: float | None):
        self._description, self._tolerance = description, tolerance
        self._parts: list[tuple[str, tuple[int, ...], int, int]] = []
        begin = 0
        for name, shape in description.state_layout:
            size = math.prod(shape)
            self._parts.append((name, shape, begin, begin + size))
            begin += size

    def add(self, logged: Array, replayed: Array, result: Verification) -> None:
        """Note the first difference, and the largest of positions."""
        for name, shape, begin, end in self._parts:
            if name == SEAL:
                continue
            one, other = logged[begin:end], replayed[begin:end]
            if name in ("position", "body_position"):
                self._note_largest(name, shape, one, other, logged, result)
            elif self._tolerance is not None:
                continue
            if result.first is None:
                self._note_first(name, shape, one, other, logged, result)

    def _note_first(
        self, name: str, shape: Shape, one: Array, other: Array, logged: Array, result: Verification
    ) -> None:
        if self._tolerance is None:
            differs = one.view(np.uint64) != other.view(np.uint64)
        else:
            differs = np.abs(one - other) > self._tolerance
        if differs.any():
            result.first = self._difference(name, shape, int(differs.argmax()), one, other, logged)

    def _note_largest(
        self, name: str, shape: Shape, one: Array, other: Array, logged: Array, result: Verification
    ) -> None:
        if not one.size:
            return
        index = int(np.abs(one - other).argmax())
        found = self._difference(name, shape, index, one, other, logged)
        if found.size > (result.largest.size if result.largest else 0.0):
            result.largest = found

    def _difference(self, name: str, shape: Shape, index: int, one: Array, other: Array, logged: Array) -> Difference:
        row = int(np.unravel_index(index, shape)[0])
        where = self._owner(name, shape, row)
        return Difference(float(logged[0]), int(logged[1]), name, where, float(one[index]), float(other[index]))

    def _owner(self, name: str, shape: tuple[int, ...], row: int) -> str:
        """Return which node, edge, body or channel a row of a part is of."""
        description = self._description
        nodes = max(s.nodes.stop for s in description.strands) if description.strands else 0
        if name.startswith("body_") and shape[0] == len(description.bodies):
            return f"body {description.bodies[row].name}"
        if name == "friction":
            return COEFFICIENTS[row]
        if name == "override":
            return description.channels[row] if row < len(description.channels) else f"load {row}"
        for strand in description.strands:
            for kind, of in (("node", strand.nodes), ("edge", strand.edges)):
                count = nodes if kind == "node" else description.edge_count
                if shape[0] == count and of.start <= row < of.stop:
                    return f"{kind} {row - of.start} of {strand.name}"
        return f"[{row}]" if shape[0] > 1 else ""

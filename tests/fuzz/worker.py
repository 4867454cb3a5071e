"""What happens to one scene: it is loaded, checked, built and, if it is small, taken one step, within limits."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import re
import resource
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from concurrent.futures import TimeoutError
from dataclasses import dataclass, is_dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from pebble import ProcessExpired, ProcessPool

from fuzz.cases import Case

LONGEST = 10.0
"""For load, check and build [s] of CPU time, which other work on the machine does not change much."""
CHECKS, PATIENCE = 3.0, 12.0
"""CPU time and time by the clock after which a process is killed, in `LONGEST`: what was read is built again, and other
processes may have the machine."""
MOST_MEMORY = 2e9
"""Of the process [bytes]."""
FEW_NODES = 60
"""Of a scene that is taken a step."""
LONGEST_MESSAGE = 2000
"""Characters of a line of a refusal."""
FILES = {
    "table.csv": "time,value\n0,0\n0.5,1\n1,0\n",
    "points.csv": "x,y,z\n0,0,0\n0.01,0,0\n0.02,0.005,0\n0.03,0.005,0\n",
    "empty.csv": "",
    "text.csv": "time,value,x,y,z\na,b,c,d,e\n",
}
PYTHON = re.compile(r"Traceback|\b[A-Z][A-Za-z]*(Error|Exception|Warning)\b|<class |object at 0x|\bNoneType\b")
"""What users are not to read."""
ORIGIN = re.compile(r"(scene\.yaml(:\d+:\d+)?( with .*?)?|override .*?|[A-Za-z][A-Za-z0-9_]*): \S")
"""What a line of a refusal begins with: file, override, or the name of a scene."""
ENDLESS = ("law_saturation", "bound", "rod_length", "coarsest")
"""Arrays of a model that may hold infinity: laws without saturation, planes, closed rods, straight ones."""
ACCEPTED, REFUSED, FAILED = "accepted", "refused", "failed"


@dataclass(frozen=True)
class Outcome:
    """What became of a scene."""

    kind: str
    message: str = ""
    seconds: float = 0.0
    memory: float = 0.0  # largest of the process [bytes]
    step: str = ""  # how the first step went, of a small scene


class Unclear(Exception):
    """A refusal from which a user does not learn what is wrong."""


def begin(most_memory: float, with_steps: bool) -> None:
    """Prepare a process: what all scenes need is imported before memory is limited."""
    from bilayer_core import Simulator, load_scene
    from bilayer_core.cli.check import check  # noqa: F401 (imported)

    os.chdir(tempfile.mkdtemp(prefix="fuzz-"))
    for name, text in FILES.items():
        Path(name).write_text(text)
    for known in ("cantilever", "gripping_friction", "ring"):
        warm = Simulator(load_scene(known))
        if with_steps:
            warm.step()
    limit_memory(most_memory)


def limit_memory(most_memory: float, with_steps: bool = False) -> None:
    """Limit the memory of this process to what it has and more [bytes]."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (size + int(most_memory), resource.RLIM_INFINITY))


def attempt(case: Case, with_step: bool = False) -> Outcome:
    """Load, check and build a scene in this process."""
    from bilayer_core.errors import BilayerError

    _forget_peak()
    start, kind, message, step = time.process_time(), ACCEPTED, "", ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                _check(case)
            except BilayerError as error:
                kind, message = REFUSED, str(error)
                require_clear(message)
            seconds = time.process_time() - start
            simulator = _built_again(case) if kind == ACCEPTED else None
        if kind == ACCEPTED and with_step and simulator.model.node_count <= FEW_NODES:
            step = _step(simulator)
    except Exception:
        return Outcome(FAILED, traceback.format_exc(), time.process_time() - start, _peak())
    memory = _peak()
    if seconds > LONGEST or memory > MOST_MEMORY:
        kind, message = FAILED, f"took {seconds:.1f} s and {memory / 1e9:.2f} GB\n{message}"
    return Outcome(kind, message, seconds, memory, step)


def _check(case: Case) -> None:
    """Call ``bilayer check``, which loads and builds the scene, and read its answer."""
    from bilayer_core.cli.check import check

    path = Path("scene.yaml")
    path.write_bytes(case.text.encode("utf-8", "surrogatepass"))
    written = io.BytesIO()
    with contextlib.redirect_stdout(io.TextIOWrapper(written, "utf-8", write_through=True)):
        check.callback(str(path), case.overrides, case.as_json)
    answer = written.getvalue().decode()
    if case.as_json:
        json.loads(answer, parse_constant=_refuse_constant)
    elif "no faults" not in answer.splitlines()[-1] or re.search(r"\b(nan|inf)\b", answer):
        raise Unclear(f"check says:\n{answer}")


def _built_again(case: Case):
    """A simulator of a scene, which is the same when it is written out and read again."""
    from bilayer_core import Simulator, load_scene
    from bilayer_core.scene.loader import parse_scene, scene_text

    scene = load_scene("scene.yaml", case.overrides)
    if parse_scene(scene_text(scene), "again") != scene:
        raise Unclear("the scene written out is not the scene that was read")
    simulator = Simulator(scene)
    _require_numbers(simulator)
    return simulator


def _require_numbers(simulator) -> None:
    """Raise `Unclear` if an array of the model is not finite."""
    from bilayer_core.jit import Record

    model = simulator.model
    for part in (model, *vars(model).values()):
        for name, array in vars(part).items() if is_dataclass(part) or isinstance(part, Record) else ():
            if isinstance(array, np.ndarray) and array.dtype == float and name not in ENDLESS:
                if not np.isfinite(array).all():
                    raise Unclear(f"{type(part).__name__}.{name} holds {array[~np.isfinite(array)][0]}")


def _refuse_constant(name: str) -> None:
    raise Unclear(f"check --json says {name}, which is no JSON")


def _step(simulator) -> str:
    from bilayer_core.errors import SimulationError

    try:
        simulator.step()
    except SimulationError as error:
        return str(error)
    return "made"


def require_clear(message: str) -> None:
    """Raise `Unclear` if a refusal is empty, too long, from Python, or says not where the fault is."""
    message.encode()
    lines = message.splitlines()
    for line in lines:
        if not ORIGIN.match(line):
            raise Unclear(f"begins with no file, override, scene or key: {line}")
        if len(line) > LONGEST_MESSAGE:
            raise Unclear(f"is {len(line)} characters long: {line}")
        if PYTHON.search(line):
            raise Unclear(f"speaks of Python: {line}")
        if not re.search(r": .*[a-z]", line):
            raise Unclear(f"says not what is wrong: {line}")
    if not lines:
        raise Unclear("is empty")


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def _peak() -> float:
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return 1024.0 * int(found[1])


def _limited(cpu_time: float, function: Callable, arguments: tuple) -> Any:
    """What a function returns within a CPU time [s], after which the process is killed."""
    most = math.ceil(time.process_time() + cpu_time)
    resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))
    return function(*arguments)


class Workers:
    """A process that scenes are tried in; it is replaced when it exceeds a limit or dies."""

    def __init__(
        self,
        with_steps: bool = False,
        longest: float = LONGEST,
        most_memory: float = MOST_MEMORY,
        prepare: Callable[[float, bool], None] = begin,
    ):
        self._with_steps, self._longest = with_steps, longest
        limits = most_memory, with_steps
        self._pool = ProcessPool(1, context=get_context("spawn"), initializer=prepare, initargs=limits)

    def outcome(self, case: Case) -> Outcome:
        """What becomes of a case."""
        return self.result(self.start(attempt, case, self._with_steps))

    def start(self, function: Callable, *arguments):
        """Begin to call a function."""
        limited = CHECKS * self._longest, function, arguments
        return self._pool.schedule(_limited, args=limited, timeout=PATIENCE * self._longest)

    def result(self, future) -> Any:
        """What a function returns, or a failure if it does not."""
        try:
            return future.result()
        except TimeoutError:
            return Outcome(FAILED, f"no answer within {PATIENCE * self._longest:g} s")
        except ProcessExpired as error:
            return Outcome(FAILED, f"the process died: {error}, exit code {error.exitcode}")
        except MemoryError as error:
            return Outcome(FAILED, f"MemoryError: {error}")

    def close(self) -> None:
        """End the processes."""
        self._pool.stop()
        self._pool.join()

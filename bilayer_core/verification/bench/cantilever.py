"""The common cantilever: this simulator and programs that install from PyPI, in one go against one reference."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from itertools import product

import numpy as np

from bilayer_core.verification.bench import converged_answers, machine, start
from bilayer_core.verification.bench.peers.exchange import Cantilever, Case
from bilayer_core.verification.bench.problems import problem
from bilayer_core.verification.bench.results import Results

PART = "cantilever"
ERRORS = (5e-2, 2e-2, 1e-2, 5e-3, 1e-3)
"""Columns of the table."""
TIME_LIMIT = 900.0
"""Wall time after which a peer is ended [s]."""


@dataclass(frozen=True)
class Peer:
    """A program."""

    name: str  # Of its distribution, and of its file in `peers`
    module: str  # By which it is imported
    label: str  # For tables and legends
    cases: tuple[tuple[int, tuple[float, ...]], ...]
    quick_cases: tuple[tuple[int, tuple[float, ...]], ...]
    """`cases`, `quick_cases`: elements with the steps [s] tried on each: explicit ones near the largest stable step."""

    @property
    def version(self) -> str | None:
        """Installed version, None without one."""
        return machine.installed_version(self.name) if find_spec(self.module) else None

    def plan(self, quick: bool) -> list[Case]:
        """Return all runs, with its own clamp and shifted by half an element."""
        return [
            Case(elements, dt, shifted)
            for shifted in (False, True)
            for elements, steps in (self.quick_cases if quick else self.cases)
            for dt in steps
        ]


PEERS = (
    Peer(
        "pyelastica",
        "elastica",
        "PyElastica",
        ((10, (4e-5,)), (20, (4e-5, 2e-5)), (40, (4e-5, 2e-5)), (80, (2e-5,))),
        ((10, (4e-5,)), (20, (4e-5,))),
    ),
    Peer(
        "mujoco",
        "mujoco",
        "MuJoCo",
        tuple(product((10, 20, 40), ((1e-3, 4e-4, 2e-4, 1e-4, 4e-5),))),  # it wants edges longer than thick
        ((10, (1e-3, 2e-4)), (20, (1e-3, 2e-4, 1e-4))),
    ),
)


def measure(results: Results, quick: bool, progress: Callable[[str], None] = lambda text: None) -> list[str]:
    """Run the peers that are installed; return a line for each that is not."""
    skipped = []
    for peer in PEERS:
        progress(f"cantilever: {peer.name}")
        if peer.version is None:
            skipped.append(f"{peer.name}: skipped, it is not installed; pip install 'bilayer_sim_ros[bench]'")
            continue
        todo = [case for case in peer.plan(quick) if results.find(PART, _identity(peer, case)) is None]
        if todo:
            _run(peer, todo, results)
    return skipped


def _identity(peer: Peer, case: Case) -> dict:
    return {"tool": peer.name, **asdict(case)}


def _run(peer: Peer, cases: list[Case], results: Results) -> None:
    """Run all cases in one process of the peer's own; what it does not answer is recorded with the reason."""
    command = [sys.executable, "-m", f"{__package__}.peers.{peer.name}"]
    text = json.dumps([asdict(case) for case in cases])
    try:
        run = subprocess.run(
            command, input=text, env=start.surroundings(), capture_output=True, text=True, timeout=TIME_LIMIT
        )
        lines, reason = run.stdout.splitlines(), _last_line(run.stderr) if run.returncode else ""
    except subprocess.TimeoutExpired as expired:
        lines, reason = (expired.stdout or b"").decode().splitlines(), f"ended after {TIME_LIMIT:g} s"
    answered = {}
    for line in lines:
        if line.startswith('{"case"'):
            found = json.loads(line)
            answered[Case(**found["case"])] = found["answer"]
    for case in cases:
        results.add(PART, {**_identity(peer, case), **_judged(answered.get(case), reason)})


def _judged(answer: dict | None, reason: str) -> dict:
    if answer is None:
        return {"outcome": reason or "no answer", "error": None, "cpu_time": None}
    way = np.column_stack([answer["times"], answer["x"], np.zeros(len(answer["x"])), answer["z"]])
    if not np.isfinite(way).all() or np.abs(way[:, 1:]).max() > 10.0 * Cantilever().length:
        return {"outcome": "unstable", "error": None, "cpu_time": answer["cpu_time"]}
    chosen = problem("cantilever")
    error = chosen.measure.error(way, converged_answers.stored(chosen, converged_answers.JUDGE).values)
    return {"outcome": "done" if math.isfinite(error) else "unstable", "error": error, "cpu_time": answer["cpu_time"]}


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else "ended without a word"

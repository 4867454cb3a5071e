"""How long a process takes to its first step: cold, with every kernel to compile, and warm, from numba's cache."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time as clock
from collections.abc import Callable
from pathlib import Path

from bilayer_core.errors import SimulationError
from bilayer_core.log.file.private_directory import private_directory
from bilayer_core.scene.loader import load_scene
from bilayer_core.verification.bench.configurations import shapes
from bilayer_core.verification.bench.results import Results

PART = "start"
SCENES, QUICK_SCENE = ("cantilever", "gripping"), "cantilever"
WARM_REPEATS = 3
PROGRAM = """
import json, os, sys, time
begin = time.perf_counter()
from bilayer_core import Simulator, load_scene
imported = time.perf_counter()
simulator = Simulator(load_scene(sys.argv[1]), model=sys.argv[2], dimension=int(sys.argv[3]))
compiled = simulator.compile()
simulator.step()
times = os.times()
cpu = time.process_time() + times.children_user + times.children_system
print(json.dumps({"cpu_time": cpu, "import_time": imported - begin, "compile_time": compiled}))
"""


def plan(quick: bool) -> list[tuple[str, str, int]]:
    """Return the scene, model and dimension of all starts; of a quick benchmark the first and the last."""
    if quick:
        found = [(QUICK_SCENE, *shape) for shape in shapes(load_scene(QUICK_SCENE))]
        return [found[0], found[-1]]
    return [(scene, *shape) for scene in SCENES for shape in shapes(load_scene(scene))]


def measure(results: Results, quick: bool, progress: Callable[[str], None] = lambda text: None) -> None:
    """Start a process with an empty kernel cache, then again with what it left there.

    Raises SimulationError if a process does not come to its first step.
    """
    for scene, model, dimension in plan(quick):
        identity = {"scene": scene, "model": model, "dimension": dimension}
        progress(f"start: {scene}, {model} {dimension}-D")
        if results.find(PART, identity) is None:
            results.add(PART, {**identity, **_starts(scene, model, dimension)})


def _starts(scene: str, model: str, dimension: int) -> dict:
    with private_directory() as cache:
        cold = first_step(scene, model, dimension, cache)
        warm = [first_step(scene, model, dimension, cache) for _ in range(WARM_REPEATS)]
    return {"cold": cold, "warm": min(warm, key=lambda start: start["cpu_time"])}


def surroundings(**more: str) -> dict[str, str]:
    """Return the environment of a process that finds this package as this one did."""
    source = str(Path(__file__).resolve().parents[2])
    paths = os.pathsep.join(filter(None, (source, os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": paths, **more}


def first_step(scene: str, model: str, dimension: int, cache: Path) -> dict:
    """Return the CPU time of a process up to its first step, its wall time to its end, and those of its parts [s].

    Windows does not tell a process the CPU time of those that it started: there that of compilers is missing.
    """
    begin = clock.perf_counter()
    command = [sys.executable, "-c", PROGRAM, scene, model, str(dimension)]
    run = subprocess.run(command, env=surroundings(NUMBA_CACHE_DIR=str(cache)), capture_output=True, text=True)
    wall = clock.perf_counter() - begin
    if run.returncode:
        raise SimulationError(f"{scene}, {model} {dimension}-D: no first step: {run.stderr.strip()}", 0.0)
    return {"wall_time": wall, **json.loads(run.stdout)}

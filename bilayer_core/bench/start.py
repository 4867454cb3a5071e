"""How long a process takes to its first step: cold, with every kernel to compile, and warm, from numba's cache."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time as clock
from collections.abc import Callable
from pathlib import Path

from ..errors import SimulationError
from ..record.private_directory import private_directory
from ..scene.loader import load_scene
from .configurations import shapes
from .results import Results

PART = "start"
SCENES, QUICK_SCENE = ("cantilever", "gripping"), "cantilever"
WARM_REPEATS = 3
PROGRAM = """
import json, sys, time
begin = time.perf_counter()
from bilayer_core import Simulator, load_scene
imported = time.perf_counter()
simulator = Simulator(load_scene(sys.argv[1]), model=sys.argv[2], dimension=int(sys.argv[3]))
compiled = simulator.compile()
simulator.step()
print(json.dumps({"import_time": imported - begin, "compile_time": compiled}))
"""


def plan(quick: bool) -> list[tuple[str, str, int]]:
    """Scene, model and dimension of all starts; of a quick benchmark the first and the last."""
    if quick:
        found = [(QUICK_SCENE, *shape) for shape in shapes(load_scene(QUICK_SCENE))]
        return [found[0], found[-1]]
    return [(scene, *shape) for scene in SCENES for shape in shapes(load_scene(scene))]


def measure(results: Results, quick: bool, progress: Callable[[str], None] = lambda text: None) -> None:
    """Start a process with an empty kernel cache, then again with what it left there.

    Raises
    ------
    SimulationError
        If a process does not come to its first step.
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
    """Environment of a process that finds this package as this one did."""
    source = str(Path(__file__).resolve().parents[2])
    paths = os.pathsep.join(filter(None, (source, os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": paths, **more}


def first_step(scene: str, model: str, dimension: int, cache: Path) -> dict:
    """CPU and wall time of a process that makes one step [s], and of its parts."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), clock.perf_counter()
    command = [sys.executable, "-c", PROGRAM, scene, model, str(dimension)]
    run = subprocess.run(command, env=surroundings(NUMBA_CACHE_DIR=str(cache)), capture_output=True, text=True)
    wall, after = clock.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if run.returncode:
        raise SimulationError(f"{scene}, {model} {dimension}-D: no first step: {run.stderr.strip()}", 0.0)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"cpu_time": cpu, "wall_time": wall, **json.loads(run.stdout)}

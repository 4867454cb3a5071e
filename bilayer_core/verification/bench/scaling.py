"""How the CPU time of a step grows with the number of nodes: linearly, if the slope in log–log is 1."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.bench.configurations import shapes
from bilayer_core.verification.bench.results import Results

PART = "scaling"
NODES = (50, 100, 200, 400, 800, 1600, 3200)
QUICK_NODES = (50, 200, 800)
STEPS, DT = 20, 1e-3
REPEATS = 3
SCENE, ROD = "bending", "strip"
"""A bilayer that bends: nodes are counted along it, so that two rods have twice as many."""
INTEGRATOR = "sdirk2"
MANY = 800
"""Nodes from which on what a step costs whatever their number hardly counts."""


def measure(results: Results, quick: bool, progress: Callable[[str], None] = lambda text: None) -> None:
    """Measure the CPU time of the first steps for every model and dimension, at several numbers of nodes."""
    for model, dimension, nodes in plan(quick):
        identity = {"model": model, "dimension": dimension, "nodes": nodes}
        progress(f"scaling: {model} {dimension}-D, {nodes} nodes")
        if results.find(PART, identity) is None:
            results.add(PART, {**identity, **_run(model, dimension, nodes)})


def plan(quick: bool) -> list[tuple[str, int, int]]:
    """Return the model, dimension and nodes of all runs."""
    sizes = QUICK_NODES if quick else NODES
    return [(*shape, nodes) for shape in shapes(load_scene(SCENE)) for nodes in sizes]


def _run(model: str, dimension: int, nodes: int) -> dict:
    config = load_scene(SCENE, [f"rods.{ROD}.stations={nodes}"])
    simulator = Simulator(config, model=model, dimension=dimension, integrator=INTEGRATOR, dt=DT)
    simulator.compile()
    start = simulator.save_state()
    best = math.inf
    for _ in range(REPEATS):
        simulator.load_state(start)
        simulator.run(STEPS * DT)
        best = min(best, simulator.cpu_time)
    return {"cpu_time": best / STEPS, "newton_iterations": simulator.statistics.iterations}


def slopes(records: list[dict], least: int = 0) -> dict[tuple[str, int], float]:
    """Return the slope of log(CPU time of a step) against log(nodes) by least squares, for every model and dimension.

    `least`: the smallest number of nodes that counts.
    """
    found = {}
    for shape in dict.fromkeys((record["model"], record["dimension"]) for record in records):
        of_shape = [r for r in records if (r["model"], r["dimension"]) == shape and r["nodes"] >= least]
        if len(of_shape) > 1:
            nodes, times = np.log([(r["nodes"], r["cpu_time"]) for r in of_shape]).T
            found[shape] = float(np.polyfit(nodes, times, 1)[0])
    return found

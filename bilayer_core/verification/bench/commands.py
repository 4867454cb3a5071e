"""How many actions of a controller a CPU second allows, and how far off the robot is then.

The stimuli of a robot go to random values of their whole ranges, by ramps from each tick to the next. The error is the
root mean square over ticks of the distance of a tip from where it is with a hundredth of the tolerance, under the same
commands by the same ramps.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator

import numpy as np

from bilayer_core.observed.inputs import SHAPES
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.bench.results import Results
from bilayer_core.verification.bench.track import Track

PART = "commands"
SCENES, QUICK_SCENE = ("gripping", "crawling_dual_leg", "crawling_inchworm", "swimming"), "crawling_inchworm"
PERIOD = 0.04
"""Of ticks [s]."""
ACTIONS, SEEDS = 25, (1, 2, 3)
"""In a run, and one run for each seed."""
CHOICES = (("sdirk2", 1.0), ("sdirk2", 5.0), ("tr_bdf2", 5.0))
"""Integrators, and tolerances over those of the scenes."""
REFERENCE = "sdirk2", 0.01


def plan(quick: bool) -> list[tuple[str, str]]:
    """Return the scenes, and the shapes of ramps, of all measurements."""
    return [(scene, shape) for scene in ((QUICK_SCENE,) if quick else SCENES) for shape in SHAPES]


def measure(results: Results, quick: bool, progress: Callable[[str], None] = lambda text: None) -> None:
    """Measure each robot under ramps of each shape, with each choice of integrator and tolerance."""
    for scene, shape in plan(quick):
        identity = {"scene": scene, "shape": shape}
        progress(f"commands: {scene}, {shape}")
        if results.find(PART, identity) is None:
            for record in list(_records(scene, shape, SEEDS[:1] if quick else SEEDS)):
                results.add(PART, {**identity, **record})


def _records(scene: str, shape: str, seeds: tuple[int, ...]) -> Iterator[dict]:
    references = [drive(scene, shape, seed, *REFERENCE)[0] for seed in seeds]
    for integrator, factor in CHOICES:
        ways, costs = zip(*(drive(scene, shape, seed, integrator, factor) for seed in seeds), strict=True)
        squares = np.sum((np.array(ways) - references) ** 2, axis=2)
        yield {
            "integrator": integrator,
            "tolerance_factor": factor,
            "actions_per_second": len(seeds) * ACTIONS / sum(costs),
            "error": float(np.sqrt(squares.mean())),
        }


def drive(scene: str, shape: str, seed: int, integrator: str, factor: float) -> tuple[np.ndarray, float]:
    """Return where the tip of a robot is at ticks [m], shape (n_tick, 3), and the CPU time of the run [s]."""
    config, chance = load_scene(scene), random.Random(seed)
    tolerance = factor * Simulator(config).steps.tolerance
    simulator = Simulator(config, integrator=integrator, tolerance=tolerance)
    simulator.compile()
    track = Track(simulator)
    for _ in range(ACTIONS):
        for name, channel in config.stimuli.items():
            simulator.set_stimulus(name, chance.uniform(channel.minimum, channel.maximum), over=PERIOD, shape=shape)
        simulator.run(PERIOD)
        track.look(simulator.time)
    return np.array(track.points["tip"]), simulator.cpu_time

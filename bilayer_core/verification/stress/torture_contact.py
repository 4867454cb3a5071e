"""Torture cases of contact: heaps, braids, heavy and light, stiff and soft, sharp and narrow."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from bilayer_core.testing.surfaces import surfaces_of
from bilayer_core.testing.trial import Trial
from bilayer_core.verification.stress.ladder import Rung, Torture, first_broken
from bilayer_core.verification.stress.linking import gauss_integral, longer
from bilayer_core.verification.stress.stress_case import Decision
from bilayer_core.verification.stress.torture_twist import X, turned

Array = np.ndarray


def met(trial: Trial) -> Decision:
    """Return the smallest gap over the barrier distance: above 0, and below 1 if anything has met at all."""
    barrier = trial.simulator.scene.contact.barrier_distance
    return Decision("smallest gap over the barrier distance", trial.judge.min_gap / barrier, 1e-9, 1.0)


def stays_apart(trial: Trial) -> Decision:
    """Run a trial and check that nothing passed through anything: the judge looks at every step, and the smallest gap
    must be below the barrier distance, so that parts have met.
    """
    trial.run()
    return met(trial)


def carries(trial: Trial) -> Decision:
    """Return the lowest place of a heavy box that falls on a strip, and its highest place after that."""
    simulator, scene = trial.simulator, trial.simulator.scene
    half, thickness = 0.5 * scene.bodies[0].surface.size[2], scene.rods[0].layers[0].thickness
    heights = []
    trial.run(each_step=lambda _: heights.append(float(simulator.frame().body_positions[0, 2]) - half))
    begin = scene.bodies[0].position[2] - half + 0.5 * scene.bodies[0].motion.velocity[2] ** 2 / -scene.gravity[2]
    return first_broken(
        Decision("lowest height of the box over the strip's thickness", min(heights) / thickness, 1.0, 2.0),
        Decision("highest place of the box over that of its energy", max(heights) / begin, 0.0, 1.0 + 2e-3),
        met(trial),
    )


def keeps_linking(trial: Trial) -> Decision:
    """Return the largest error of the linking of two rods, compared with the turns of the ends."""
    simulator = trial.simulator
    strands = [strand.nodes for strand in simulator.description.strands]
    before = _linking(simulator.positions, strands)
    trial.run()
    change = _linking(simulator.positions, strands) - before
    off = float(np.abs(change - turned(trial)).max())
    return first_broken(Decision("turns of linking that are missing", off, 0.0, LINKING), met(trial))


LINKING = 1e-3
"""Turns; a rod that has passed through another changes one."""


def _linking(positions: Array, strands: list[slice]) -> Array:
    curves = [longer(positions[nodes], X) for nodes in strands]
    return np.array([gauss_integral(first, second) for first, second in combinations(curves, 2)])


def comes_to_rest(trial: Trial) -> Decision:
    """Return the mean speed of a heap at the end, over that of its fall."""
    simulator, fastest, mass = trial.simulator, 0.0, trial.simulator.model.rods.node_mass

    def speed() -> float:
        return math.sqrt(float(mass @ (simulator.velocities**2).sum(axis=1)) / mass.sum())

    def look(_: float) -> None:
        nonlocal fastest
        fastest = max(fastest, speed())

    trial.run(each_step=look)
    return first_broken(Decision("speed at the end over the largest", speed() / fastest, 0.0, AT_REST), met(trial))


AT_REST = 0.05
"""Over the largest speed: what still moves of a heap."""


def clears_edges(trial: Trial) -> Decision:
    """Return the smallest gap over the barrier distance of whole edges, not only of their stations."""
    simulator, smallest = trial.simulator, math.inf
    model = simulator.model
    surfaces = surfaces_of(simulator.scene)
    radius, barrier = 0.5 * simulator.scene.rods[0].layers[0].thickness, simulator.scene.contact.barrier_distance
    parts = np.linspace(0.0, 1.0, ALONG)[:, None, None]

    def look(_: float) -> None:
        nonlocal smallest
        nodes = simulator.positions[: model.node_count]
        points = (nodes[:-1] + parts * (nodes[1:] - nodes[:-1])).reshape(-1, 3)
        gaps = [float(s.distance((points - s.position) @ s.rotation).min()) - radius for s in surfaces]
        smallest = min(smallest, *gaps)

    trial.run(each_step=look)
    return Decision("smallest gap of edges over the barrier distance", smallest / barrier, 1e-9, 1.0)


ALONG = 9
"""Points of an edge that are looked at."""


def is_pressed(trial: Trial) -> Decision:
    """Return the width of a coil between two walls that have closed, over their distance."""
    trial.run()
    simulator = trial.simulator
    walls = simulator.frame().body_positions[:, 0]
    x, half = simulator.positions[:, 0], 0.5 * simulator.scene.rods[0].layers[0].thickness
    inside = min(float(x.min() - walls.min()), float(walls.max() - x.max())) - half
    fills = (float(np.ptp(x)) + 2.0 * half) / float(np.ptp(walls))
    return first_broken(
        Decision("width of the coil over the distance of the walls", fills, 0.9, 1.0),
        Decision("gap to the nearer wall", inside, 0.0, math.inf, "m"),
        met(trial),
    )


def _heap(side: int, layers: int) -> tuple[str, ...]:
    """Return the changes that make a heap with so many noodles side by side and on top of each other, twice."""
    return (
        f"rods.along.pattern.counts=[{side}, {layers}]",
        f"rods.across.pattern.counts=[{side}, {layers}]",
        "rods.along.pattern.steps=[[0, 0.006, 0], [0, 0.0007, 0.016]]",
        "rods.across.pattern.steps=[[0.006, 0, 0], [0.0007, 0, 0.016]]",
    )


def _ten_times_faster() -> tuple[str, ...]:
    return (*(f"bodies.{hand}.motion.times=[0, 0.2667]" for hand in ("left", "right")), "duration=0.4")


EULER = "solver.integrator=implicit_euler"
CONTACT = (
    Torture(
        15,
        "mass ratio",
        "mass_ratio",
        "IPC",
        "no crossing",
        "the box comes down to the strip, never below its thickness, and rises no higher than its energy lets it",
        carries,
        (
            *(Rung(f"ratio {ratio:g}", (f"bodies.box.motion.mass={1e-3 * ratio}",)) for ratio in (1, 1e2, 1e4, 1e6)),
            Rung("ratio 1e4, dt 1 ms", ("solver.dt=0.001",)),
            Rung("ratio 1e4, implicit Euler, dt 10 ms", (EULER, "solver.dt=0.01")),
            Rung("ratio 1e4, in space", ("solver.dimension=3",)),
            Rung("ratio 1e4, at 3 m/s", ("bodies.box.motion.velocity=[0, 0, -3]", "contact.impact_speed=4")),
        ),
    ),
    Torture(
        16,
        "four rods twisted together",
        "four_rods",
        "IPC",
        "no crossing",
        "linking of each pair, by the Gauss integral, is what the end has turned",
        keeps_linking,
        (
            Rung("within 10 s, dt 25 ms", ("solver.dt=0.025",)),
            Rung("within 10 s, implicit Euler, dt 25 ms", (EULER, "solver.dt=0.025")),
            Rung("within 10 s, adaptive"),
            Rung("within 1 s, dt 25 ms", ("solver.dt=0.025", "bodies.right.motion.times=[0, 1]", "duration=1.5")),
            Rung("within 10 s, stiffness 100 MPa", ("solver.dt=0.025", "contact.stiffness=1e8")),
            Rung("within 10 s, 61 stations", ("solver.dt=0.025", "rods.rod.stations=61")),
            Rung(
                "long, within 100 s, dt 25 ms",
                ("solver.dt=0.025", "bodies.right.motion.times=[0, 100]", "duration=100"),
            ),
        ),
    ),
    Torture(
        17,
        "noodles",
        "noodles",
        "Codimensional IPC",
        "no crossing, comes to rest",
        "mean speed at the end below 5 % of the largest, and every gap above zero",
        comes_to_rest,
        (
            Rung("12 noodles"),
            Rung("12 noodles, implicit Euler, dt 5 ms", (EULER, "solver.dt=0.005")),
            Rung("12 noodles, without friction", ("contact.friction.coefficient=0", "damping.mass=20", "duration=1.2")),
            Rung("12 noodles, stiffness 10 MPa", ("contact.stiffness=1e7",)),
            Rung("long, 48 noodles", _heap(6, 4)),
            Rung("long, 120 noodles, implicit Euler, dt 5 ms", (*_heap(6, 10), EULER, "solver.dt=0.005")),
        ),
    ),
    Torture(
        18,
        "braid",
        "braid",
        "Codimensional IPC",
        "no crossing",
        "linking of each pair, by the Gauss integral, is what the hands have turned together",
        keeps_linking,
        (
            Rung("270 degrees a second"),
            Rung("tolerance 1e-2", ("solver.tolerance=1e-2",)),
            Rung("implicit Euler, dt 10 ms", (EULER, "solver.dt=0.01")),
            Rung("stiffness 100 kPa", ("contact.stiffness=1e5",)),
            Rung("without friction", ("contact.friction.coefficient=0",)),
            Rung("101 stations", ("rods.thread.stations=101",)),
            Rung("2700 degrees a second", _ten_times_faster()),
        ),
    ),
    Torture(
        20,
        "wedge, spike and crack",
        "spikes",
        "IPC, after Erleben",
        "no crossing",
        "every point of every edge above every obstacle, not only stations",
        clears_edges,
        (
            Rung("121 stations"),
            Rung("61 stations", ("rods.strip.stations=61",)),
            Rung("31 stations", ("rods.strip.stations=31",)),
            Rung("dt 5 ms", ("solver.dt=0.005",)),
            Rung("implicit Euler, dt 10 ms", (EULER, "solver.dt=0.01")),
            Rung("in space", ("solver.dimension=3",)),
        ),
    ),
    Torture(
        21,
        "100 Pa to 100 MPa in one scene",
        "stiffness",
        "IPC",
        "no crossing",
        "every gap above zero, and below the barrier distance where they have met",
        stays_apart,
        (
            Rung("adaptive"),
            Rung("dt 2 ms", ("solver.dt=0.002",)),
            Rung("implicit Euler, dt 10 ms", (EULER, "solver.dt=0.01")),
            Rung("stiffness 10 kPa", ("contact.stiffness=1e4",)),
            Rung("stiffness 100 MPa", ("contact.stiffness=1e8",)),
        ),
    ),
    Torture(
        22,
        "compactor",
        "compactor",
        "IPC",
        "no crossing",
        "the coil fills the distance of the walls, to 10 %, and every gap is above zero",
        is_pressed,
        (
            Rung("adaptive"),
            Rung("dt 5 ms", ("solver.dt=0.005",)),
            Rung("implicit Euler, dt 10 ms", (EULER, "solver.dt=0.01")),
            Rung("without friction", ("contact.friction.coefficient=0",)),
            Rung("stiffness 100 MPa", ("contact.stiffness=1e8",)),
            Rung("in space", ("solver.dimension=3",)),
        ),
    ),
)

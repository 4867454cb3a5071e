"""Resting, creeping, sliding, rolling: contact and friction on a plane."""

from __future__ import annotations

import math
from functools import cache, partial

import numpy as np
from scipy.optimize import brentq

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.testing.gaps import GapCheck
from bilayer_core.verification.validate.closed_forms import oblique_slide
from bilayer_core.verification.validate.parts import GROUND, ball, contact, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

GRAVITY = 9.81
MESHES = (10, 20, 40)
STEEP, GENTLE = 0.5, 0.2
"""Angles of slopes [rad]: a block slides down the first and creeps down the second."""
SLIPPERY, ROUGH = 0.3, 0.5
"""Friction coefficients there."""


def tilted_gravity(angle: float) -> list[float]:
    """Return the gravity on level ground that acts like a slope down to +x [m/s²]."""
    return [GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)]


def block(gravity: list[float], friction: dict, dt: float = 1e-3) -> Simulator:
    """Return a simulator of a short stiff strip along x on the ground; `friction` is as in a scene."""
    strip = rod([layer(thickness=2e-3)], length=0.02, stations=5, start=(0, 0, 1.99e-3))
    surroundings = {"obstacles": [GROUND], "contact": {**contact(), "friction": friction}}
    solver = {"dt": dt, "integrator": "implicit_euler"}
    return Simulator(load_scene(scene([strip], gravity=gravity, solver=solver, **surroundings)))


def acceleration(simulator: Simulator, settle: float = 0.05, time: float = 0.2) -> np.ndarray:
    """Return the mean acceleration of the nodes over `time` [s], after `settle` [s], shape (3,)."""
    simulator.run(settle)
    before = simulator.velocities.mean(axis=0)
    simulator.run(time)
    return (simulator.velocities.mean(axis=0) - before) / time


def stacked(model: str, dimension: int) -> tuple[float, float]:
    """Return the distance of the middles of two strips of unlike layers, one on the other on the ground [mm].

    Without friction the upper one would slide off.
    """
    unlike = {"paper": {"youngs_modulus": 2e9, "poisson_ratio": 0.4, "density": 1000.0}}
    layers = [layer("bottom"), layer("top", material="paper")]
    heights = {"low": 1.999e-3, "high": 4.998e-3}
    strips = [rod(layers, 0.05, 11, (0, 0, height), name) for name, height in heights.items()]
    config = scene(
        strips,
        gravity=[0, 0, -GRAVITY],
        obstacles=[GROUND],
        contact=contact(coefficient=0.5),
        solver={"model": model, "dimension": dimension},
    )
    config["materials"] |= unlike
    simulator = Simulator(load_scene(config))
    simulator.solve_static()
    first, last = (  # nodes of the bottom layer, or of the laminate
        strand.first_node for strand in simulator.model.strands if strand.name.split("/")[1] in ("bottom", "laminate")
    )
    return 1e3 * float(simulator.positions[last + 5, 2] - simulator.positions[first + 5, 2]), 2.0 + 1e3 * resting_gap()


def side_by_side() -> tuple[float, float]:
    """Return the distance of the middles of two strips on the ground, one pushed against the edge of the other [mm].

    A border stands for a quarter of the width: of what carries a load all over, it has a quarter.
    """
    strips = [rod([layer(thickness=2e-3)], 0.02, 5, (0, y, 1.99e-3), name) for name, y in (("a", 0.0), ("b", 0.0112))]
    strips[0] |= {"clamp_start": "wall"}
    config = scene(
        strips,
        gravity=[0, -GRAVITY, -GRAVITY],
        obstacles=[GROUND],
        bodies=[fixed(position=(0, 0, 1.99e-3))],
        contact=contact(),
        damping={"mass": 50.0},
        solver={"model": "laminate", "integrator": "sdirk2", "dt": 2e-3},
    )
    simulator = Simulator(load_scene(config))
    simulator.run(1.0)
    distances = simulator.positions[5:, 1] - simulator.positions[:5, 1]
    return 1e3 * float(distances.mean()), 10.0 + 1e3 * resting_gap(4.0)


def slide_on_a_ribbon() -> tuple[float, float]:
    """Return the acceleration of a strip down another one on a steep slope [m/s²]."""
    upper = rod([layer(thickness=2e-3)], 0.02, 5, (0.002, 0, 4.98e-3), "upper")
    lower = rod([layer(thickness=2e-3)], 0.08, 17, (0, 0, 1.99e-3), "lower", clamp_start="wall")
    config = scene(
        [lower, upper],
        gravity=tilted_gravity(STEEP),
        obstacles=[GROUND],
        bodies=[fixed(position=(0, 0, 1.99e-3))],
        contact=contact(coefficient=SLIPPERY),
        solver={"model": "laminate"},
    )
    simulator = Simulator(load_scene(config))
    nodes = slice(17, None)
    simulator.run(0.05)
    before = simulator.velocities[nodes].mean(axis=0)
    simulator.run(0.1)
    found = (simulator.velocities[nodes].mean(axis=0) - before) / 0.1
    return float(found[0]), GRAVITY * (math.sin(STEEP) - SLIPPERY * math.cos(STEEP))


def overlap(config: dict, time: float, looks: int) -> tuple[float, float]:
    """Return how deep rods go into each other, as rectangles with round borders, at some moments of a run, or how far
    beyond the barrier distance they stay [mm]; 0.
    """
    simulator = Simulator(load_scene(config))
    judge, least = GapCheck(simulator.model), math.inf
    for _ in range(looks):
        simulator.run(time / looks)
        least = min(least, judge.smallest(judge.moment(simulator.frame())))
    return 1e3 * max(-least, least - config["contact"]["barrier_distance"], 0.0), 0.0


def petals() -> tuple[float, float]:
    """Return the overlap of petals of gel on paper, wide enough to meet with their edges as they close [mm]."""
    gel = {"youngs_modulus": 2e7, "poisson_ratio": 0.49, "density": 1050.0, "retardation_time": 5e-4}
    paper = {"youngs_modulus": 2e9, "poisson_ratio": 0.3, "density": 800.0, "retardation_time": 5e-4}
    swelling = {"stimulus": "base", "gain": 0.1, "interval": [0.0, 0.02]}
    layers = [layer("gel", 8e-4, "gel", eigenstrain=swelling), layer("paper", 1e-4, "paper")]
    width = {"at": [0, 0.025, 0.05], "value": [0.008, 0.014, 0.003]}
    pattern = {"axis": [0, 0, 1], "center": [0, 0, 0], "count": 5}
    petal = rod(layers, 0.05, 26, (0.01, 0, 0), "petal", width, pattern=pattern, clamp_start="centre")
    config = scene(
        [petal],
        bodies=[fixed("centre")],
        stimuli={"base": {"schedule": {"type": "ramp", "start": 0.0, "end": 1.5, "from": 0, "to": 1}}},
        contact={**contact(3e-4, 0.4, 1e-3), "stiffness": 1e6},
        solver={"model": "laminate", "integrator": "sdirk2", "dt": 5e-3},
    )
    return overlap({**config, "materials": {"gel": gel, "paper": paper}}, 1.8, 6)


def roll() -> tuple[float, float]:
    """Return the overlap of the turns of a coated slab that rolls up by its film [mm]."""
    soft = {"youngs_modulus": 1e6, "poisson_ratio": 0.45, "density": 1000.0, "retardation_time": 2e-3}
    swelling = {"stimulus": "film", "gain": -0.1}
    layers = [layer("slab", 2e-3, "slab"), layer("film", 1e-4, "film", eigenstrain=swelling)]
    config = scene(
        [rod(layers, 0.1, 81, clamp_start="wall")],
        bodies=[fixed()],
        damping={"mass": 20.0},
        stimuli={"film": {"schedule": {"type": "ramp", "start": 0, "end": 0.5, "from": 0, "to": 1}}},
        contact={"barrier_distance": 2e-4, "stiffness": 1e6, "rods": True},
        solver={"model": "laminate", "dimension": 2, "integrator": "sdirk2", "dt": 1e-3},
    )
    return overlap({**config, "materials": {"slab": soft, "film": {**soft, "youngs_modulus": 1e8}}}, 0.8, 8)


@cache
def resting_gap(times: float = 1.0) -> float:
    """Return the gap d [m] at which the barrier carries some times 10 mm × 2 mm of density 1000: K_c [2(d − d̂)
    log(d/d̂) + (d − d̂)²/d] = q.
    """
    limit, stiffness, weight = 1e-3, 1e7, times * 1000.0 * GRAVITY * 0.01 * 2e-3

    def excess(d: float) -> float:
        return stiffness * (2.0 * (d - limit) * math.log(d / limit) + (d - limit) ** 2 / d) - weight

    return brentq(excess, 0.5 * limit, limit * (1.0 - 1e-9), xtol=1e-16)


def compression(edges: int) -> tuple[float, float]:
    """Return d̂ − d of the node that is worst off, and as it should be [µm]."""
    layers = [layer("bottom"), layer("top")]
    strip = rod(layers, stations=edges + 1, start=(0, 0, 2e-3))
    config = scene([strip], gravity=[0, 0, -GRAVITY], obstacles=[GROUND], contact=contact())
    simulator = Simulator(load_scene(config))
    simulator.solve_static()
    gaps = simulator.positions[: edges + 1, 2] - 0.5e-3
    worst = gaps[np.argmax(np.abs(gaps - resting_gap()))]
    return 1e6 * (1e-3 - worst), 1e6 * (1e-3 - resting_gap())


def slide() -> tuple[float, float]:
    """Return the acceleration of a block down a steep slope [m/s²]."""
    simulator = block(tilted_gravity(STEEP), {"coefficient": SLIPPERY, "speed_threshold": 1e-4})
    answer = GRAVITY * (math.sin(STEEP) - SLIPPERY * math.cos(STEEP))
    return acceleration(simulator, settle=0.1)[0], answer


def creep() -> tuple[float, float]:
    """Return the speed of a block on a gentle slope [µm/s]: where the smoothed law's friction carries it."""
    threshold = 1e-3
    simulator = block(tilted_gravity(GENTLE), {"coefficient": ROUGH, "speed_threshold": threshold})
    simulator.run(0.5)
    answer = threshold * (1.0 - math.sqrt(1.0 - math.tan(GENTLE) / ROUGH))
    return 1e6 * simulator.velocities[:, 0].mean(), 1e6 * answer


DIRECTIONS = {
    "forward": ([4.0, 0.0, -GRAVITY], 0.1),
    "backward": ([-4.0, 0.0, -GRAVITY], 0.3),
    "left": ([0.0, 4.0, -GRAVITY], 0.2),
    "right": ([0.0, -4.0, -GRAVITY], 0.2),
}


def slide_toward(direction: str) -> tuple[float, float]:
    """Return the acceleration [m/s²] of a strip with a friction coefficient for each direction."""
    gravity, coefficient = DIRECTIONS[direction]
    friction = {"coefficient": 0.5, "speed_threshold": 1e-4, "forward": 0.1, "backward": 0.3, "sideways": 0.2}
    found = acceleration(block(gravity, friction))
    return float(found[:2] @ np.sign(gravity[:2])), 4.0 - coefficient * GRAVITY


@cache
def _oblique() -> tuple[np.ndarray, np.ndarray]:
    along, across, time = 0.1, 0.4, 0.3
    friction = {"coefficient": 0.5, "speed_threshold": 1e-4, "forward": along, "sideways": across}
    simulator = block([1.5, 6.0, -GRAVITY], friction)
    simulator.run(time)
    return simulator.velocities.mean(axis=0)[:2], oblique_slide((1.5, 6.0), (along, across), GRAVITY, time)


def rebound() -> tuple[float, float]:
    """Return the energy of a soft strip that has fallen flat on the ground from 10 m, over that before; the barrier is
    elastic.
    """
    soft = {"gel": {"youngs_modulus": 1e4, "poisson_ratio": 0.5, "density": 1000.0}}
    strip = rod([layer(thickness=2e-3)], length=0.05, start=(0, 0, 10))
    law = {**contact(barrier_distance=1e-4), "stiffness": 1e9}
    config = scene([strip], gravity=[0, 0, -GRAVITY], obstacles=[GROUND], contact=law, materials=soft)
    simulator = Simulator(load_scene({**config, "solver": {"tolerance": 1e-7}}))
    begin = GRAVITY * simulator.com[2]
    simulator.run(1.6)
    return (GRAVITY * simulator.com[2] + 0.5 * simulator.velocities[:, 2].mean() ** 2) / begin, 1.0


WIDTH, THICKNESS = 3e-3, 2e-3
"""Of a strip that stands on a slope across it, on its lower border: up to the slope (w − h)/h."""


def upright(part: float) -> float:
    """Return the cosine of the roll of a strip after half a second on a slope that is a part of the steepest."""
    angle = math.atan(part * (WIDTH - THICKNESS) / THICKNESS)
    strip = rod([layer(thickness=THICKNESS)], length=0.02, stations=5, start=(0, 0, 1.99e-3), width=WIDTH)
    gravity = [0.0, GRAVITY * math.sin(angle), -GRAVITY * math.cos(angle)]
    content = scene([strip], gravity=gravity, obstacles=[GROUND], contact=contact(coefficient=2.0))
    simulator = Simulator(load_scene(content))
    simulator.run(0.5)
    return float(simulator.frame().directors[:, 2].mean())


BALLS = {"solid": (False, 5.0 / 7.0), "hollow": (True, 3.0 / 5.0)}


@cache
def _rolling(kind: str) -> tuple[float, float, float]:
    """Return the acceleration [m/s²], speed [m/s] and ω r [m/s] of a ball on a slope."""
    angle, radius = 0.3, 0.02
    far_away = rod([layer()], length=0.02, stations=3, start=(0, 5, 5), clamp_start="wall")
    config = scene(
        [far_away],
        gravity=tilted_gravity(angle),
        obstacles=[GROUND],
        bodies=[fixed(position=(0, 5, 5)), ball((0, 0, 0.0208), radius, shell=BALLS[kind][0])],
        contact=contact(coefficient=0.6, speed_threshold=1e-4),
        solver={"integrator": "implicit_euler"},
    )
    simulator = Simulator(load_scene(config))
    simulator.run(0.1)
    before = simulator.frame()
    simulator.run(0.2)
    after = simulator.frame()
    speed = after.body_velocities[1, 0]
    return (speed - before.body_velocities[1, 0]) / 0.2, speed, after.body_angular_velocities[1, 1] * radius


def rolling_acceleration(kind: str) -> tuple[float, float]:
    """Return the acceleration of a ball down a slope of 0.3 rad, simulated and exact [m/s²]."""
    return _rolling(kind)[0], BALLS[kind][1] * GRAVITY * math.sin(0.3)


def rolling_slip(kind: str) -> tuple[float, float]:
    """Return the speed of its surface [m/s] against that of its centre."""
    return _rolling(kind)[2], _rolling(kind)[1]


CASES = [
    *cases(
        "contact/resting gap/{} edges",
        "barrier law: the force on each length is its weight (gap 0.9974448 mm, below d̂ by)",
        0.01,
        compression,
        MESHES,
        unit="µm",
    ),
    Case("contact/slide", "g (sin α − μ cos α)", 0.005, slide, "m/s²"),
    Case(
        "contact/stands on its width",
        "level while the slope across is below (w − h)/h, here 0.95 of it: cosine of the roll",
        1e-4,
        lambda: (upright(0.95), 1.0),
    ),
    *(
        Case(
            f"contact/unlike strips on each other/{model}, {dimension}-D",
            "thickness and the gap at which the barrier carries the weight: distance of middles",
            1e-7,
            partial(stacked, model, dimension),
            "mm",
        )
        for model in ("laminate", "two_rod")
        for dimension in (2, 3)
    ),
    Case(
        "contact/ribbons side by side",
        "width and the gap at which a quarter of the barrier carries the load: distance of middles",
        1e-4,
        side_by_side,
        "mm",
    ),
    *(
        Case(f"contact/{name}", "overlap of rectangles, as part of the thickness", limit, of, "mm", scale, long=True)
        for name, of, limit, scale in (
            ("petals that close", petals, 0.05, 0.9),
            ("coated slab that rolls up", roll, 0.01, 2.1),
        )
    ),
    Case("contact/slide on a ribbon", "g (sin α − μ cos α)", 0.005, slide_on_a_ribbon, "m/s²"),
    Case("contact/rebound at 14 m/s", "energy of a flat strip with sound at 3 m/s, over that before", 0.005, rebound),
    Case("contact/creep", "ε_v (1 − √(1 − tan α/μ))", 0.01, creep, "µm/s"),
    *cases(
        "contact/slide {}",
        "g_x − μ g with the coefficient of that direction",
        0.01,
        slide_toward,
        DIRECTIONS,
        unit="m/s²",
    ),
    *cases(
        "contact/slide obliquely/{1}",
        "greatest dissipation, μ = 0.1 along and 0.4 across, by Runge–Kutta",
        0.01,
        lambda k, _axis: (_oblique()[0][k], _oblique()[1][k]),
        enumerate("xy"),
        unit="m/s",
    ),
    *(
        Case(
            f"contact/rolling ball/{kind}/{figure}",
            against,
            0.01,
            lambda kind=kind, measure=measure: measure(kind),
            unit,
        )
        for kind in BALLS
        for figure, against, measure, unit in (
            ("acceleration", "g sin α/(1 + J/m r²)", rolling_acceleration, "m/s²"),
            ("surface speed", "that of its centre: no slip", rolling_slip, "m/s"),
        )
    ),
]

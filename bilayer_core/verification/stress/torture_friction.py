"""Torture cases of friction: a capstan, a block on a slope, leaning boards, a strip pulled from under a box."""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.testing.trial import Trial
from bilayer_core.verification.stress.ladder import Rung, Torture, first_broken
from bilayer_core.verification.stress.stress_case import Decision

Array = np.ndarray


def holds(trial: Trial) -> Decision:
    """Return the ratio of the two tensions of a strip that slides over a drum, while the hand is fastest."""
    simulator, friction = trial.simulator, trial.simulator.scene.contact.friction
    pull = abs(simulator.scene.loads[0].force[2])
    trial.run(CAPSTAN_FROM)
    tensions = []
    trial.run(each_step=lambda _: tensions.append(abs(float(simulator.clamps["strip.end"].wrench[2]))))
    ratio = float(np.mean(tensions)) / pull
    return Decision.near("T2/T1 half way round", ratio, math.exp(friction.coefficient * math.pi), CAPSTAN)


CAPSTAN_FROM = 0.5
"""Time from which on tensions are taken [s]: it slides at more than twenty times the threshold."""
CAPSTAN = 0.03
"""Relative error that is allowed: edges are straight, and the strip is as stiff as 0.3 % of its tension."""


def slides(trial: Trial) -> Decision:
    """Return the acceleration of a block down a slope, or how fast it creeps over the threshold of friction."""
    simulator, scene = trial.simulator, trial.simulator.scene
    friction, (along, _, down) = scene.contact.friction, scene.gravity
    coefficient, steep = friction.coefficient, along / -down

    def speed() -> float:
        return float(simulator.frame().body_velocities[1, 0])

    trial.run(0.5 * scene.duration)
    before, begin = speed(), simulator.time
    trial.run()
    if coefficient < steep:
        gained = (speed() - before) / (simulator.time - begin)
        return Decision.near("acceleration down the slope", gained, along + coefficient * down, SLIDE, "m/s²")
    creep = 1.0 - math.sqrt(1.0 - steep / coefficient)
    return Decision.near("speed over the threshold of friction", speed() / friction.speed_threshold, creep, SLIDE)


SLIDE = 0.03
"""Relative error of an acceleration and of a creep."""


def stands(trial: Trial) -> Decision:
    """Return by how much the top of two boards has sunk, over their length, from when they have come to bear on each
    other.
    """
    simulator, scene = trial.simulator, trial.simulator.scene
    coefficient = scene.contact.friction.coefficient
    needed = 0.5 / math.tan(scene.bodies[1].rotation[1] * -1.0)

    def height() -> float:
        return float(simulator.frame().body_positions[1:, 2].mean())

    trial.run(SETTLED)
    start, board = height(), max(scene.bodies[1].surface.size)
    trial.run()
    sunk = (start - height()) / board
    what = f"way down over the length of a board, with {coefficient / needed:.3g} of the coefficient needed"
    creep = scene.contact.friction.speed_threshold * scene.duration / board
    return Decision(what, sunk, *((-creep, creep) if coefficient > needed else (FALLEN, 1.0)))


SETTLED = 0.05
"""Time after which the boards bear on each other [s]."""
FALLEN = 0.1
"""Over the length of a board."""


def stays_on_table(trial: Trial) -> Decision:
    """Return the speed that the box has got, over what friction can give it: from the strip, and back from the
    table.
    """
    simulator, scene = trial.simulator, trial.simulator.scene
    largest, lowest, begin = 0.0, math.inf, scene.bodies[0].motion.times[0]
    half = 0.5 * scene.bodies[1].surface.size[2]
    sliding = scene.contact.friction.coefficient * -scene.gravity[2]

    def look(time: float) -> None:
        nonlocal largest, lowest
        frame = simulator.frame()
        lowest = min(lowest, float(frame.body_positions[1, 2]) - half)
        if time > begin:
            speed = math.hypot(*frame.body_velocities[1, :2])
            largest = max(largest, (speed - scene.contact.friction.speed_threshold) / (sliding * scene.duration))

    trial.run(each_step=look)
    given = Decision("largest speed of the box over μ g t", largest, 0.0, 1.0)
    return first_broken(given, Decision("lowest height of the box above the table", lowest, 0.0, math.inf, "m"))


def _friction(value: float) -> str:
    return f"contact.friction.coefficient={value}"


EULER = "solver.integrator=implicit_euler"
BOARDS_NEED = 0.2887
FRICTION = (
    Torture(
        12,
        "capstan",
        "capstan",
        "Euler",
        "T2/T1 = e^{μθ}",
        "T2/T1 within 3 % of exp(μ π)",
        holds,
        (
            Rung("mu 0.1", (_friction(0.1),)),
            Rung("mu 0.2", (_friction(0.2),)),
            Rung("mu 0.4"),
            Rung(
                "mu 0.8", (_friction(0.8), "materials.film.youngs_modulus=1e9", "rods.strip.layers.film.thickness=1e-4")
            ),
            Rung("mu 0.4, dt 1 ms", ("solver.dt=0.001",)),
            Rung("mu 0.4, implicit Euler, dt 10 ms", (EULER, "solver.dt=0.01")),
            Rung("mu 0.4, 241 stations", ("rods.strip.stations=241",)),
            Rung("mu 0.4, threshold 0.01 mm/s", ("contact.friction.speed_threshold=1e-5",)),
        ),
    ),
    Torture(
        13,
        "block on a slope",
        "slope",
        "IPC",
        "μ 0.49 slides, 0.5 sticks",
        "acceleration within 3 % of g (sin α − μ cos α); or creep within 3 % of the smoothed law's, which is "
        "the threshold of friction at most",
        slides,
        (
            Rung("mu 0.49"),
            Rung("mu 0.49, dt 1 ms", ("solver.dt=0.001",)),
            Rung("mu 0.49, implicit Euler, dt 10 ms", (EULER, "solver.dt=0.01")),
            Rung("mu 0.5", (_friction(0.5),)),
            Rung("mu 0.5, threshold 0.01 mm/s", (_friction(0.5), "contact.friction.speed_threshold=1e-5")),
            Rung("mu 0.51", (_friction(0.51),)),
            Rung("mu 0.51, implicit Euler, dt 10 ms", (_friction(0.51), EULER, "solver.dt=0.01")),
            Rung("mu 0.6, stiffness 1 GPa", (_friction(0.6), "contact.stiffness=1e9")),
        ),
    ),
    Torture(
        14,
        "two leaning boards",
        "boards",
        "IPC, whose arch has wedge-shaped blocks",
        "stands; falls at low μ",
        "an arch of two boards stands from μ = 1/(2 tan β) on: it sinks by less than friction creeps, else by 10 % of "
        "a board",
        stands,
        (
            *(
                Rung(f"{part:g} of mu needed", (_friction(part * BOARDS_NEED),))
                for part in (0.3, 0.7, 0.9, 1.1, 1.5, 3.0)
            ),
            Rung("1.5, dt 1 ms", (_friction(1.5 * BOARDS_NEED), "solver.dt=0.001")),
            Rung("0.7, implicit Euler, dt 5 ms", (_friction(0.7 * BOARDS_NEED), EULER, "solver.dt=0.005")),
        ),
    ),
    Torture(
        19,
        "strip pulled from under a box",
        "tablecloth",
        "Codimensional IPC",
        "stable at dt 10 ms",
        "speed of the box below μ g t, its height above the table, and no gap below zero",
        stays_on_table,
        (
            Rung("2 m/s, adaptive"),
            *(
                Rung(
                    f"{speed:g} m/s, dt 10 ms",
                    (f"bodies.hand.motion.times=[0.1, {0.1 + 0.2 / speed}]", "solver.dt=0.01"),
                )
                for speed in (0.5, 2.0, 8.0)
            ),
            Rung("0.5 m/s, implicit Euler, dt 10 ms", ("bodies.hand.motion.times=[0.1, 0.5]", EULER, "solver.dt=0.01")),
            Rung("8 m/s, adaptive", ("bodies.hand.motion.times=[0.1, 0.125]",)),
            Rung("8 m/s, implicit Euler, dt 10 ms", ("bodies.hand.motion.times=[0.1, 0.125]", EULER, "solver.dt=0.01")),
            Rung("2 m/s, in space", ("solver.dimension=3",)),
        ),
    ),
)

"""Torture cases of single beams in motion: snapping arches, free flight, and a column driven at twice a frequency."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from bilayer_core.testing.judge import MOST_GAIN
from bilayer_core.testing.trial import Trial
from bilayer_core.verification.stress.kirchhoff import stiffness
from bilayer_core.verification.stress.ladder import Rung, Torture, first_broken
from bilayer_core.verification.stress.stress_case import Decision

Array = np.ndarray


def snaps(trial: Trial) -> Decision:
    """Return how lop-sided an arch gets on its way through, over its rise."""
    simulator = trial.simulator
    start = simulator.positions[:, 2].copy()
    rise, largest, through = float(start.max()), 0.0, False

    def look(_: float) -> None:
        nonlocal largest, through
        height = simulator.positions[:, 2]
        through = through or bool(height[len(height) // 2] < -0.5 * rise)
        if not through:
            largest = max(largest, 0.5 * float(np.abs(height - height[::-1]).max()) / rise)

    trial.run(each_step=look)
    slow = simulator.scene.loads[0].schedule.end > SLOW_PUSH
    low, high = (LOPSIDED, math.inf) if slow else (0.0, SYMMETRIC)
    return Decision("lop-sided part over the rise", largest if through else math.nan, low, high)


SLOW_PUSH = 0.5
"""Seconds in which the load of a slow push grows; several periods of the arch."""
LOPSIDED, SYMMETRIC = 0.2, 0.02
"""Over the rise: of a slow push and of a fast one."""


def snaps_late(trial: Trial) -> Decision:
    """Return the delay of a snap beyond the largest load that has an equilibrium, against that of the arch's one mode.

    With the shape y sin k x, k = π/L, of a rise a without stress, under the load q sin k x downwards,

        ρA y″ = EI k⁴ (a − y) + EA k⁴/4 (a² − y²) y − q,

    and q is largest in equilibrium at y² = (a² − 4 I/A)/3 (Timoshenko and Gere).
    """
    simulator, scene = trial.simulator, trial.simulator.scene
    rod, middle, crossed = scene.rods[0], len(simulator.positions) // 2, []

    def look(time: float) -> None:
        if not crossed and simulator.positions[middle, 2] < 0.0:
            crossed.append(time)

    a, span = float(simulator.positions[middle, 2]), float(np.ptp(simulator.positions[:, 0]))
    wave, bending = math.pi / span, float(stiffness(scene)[2])
    slender = 3.0 / rod.layers[0].thickness ** 2
    line = scene.materials["film"].density * rod.width * rod.layers[0].thickness

    def resists(y: float) -> float:
        return bending * wave**4 * (a - y + slender * (a**2 - y**2) * y)

    loads, ramp = scene.loads, scene.loads[0].schedule.end
    total = sum(-load.force[2] * math.sin(math.pi * (i + 1) / (len(loads) + 1)) for i, load in enumerate(loads))
    rate = total * 2.0 / span / ramp  # of q, by the work of the loads on the mode
    critical = resists(math.sqrt((a**2 - 1.0 / slender) / 3.0)) / rate
    passing = [lambda t, y: y[0]]
    passing[0].terminal = True
    way = solve_ivp(
        lambda t, y: (y[1], (resists(y[0]) - rate * t) / line),
        (0.0, ramp),
        (a, 0.0),
        events=passing,
        rtol=1e-9,
        atol=1e-12,
    )
    trial.run(each_step=look)
    delay = crossed[0] - critical if crossed else math.nan
    return Decision.near("delay of the snap", delay, float(way.t[-1]) - critical, 0.05, "s")


def _ramps(seconds: float) -> tuple[str, ...]:
    return (
        f"duration={seconds}",
        "solver.tolerance=1e-6",
        *(f"loads.push{i}.schedule.end={seconds}" for i in range(1, 10)),
    )


def keeps_momenta(trial: Trial) -> Decision:
    """Return the momentum and angular momentum of a beam in free flight."""
    simulator, scene = trial.simulator, trial.simulator.scene
    end = scene.loads[0].schedule.times[-1]
    trial.run(end)
    impulse = sum(np.array(load.force) * 0.5 * end for load in scene.loads)
    first = simulator.frame()
    energy = [sum(first.energy.values()) + _kinetic(trial)]
    moment = _moment(trial)

    def look(_: float) -> None:
        energy.append(sum(simulator.energy().values()) + _kinetic(trial))

    trial.run(each_step=look)
    mass = simulator.model.rods.node_mass
    off = float(np.linalg.norm(mass @ simulator.velocities - impulse) / np.linalg.norm(impulse))
    lost = float(np.linalg.norm(_moment(trial) - moment) / np.linalg.norm(moment))
    grown = max(energy) / energy[0] - 1.0
    kept = Decision("momentum off the impulse, over it", off, 0.0, 1e-6)
    turning = Decision("angular momentum that changed, over all", lost, 0.0, ANGULAR[simulator.plan.integrator])
    bounded = Decision("largest rise of the energy after the push", grown, -1.0, MOST_GAIN)
    return first_broken(turning, kept, bounded)


ANGULAR = {
    "implicit_midpoint": 1e-6,
    "sdirk2": 1e-2,
    "tr_bdf2": 1e-2,
    "generalised_alpha": 1e-2,
    "implicit_euler": 1e-2,
}
"""Angular momentum that may change in all, over it: with the midpoint rule what Newton leaves."""


def _kinetic(trial: Trial) -> float:
    return 0.5 * float(trial.simulator.model.rods.node_mass @ (trial.simulator.velocities**2).sum(axis=1))


def _moment(trial: Trial) -> Array:
    simulator = trial.simulator
    return simulator.model.rods.node_mass @ np.cross(simulator.positions, simulator.velocities)


def grows(trial: Trial) -> Decision:
    """Return the rate at which the middle of a driven column swings more and more, by the halves of the time after the
    tap.
    """
    simulator, scene = trial.simulator, trial.simulator.scene
    length = scene.rods[0].path.length
    line = scene.materials["film"].density * scene.rods[0].width * scene.rods[0].layers[0].thickness
    frequency = math.pi**2 * math.sqrt(float(stiffness(scene)[2]) / line) / length**2
    part = abs(scene.loads[0].force[0]) / (float(stiffness(scene)[2]) * (math.pi / length) ** 2)
    times, swings = [], []

    def look(time: float) -> None:
        times.append(time)
        swings.append(float(simulator.positions[len(simulator.positions) // 2, 2]))

    trial.run(each_step=look)
    at, swing = np.array(times), np.abs(np.array(swings))
    quarter = 0.25 * scene.duration
    early = swing[(at > quarter) & (at < 2.0 * quarter)].max()
    late = swing[at > 3.0 * quarter].max()
    rate = math.log(late / early) / (2.0 * quarter)
    damped = 0.5 * scene.damping.mass
    if simulator.plan.integrator == "implicit_euler":
        damped += 0.5 * frequency**2 * simulator.dt
    tuned = 2.0 * math.pi / scene.loads[0].schedule.period / frequency - 2.0
    inside = 0.25 * part * frequency - damped
    if abs(tuned) > 0.5 * part:
        return Decision("growth outside of the tongue", rate, -math.inf, 0.5 * damped, "1/s")
    width = GROWTH * 0.25 * part * frequency
    return Decision("growth inside of the tongue", rate, inside - width, inside + width, "1/s")


GROWTH = 0.1
"""Of the growth without damping: how far off the measured one may be."""


EULER = "solver.integrator=implicit_euler"
MIDPOINT = "solver.integrator=implicit_midpoint"
FAST = ("loads.push.force=[0, 0, -1]", "loads.push.schedule.end=0.02", "duration=0.2")
MOTION = (
    Torture(
        10,
        "snap-through of an arch",
        "arch_push",
        "arXiv 2312.13908",
        "slow: asymmetric; fast: symmetric",
        "largest lop-sided part until it is through: above 20 % of the rise where the push takes 3 s, below 2 % where "
        "it takes 20 ms",
        snaps,
        (
            Rung("slow"),
            Rung("slow, tolerance 1e-3", ("solver.tolerance=1e-3",)),
            Rung("slow, 81 stations", ("rods.arch.stations=81",)),
            Rung("slow, implicit Euler, dt 2 ms", (EULER, "solver.dt=0.002")),
            Rung("fast", FAST),
            Rung("fast, 81 stations", (*FAST, "rods.arch.stations=81")),
            Rung("fast, implicit Euler, dt 0.2 ms", (*FAST, EULER, "solver.dt=0.0002")),
        ),
    ),
    Torture(
        11,
        "delay at a saddle-node",
        "delay",
        "arXiv 2312.15699",
        "delay scales as at a saddle-node",
        "delay within 5 % of that of the equation of the arch's one mode, over sixteen times of the rate; skipped "
        "modes of a ribbon are not looked at",
        snaps_late,
        (
            *(Rung(f"ramp of {seconds:g} s", _ramps(seconds)) for seconds in (0.5, 1.0, 2.0, 4.0, 8.0)),
            Rung(
                "ramp of 2 s, implicit midpoint, dt 1 ms",
                (*_ramps(2.0), MIDPOINT, "solver.dt=0.001", "solver.tolerance=null"),
            ),
            Rung("ramp of 2 s, in space", (*_ramps(2.0), "solver.dimension=3")),
        ),
    ),
    Torture(
        24,
        "free-flying beam",
        "free_flight",
        "Simo and Vu-Quoc 1986",
        "momenta kept; energy bounded",
        "momentum is the impulse to 1e-6; angular momentum changes by 1e-6 (midpoint) or 1 % at most; "
        "energy does not rise",
        keeps_momenta,
        (
            Rung("sdirk2"),
            Rung("tr_bdf2", ("solver.integrator=tr_bdf2",)),
            Rung("generalised alpha, dt 2 ms", ("solver.integrator=generalised_alpha", "solver.dt=0.002")),
            Rung("implicit midpoint, dt 1 ms", (MIDPOINT, "solver.dt=0.001")),
            Rung("implicit midpoint, dt 5 ms", (MIDPOINT, "solver.dt=0.005")),
            Rung("implicit Euler, dt 5 ms", (EULER, "solver.dt=0.005")),
            Rung("sdirk2, tolerance 1e-3", ("solver.tolerance=1e-3",)),
        ),
    ),
    Torture(
        25,
        "parametric drive",
        "mathieu",
        "Mathieu",
        "grows inside the tongue, decays outside; implicit Euler hides it",
        "growth within 10 % of p w/4 − c/2, with implicit Euler less w² h/2; none outside of |W/w − 2| < p/2",
        grows,
        (
            Rung("inside"),
            Rung("inside, tolerance 1e-6", ("solver.tolerance=1e-6",)),
            Rung("inside, implicit midpoint, dt 1 ms", (MIDPOINT, "solver.dt=0.001")),
            Rung("inside, generalised alpha, dt 1 ms", ("solver.integrator=generalised_alpha", "solver.dt=0.001")),
            Rung("inside, implicit Euler, dt 1 ms", (EULER, "solver.dt=0.001")),
            Rung("inside, implicit Euler, dt 5 ms: hidden", (EULER, "solver.dt=0.005")),
            Rung("outside, 1.7 w", ("loads.drive.schedule.period=0.1297244",)),
            Rung("outside, 2.3 w", ("loads.drive.schedule.period=0.0958833",)),
        ),
    ),
)

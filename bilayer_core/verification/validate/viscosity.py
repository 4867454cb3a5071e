"""Kelvin–Voigt viscosity: decay of vibrations, creep, spin without loss, and the order of each integrator with it."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import curve_fit

from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.motion import change_of_spin, let_go
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

LENGTH, STATIONS, FIRST_MODE = 0.1, 31, 1.8751040687119611
METHODS = tuple(name for name in INTEGRATORS if name not in ("implicit_euler", "implicit_midpoint"))


def gel(time: float, youngs_modulus: float = 1e6) -> dict:
    """Return a material with a retardation time [s]."""
    return {"youngs_modulus": youngs_modulus, "poisson_ratio": 0.5, "density": 1000.0, "retardation_time": time}


def damping_ratio(
    model: str, dimension: int, integrator: str, times: tuple[float, float] = (0.02, 0.02)
) -> tuple[float, float]:
    """Return the damping ratio ζ of the first bending mode of a cantilever of two equal layers, from a fit to its tip,
    and ω τ/2 for comparison.

    EI (w″″ + τ ẇ″″) + ρA ẅ = 0 has for each mode q̈ + τ ω² q̇ + ω² q = 0; either layer has half
    of the stiffness, so that τ is the mean of theirs.
    """
    cantilever = rod(
        [layer("bottom"), layer("top", material="top")],
        length=LENGTH,
        stations=STATIONS,
        clamp_start="wall",
        name="cantilever",
    )
    solver = {"newton_tolerance": 1e-11, "integrator": integrator, "model": model, "dimension": dimension}
    content = scene(
        [cantilever], solver=solver, bodies=[fixed()], materials={"gel": gel(times[0]), "top": gel(times[1])}
    )
    simulator = Simulator(load_scene(content), dt=1e-3)
    x, velocity = FIRST_MODE * simulator.positions[:, 0] / LENGTH, np.zeros_like(simulator.positions)
    velocity[:, 2] = 1e-4 * (np.cosh(x) - np.cos(x) - 0.7340955 * (np.sinh(x) - np.sin(x)))
    let_go(simulator, velocity)
    moments, tip, start = [], [], simulator.positions[STATIONS - 1, 2]
    while simulator.time < 3.0:
        simulator.step()
        moments.append(simulator.time)
        tip.append(1e5 * (simulator.positions[STATIONS - 1, 2] - start))

    def decaying(t, a, b, decay, omega):
        return np.exp(-decay * t) * (a * np.cos(omega * t) + b * np.sin(omega * t))

    late = np.array(moments) > 0.3  # higher modes have died away
    (_, _, decay, omega), _ = curve_fit(decaying, np.array(moments)[late], np.array(tip)[late], p0=[0, 3, 0.4, 6.4])
    natural = math.hypot(decay, omega)
    return decay / natural, 0.25 * natural * sum(times)


def creep() -> tuple[float, float]:
    """Return the strain of a light strip one retardation time after a sudden pull, over that at rest."""
    time, force, length = 0.05, 1e-3, 0.01
    light = gel(time) | {"density": 1e-3}
    strip = rod([layer()], length=length, stations=6, clamp_start="wall", name="strip")
    pull = {"name": "pull", "rod": "strip", "position": length, "force": [force, 0, 0]}
    solver = {"integrator": "tr_bdf2", "newton_tolerance": 1e-12}
    content = scene([strip], solver=solver, bodies=[fixed()], materials={"gel": light}, loads=[pull])
    simulator = Simulator(load_scene(content), dt=time / 200)
    simulator.run(time)
    at_rest = force / (light["youngs_modulus"] * strip["width"] * strip["layers"][0]["thickness"])
    return (simulator.positions[5, 0] / length - 1.0) / at_rest, 1.0 - math.exp(-1.0)


def spun(integrator: str) -> float:
    """Return the angular momentum that a soft viscous strip loses in half a second at 20 rad/s once it has stretched,
    over its own.
    """
    ribbon = rod([layer(thickness=2e-3)], length=LENGTH, stations=11, start=(-0.5 * LENGTH, 0, 0))
    solver = {"dt": 1e-3, "integrator": integrator, "newton_tolerance": 1e-11}
    simulator = Simulator(load_scene(scene([ribbon], materials={"gel": gel(0.01, 1e5)}, solver=solver)))
    return change_of_spin(simulator, 0.5, 0.5)


def order(integrator: str, time: float = 1e-3, steps: tuple[float, ...] = (1e-3, 5e-4, 2.5e-4)) -> tuple[float, float]:
    """Return the order in time from the tip of a soft, viscous bilayer that a smooth force swings far in space, at
    successively halved steps.
    """
    arm = rod(
        [layer("bottom"), layer("top", natural_twist=5.0)], length=0.06, stations=11, clamp_start="wall", name="arm"
    )
    swing = {"type": "sine", "mean": 1, "amplitude": 1, "period": 0.1, "phase": -0.5 * math.pi}
    load = {"name": "swing", "rod": "arm", "position": 0.06, "force": [0, 2e-3, 4e-3], "schedule": swing}
    solver = {"newton_tolerance": 1e-11, "integrator": integrator}
    content = scene([arm], solver=solver, bodies=[fixed()], materials={"gel": gel(time)}, loads=[load])
    tips = []
    for dt in steps:
        simulator = Simulator(load_scene(content), dt=dt)
        simulator.run(0.1)
        tips.append(simulator.positions[10])
    differences = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    return math.log2(differences[0] / differences[1]), float(INTEGRATORS[integrator].order)


CASES = [
    *(
        Case(
            f"viscosity/decay/{model} {dimension}-D {integrator}",
            "damping ratio ω τ/2 of a cantilever's first mode",
            1e-4,
            lambda model=model, dimension=dimension, integrator=integrator: damping_ratio(model, dimension, integrator),
        )
        for model, dimension, integrator in (
            *(("laminate", 2, integrator) for integrator in METHODS),
            ("laminate", 3, "tr_bdf2"),
            ("two_rod", 2, "tr_bdf2"),
            ("two_rod", 3, "tr_bdf2"),
        )
    ),
    Case(
        "viscosity/decay/of one layer",
        "damping ratio ω τ/4 for small ω τ where one layer of two is viscous",
        2e-4,
        lambda: damping_ratio("two_rod", 3, "tr_bdf2", (0.0, 0.004)),
    ),
    Case("viscosity/creep", "1 − 1/e of the strain at rest, one retardation time after a pull", 1e-4, creep),
    *cases(
        "viscosity/spin/{}",
        "angular momentum of a spinning strip, which viscosity leaves alone",
        2e-5,
        lambda integrator: (spun(integrator), 0.0),
        ("tr_bdf2", "generalised_alpha"),
        scale=1.0,
    ),
    *cases(
        "viscosity/order in time/{}",
        "the integrator's order, at a viscous arm's tip",
        0.15,
        order,
        METHODS,
        scale=1.0,
        long=True,
    ),
]

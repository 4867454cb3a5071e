"""Beams: a heavy cantilever against the elastica, loads of buckling, stiffness of a bonded pair, slow vibration."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import (
    EULER_FREE_END,
    FIRST_MODE,
    GREENHILL,
    bonded_bending_stiffness,
    heavy_cantilever,
)
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

LENGTH, WIDTH, THICKNESS, DENSITY, GRAVITY = 0.1, 0.01, 2e-3, 1000.0, 9.81
SOFT = 1e6
"""Young's modulus [Pa] with which the cantilever's tip sinks by 87 % of its length."""
WEIGHT = DENSITY * GRAVITY * WIDTH * THICKNESS
BENDING, AXIAL = SOFT * WIDTH * THICKNESS**3 / 12.0, SOFT * WIDTH * THICKNESS
MESHES = (50, 100, 200)
BRACKET = (0.9, 1.1)
"""Of the answer: where a load of buckling is looked for."""
BISECTIONS = 10


def beam(stations: int, gravity: tuple[float, float, float] = (0.0, 0.0, 0.0), **more) -> dict:
    """Return one soft layer along x, clamped at the origin."""
    material = {"youngs_modulus": SOFT, "poisson_ratio": 0.5, "density": DENSITY}
    strip = rod([layer(thickness=THICKNESS)], LENGTH, stations, clamp_start="wall")
    return scene([strip], gravity=list(gravity), bodies=[fixed()], materials={"gel": material}, **more)


@cache
def elastica_tip() -> tuple[float, float]:
    """Return the tip (x, z) of the heavy cantilever [m], exact."""
    return tuple(heavy_cantilever(WEIGHT, BENDING, AXIAL, LENGTH))


@cache
def cantilever_tip(edges: int, dimension: int = 3) -> tuple[float, float]:
    """Return the tip (x, z) of the heavy cantilever [m], simulated with rods."""
    simulator = Simulator(load_scene(beam(edges + 1, (0.0, 0.0, -GRAVITY))), dimension=dimension)
    simulator.solve_static()
    return tuple(simulator.positions[-1, [0, 2]])


def cantilever_error(edges: int) -> float:
    """Return the distance of the tip from where it should be, over the length."""
    return math.dist(cantilever_tip(edges), elastica_tip()) / LENGTH


def order_in_space() -> tuple[float, float]:
    """Return the order of convergence of the cantilever's tip under refinement, and the expected order, 2."""
    coarse, fine = (cantilever_error(edges) for edges in MESHES[1:])
    return math.log2(coarse / fine), 2.0


def _critical(answer: float, description: Callable[[float], dict], dimension: int) -> tuple[float, float]:
    """Return the multiple of `answer` at which a straight column becomes unstable, by bisection, and 1."""
    low, high = BRACKET
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        simulator = Simulator(load_scene(description(middle * answer)), dimension=dimension)
        low, high = (middle, high) if simulator.solve_static().stable else (low, middle)
    return 0.5 * (low + high), 1.0


def imperfect_column(
    part: float, direction: str = "normal", dimension: int | str = "auto", model: str = "laminate"
) -> tuple[float, float]:
    """Return the distance of a column's tip from its axis at a part of Euler's load, over its imperfection, and 1/(1 −
    part).
    """
    size, sides = 1e-4 * LENGTH, (WIDTH, THICKNESS) if direction == "normal" else (THICKNESS, WIDTH)
    load = part * EULER_FREE_END * BENDING / LENGTH**2
    press = {"name": "press", "rod": "rod", "position": LENGTH, "force": [-load, 0, 0]}
    config = beam(101, loads=[press])
    imperfection = {"shape": "bow", "size": size, "direction": direction}
    config["rods"][0] |= {"width": sides[0], "imperfection": imperfection, "layers": [layer(thickness=sides[1])]}
    simulator = Simulator(load_scene(config), dimension=dimension, model=model)
    simulator.solve_static()
    return float(np.linalg.norm(simulator.positions[100, 1:])) / size, 1.0 / (1.0 - part)


def eulers_load(dimension: int = 3) -> tuple[float, float]:
    """Return the end load at which a column with one free end buckles, over Euler's."""

    def pressed(load: float) -> dict:
        return beam(101, loads=[{"name": "press", "rod": "rod", "position": LENGTH, "force": [-load, 0, 0]}])

    return _critical(EULER_FREE_END * BENDING / LENGTH**2, pressed, dimension)


def greenhills_weight(dimension: int = 3) -> tuple[float, float]:
    """Return the weight at which an upright column buckles, over Greenhill's."""
    mass = DENSITY * WIDTH * THICKNESS
    return _critical(GREENHILL * BENDING / LENGTH**3 / mass, lambda g: beam(101, (-g, 0.0, 0.0)), dimension)


PAIRS = {
    "equal layers": ((1e8, 1e8), (1e-3, 1e-3)),
    "modulus ratio 5": ((5e8, 1e8), (1e-3, 1e-3)),
    "thickness ratio 3": ((1e8, 1e8), (1.5e-3, 0.5e-3)),
}


def bonded_tip(pair: str, edges: int = 80) -> tuple[float, float]:
    """Return the sinking of the tip of a bonded pair under a weight that hardly bends it, and F L³/3EI [mm]."""
    moduli, thickness = PAIRS[pair]
    stiffness = bonded_bending_stiffness(moduli, thickness, WIDTH)
    expected = 1e-3 * LENGTH
    force = 3.0 * stiffness * expected / LENGTH**3
    layers = [layer(name, h, name) for name, h in zip(("bottom", "top"), thickness, strict=True)]
    config = scene(
        [rod(layers, LENGTH, edges + 1, clamp_start="wall")],
        bodies=[fixed()],
        materials={name: {**GEL, "youngs_modulus": e} for name, e in zip(("bottom", "top"), moduli, strict=True)},
        loads=[{"name": "pull", "rod": "rod", "position": LENGTH, "force": [0, 0, -force]}],
    )
    simulator = Simulator(load_scene(config))
    before = simulator.positions[edges, 2]
    simulator.solve_static()
    return 1e3 * (before - simulator.positions[edges, 2]), 1e3 * expected


def vibration(edges: int = 40, periods: int = 4, steps: int = 300, dimension: int = 3) -> tuple[float, float]:
    """Return the frequency of a cantilever that is let go, from crossings of its slowest mode's amplitude, and ω/2π
    [Hz].

    Integrated by `sdirk2` with `steps` a period; the pull at the tip ends with the first step.
    """
    mass = DENSITY * WIDTH * THICKNESS
    expected = (FIRST_MODE / LENGTH) ** 2 * math.sqrt(BENDING / mass) / (2.0 * math.pi)
    dt = 1.0 / (expected * steps)
    force = 3.0 * BENDING * 1e-3 / LENGTH**2
    load = {"name": "pull", "rod": "rod", "position": LENGTH, "force": [0, 0, -force]}
    load["schedule"] = {"type": "table", "times": [0.0, 1e-3 * dt], "values": [1.0, 0.0]}
    solver = {"dt": dt, "newton_tolerance": 1e-10, "integrator": "sdirk2"}
    simulator = Simulator(load_scene(beam(edges + 1, loads=[load], solver=solver)), dimension=dimension)
    simulator.solve_static()
    s = np.linspace(0.0, 1.0, edges + 1)
    shape = simulator.model.rods.node_mass * cantilever_mode(s)
    times, amplitudes = [], []
    for _ in range(periods * steps):
        simulator.step()
        times.append(simulator.time)
        amplitudes.append(shape @ simulator.positions[:, 2])
    times, amplitudes = np.array(times), np.array(amplitudes)
    rising = np.flatnonzero((amplitudes[:-1] < 0.0) & (amplitudes[1:] >= 0.0))
    part = amplitudes[rising] / (amplitudes[rising] - amplitudes[rising + 1])
    crossings = times[rising] + part * dt
    return (len(crossings) - 1) / (crossings[-1] - crossings[0]), expected


def cantilever_mode(s: np.ndarray) -> np.ndarray:
    """Return the slowest mode of a cantilever at s = x/L, 1 at its end."""
    k = FIRST_MODE
    ratio = (math.cosh(k) + math.cos(k)) / (math.sinh(k) + math.sin(k))
    return 0.5 * (np.cosh(k * s) - np.cos(k * s) - ratio * (np.sinh(k * s) - np.sin(k * s)))


ELASTICA = "extensible elastica under its own weight, by collocation"
CASES = [
    *(
        Case(
            f"beams/cantilever tip {axis}/{MESHES[-1]} edges",
            ELASTICA,
            1e-4,
            lambda k=k: (1e3 * cantilever_tip(MESHES[-1])[k], 1e3 * elastica_tip()[k]),
            "mm",
            scale=1e3 * LENGTH,
        )
        for k, axis in enumerate("xz")
    ),
    Case("beams/cantilever tip/order in space", "order 2 of the bending elements", 0.1, order_in_space, scale=1.0),
    Case("beams/Euler's load", "π² EI/4L², by the stability of the straight column", 0.01, eulers_load),
    *cases(
        "beams/imperfect column/{:g} of Euler's load",
        "1/(1 − P/P_cr) times the imperfection",
        2e-3,
        imperfect_column,
        (0.5, 0.9),
    ),
    Case("beams/Greenhill's weight", "q L³ = 7.837 EI, by the stability of the column", 0.01, greenhills_weight),
    *cases("beams/bonded stiffness/{}", "F L³/3EI of the bonded section", 0.01, bonded_tip, PAIRS, unit="mm"),
    Case("beams/vibration", "1.875² √(EI/ρA)/2πL²", 0.005, vibration, "Hz", long=True),
]

"""Light with a direction: the shape that a strip takes towards it, faces that turn away, shadows, order in time."""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import numpy as np

from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import lag_behind, strip_towards_light, timoshenko
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

LENGTH, THICKNESS, GAIN = 0.1, 2e-3, 0.02
CURVATURE = timoshenko(1.0, 1.0) * GAIN / THICKNESS
"""Of the strip where light falls on it along its normal [1/m]."""
SMALL = 1e-5
"""Gain with which a strip stays straight."""
STEPS = (5e-4, 2.5e-4, 1.25e-4)
TURN, TIME, LAG = 1.9 * math.pi, 1.0, 0.2
"""Angle [rad] by which a clamp turns its strip in a time [s], and the lag of its layer [s]."""


def lit_strip(
    angle: float, gain: float = GAIN, stations: int = 81, lag: float = 0.1, light: dict | None = None, **more
) -> dict:
    """Return a strip along x that bends in light from the direction (sin, 0, cos) of `angle` [rad].

    Its top layer follows the light.
    """
    top = layer("top", eigenstrain={"stimulus": "sun", "gain": gain, "time_constant": lag})
    shines = {"from": [math.sin(angle), 0, math.cos(angle)], **(light or {})}
    content = {
        "bodies": [fixed()],
        "stimuli": {"sun": {"schedule": {"type": "hold", "value": 1}, "light": shines}},
        "solver": {},
    }
    return scene(
        [rod([layer("bottom"), top], length=LENGTH, stations=stations, clamp_start="wall")],
        **(content | more),
    ) | {"solver": (content | more)["solver"]}


@cache
def _settled(angle: float, model: str, dimension: int) -> np.ndarray:
    simulator = Simulator(load_scene(lit_strip(angle)), model=model, dimension=dimension)
    simulator.solve_static()
    ends = [strand.first_node + strand.node_count - 1 for strand in simulator.model.strands]
    return (simulator.positions - simulator.model.start_position)[ends].mean(axis=0) + [LENGTH, 0, 0]


def tip(angle: float, model: str, dimension: int, axis: int) -> tuple[float, float]:
    """Return the coordinate of the tip of a strip that has settled in the light [mm]."""
    x, z = strip_towards_light(math.radians(angle), CURVATURE, LENGTH, 0.5 * GAIN)
    found = _settled(math.radians(angle), model, dimension)
    return 1e3 * float(found[axis]), 1e3 * (x if axis == 0 else z)


def in_the_dark() -> tuple[float, float]:
    """Return the displacement of the tip of a strip lit from behind [mm], and 0."""
    return 1e3 * float(np.linalg.norm(_settled(math.radians(160.0), "laminate", 3) - [LENGTH, 0, 0])), 0.0


def behind_a_turning_strip(solver: dict) -> tuple[float, float]:
    """Return the strain of a layer that its clamp turns out of the light, round in the dark and into it again, over its
    gain.
    """
    wall = fixed(motion={"type": "prescribed", "times": [0, TIME], "rotations": [[0, 0, 0], [0, TURN, 0]]})
    soft = {"gel": {"youngs_modulus": 1e9, "poisson_ratio": 0.5, "density": 1e-4}}
    content = lit_strip(0.3, SMALL, 11, LAG, bodies=[wall], materials=soft, solver=solver)
    simulator = Simulator(load_scene(content), model="laminate")
    simulator.run(TIME)
    found = -simulator.curvatures[5] * GAIN / (SMALL * CURVATURE)

    def seen(time: float) -> float:
        s = time / TIME
        return max(0.0, math.cos(TURN * s * s * (3.0 - 2.0 * s) - 0.3))

    return float(found), lag_behind(seen, LAG, TIME)


def order_in_time(integrator: str) -> tuple[float, float]:
    """Return the order in time from the tip of a soft bilayer that a light which comes and goes swings, at successively
    halved steps.
    """
    wave = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.1, "phase": -0.5 * math.pi}
    soft = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}
    content = lit_strip(0.6, 0.1, 11, 0.03, materials=soft)
    content["rods"][0]["path"]["length"] = 0.06
    content["stimuli"]["sun"]["schedule"] = wave
    content["solver"] = {"newton_tolerance": 1e-10, "integrator": integrator, "model": "two_rod", "dimension": 3}
    tips = []
    for dt in STEPS:
        simulator = Simulator(load_scene(content), dt=dt)
        simulator.run(0.1)
        tips.append(simulator.positions[10])
    differences = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    return math.log2(differences[0] / differences[1]), float(INTEGRATORS[integrator].order)


ROOF = 0.03
"""Height of what throws a shadow over the strip [m]; it begins over the strip's middle."""


def lit_part(by: str, angle: float, model: str) -> tuple[float, float]:
    """Return the part of a strip that lies outside the shadow of a roof over its outer half, from how far it bends."""
    outer, high = 0.5 * LENGTH, ROOF
    content = lit_strip(math.radians(angle), SMALL, 81, light={"shadow": True})
    if by == "box":
        box = {"name": "roof", "type": "box", "position": [outer + 0.1, 0, high + 5e-3], "size": [0.2, 0.1, 0.01]}
        content |= {"obstacles": [box], "contact": {"barrier_distance": 1e-4, "stiffness": 1e7}}
    elif by == "cylinder":
        pipe = {"type": "cylinder", "position": [outer, 0, high], "axis": [0, 1, 0], "radius": 0.01, "length": 0.1}
        content |= {"obstacles": [pipe | {"name": "roof"}], "contact": {"barrier_distance": 1e-4, "stiffness": 1e7}}
    else:
        roof = rod([layer()], length=0.2, stations=81, start=(outer, 0, high), name="roof", clamp_start="post")
        content["rods"].append(roof)
        content["bodies"].append(fixed("post", (outer, 0, high)))
    simulator = Simulator(load_scene(content), model=model)
    simulator.solve_static()
    sun = math.tan(math.radians(angle))
    share = np.full(80, LENGTH / 80.0)
    share[[0, -1]] *= 0.5, 1.5  # nodes: of half an edge at the clamp, and with the half edge at the free end
    bend = -float(simulator.curvatures[:80] @ share)
    whole = SMALL / GAIN * CURVATURE * math.cos(math.radians(angle)) * LENGTH
    face = THICKNESS / 2.0
    if by == "cylinder":  # its shadow is as wide as it is thick, measured across the light
        return bend / whole, 1.0 - 2.0 * 0.01 / math.cos(math.radians(angle)) / LENGTH
    if by == "box" and sun > 0.0:
        high += 0.01  # its upper edge hides more than the lower one
    return bend / whole, (outer - (high - face) * sun) / LENGTH


CASES = [
    *(
        Case(
            f"light/curl/{model}, {dimension}-D, {angle:g}°/{'xz'[axis // 2]}",
            "sin(θ + α) = tanh(artanh(sin α) − κ₀ s), from θ′ = −κ₀ max(0, cos(θ + α))",
            1e-3 if model == "laminate" else 1e-2,
            lambda angle=angle, model=model, dimension=dimension, axis=axis: tip(angle, model, dimension, axis),
            "mm",
            scale=1e3 * LENGTH,
        )
        for angle in (0.0, 60.0, -60.0)
        for model, dimension in (("laminate", 2), ("laminate", 3), ("two_rod", 2))
        for axis in (0, 2)
    ),
    Case("light/back face", "what looks away from the light sees nothing", 1e-9, in_the_dark, "mm", scale=1.0),
    *(
        Case(
            f"light/turned through/{name}",
            "T y′ = max(0, cos(φ(t) − α)) − y, by Runge and Kutta's method to 1e-12",
            limit,
            lambda solver=solver: behind_a_turning_strip(solver),
            scale=1.0,
        )
        for name, solver, limit in (
            ("default", {}, 1e-3),
            ("tolerance 1e-06", {"tolerance": 1e-6}, 2e-4),
            ("sdirk2, 5 ms", {"integrator": "sdirk2", "dt": 5e-3}, 1e-3),
            ("sdirk2, 2.5 ms", {"integrator": "sdirk2", "dt": 2.5e-3}, 3e-4),
        )
    ),
    *cases(
        "light/order in time/{}",
        "the integrator's order, at the tip of a bilayer that light swings",
        0.15,
        order_in_time,
        INTEGRATORS,
        scale=1.0,
    ),
    *cases(
        "light/shadow of a {}, {:g}°/{}",
        "straight rays: the part of the strip beside the shadow",
        2e-3,
        lit_part,
        product(("box", "cylinder", "rod"), (0.0, 30.0, -20.0), ("laminate", "two_rod")),
        scale=1.0,
    ),
]

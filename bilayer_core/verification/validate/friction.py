"""Friction under normal forces that change, and what sticks and slips: a block on a belt."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.optimize import brentq

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import StickSlip, stick_slip
from bilayer_core.verification.validate.parts import GROUND, contact, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

GRAVITY, MASS = 10.0, 0.01
SIZE = (0.04, 0.04, 0.002)
FAR = (0.0, 5.0, 5.0)
"""Where a rod is that takes no part: a scene has one at least."""
SPEED, COEFFICIENT = 4.0, 0.1
"""Of the block under a growing load at the start [m/s], and of its friction."""
BELT = StickSlip(
    mass=MASS,
    stiffness=10.0,
    coefficient=0.3,
    threshold=1e-3,
    normal_force=MASS * GRAVITY,
    amplitude=0.5 * MASS * GRAVITY,
    period=0.13,
    travel=0.2,
    duration=1.0,
)
SAMPLES = 250
SECOND_ORDER = ("sdirk2", "tr_bdf2", "generalised_alpha", "implicit_midpoint")


def block(position: tuple[float, float, float], velocity: float = 0.0) -> dict:
    """Return a flat block with its speed along x [m/s]."""
    motion = {"type": "free", "mass": MASS, "inertia": [1e-5] * 3, "velocity": [velocity, 0, 0]}
    return {
        "name": "block",
        "position": list(position),
        "motion": motion,
        "surface": {"shape": "box", "size": list(SIZE)},
    }


def resting_gap(law: dict, corner_length: float) -> float:
    """Return the gap at which the barrier carries the block's weight on four corners [m]."""
    limit = law["barrier_distance"]

    def excess(d: float) -> float:
        force = 2.0 * (d - limit) * math.log(d / limit) + (d - limit) ** 2 / d
        return law["stiffness"] * corner_length * force - 0.25 * MASS * GRAVITY

    return brentq(excess, 1e-9 * limit, limit * (1.0 - 1e-12), xtol=1e-18)


def at_rest(content: dict, height: str = "block") -> Simulator:
    """Return a simulator of the scene with its block at its resting height above what is below z = 0."""
    model = Simulator(load_scene(content)).model
    gap = resting_gap(content["contact"], float(model.surfaces.weight[model.node_count]))
    for body in content["bodies"]:
        if body["name"] == height:
            body["position"][2] = 0.5 * SIZE[2] + gap
    return Simulator(load_scene(content))


def under_a_growing_load(solver: dict) -> tuple[float, float]:
    """Return the speed [m/s] after a second in which the normal force has grown threefold; solver {} is the default."""
    spectator = rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")
    growing = {"type": "ramp", "start": 0, "end": 1.0, "from": 0, "to": 1}
    content = scene(
        [spectator],
        gravity=[0, 0, -GRAVITY],
        obstacles=[GROUND],
        contact=contact(coefficient=COEFFICIENT),
        bodies=[fixed(position=FAR), block((0, 0, SIZE[2]), SPEED)],
        loads=[{"name": "press", "body": "block", "force": [0, 0, -2.0 * MASS * GRAVITY], "schedule": growing}],
    )
    content["solver"] = solver
    simulator = at_rest(content)
    simulator.run(1.0)
    return float(simulator.frame().body_velocities[1, 0]), SPEED - 2.0 * COEFFICIENT * GRAVITY


def on_a_belt(solver: dict) -> np.ndarray:
    """Return the displacements of the block [m] at `SAMPLES` equal times, shape (SAMPLES,).

    A belt draws it along, a ribbon without mass holds it, and what presses on it comes and goes: it sticks, slips, and
    swings back.
    """
    length, width, thickness = 0.1, 0.01, 1e-3
    modulus = BELT.stiffness * length / (width * thickness)
    ribbon = rod(
        [layer(material="thread")],
        length=length,
        stations=3,
        start=(-length - 0.5 * SIZE[0], 0, SIZE[2]),
        clamp_start="wall",
        clamp_end="block",
    )
    press = {"type": "sine", "mean": 0, "amplitude": 1, "period": BELT.period}
    motion = {"type": "prescribed", "times": [0, BELT.duration], "displacements": [[0, 0, 0], [BELT.travel, 0, 0]]}
    content = scene(
        [ribbon],
        gravity=[0, 0, -GRAVITY],
        materials={"thread": {"youngs_modulus": modulus, "poisson_ratio": 0.5, "density": 1e-3}},
        contact=contact(1e-4, BELT.coefficient, BELT.threshold) | {"stiffness": 1e9},
        bodies=[
            fixed(position=(-length - 0.5 * SIZE[0], 0, SIZE[2])),
            block((0, 0, SIZE[2])),
            {
                "name": "belt",
                "position": [0, 0, -0.02],
                "motion": motion,
                "surface": {"shape": "box", "size": [2.0, 0.1, 0.04]},
            },
        ],
        loads=[{"name": "press", "body": "block", "force": [0, 0, -BELT.amplitude], "schedule": press}],
        output={"rate": SAMPLES / BELT.duration},
    )
    content["solver"] = solver
    simulator, found = at_rest(content), []
    for _ in range(SAMPLES):
        simulator.run(BELT.duration / SAMPLES)
        found.append(simulator.bodies["block"].position[0])
    return np.array(found)


@cache
def _swing() -> np.ndarray:
    return stick_slip(BELT, np.linspace(0.0, BELT.duration, SAMPLES + 1)[1:])


def error_on_a_belt(solver: dict) -> tuple[float, float]:
    """Return the largest error of the displacement over the run, as a part of the largest displacement, and 0."""
    return float(np.abs(on_a_belt(solver) - _swing()).max() / np.abs(_swing()).max()), 0.0


GRAIN = (0.2, 0.6, 0.4)
"""Coefficients along a grain, against it, and across it."""
PULL = 0.5
"""Force along the ground on the block on a grain, as a part of its weight: between the first two of these."""


def pulled_over_grain(
    angle: float, off: float, solver: dict, grain: dict | None = None, time: float = 0.5
) -> np.ndarray:
    """Return the velocity of a block after `time` [s], turned back by `angle` [m/s], shape (3,).

    Ground and pull are turned by `angle` about the normal together: the pull is at `off` [rad] from the grain. `grain`
    says what has the grain, in keys of the ground; by default the ground itself.
    """
    spectator = rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")
    axis = [math.cos(angle), math.sin(angle), 0.0]
    law = contact(coefficient=GRAIN[2], speed_threshold=1e-5)
    law["friction"] |= dict(zip(("forward", "backward", "sideways"), GRAIN, strict=True))
    pull = PULL * GRAVITY * np.array([math.cos(angle + off), math.sin(angle + off)])
    content = scene(
        [spectator],
        gravity=[*pull.tolist(), -GRAVITY],
        obstacles=[GROUND | ({"grain": axis} if grain is None else {})],
        contact=law,
        bodies=[fixed(position=FAR), block((0, 0, SIZE[2]))],
    )
    if grain == {"of": "block"}:  # the block slides with it: forward is where the ground goes
        content["bodies"][1]["surface"]["grain"] = [-c for c in axis]
    elif grain == {"of": "world"}:
        content["contact"]["friction"]["axis"] = axis
    content["solver"] = solver
    simulator = at_rest(content)
    simulator.run(time)
    x, y, z = simulator.frame().body_velocities[1, :3]
    return np.array([axis[0] * x + axis[1] * y, axis[0] * y - axis[1] * x, z])


def acceleration_on_grain(off: float) -> np.ndarray:
    """Return the acceleration of a block from rest, along the grain and across it [m/s²], shape (2,).

    The block goes straight on, along a unit vector d at which pull and friction M² d/|M d| leave nothing across d; M
    has the coefficients along and across the grain.
    """
    pull = PULL * np.array([math.cos(off), math.sin(off)])

    def left(angle: float) -> np.ndarray:
        d = np.array([math.cos(angle), math.sin(angle)])
        m = np.array([GRAIN[0] if d[0] >= 0.0 else GRAIN[1], GRAIN[2]])
        return pull - m * m * d / np.linalg.norm(m * d)

    if abs(math.sin(off)) < 1e-12:
        angle = off
    else:
        ends = off - 0.5 * math.pi, off + 0.5 * math.pi
        angle = brentq(lambda a: float(left(a) @ [-math.sin(a), math.cos(a)]), *ends, xtol=1e-15)
    along = float(left(angle) @ [math.cos(angle), math.sin(angle)])
    return GRAVITY * max(along, 0.0) * np.array([math.cos(angle), math.sin(angle)])


def speed_over_grain(angle: float, off: float, solver: dict) -> tuple[float, float]:
    """Return the error of the velocity after half a second [m/s], and 0."""
    error = pulled_over_grain(angle, off, solver)[:2] - 0.5 * acceleration_on_grain(off)
    return float(np.linalg.norm(error)), 0.0


STRAIN, STRIP = 0.05, 0.1
"""How much a crawling strip extends, and its length [m]."""


def stride(
    forward: float,
    backward: float,
    stations: int,
    obstacles: tuple[dict, ...] = (GROUND,),
    dimension: int | str = "auto",
    solver: dict | None = None,
) -> tuple[float, float]:
    """Return the way of the middle of a strip [mm] that extends evenly and goes back, and what it must be.

    It rests where the friction of what slides backward and of what slides forward are equal: at the part
    μ₊/(μ₊ + μ₋) of its length as it extends, and at 1 minus that as it goes back. So it advances by ε L times the
    difference.
    """
    muscle = layer(thickness=1e-4, material="film", eigenstrain={"stimulus": "pulse", "gain": STRAIN})
    law = contact(2e-5, coefficient=backward, speed_threshold=1e-5)
    law["friction"] |= {"forward": forward, "backward": backward}
    content = scene(
        [rod([muscle], length=STRIP, stations=stations, start=(0, 0, 6e-5))],
        materials={"film": {"youngs_modulus": 1e9, "poisson_ratio": 0.5, "density": 1000.0}},
        gravity=[0, 0, -GRAVITY],
        stimuli={"pulse": {"schedule": {"type": "table", "times": [0, 1, 2], "values": [0, 1, 0]}}},
        obstacles=list(obstacles),
        contact=law,
        start="settle",
        duration=2.2,
    )
    content["solver"] = dict(solver or {})
    simulator = Simulator(load_scene(content), dimension=dimension)
    simulator.run()
    middle = simulator.rods["rod"].positions[stations // 2, 0] - 0.5 * STRIP
    return 1e3 * float(middle), 1e3 * STRAIN * STRIP * (backward - forward) / (backward + forward)


SLIDER = {"length": 0.02, "thickness": 4e-3, "coefficient": 0.5}
"""A stiff strip that slides over the ground or along a strip that is held."""


def _box(begin: float, end: float, name: str = "box") -> dict:
    """Return a box between two places along x [m] whose top is that of the ground."""
    place = [0.5 * (begin + end), 0, -0.01]
    return {"name": name, "type": "box", "position": place, "size": [end - begin, 0.05, 0.02]}


def box_on_ground(end: float) -> tuple[dict, ...]:
    """Return a box that ends at a place along x [m], and the ground."""
    return _box(-0.1, end), GROUND


def two_boxes(meet: float) -> tuple[dict, ...]:
    """Return two boxes that meet at a place along x [m]."""
    return _box(-0.1, meet), _box(meet, 0.2, "next")


ON_BOXES = {
    "on a box": (_box(-0.1, 0.2),),
    "from a box onto the ground": box_on_ground(0.0237),
    "from box to box": two_boxes(0.0427),
}
"""Obstacles under strips that crawl, but for the ground alone. On the ground the box ends away from what rests, since
the pressure is uneven near its border; the two boxes meet within an edge of what rests.
"""


def shift_of_pressure(under: str, width: float, dimension: int) -> tuple[float, float]:
    """Return how far before its middle a sliding strip presses on what is below it [mm], and what it must be.

    Friction μ N acts on its face, h below its mass centre, and the pressure must balance its moment μ N h.
    """
    length, thickness, coefficient = SLIDER.values()
    start = (0, 0, 0.5 * thickness + 1.9e-4)
    slider = rod([layer(thickness=thickness, material="stiff")], length, 11, start, "slider", width)
    slider["velocity"] = [0.6, 0, 0]
    content = scene(
        [slider],
        solver={"dimension": dimension, "model": "laminate"},
        materials={"stiff": {"youngs_modulus": 1e10, "poisson_ratio": 0.5, "density": 1000.0}},
        gravity=[0, 0, -GRAVITY],
        contact=contact(2e-4, coefficient) | {"stiffness": 1e7},
    )
    if under == "ground":
        content["obstacles"] = [GROUND]
    else:
        ends = {"clamp_start": "left", "clamp_end": "right"}
        low = (-length, 0, -0.5 * thickness)
        held = rod([layer(thickness=thickness, material="stiff")], 4 * length, 33, low, "held", width, **ends)
        content["rods"].append(held)
        content["bodies"] = [fixed("left", low), fixed("right", (3 * length, 0, low[2]))]
    simulator = Simulator(load_scene(content))
    simulator.run(0.1)  # the rocking has died away by then
    view = simulator.rods["slider"]
    force, place = simulator.contact_forces[: len(view.positions), 2], view.positions
    gap = 0.0 if under == "ground" else float(simulator.frame().min_gap)
    found = float(force @ place[:, 0] / force.sum() - place[:, 0].mean())
    return 1e3 * found, 1e3 * coefficient * 0.5 * (thickness + gap)


def rolling_on_rods() -> tuple[float, float]:
    """Return the speed [m/s] after 0.1 s of a round rod that rolls down two others, and g sin β t/(1 + ½ (r/R)²); R is
    the distance of its axis from the middle of the gap.
    """
    radius, slope, time, ends = 2e-3, 0.1, 0.1, (-0.02, 0.1)
    rods, bodies = [], []
    for side, y in (("left", -0.01), ("right", 0.01)):
        names = [f"{side}_{end}" for end in ("start", "end")]
        bodies += [fixed(name, (x, y, -radius)) for name, x in zip(names, ends, strict=True)]
        clamps = dict(zip(("clamp_start", "clamp_end"), names, strict=True))
        below, length = [layer(thickness=2.0 * radius, material="stiff")], ends[1] - ends[0]
        rods.append(rod(below, length, 33, (ends[0], y, -radius), f"{side}_rail", 2.0 * radius, **clamps))
    across = rod([{"name": "only", "material": "stiff"}], 0.04, 9, (0, -0.02, radius + 1.9e-4), "roller")
    across["path"]["direction"] = [0, 1, 0]
    del across["width"]
    content = scene(
        [*rods, across | {"radius": radius}],
        solver={"model": "laminate"},
        bodies=bodies,
        materials={"stiff": {"youngs_modulus": 1e10, "poisson_ratio": 0.5, "density": 1000.0}},
        gravity=[GRAVITY * math.sin(slope), 0, -GRAVITY * math.cos(slope)],
        contact=contact(2e-4, 0.5, 1e-5),
    )
    simulator = Simulator(load_scene(content))
    simulator.run(time)
    roller = simulator.model.strands[-1].first_node
    rolls_about = radius + 0.5 * float(simulator.frame().min_gap)
    speed = float(simulator.velocities[roller:, 0].mean())
    return speed, GRAVITY * math.sin(slope) * time / (1.0 + 0.5 * (radius / rolls_about) ** 2)


def pulled_by_own(rule: str) -> tuple[float, float]:
    """Return the speed [m/s] after 0.5 s of a block that is pulled by half its weight, with 0.3 on ground with 0.1."""
    law = contact(coefficient=0.6, speed_threshold=1e-5)
    law["friction"]["combine"] = rule
    content = scene(
        [rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")],
        gravity=[0.5 * GRAVITY, 0, -GRAVITY],
        obstacles=[GROUND | {"friction": {"coefficient": 0.1}}],
        contact=law,
        bodies=[fixed(position=FAR), block((0, 0, SIZE[2])) | {"friction": {"coefficient": 0.3}}],
    )
    simulator = at_rest(content | {"solver": {}})
    simulator.run(0.5)
    return float(simulator.frame().body_velocities[1, 0]), 0.5 * (0.5 - OF_PAIR[rule]) * GRAVITY


OF_PAIR = {"minimum": 0.1, "geometric": math.sqrt(0.03), "mean": 0.2, "maximum": 0.3}
"""Coefficients by the rules of `contact.friction.combine` from 0.1 and 0.3."""


def _named(solver: dict) -> str:
    if "integrator" in solver:
        return f"{solver['integrator']}, {1e3 * solver['dt']:g} ms"
    return f"tolerance {solver['tolerance']:g}" if solver else "default"


CASES = [
    *(
        Case(
            f"friction/growing load/{_named(solver)}",
            "v₀ − μ ∫N dt/m while N grows from m g to 3 m g in 1 s",
            limit,
            lambda solver=solver: under_a_growing_load(dict(solver)),
            "m/s",
        )
        for solver, limit in (
            ({}, 1e-3),
            ({"tolerance": 1e-6}, 1e-5),
            *(({"integrator": name, "dt": 4e-3}, 1e-5) for name in SECOND_ORDER),
        )
    ),
    *(
        Case(
            f"friction/stick and slip/{_named(solver)}",
            "own equation, by Radau's method to 1e-10: a block on a belt, held by a spring, pressed in turns",
            limit,
            lambda solver=solver: error_on_a_belt(dict(solver)),
            scale=1.0,
            long=not solver,
        )
        for solver, limit in (
            ({}, 0.02),
            ({"tolerance": 1e-6}, 1e-3),
            *(({"integrator": name, "dt": 1e-3}, 2e-3) for name in SECOND_ORDER),
        )
    ),
    *cases(
        "friction/grain at {:g}°/{}",
        "velocity after 0.5 s, m a = pull − N M² d/|M d|, a along d; M: 0.2 along, 0.6 against, 0.4 across grain",
        2e-5,
        lambda angle, _what, off: speed_over_grain(math.radians(angle), math.radians(off), {}),
        [
            (angle, what, off)
            for angle in (0.0, 77.0)
            for what, off in (
                ("along it", 0.0),
                ("against it, stuck", 180.0),
                ("40° off it", 40.0),
                ("100° off it", 100.0),
            )
        ],
        unit="m/s",
        scale=1.0,
    ),
    *cases(
        "friction/stride/{:g} and {:g}, {} stations",
        "ε L (μ₋ − μ₊)/(μ₋ + μ₊), by the place where an evenly extending strip rests",
        0.01,
        stride,
        [(forward, backward, stations) for forward, backward in ((0.4, 0.5), (0.2, 0.8)) for stations in (21, 41, 81)],
        unit="mm",
    ),
    *cases(
        "friction/stride {0}/0.4 and 0.5, {2} stations",
        "ε L (μ₋ − μ₊)/(μ₋ + μ₊), by the place where an evenly extending strip rests",
        0.01,
        lambda _name, obstacles, stations: stride(0.4, 0.5, stations, obstacles),
        [(name, obstacles, stations) for name, obstacles in ON_BOXES.items() for stations in (21, 41)],
        unit="mm",
    ),
    *cases(
        "friction/pressure under a sliding strip/{0}, {3}-D",
        "μ h before its middle, at the height h of its mass centre over its face",
        1e-3,
        lambda _name, under, width, dimension: shift_of_pressure(under, width, dimension),
        [
            (name, under, width, dimension)
            for name, under, width in (
                ("on the ground", "ground", 1e-2),
                ("on a ribbon", "strip", 1e-2),
                ("round on round", "strip", 4e-3),
            )
            for dimension in (2, 3)
        ],
        unit="mm",
    ),
    Case(
        "friction/round rod that rolls down two others",
        "g sin β t/(1 + ½ (r/R)²), R from its axis to the middle of the gap",
        2e-3,
        rolling_on_rods,
        "m/s",
    ),
    *(
        Case(
            f"friction/of two/{rule}",
            f"(½ − μ) g t with μ = {mu:.4g}, the {rule} of 0.1 and 0.3",
            1e-3,
            lambda rule=rule: pulled_by_own(rule),
            "m/s",
        )
        for rule, mu in OF_PAIR.items()
    ),
]

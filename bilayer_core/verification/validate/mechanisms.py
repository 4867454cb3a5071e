"""Springs, friction and limits of hinges; slides and universal joints: motions of rigid bodies with known answers."""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.kinematics.rotation import matrix_from_quaternion
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.joints import EDGES, LENGTH, SIZES, THICKNESS, WIDTH, layers_of
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

GRAVITY = 9.81
MASS, INERTIA, ARM = 2e-3, 3e-7, 0.03
"""Of a rigid pendulum: its mass, its moment of inertia about its mass centre, and how far that is from the hinge."""
SWING = INERTIA + MASS * ARM**2
"""Its moment of inertia about the hinge."""
STEPS = {"integrator": "tr_bdf2", "dt": 5e-4}


def spring_period(model: str, dimension: int) -> tuple[float, float]:
    """Return the period of a stiff strip on a hinge with a spring [ms], simulated and as 2π √(I/k)."""
    mass = GEL["density"] * LENGTH * WIDTH * THICKNESS
    inertia = mass * (LENGTH**2 / 3.0 + THICKNESS**2 / 12.0)
    spring = inertia * 400.0
    strip = rod(layers_of(model), LENGTH, EDGES + 1, width=WIDTH, clamp_start="pin", name="arm")
    motion = {"type": "guided", "hinge": [0, 1, 0], "turning": {"spring": spring, "rest_angle": 0.1}}
    stiff = {"gel": GEL | {"youngs_modulus": 1e12}}
    content = scene([strip], bodies=[{"name": "pin", "position": [0, 0, 0], "motion": motion}], materials=stiff)
    simulator = Simulator(load_scene(content), model=model, dimension=dimension, **STEPS)
    times = _crossings(simulator, lambda: simulator.bodies["pin"].turning.value - 0.1, 3)
    return 1e3 * (times[2] - times[0]), 1e3 * math.tau * math.sqrt(inertia / spring)


def _crossings(simulator: Simulator, value, count: int) -> list[float]:
    """Return the times at which a value changes its sign [s]."""
    times, last = [], value()
    while len(times) < count:
        before = simulator.time
        simulator.step()
        now = value()
        if last * now < 0.0:
            times.append(before + (simulator.time - before) * last / (last - now))
        last = now
    return times


def _idle() -> dict:
    """Return a rod far from everything, since every scene needs one."""
    return rod([layer()], 0.01, 5, start=(0.5, 0.0, 0.0), name="idle", clamp_start="post")


def rigid(bodies: list[dict], joints: list[dict] = (), gravity: float = GRAVITY) -> dict:
    """Return a scene of rigid bodies and an idle rod."""
    post = fixed("post", (0.5, 0.0, 0.0))
    return scene([_idle()], bodies=[post, *bodies], joints=list(joints), gravity=[0, 0, -gravity])


def pendulum(angle: float, axis: tuple = (0, -1, 0), **turning) -> dict:
    """Return a rigid body on a hinge to a wall, at an angle from its hanging position.

    About +y it falls to greater angles.
    """
    body = {
        "name": "bob",
        "position": [ARM * math.sin(angle), 0.0, -ARM * math.cos(angle)],
        "motion": {"type": "free", "mass": MASS, "inertia": [INERTIA] * 3},
    }
    hinge = {"name": "hinge", "type": "hinge", "bodies": ["wall", "bob"], "point": [0, 0, 0], "axis": axis}
    return rigid([fixed("wall", (0, 0, 0.01)), body], [hinge | {"turning": turning}])


def _extremes(simulator: Simulator, value, count: int) -> list[float]:
    """Return the first values at which a value turns back, from parabolas through three steps."""
    found, row = [], [value()]
    while len(found) < count:
        simulator.step()
        row = [*row[-2:], value()]
        if len(row) == 3 and (row[1] - row[0]) * (row[2] - row[1]) < 0.0:
            slope, bend = 0.5 * (row[2] - row[0]), row[2] - 2.0 * row[1] + row[0]
            found.append(row[1] - 0.5 * slope**2 / bend)
    return found


def friction_of_a_swing(dimension: int) -> tuple[float, float]:
    """Return the amplitude that hinge friction takes from a pendulum per cycle [mrad], simulated and as 4 M/(m g l)."""
    start, lost = math.radians(3.0), 4e-3
    moment = 0.25 * lost * MASS * GRAVITY * ARM
    content = pendulum(start, friction=moment, friction_speed=1e-3)
    simulator = Simulator(load_scene(content), dimension=dimension, **STEPS)
    hinge = simulator.joints["hinge"]
    far, near = _extremes(simulator, lambda: hinge.turning.value, 2)
    return 1e3 * abs(near), 1e3 * lost


def flywheel(dimension: int) -> tuple[float, float]:
    """Return the whole turn of a wheel that friction of its hinge brings to rest [rad], I ω²/(2 M), more than two times
    round.
    """
    inertia, speed, angle = 1e-6, 40.0, 15.0
    law = {"friction": inertia * speed**2 / (2.0 * angle), "friction_speed": 0.01}
    motion = {"type": "guided", "hinge": [0, 1, 0], "mass": 1e-3, "inertia": [inertia] * 3, "angular_speed": speed}
    content = rigid([{"name": "wheel", "position": [0, 0, 0], "motion": motion | {"turning": law}}])
    simulator = Simulator(load_scene(content), dimension=dimension, **STEPS)
    simulator.run(1.0)
    return simulator.bodies["wheel"].turning.value, angle


def rebound(dimension: int) -> tuple[float, float]:
    """Return the time in which a pendulum falls on a limit where it would hang, and comes back [ms], half a period."""
    start = math.radians(3.0)
    content = pendulum(start, axis=(0, 1, 0), limits=[-0.1, start], limit_stiffness=1e4)
    simulator = Simulator(load_scene(content), dimension=dimension, integrator="tr_bdf2", tolerance=1e-6)
    hinge = simulator.joints["hinge"]
    times = _crossings(simulator, lambda: hinge.turning.value - 0.5 * start, 4)
    radius = SWING / (MASS * ARM)
    # between one fall through half of its height and the next
    return 1e3 * (times[2] - times[0]), 1e3 * math.pi * math.sqrt(radius / GRAVITY) * (1.0 + start**2 / 16.0)


def rest_on_a_limit(dimension: int) -> tuple[float, float]:
    """Return how far a pendulum that leans on a limit at 30° is beyond it [mrad], M/K + w/2."""
    angle, stiffness = math.radians(30.0), 1e-1
    content = pendulum(angle, axis=(0, 1, 0), limits=[-1.0, 0.0], limit_stiffness=stiffness)
    simulator = Simulator(load_scene(content), dimension=dimension)
    simulator.solve_static()
    beyond = simulator.joints["hinge"].turning.value
    moment = MASS * GRAVITY * ARM * math.sin(angle - beyond)
    return 1e3 * beyond, 1e3 * (moment / stiffness + 0.5e-3)


def bead(dimension: int, **sliding) -> tuple[float, float]:
    """Return the way of a block down a guide tilted by 30°, in 0.2 s [mm], ½ (g sin β − F/m) t², against friction and
    without.
    """
    tilt, time = math.radians(30.0), 0.2
    axis = [math.cos(tilt), 0.0, -math.sin(tilt)]
    block = {
        "name": "bead",
        "position": [0, 0, 0.02],
        "motion": {"type": "free", "mass": MASS, "inertia": [INERTIA] * 3},
    }
    joint = {"name": "rail", "type": "slide", "bodies": ["wall", "bead"], "point": [0, 0, 0], "axis": axis}
    content = rigid([fixed("wall", (0, 0, 0)), block], [joint | {"sliding": sliding}])
    simulator = Simulator(load_scene(content), dimension=dimension, **STEPS)
    simulator.run(time)
    way = simulator.joints["rail"].sliding.value
    return 1e3 * way, 1e3 * 0.5 * (GRAVITY * math.sin(tilt) - sliding.get("friction", 0.0) / MASS) * time**2


def rotating_guide(dimension: int) -> tuple[float, float]:
    """Return the way of a bead out along a guide that a heavy wheel turns [mm], r (cosh ωt − 1)."""
    speed, radius, time, inertia = 10.0, 0.02, 0.15, 10.0
    turns = {"type": "guided", "hinge": [0, 1, 0], "mass": 1.0, "inertia": [inertia] * 3, "angular_speed": speed}
    free = {"type": "free", "mass": MASS, "inertia": [INERTIA] * 3}
    free |= {"velocity": [0, 0, -speed * radius], "angular_velocity": [0, speed, 0]}
    bodies = [
        {"name": "wheel", "position": [0, 0, 0], "motion": turns},
        {"name": "bead", "position": [radius, 0, 0], "motion": free},
    ]
    joint = {"name": "guide", "type": "slide", "bodies": ["wheel", "bead"], "point": [radius, 0, 0], "axis": [1, 0, 0]}
    content = rigid(bodies, [joint | {"sliding": {}}], 0.0)
    simulator = Simulator(load_scene(content), dimension=dimension, **STEPS)
    simulator.run(time)
    return 1e3 * simulator.joints["guide"].sliding.value, 1e3 * radius * (math.cosh(speed * time) - 1.0)


def universal_joint(bend: float) -> tuple[float, float]:
    """Return the largest difference of ω₂/ω₁ over a turn from cos β/(1 − sin²β cos²θ), above 0."""
    beta, speed = math.radians(bend), 20.0
    out = [math.cos(beta), 0.0, math.sin(beta)]
    turns = {"type": "guided", "mass": 1e-3, "turning": {}}
    ratio = math.cos(beta) / (1.0 - math.sin(beta) ** 2)  # at θ = 0, the fork of the first shaft in the plane of both
    bodies = [
        {
            "name": "first",
            "position": [0, 0, 0],
            "motion": turns | {"hinge": [1, 0, 0], "inertia": [10.0] * 3, "angular_speed": speed},
        },
        {
            "name": "second",
            "position": [0, 0, 0],
            "motion": turns | {"hinge": out, "inertia": [1e-7] * 3, "angular_speed": speed * ratio},
        },
    ]
    cross = {"name": "cross", "type": "universal", "bodies": ["first", "second"], "point": [0, 0, 0]}
    cross |= {"axis": [0, 0, 1], "second_axis": [0, 1, 0]}
    content = rigid(bodies, [cross], 0.0)
    simulator = Simulator(load_scene(content), **STEPS)
    axes, worst = (np.array([1.0, 0.0, 0.0]), np.array(out)), 0.0
    for _ in range(60):
        simulator.run(5e-3)
        frame = simulator.frame()
        names = list(simulator.bodies)
        first, second = (
            float(frame.body_angular_velocities[names.index(name)] @ axis)
            for name, axis in zip(("first", "second"), axes, strict=True)
        )
        fork = matrix_from_quaternion(frame.body_quaternions[names.index("first")])[:, 2]
        theta = math.atan2(-fork[1], fork[2])
        expected = math.cos(beta) / (1.0 - math.sin(beta) ** 2 * math.cos(theta) ** 2)
        worst = max(worst, abs(second / first - expected))
    return worst, 0.0


CASES = [
    *cases(
        "mechanisms/spring of a hinge/{1}-D {0}",
        "period of a rigid strip on a hinge with a spring, 2π √(I/k)",
        1e-3,
        spring_period,
        SIZES,
        unit="ms",
    ),
    *(
        Case(f"mechanisms/{name}/{dimension}-D", against, limit, lambda m=measure, d=dimension: m(d), unit=unit)
        for name, against, limit, unit, measure in (
            ("friction of a hinge", "amplitude lost in a cycle, 4 M/(m g l)", 2e-3, "mrad", friction_of_a_swing),
            ("friction of a wheel", "turn until it stands, I ω²/(2 M)", 1e-4, "rad", flywheel),
            ("limit, rebound", "half a period of a rigid pendulum", 2e-3, "ms", rebound),
            ("limit, rest", "M/K + w/2 beyond the limit", 1e-6, "mrad", rest_on_a_limit),
            ("slide", "way down a tilted guide, ½ g sin β t²", 1e-6, "mm", bead),
            (
                "friction of a slide",
                "way down a tilted guide, ½ (g sin β − F/m) t²",
                1e-4,
                "mm",
                lambda d: bead(d, friction=5e-3),
            ),
            ("rotating guide", "way of a bead, r (cosh ωt − 1)", 1e-3, "mm", rotating_guide),
        )
        for dimension in (2, 3)
    ),
    *cases(
        "mechanisms/universal joint/{}°",
        "ratio of speeds, cos β/(1 − sin²β cos²θ), largest difference over a turn",
        1e-3,
        universal_joint,
        (20, 45),
        scale=1.0,
    ),
]

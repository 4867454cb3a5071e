"""Poses that controllers ask of a body that holds a strip: top speed, duration, and lag behind a stream of goals."""

from __future__ import annotations

from functools import cache

import numpy as np

from bilayer_core.kinematics.rotation import matrix_from_quaternion
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.poses import LEAST_TIME, rotation_vector_between
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

TOP_SPEED, TOP_ANGULAR_SPEED = 0.2, 2.0
WAY, ANGLE = np.array([0.03, 0.0, 0.04]), 1.2
STREAM, PERIOD = 0.05, 0.01


def _hub(dimension: int) -> Simulator:
    strip = rod([layer("sheet")], 0.06, 21, name="arm", clamp_start="hub")
    motion = {"type": "prescribed", "top_speed": TOP_SPEED, "top_angular_speed": TOP_ANGULAR_SPEED}
    content = scene([strip], bodies=[{"name": "hub", "position": [0, 0, 0], "motion": motion}])
    content["materials"]["gel"]["retardation_time"] = 0.01
    return Simulator(load_scene(content), dimension=dimension)


@cache
def _on_the_way(dimension: int) -> tuple[float, float]:
    """Return the largest speed [m/s] on a way, and the angle [rad] half-way through a turn that takes longer."""
    simulator, speed = _hub(dimension), 0.0
    turned = np.array([0.0, np.sin(0.5 * ANGLE), 0.0, np.cos(0.5 * ANGLE)])
    simulator.set_pose("hub", WAY)
    end = 1.5 * float(np.linalg.norm(WAY)) / TOP_SPEED
    while simulator.time < end:
        before, begin = simulator.bodies["hub"].position, simulator.time
        simulator.step(until=min(end, begin + 0.01 * end))
        moved = np.linalg.norm(simulator.bodies["hub"].position - before)
        speed = max(speed, float(moved) / (simulator.time - begin))
    simulator.set_pose("hub", quaternion=turned)
    simulator.run(0.75 * ANGLE / TOP_ANGULAR_SPEED)
    rotation = matrix_from_quaternion(simulator.bodies["hub"].quaternion)
    return speed, float(rotation_vector_between(np.eye(3), rotation)[1])


@cache
def _lag(dimension: int) -> float:
    """Return the time [s] by which the hub is behind goals that move steadily, of which each comes a period after the
    last.
    """
    simulator = _hub(dimension)
    for k in range(100):
        simulator.set_pose("hub", [STREAM * PERIOD * k, 0.0, 0.0])
        simulator.run(PERIOD)
    return 99 * PERIOD - simulator.bodies["hub"].position[0] / STREAM


def _lag_of_recursion() -> float:
    """Return the same lag [s] from repeating x → x + part (goal − x) + T s (1 − s)² v with s = period/T."""
    s, x, v = PERIOD / LEAST_TIME, 0.0, 0.0
    for k in range(100):
        away = STREAM * PERIOD * k - x
        x += s * s * (3.0 - 2.0 * s) * away + LEAST_TIME * s * (1.0 - s) ** 2 * v
        v = 6.0 * s * (1.0 - s) / LEAST_TIME * away + (1.0 - s) * (1.0 - 3.0 * s) * v
    return 99 * PERIOD - x / STREAM


CASES = [
    case
    for dimension in (2, 3)
    for case in (
        Case(
            f"poses/{dimension}-D/top speed",
            "the top speed, half-way to a pose; over a hundredth of the way",
            1e-3,
            lambda dimension=dimension: (_on_the_way(dimension)[0], TOP_SPEED),
            unit="m/s",
        ),
        Case(
            f"poses/{dimension}-D/half of a turn",
            "half the angle after half the time that the top angular speed demands",
            1e-9,
            lambda dimension=dimension: (_on_the_way(dimension)[1], 0.5 * ANGLE),
            unit="rad",
        ),
        Case(
            f"poses/{dimension}-D/lag",
            "the recursion of the cubic: two thirds of its time, less a part of the period",
            1e-6,
            lambda dimension=dimension: (1e3 * _lag(dimension), 1e3 * _lag_of_recursion()),
            unit="ms",
        ),
    )
]

"""A torture case of a knot that is pulled tight.

Without friction the tension of a loose overhand knot is B/(2 R²), R the radius of its loop; friction of the
coefficient μ adds 0.492 μ (B/R²) √(R/h), h half the distance of its strands (Audoly, Clauvelin and Neukirch 2007).
Both are limits for h far below R, from above: of the thread here, with R/h about 20, the first part is 1.6 times as
large. So the limit is a lower bound, and the upper one only tells a tension that is out of proportion.
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.testing.trial import Trial
from bilayer_core.verification.stress.kirchhoff import stiffness
from bilayer_core.verification.stress.ladder import Rung, Torture, first_broken
from bilayer_core.verification.stress.stress_case import Decision
from bilayer_core.verification.stress.torture_contact import met

Array = np.ndarray
FRICTION_PART = 0.492
"""Of the braid's forces (`tests/robots/test_knot.py` finds it anew)."""
THICKER = 2.5
"""Times the limit of thin threads, below which the tension of a thick one is expected."""


def loop_radius(points: Array) -> float:
    """Return the radius of the circle that the middle two radians of the loop follow [m]."""
    edges = np.diff(points, axis=0)
    length = np.linalg.norm(edges, axis=1).mean()
    cosine = (
        (edges[:-1] * edges[1:]).sum(axis=1) / np.linalg.norm(edges[:-1], axis=1) / np.linalg.norm(edges[1:], axis=1)
    )
    turn = np.arccos(cosine.clip(-1.0, 1.0))
    top, radius = int(np.argmax(np.linalg.norm(points[:, 1:] - points[0, 1:], axis=1))), 0.05
    for _ in range(20):
        reach = max(1, int(radius / length))
        radius = length / float(turn[top - 1 - reach : top + reach].mean())
    return radius


def pulls(trial: Trial) -> Decision:
    """Return the tension of a knot that is being tied, over that of a thin thread."""
    simulator, scene = trial.simulator, trial.simulator.scene
    trial.run(PULLED * scene.duration)
    left, right = (float(simulator.clamps[f"thread.{end}"].wrench[0]) for end in ("start", "end"))
    radius = loop_radius(simulator.positions)
    half = 0.5 * (scene.rods[0].layers[0].thickness + simulator.frame().min_gap)
    bending = float(stiffness(scene)[2])
    limit = 0.5 + FRICTION_PART * scene.contact.friction.coefficient * math.sqrt(radius / half)
    found = 0.5 * (left - right) * radius**2 / bending
    tied = Decision("radius of the loop", radius, 1.5 * scene.rods[0].width, 0.08, "m")
    return first_broken(Decision("tension over that of a thin thread", found / limit, 1.0, THICKER), tied, met(trial))


PULLED = 0.9
"""Part of the scene after which the tension is taken: the hands still move then."""
KNOT = (
    Torture(
        8,
        "overhand knot",
        "knot",
        "Audoly 2007, Jawed 2015",
        "tension against crossing number",
        "tension from 1 to 2.5 times that of a thin thread, B/R² (½ + 0.492 μ √(R/h)); of one crossing number alone",
        pulls,
        (
            Rung("201 stations", ("rods.thread.stations=201",)),
            Rung("201 stations, without friction", ("rods.thread.stations=201", "contact.friction.coefficient=0")),
            Rung(
                "201 stations, implicit Euler, dt 10 ms",
                ("rods.thread.stations=201", "solver.integrator=implicit_euler", "solver.dt=0.01"),
            ),
            Rung("201 stations, mu 0.2", ("rods.thread.stations=201", "contact.friction.coefficient=0.2")),
            Rung("long, 401 stations"),
        ),
    ),
)

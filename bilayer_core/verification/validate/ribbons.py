"""Balls anywhere on a wide strip: between its stations and across its width."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import contact, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

LENGTH, WIDTH, THICKNESS, BARRIER = 0.1, 0.02, 2e-3, 2e-4
SOFT = 1e5
"""Stiffness of the barrier [Pa], which does not bend the strip."""
GAP = 0.4 * BARRIER
RADII = (1e-3, 2.5e-3, 1e-2, 2e-2)
"""Of balls [m]."""
PLACES = 8
"""Of each, at random where it presses within the borders."""


@cache
def pressed(radius: float, worst: bool) -> float:
    """Return the force [N] that a strip feels of a ball that stands at the gap `GAP` over it; the one farthest from the
    mean of several places, or the mean.
    """
    patch = math.sqrt(2.0 * (radius + 0.5 * THICKNESS) * BARRIER)
    random = np.random.default_rng(7)
    across = 0.5 * (WIDTH - THICKNESS) - patch
    forces = []
    for _ in range(PLACES):
        place = random.uniform(-0.5 * LENGTH + patch, 0.5 * LENGTH - patch), random.uniform(-across, across)
        stands = [fixed(name, (x, 0, 0)) for name, x in (("a", -0.5 * LENGTH), ("b", 0.5 * LENGTH))]
        ball = fixed("ball", (*place, radius + 0.5 * THICKNESS + GAP), surface={"shape": "sphere", "radius": radius})
        ends = {"clamp_start": "a", "clamp_end": "b"}
        strip = rod([layer(thickness=THICKNESS)], LENGTH, 41, (-0.5 * LENGTH, 0, 0), width=WIDTH, **ends)
        content = scene(
            [strip],
            bodies=[*stands, ball],
            contact={**contact(BARRIER), "stiffness": SOFT},
            materials={"gel": {"youngs_modulus": 1e12, "poisson_ratio": 0.5, "density": 1000.0}},
        )
        simulator = Simulator(load_scene(content))
        simulator.solve_static()
        forces.append(simulator.bodies["ball"].contact_wrench[2])
    mean = float(np.mean(forces))
    return max(forces, key=lambda force: abs(force - mean)) if worst else mean


def pressure(radius: float) -> float:
    """Return the force of a ball on a flat strip [N]: the barrier's energy for each length and width, integrated over
    the plane of the strip's middle, F = 2π z K b(d)/w.

    z is the height of the ball's centre over that plane; D² = z² + s² at the distance s from below it, so that
    s ds = D dD and ∫ −b′ (z/D) 2π s ds = 2π z b(d). w is the strip's width between the middles of its rounded borders,
    or that of the patch within which the ball can touch it.
    """
    around = radius + 0.5 * THICKNESS
    width = min(WIDTH - THICKNESS, 2.0 * math.sqrt(2.0 * around * BARRIER))
    stored = (GAP - BARRIER) ** 2 * math.log(BARRIER / GAP)
    return 2.0 * math.pi * (around + GAP) * SOFT * stored / width


CASES = [
    Case(
        f"ribbons/ball of {2e3 * radius:g} mm on a strip/{name}",
        "2π z K b(d)/w",
        0.01,
        lambda radius=radius, worst=worst: (1e3 * pressed(radius, worst), 1e3 * pressure(radius)),
        unit="mN",
    )
    for radius in RADII
    for name, worst in (("force at the worst place", True), ("mean force", False))
]

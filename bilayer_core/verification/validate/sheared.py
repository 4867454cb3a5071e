"""A ribbon between two clamps, pressed together to an arch, and sheared by one clamp that moves sideways.

Far enough aside its middle lies as high as the clamps, by symmetry. With less shear that is unstable, and the middle
rises or sinks: a pitchfork, at a shear that depends on how stiff the ribbon is in twist. S. K. Panda and M. K. Jawed
(2026, arXiv 2605.05529) compare laws of ribbons by it, with a public program: 100 mm long, 1 mm thick, ν = 0.5, nodes
within 10 mm of the ends held, pressed by 25 mm. Of 63 nodes 51 joints are between, as in a ribbon of 51 edges.

Laws of ribbons are not convex where a twisted one is hardly bent, as it is in the middle here; Sadowsky's and Sano's
share that. From w/L = 1/6 on several shapes are at rest there, and which of them is found depends on the mesh
(docs/strips.md has the scatter), so that only the narrow ribbon is a case.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.motion import put
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

LENGTH, EDGES = 0.1, 51
FREE = LENGTH * EDGES / 62
"""Between the clamps [m]."""
PRESSED, SHEARED = 0.25 * LENGTH, 0.45 * LENGTH
"""Ways of the clamp along the ribbon and aside, at which the middle is as high as the clamps [m]."""
FIRST_STEP, LAST_STEP = 1e-3, 2e-5
"""Of the shear, from there back to where that is unstable [m]."""
LEVEL = 1e-6
"""Height of the middle that is none [m]."""
PUBLIC = {("beam", "Kirchhoff's", 12): 0.36281, ("strip", "Sano's", 12): 0.35281}
"""Shear over length at the pitchfork, from equilibria of the public program's energies, by section and L over w."""


def _simulator(width: float, section: str, edges: int, between: float) -> Simulator:
    ends = {"clamp_start": "still", "clamp_end": "moved"}
    ribbon = rod([layer()], between, edges + 1, width=width, section=section, **ends)
    gel = {"youngs_modulus": 1e10, "poisson_ratio": 0.5, "density": 1000.0}
    bodies = [fixed("still"), fixed("moved", (between, 0, 0))]
    return Simulator(load_scene(scene([ribbon], bodies=bodies, materials={"gel": gel})), model="laminate", dimension=3)


def _move(simulator: Simulator, along: float, aside: float) -> bool:
    """Move the clamp [m], and go to the equilibrium near the shape moved along; whether that is stable."""
    part = np.linspace(0.0, 1.0, len(simulator.positions))
    way = np.stack([along * part, aside * (3.0 - 2.0 * part) * part**2, 0.0 * part], axis=1)
    place = simulator.frame().body_positions + [[0.0, 0.0, 0.0], [along, aside, 0.0]]
    put(simulator, position=simulator.positions + way, body_position=place)
    return simulator.solve_static().stable


def _height(simulator: Simulator) -> float:
    last = len(simulator.positions) - 1
    return abs(float(simulator.positions[[last // 2, last - last // 2], 2].mean()))


def pitchfork(width: float, section: str, edges: int = EDGES, between: float = FREE) -> float:
    """Return the shear over the length at which the middle of a ribbon leaves the height of the clamps; these are so
    far apart [m] at first.
    """
    ribbon = _simulator(width, "beam", edges, between)
    arch = ribbon.positions.copy()
    arch[:, 2] = -1e-3 * np.sin(np.pi * arch[:, 0] / between) ** 2
    put(ribbon, position=arch)
    for _ in range(10):
        _move(ribbon, -PRESSED / 10, 0.0)
    for _ in range(15):
        _move(ribbon, 0.0, SHEARED / 15)
    if section == "strip":  # which would keep an arch on its way
        parts = {
            name: getattr(ribbon._state, name).copy() for name in ("position", "director1", "twist", "body_position")
        }
        ribbon = _simulator(width, section, edges, between)
        put(ribbon, **parts)
        ribbon.solve_static()
    shear, step, level = SHEARED, FIRST_STEP, ribbon.save_state()
    while step > LAST_STEP:
        if _move(ribbon, 0.0, -step) and _height(ribbon) < LEVEL:
            shear, level = shear - step, ribbon.save_state()
        else:
            ribbon.load_state(level)
            step *= 0.5
    return shear / LENGTH


CASES = [
    Case(
        f"strips/sheared sideways/w/L 1:{ratio}, {section}",
        f"the public program's equilibria with {law} energy, 63 nodes",
        0.02,
        lambda ratio=ratio, section=section, answer=answer: (pitchfork(LENGTH / ratio, section), answer),
        "W/L",
    )
    for (section, law, ratio), answer in PUBLIC.items()
]

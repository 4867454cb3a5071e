"""Wide strips: curvature of free ones that swell, also after they were held flat, and their stiffness in bending."""

from __future__ import annotations

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import PlateStrip
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

WIDTH, THICKNESS = 20e-3, 0.2e-3
RATIOS = (0.1, 1, 3, 6, 10, 36, 100)
"""w²κ₀/H, with the curvature κ₀ of a narrow strip."""
BENT = (1, 5, 36)
"""w²κ/H of a straight strip that a moment bends about as far."""


def _simulator(poisson: float, dimension: int, gain: float = 0.0, length: float = 0.2, **more) -> Simulator:
    law = {"stimulus": "heat", "gain": gain}
    layers = [layer("bottom", 0.5 * THICKNESS, eigenstrain=law), layer("top", 0.5 * THICKNESS)]
    strip = rod(layers, length, 21, width=WIDTH, section="strip", clamp_start="wall", **more.pop("held", {}))
    content = scene(
        [strip],
        bodies=[fixed(), *more.pop("bodies", [])],
        materials={"gel": {**GEL, "poisson_ratio": poisson}},
        stimuli={"heat": {"schedule": {"type": "hold", "value": 0}}},
        **more,
    )
    return Simulator(load_scene(content), model="laminate", dimension=dimension)


def swollen(ratio: float, poisson: float, held_flat: bool) -> tuple[float, float]:
    """Return κ/κ₀ of a free strip, and that of a plate: in a plane, where the stimulus grows in steps, or in space,
    where it acts at once on a flat strip.
    """
    curvature = ratio * THICKNESS / WIDTH**2
    simulator = _simulator(poisson, 3 if held_flat else 2, curvature * THICKNESS / 1.5)
    for value in (1.0,) if held_flat else np.geomspace(0.05, 1.0, 20):
        simulator.set_stimulus("heat", value)
        simulator.solve_static()
    return simulator.curvatures[10] / curvature, PlateStrip(poisson).swollen_curvature(ratio)


def stiffness(ratio: float, poisson: float) -> tuple[float, float]:
    """Return M/(EI κ) of a strip that a moment bends, and that of a plate as curved."""
    bending = GEL["youngs_modulus"] * WIDTH * THICKNESS**3 / 12.0
    moment = bending * ratio * THICKNESS / WIDTH**2
    length = 0.05  # edges turn so little that the tangent of half a turn is the turn
    motion = {"type": "free", "mass": 1e-3, "inertia": [1e-7, 1e-7, 1e-7]}
    crank = {"name": "crank", "position": [length, 0, 0], "motion": motion}
    load = {"name": "moment", "body": "crank", "moment": [0, -moment, 0]}
    simulator = _simulator(poisson, 3, length=length, held={"clamp_end": "crank"}, bodies=[crank], loads=[load])
    simulator.solve_static()
    curvature = abs(float(simulator.curvatures[10]))
    return moment / (bending * curvature), PlateStrip(poisson).stiffness(WIDTH**2 * curvature / THICKNESS)


PLATE = "a plate strip, solved across its width"
CASES = [
    Case(
        f"strips/{name}, ν {poisson}/w²κ₀/H {ratio:g}",
        PLATE,
        1e-3,
        lambda ratio=ratio, poisson=poisson, held_flat=held_flat: swollen(ratio, poisson, held_flat),
    )
    for name, held_flat, ratios in (("swollen", False, RATIOS), ("held flat, then released", True, RATIOS[-3:]))
    for poisson in (0.3, 0.5)
    for ratio in ratios
]
CASES += [
    Case(f"strips/bending stiffness, ν 0.5/w²κ/H {ratio:g}", PLATE, 1e-3, lambda ratio=ratio: stiffness(ratio, 0.5))
    for ratio in BENT
]

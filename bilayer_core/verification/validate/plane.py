"""Dimension 2: cases of the other families that stay in a plane, with two unknowns a node."""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate import beams, bending
from bilayer_core.verification.validate.closed_forms import timoshenko
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

DIMENSION = 2
RATIOS = (5.0, 0.5)
"""Of modulus and thickness: neither layer is in the middle."""
STRAIN = 0.05
LIMITS = {"two_rod": 0.01, "laminate": 1e-9}


def curvature(model: str) -> tuple[float, float]:
    """Return κH/η of the node in the middle, and Timoshenko's."""
    simulator = Simulator(load_scene(bending.strip(*RATIOS, STRAIN)), model=model, dimension=DIMENSION)
    simulator.solve_static()
    middle = simulator.curvatures[bending.STATIONS // 2]
    return float(-middle * bending.THICKNESS / STRAIN), timoshenko(*RATIOS)


def tip() -> tuple[float, float]:
    """Return the distance of the heavy cantilever's tip from where it should be, over its length, and 0."""
    found = beams.cantilever_tip(beams.MESHES[-1], DIMENSION)
    return float(np.linalg.norm(np.subtract(found, beams.elastica_tip())) / beams.LENGTH), 0.0


def blade(part: float) -> dict:
    """Return a blade that stands on edge under a force on its tip.

    The force is a part of the one that turns the blade over: 4.013 √(E I₂ G J)/L².
    """
    length, width, thickness, modulus = 0.1, 0.6e-3, 12e-3, GEL["youngs_modulus"]
    stiff, shear = modulus * thickness * width**3 / 12.0, modulus / 3.0
    torsion = shear * thickness * width**3 / 3.0 * (1.0 - 0.63 * width / thickness)
    force = part * 4.013 * math.sqrt(stiff * torsion) / length**2
    grown = {"type": "ramp", "start": 0.0, "end": 0.5, "from": 0.0, "to": 1.0}
    load = {"name": "tip", "rod": "rod", "position": length, "force": [0, 0, -force], "schedule": grown}
    strip = rod([layer(thickness=thickness)], length, 41, width=width, clamp_start="wall")
    return {**scene([strip], bodies=[fixed()], loads=[load], duration=10.0), "solver": {"dimension": DIMENSION}}


def least_warned() -> tuple[float, float]:
    """Return the part of the critical force from which a run in a plane warns that the blade would have left it."""
    low, high = 0.9, 1.1
    for _ in range(6):
        middle = 0.5 * (low + high)
        simulator = Simulator(load_scene(blade(middle)))
        simulator.run()
        warned = any("--dimension 3" in warning for warning in simulator.summary()["warnings"])
        low, high = (low, middle) if warned else (middle, high)
    return high, 1.0


CASES = [
    *(
        Case(
            f"plane/{model}, m = {RATIOS[0]:g}, n = {RATIOS[1]:g}",
            "Timoshenko's bilayer (1925), formula corrected",
            limit,
            lambda model=model: curvature(model),
        )
        for model, limit in LIMITS.items()
    ),
    Case(f"plane/cantilever tip/{beams.MESHES[-1]} edges", beams.ELASTICA, 1e-4, tip, scale=1.0),
    Case(
        "plane/Euler's load",
        "π² EI/4L², by the stability of the straight column",
        0.01,
        lambda: beams.eulers_load(DIMENSION),
    ),
    Case(
        "plane/Greenhill's weight",
        "q L³ = 7.837 EI, by the stability of the column",
        0.01,
        lambda: beams.greenhills_weight(DIMENSION),
    ),
    Case("plane/blade turns over", "4.013 √(E I₂ G J)/L² (Prandtl, Michell), by warnings of runs", 0.02, least_warned),
    Case(
        "plane/vibration",
        "1.875² √(EI/ρA)/2πL²",
        0.005,
        lambda: beams.vibration(dimension=DIMENSION),
        "Hz",
        long=True,
    ),
]

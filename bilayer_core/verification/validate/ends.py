"""Ends of layers in two bonded rods: beside a free end of the strip, and where a layer covers a part of it."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate import bending, helix
from bilayer_core.verification.validate.closed_forms import bonded_helix, timoshenko
from bilayer_core.verification.validate.parts import GEL
from bilayer_core.verification.validate.validation_case import Case, cases

PAIRS = ((1.0, 1.0), (3.3, 6.7), (0.2, 3.0))
"""(m, n): the second is the one that is off most where nothing bends the last half edge."""
STRAIN, LENGTH, PATCH, STATIONS = 0.02, 0.1, (0.04, 0.05), 81
SMALL, LONG_PATCH = 0.005, (0.026, 0.074)
"""Eigenstrain and place [m] of a patch that ends between stations of most meshes."""


def beside_free_end(m: float, n: float, dimension: int) -> tuple[float, float]:
    """Return κH/η of the node before the free end, and Timoshenko's."""
    simulator = Simulator(load_scene(bending.strip(m, n, STRAIN)), dimension=dimension)
    simulator.solve_static()
    return -simulator.curvatures[bending.STATIONS - 2] * bending.THICKNESS / STRAIN, timoshenko(m, n)


@cache
def patched(m: float, n: float, dimension: int, stations: int = STATIONS) -> tuple[float, float]:
    """Return the angle [rad] and sag [m] of the end of a strip with a growing layer on a tenth of it."""
    config = bending.strip(m, n, STRAIN, stations)
    config["rods"][0]["path"]["length"] = LENGTH
    config["rods"][0]["layers"][1]["interval"] = list(PATCH)
    simulator = Simulator(load_scene(config), dimension=dimension)
    simulator.solve_static()
    bottom = simulator.positions[:stations]
    last = bottom[-1] - bottom[-2]
    return float(-np.arctan2(last[2], last[0])), float(bottom[0, 2] - bottom[-1, 2])


def beam(m: float, n: float) -> tuple[float, float]:
    """Return the angle [rad] and sag [m] of the end of two beams.

    They are straight but for the patch, an arc of Timoshenko's curvature κ per rest length. There the bottom layer has
    the strain ΣEI κ/(c EA), since nothing holds the section: ΣEI κ = N c.
    """
    top = bending.THICKNESS / (1.0 + n)
    bottom, modulus, width = n * top, m * GEL["youngs_modulus"], 0.01
    curvature, length = timoshenko(m, n) * STRAIN / bending.THICKNESS, PATCH[1] - PATCH[0]
    stiffness = (modulus * bottom**3 + GEL["youngs_modulus"] * top**3) * width / 12.0
    strain = stiffness * curvature / (0.5 * bending.THICKNESS * modulus * width * bottom)
    angle = curvature * length
    arc = (1.0 + strain) * length * (1.0 - np.cos(angle)) / angle
    return angle, arc + (LENGTH - PATCH[1]) * np.sin(angle)


@cache
def turned(model: str, stations: int) -> tuple[float, float]:
    """Return the angle [rad] by which a patch turns its strip that begins and ends between stations, and that of an
    arc.
    """
    config = bending.strip(1.0, 1.0, SMALL, stations)
    config["rods"][0]["path"]["length"] = LENGTH
    config["rods"][0]["layers"][1]["interval"] = list(LONG_PATCH)
    simulator = Simulator(load_scene(config), dimension=2, model=model)
    simulator.solve_static()
    edges = np.diff(simulator.positions[:stations], axis=0)[[0, -1]]
    first, last = np.arctan2(-edges[:, 2], edges[:, 0])
    return float(last - first), timoshenko(1.0, 1.0) * SMALL / bending.THICKNESS * (LONG_PATCH[1] - LONG_PATCH[0])


def last_turn(torsion: str, natural: tuple[float, float]) -> tuple[float, float]:
    """Return the pitch [m] of a bonded helix through its last four points, and that of least energy."""
    points = helix.middle_curve(torsion, *natural)
    return helix.screw(points[-4:])[1], bonded_helix(*natural, torsion)[1]


CASES = [
    *cases(
        "ends/free end m = {:g}, n = {:g}/{}-D",
        "Timoshenko's bilayer (1925), formula corrected",
        1e-3,
        beside_free_end,
        [(m, n, dimension) for m, n in PAIRS for dimension in (2, 3)],
    ),
    *(
        Case(
            f"ends/patch m = {m:g}, n = {n:g}/{figure}, {dimension}-D",
            "an arc of Timoshenko's curvature between straight parts",
            1e-3,
            lambda m=m, n=n, i=i, dimension=dimension: (patched(m, n, dimension)[i], beam(m, n)[i]),
            ("rad", "m")[i],
        )
        for m, n in PAIRS
        for i, figure in enumerate(("angle", "tip"))
        for dimension in (2, 3)
    ),
    *cases(
        "ends/patch between stations/{}, {} stations",
        "Timoshenko's curvature times the length of the patch",
        1e-3,
        turned,
        product(("laminate", "two_rod"), (11, 21, 34, 81)),
        unit="rad",
    ),
    *(
        Case(
            f"ends/last turn {torsion} ({natural[0]:g}, {natural[1]:g})/pitch",
            "pitch of least energy per length",
            2e-3,
            lambda torsion=torsion, natural=natural: last_turn(torsion, natural),
            "m",
        )
        for torsion in helix.TORSIONS
        for natural in helix.NATURAL
    ),
]

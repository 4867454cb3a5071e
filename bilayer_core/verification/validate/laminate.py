"""One curve for both layers: exact where strips bend or twist by themselves, and what two bonded rods come near to.

The bond of two rods is a penalty. The softer it is, the more its layers slide; the stiffer, the less curvature may vary
from edge to edge (locking). The laminate has no bond: it is the limit of stiff bonds on fine meshes.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate import bending, helix, torsion
from bilayer_core.verification.validate.closed_forms import (
    bonded_bending_stiffness,
    bonded_helix,
    strip_torsion,
    timoshenko,
)
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

MODEL = "laminate"
EXACT = 1e-9
MULTIPLES = (0.1, 1.0, 10.0, 100.0, 1000.0, 10000.0)
"""Of the section's own stiffness: all three of `coupling`."""
UNIFORM, EDGES = 0.05, 40


def every_node(m: float, n: float) -> tuple[float, float]:
    """Return κH/η of the node that is farthest off, ends included, and Timoshenko's."""
    simulator = Simulator(load_scene(bending.strip(m, n, 0.05)), model=MODEL)
    simulator.solve_static()
    found, answer = -simulator.curvatures * bending.THICKNESS / 0.05, timoshenko(m, n)
    return found[np.argmax(np.abs(found - answer))], answer


def covered_part(edges: int) -> tuple[float, float]:
    """Return the angle by which a growing layer on a fifth of a strip turns its end, and κ times its length [rad]."""
    grown = layer("top", interval=[0.04, 0.06], eigenstrain={"stimulus": "heat", "gain": UNIFORM})
    config = scene(
        [rod([layer("bottom"), grown], stations=edges + 1, clamp_start="wall")],
        bodies=[fixed()],
        stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}},
    )
    simulator = Simulator(load_scene(config), model=MODEL)
    simulator.solve_static()
    last = np.diff(simulator.positions, axis=0)[-1]
    return -np.arctan2(last[2], last[0]), timoshenko(1.0, 1.0) * UNIFORM / 2e-3 * 0.02


def linear_helix(torsion_kind: str, curvature: float, twist: float) -> tuple[float, float]:
    """Return the radius and pitch [m] at small strain: each layer's natural curvature and twist by its share of the
    stiffness.
    """
    thickness, width, shear = (1e-3, 1e-3), 0.01, torsion.SHEAR_MODULUS
    modulus = GEL["youngs_modulus"]
    own = modulus * width * thickness[1] ** 3 / 12.0
    chi = curvature * own / bonded_bending_stiffness((modulus, modulus), thickness, width)
    stiffness = strip_torsion((shear, shear), thickness, width)
    tau = twist * 0.5 * stiffness["layers"] / stiffness[torsion_kind]
    squared = chi**2 + tau**2
    return abs(chi) / squared, 2.0 * np.pi * abs(tau) / squared


@cache
def uniform(coupling: float | None) -> float:
    """Return κH/η in the middle of a strip that grows uniformly: of two rods with a multiple of the bond, or the
    laminate.
    """
    layers = [layer("bottom"), layer("top", eigenstrain={"stimulus": "heat", "gain": UNIFORM})]
    chi = torsion.curvatures(layers, EDGES, *_model(coupling))
    return -float(chi[:, EDGES // 2].mean()) * 2e-3 / UNIFORM


@cache
def wave(edges: int, coupling: float | None) -> float:
    """Return κH/η where growth is a wave along the strip, likewise."""
    return torsion.wave_curvature(edges, *_model(coupling))[0]


def _model(coupling: float | None) -> tuple[str, dict[str, float]]:
    if coupling is None:
        return MODEL, {}
    return "two_rod", dict.fromkeys(("translation", "bending", "twist"), coupling)


def _helix_case(kind: str, natural: tuple[float, float], index: int) -> list[Case]:
    figure = ("radius", "pitch")[index]
    name = f"laminate/helix {kind} ({natural[0]:g}, {natural[1]:g})/{figure}"

    def against(answer):
        return lambda: (1e3 * helix.measured(kind, *natural, MODEL)[index], 1e3 * answer()[index])

    cases = [
        Case(name, "shares of stiffness, small strain", 1e-3, against(lambda: linear_helix(kind, *natural)), "mm"),
    ]
    if kind == "laminate":
        name, answer = f"{name}/large strain", lambda: bonded_helix(*natural, kind)
        cases.append(Case(name, "least energy per length of two bonded rods", 0.01, against(answer), "mm"))
    return cases


CASES = [
    *cases(
        "laminate/every node, m = {:g}, n = {:g}",
        "Timoshenko's bilayer (1925), formula corrected; ends included",
        EXACT,
        every_node,
        bending.PAIRS,
    ),
    *cases(
        "laminate/covered part/{} edges",
        "curvature times the length that the layer covers",
        5e-3,
        covered_part,
        (20, 40),
        unit="rad",
    ),
    *(
        Case(
            f"laminate/torsion {kind}/{edges} edges",
            f"torque over twist rate: GJ of {'the bonded strip' if kind == 'laminate' else 'both layers, summed'}",
            EXACT,
            lambda kind=kind, edges=edges: torsion.torsional_stiffness(kind, edges, MODEL),
            "N m²",
        )
        for kind in ("layers", "laminate")
        for edges in torsion.MESHES
    ),
    *cases(
        "laminate/cosine/{} edges",
        "Timoshenko's curvature of the local growth, 5 % cos(2π s/L)",
        EXACT,
        lambda edges: (wave(edges, None), timoshenko(1.0, 1.0)),
        torsion.MESHES,
    ),
    *(
        case
        for kind in helix.TORSIONS
        for natural in helix.NATURAL
        for index in (0, 1)
        for case in _helix_case(kind, natural, index)
    ),
    *(
        Case(
            f"laminate/two rods with {multiple:g} times the bond",
            "the laminate, growing uniformly",
            3e-4 / multiple,
            lambda multiple=multiple: (uniform(multiple), uniform(None)),
        )
        for multiple in MULTIPLES[:-1]
    ),
]

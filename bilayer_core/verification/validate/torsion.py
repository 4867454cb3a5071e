"""Torsion of bonded strips, and what they must not do: lock in twist, zigzag between their layers, lock where curvature
varies.
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import bending_of_layers, clamped_twist, strip_torsion, timoshenko
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

LENGTH, THICKNESS = 0.1, (1e-3, 1.5e-3)
SHEAR_MODULUS = GEL["youngs_modulus"] / (2.0 * (1.0 + GEL["poisson_ratio"]))
MESHES = (20, 40, 80)
TWIST = 0.5
"""[rad/m]: so small that the stretch of the outer fibres does not count."""
WAVE = 0.05
SECTIONS = {
    "0.7 + 1.6 mm, E 1 : 0.3": ((1.0, 0.3), (0.7e-3, 1.6e-3), 0.01),
    "0.3 + 2 mm, E 1 : 0.001": ((1.0, 1e-3), (0.3e-3, 2e-3), 0.005),
    "2 + 3 mm, 1 mm wide": ((1.0, 2.0), (2e-3, 3e-3), 0.001),
}
"""Multiples of the modulus and thicknesses [m], bottom and top, and width [m]."""


def twisted_strip(
    torsion: str,
    edges: int,
    moment: float,
    multiples: tuple[float, float] = (1.0, 1.0),
    thickness: tuple[float, float] = THICKNESS,
    width: float = 0.01,
) -> dict:
    """Return a strip between a wall and a body on which a moment about the strip's axis acts [N m]."""
    layers = [
        layer(name, thickness=h, stiffness=of_modulus)
        for name, h, of_modulus in zip(("bottom", "top"), thickness, multiples, strict=True)
    ]
    crank = {
        "name": "crank",
        "position": [LENGTH, 0, 0],
        "motion": {"type": "free", "mass": 1e-3, "inertia": [1e-7, 1e-7, 1e-7]},
    }
    return scene(
        [rod(layers, LENGTH, edges + 1, width=width, torsion=torsion, clamp_start="wall", clamp_end="crank")],
        bodies=[fixed(), crank],
        loads=[{"name": "torque", "body": "crank", "moment": [moment, 0, 0]}],
    )


def torsional_stiffness(
    torsion: str, edges: int, model: str = "two_rod", section: str | None = None
) -> tuple[float, float]:
    """Return the moment over twist per length in the middle half of the strip, away from what clamps do, and GJ
    [N m²].
    """
    multiples, thickness, width = SECTIONS[section] if section else ((1.0, 1.0), THICKNESS, 0.01)
    moduli = tuple(SHEAR_MODULUS * multiple for multiple in multiples)
    declared = strip_torsion(moduli, thickness, width)[torsion]
    moment = TWIST * declared
    simulator = Simulator(load_scene(twisted_strip(torsion, edges, moment, multiples, thickness, width)), model=model)
    simulator.solve_static()
    directors = simulator.frame().directors[:edges]
    first, last = edges // 4, 3 * edges // 4
    angle = np.arctan2(-directors[[first, last], 1], directors[[first, last], 2])  # of m1, about +x from +z
    return moment / ((angle[1] - angle[0]) * edges / LENGTH / (last - first)), declared


def turned_tube(inner: float, axis: int, model: str) -> tuple[float, float]:
    """Return the angle [rad] by which a moment turns the end of a round rod, about itself (axis 0) or across, and M L
    over G π/2 (R⁴ − r⁴) or E π/4 (R⁴ − r⁴); R is 2 mm.
    """
    second = 0.25 * np.pi * (2e-3**4 - inner**4)
    stiffness = (2.0 * SHEAR_MODULUS if axis == 0 else GEL["youngs_modulus"]) * second
    content = twisted_strip("laminate", 20, 0.0)
    content["rods"][0] |= {"radius": 2e-3, "layers": [{"name": "wall", "material": "gel"}]}
    content["rods"][0] |= {"inner_radius": inner} if inner else {}
    del content["rods"][0]["width"]
    content["loads"][0]["moment"] = [stiffness * TWIST * (k == axis) for k in range(3)]
    simulator = Simulator(load_scene(content), model=model)
    simulator.solve_static()
    x, y, z, w = simulator.frame().body_quaternions[1]
    return float(2.0 * np.arctan2(np.linalg.norm([x, y, z]), w)), TWIST * LENGTH


def clamped_ends(torsion: str, edges: int) -> tuple[float, float]:
    """Return the angle of the crank of two rods whose centrelines may not tilt at their ends, and Vlasov's [rad]."""
    stiffness = strip_torsion((SHEAR_MODULUS, SHEAR_MODULUS), THICKNESS, 0.01)[torsion]
    moment = TWIST * stiffness
    simulator = Simulator(load_scene(twisted_strip(torsion, edges, moment)), model="two_rod")
    simulator.solve_static()
    w, x = simulator.frame().body_quaternions[1, [3, 0]]
    # EI₂ of a layer is w²/12 times its EA: both centrelines, z over their axis, bend across the width by z τ′
    bending = bending_of_layers((GEL["youngs_modulus"],) * 2, THICKNESS, 0.01)
    return 2.0 * np.arctan2(x, w), clamped_twist(moment, stiffness, 0.01**2 / 12.0 * bending, LENGTH)


@cache
def _curvature_of_uniform_growth(edges: int) -> np.ndarray:
    """Return χ of both layers at inner nodes away from the ends [1/m], shape (2, n)."""
    layers = [layer("bottom"), layer("top", eigenstrain={"stimulus": "heat", "gain": WAVE})]
    return curvatures(layers, edges)[:, edges // 4 : 3 * edges // 4]


def curvatures(
    layers: list[dict], edges: int, model: str = "two_rod", coupling: dict[str, float] | None = None
) -> np.ndarray:
    """Return χ of each strand of a clamped strip in equilibrium [1/m], shape (n_strand, edges + 1)."""
    config = scene(
        [rod(layers, LENGTH, edges + 1, clamp_start="wall")],
        bodies=[fixed()],
        stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}},
        coupling=coupling or {},
    )
    simulator = Simulator(load_scene(config), model=model)
    simulator.solve_static()
    return simulator.curvatures.reshape(-1, edges + 1)


def zigzag(edges: int) -> tuple[float, float]:
    """Return the largest alternation of curvature from node to node of either layer, over the curvature; 0."""
    chi = _curvature_of_uniform_growth(edges)
    return np.abs(chi[:, :-2] - 2.0 * chi[:, 1:-1] + chi[:, 2:]).max() / 4.0 / np.abs(chi).mean(), 0.0


def wave_strip(edges: int) -> tuple[list[dict], np.ndarray]:
    """Return the layers of which the top one grows by `WAVE` cos(2π s/L), and that strain at the edges, shape
    (edges,).
    """
    size = LENGTH / edges
    strain = WAVE * np.cos(2.0 * np.pi * (np.arange(edges) + 0.5) / edges)
    laws = [
        {"stimulus": "heat", "gain": float(gain), "interval": [k * size, (k + 1) * size]}
        for k, gain in enumerate(strain)
    ]
    return [layer("bottom"), layer("top", eigenstrain=laws)], strain


def amplitude(chi: np.ndarray, strain: np.ndarray) -> float:
    """Return κH/η of χ at inner nodes [1/m], projected on the strain of the edges in the middle half."""
    at_nodes = 0.5 * (strain[:-1] + strain[1:])
    middle = slice(len(strain) // 4, 3 * len(strain) // 4)
    return -(chi[middle] @ at_nodes[middle]) / (at_nodes[middle] @ at_nodes[middle]) * 2e-3


def wave_curvature(edges: int, model: str = "two_rod", coupling: dict[str, float] | None = None) -> tuple[float, float]:
    """Return κH/η where growth is a wave along the strip, and Timoshenko's."""
    layers, strain = wave_strip(edges)
    chi = curvatures(layers, edges, model, coupling)[:, 1:-1].mean(axis=0)
    return amplitude(chi, strain), timoshenko(1.0, 1.0)


CASES = [
    *(
        Case(
            f"torsion/{torsion}/{edges} edges",
            f"torque over twist rate: GJ of {'the bonded strip' if torsion == 'laminate' else 'both layers, summed'}",
            0.01,
            lambda torsion=torsion, edges=edges: torsional_stiffness(torsion, edges),
            "N m²",
        )
        for torsion in ("layers", "laminate")
        for edges in MESHES
    ),
    *cases(
        "torsion/{}/{}",
        "torque over twist rate: GJ of the layered section",
        0.002,
        lambda section, model: torsional_stiffness("laminate", 40, model, section),
        product(SECTIONS, ("two_rod", "laminate")),
        unit="N m²",
    ),
    *(
        Case(
            f"torsion/clamped ends {torsion}/{edges} edges",
            "angle by which two rods turn that hold back a part of their warping, Vlasov's equation",
            limit,
            lambda torsion=torsion, edges=edges: clamped_ends(torsion, edges),
            "rad",
        )
        for torsion in ("layers", "laminate")
        for edges, limit in ((40, 0.01), (160, 0.002))
    ),
    *cases(
        "locking/zigzag/{} edges",
        "no alternation of curvature between neighbouring nodes (5 % growth)",
        1e-3,
        zigzag,
        MESHES,
        scale=1.0,
    ),
    *cases(
        "locking/cosine/{} edges",
        "Timoshenko's curvature of the local growth, 5 % cos(2π s/L)",
        0.01,
        wave_curvature,
        MESHES,
    ),
    *cases(
        "torsion/round/{0}, {3}, {4}",
        "M L over the stiffness of a round section",
        1e-3,
        lambda _kind, inner, axis, _what, model: turned_tube(inner, axis, model),
        [
            (kind, inner, axis, what, model)
            for kind, inner in (("solid", 0.0), ("hollow", 1.5e-3))
            for axis, what in ((0, "twisted"), (1, "bent"), (2, "bent across"))
            for model in ("laminate", "two_rod")
        ],
        unit="rad",
    ),
]

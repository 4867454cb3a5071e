"""What a bonded strip must not do: lock in twist, zigzag between its layers, lock where its curvature varies."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..scene.loader import load_scene
from ..simulation.simulator import Simulator
from .case import Case
from .parts import GEL, fixed, layer, rod, scene
from .references import strip_torsion, timoshenko

LENGTH, THICKNESS = 0.1, (1e-3, 1.5e-3)
SHEAR_MODULUS = GEL["youngs_modulus"] / (2.0 * (1.0 + GEL["poisson_ratio"]))
MESHES = (20, 40, 80)
TWIST = 0.5
"""[rad/m]: so small that the stretch of the outer fibres does not count."""
WAVE = 0.05


def twisted_strip(torsion: str, edges: int, moment: float) -> dict:
    """A strip between a wall and a body on which a moment about the strip's axis acts [N m]."""
    layers = [layer("bottom", thickness=THICKNESS[0]), layer("top", thickness=THICKNESS[1])]
    crank = {
        "name": "crank",
        "position": [LENGTH, 0, 0],
        "motion": {"type": "free", "mass": 1e-3, "inertia": [1e-7, 1e-7, 1e-7]},
    }
    return scene(
        [rod(layers, LENGTH, edges + 1, torsion=torsion, clamp_start="wall", clamp_end="crank")],
        bodies=[fixed(), crank],
        loads=[{"name": "torque", "body": "crank", "moment": [moment, 0, 0]}],
    )


def torsional_stiffness(torsion: str, edges: int, model: str = "two_rod") -> tuple[float, float]:
    """Moment over twist per length in the middle half of the strip, away from what clamps do, and GJ [N m²]."""
    declared = strip_torsion((SHEAR_MODULUS, SHEAR_MODULUS), THICKNESS, 0.01)[torsion]
    moment = TWIST * declared
    simulator = Simulator(load_scene(twisted_strip(torsion, edges, moment)), model=model)
    simulator.solve_static()
    directors = simulator.frame().directors[:edges]
    first, last = edges // 4, 3 * edges // 4
    angle = np.arctan2(-directors[[first, last], 1], directors[[first, last], 2])  # of m1, about +x from +z
    return moment / ((angle[1] - angle[0]) * edges / LENGTH / (last - first)), declared


@cache
def _curvature_of_uniform_growth(edges: int) -> np.ndarray:
    """χ of both layers at inner nodes away from the ends [1/m], shape (2, n)."""
    layers = [layer("bottom"), layer("top", eigenstrain={"stimulus": "heat", "gain": WAVE})]
    return curvatures(layers, edges)[:, edges // 4 : 3 * edges // 4]


def curvatures(
    layers: list[dict], edges: int, model: str = "two_rod", coupling: dict[str, float] | None = None
) -> np.ndarray:
    """χ of each strand of a clamped strip in equilibrium [1/m], shape (n_strand, edges + 1)."""
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
    """Largest alternation of curvature from node to node of either layer, over the curvature; 0."""
    chi = _curvature_of_uniform_growth(edges)
    return np.abs(chi[:, :-2] - 2.0 * chi[:, 1:-1] + chi[:, 2:]).max() / 4.0 / np.abs(chi).mean(), 0.0


def wave_strip(edges: int) -> tuple[list[dict], np.ndarray]:
    """Layers of which the top one grows by `WAVE` cos(2π s/L), and that strain at the edges, shape (edges,)."""
    size = LENGTH / edges
    strain = WAVE * np.cos(2.0 * np.pi * (np.arange(edges) + 0.5) / edges)
    laws = [
        {"stimulus": "heat", "gain": float(gain), "interval": [k * size, (k + 1) * size]}
        for k, gain in enumerate(strain)
    ]
    return [layer("bottom"), layer("top", eigenstrain=laws)], strain


def amplitude(chi: np.ndarray, strain: np.ndarray) -> float:
    """κH/η of χ at inner nodes [1/m], projected on the strain of the edges in the middle half."""
    at_nodes = 0.5 * (strain[:-1] + strain[1:])
    middle = slice(len(strain) // 4, 3 * len(strain) // 4)
    return -(chi[middle] @ at_nodes[middle]) / (at_nodes[middle] @ at_nodes[middle]) * 2e-3


def wave_curvature(edges: int, model: str = "two_rod", coupling: dict[str, float] | None = None) -> tuple[float, float]:
    """κH/η where growth is a wave along the strip, and Timoshenko's."""
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
    *(
        Case(
            f"locking/zigzag/{edges} edges",
            "no alternation of curvature between neighbouring nodes (5 % growth)",
            1e-3,
            lambda edges=edges: zigzag(edges),
            scale=1.0,
        )
        for edges in MESHES
    ),
    *(
        Case(
            f"locking/cosine/{edges} edges",
            "Timoshenko's curvature of the local growth, 5 % cos(2π s/L)",
            0.01,
            lambda edges=edges: wave_curvature(edges),
        )
        for edges in MESHES
    ),
]

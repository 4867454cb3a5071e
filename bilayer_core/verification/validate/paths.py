"""Rods on curved paths: a helical spring of flat ribbon under small loads, against Kirchhoff's theory.

The ribbon lies on a cylinder of radius R with the pitch angle α; its end is fixed to a body on the axis, on which a
force F along the axis acts. With the tangent T, the normal N to the axis and the binormal B, the moment about a section
is that of F on the arm R,

    F R e_φ = F R (cos α T − sin α B),

the same everywhere: it twists the section and bends it about B, through the ribbon's thickness (EI_B = E w h³/12).
There is no moment about N, so the other bending stiffness does not matter whatever the pitch. The tension is F sin α.
By Castigliano's theorem, with a moment M about the axis, M (sin α T + cos α B), beside F,

    extension/L = F [R² (cos²α/GJ + sin²α/EI_B) + sin²α/EA] + M R sin α cos α (1/GJ − 1/EI_B)
    rotation/L  = F R sin α cos α (1/GJ − 1/EI_B) + M (sin²α/GJ + cos²α/EI_B)

The first is the usual formula of close-coiled springs, F R² L/GJ, where α = 0.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from bilayer_core.kinematics.rotation import matrix_from_quaternion, rotation_vector
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import strip_torsion
from bilayer_core.verification.validate.parts import GEL, fixed, layer, scene
from bilayer_core.verification.validate.validation_case import Case

RADIUS, WIDTH, THICKNESS, TURNS = 10e-3, 3e-3, 0.6e-3, 2.5
EDGES_PER_TURN = 96
PITCH_ANGLES = (10.0, 35.0, 65.0)
"""[deg]"""
FORCE, MOMENT = 1e-6, 1e-8
"""[N], [N m]: strains of some 1e-6."""


def spring(pitch_angle: float, layers: list[dict], stations: int, load: dict) -> dict:
    """Return the spring between a wall and a body on its axis, the z axis."""
    pitch = 2.0 * math.pi * RADIUS * math.tan(math.radians(pitch_angle))
    ribbon = {
        "name": "ribbon",
        "width": WIDTH,
        "path": {
            "shape": "helix",
            "start": [RADIUS, 0, 0],
            "axis": [0, 0, 1],
            "radius": RADIUS,
            "pitch": pitch,
            "angle": 2.0 * math.pi * TURNS,
        },
        "normal": [-1, 0, 0],
        "stations": stations,
        "layers": layers,
        "clamp_start": "wall",
        "clamp_end": "end",
    }
    end = {
        "name": "end",
        "position": [0, 0, pitch * TURNS],
        "motion": {"type": "free", "mass": 1e-3, "inertia": [1e-7, 1e-7, 1e-7]},
    }
    return scene([ribbon], bodies=[fixed(), end], loads=[{"name": "load", "body": "end", **load}])


@cache
def compliance(pitch_angle: float, model: str, pairs: bool, edges_per_turn: int = EDGES_PER_TURN) -> np.ndarray:
    """Return the extension and rotation about the axis per force, and per moment: [[m/N, m/(N m)], [rad/N, rad/(N m)]],
    of a ribbon of one layer or of a pair of equal ones.
    """
    layers = [layer("inner", THICKNESS / 2), layer("outer", THICKNESS / 2)] if pairs else [layer(thickness=THICKNESS)]
    stations = round(edges_per_turn * TURNS) + 1
    found = np.zeros((2, 2))
    for column, (key, size) in enumerate((("force", FORCE), ("moment", MOMENT))):
        for sign in (0.5, -0.5):  # what is quadratic in the load drops out
            load = {key: [0, 0, sign * size]}
            simulator = Simulator(load_scene(spring(pitch_angle, layers, stations, load)), model=model)
            start = simulator.frame().body_positions[1, 2]
            simulator.solve_static()
            end = simulator.frame()
            turn = rotation_vector(matrix_from_quaternion(end.body_quaternions[1]))[2]
            found[:, column] += 2.0 * sign * np.array([end.body_positions[1, 2] - start, turn]) / size
    return found


def _stiffnesses() -> tuple[float, float, float]:
    """Return GJ, EI_B [N m²] and EA [N]."""
    modulus, shear = GEL["youngs_modulus"], GEL["youngs_modulus"] / (2.0 * (1.0 + GEL["poisson_ratio"]))
    twisting = strip_torsion((shear, shear), (THICKNESS / 2, THICKNESS / 2), WIDTH)["laminate"]
    return twisting, modulus * WIDTH * THICKNESS**3 / 12.0, modulus * WIDTH * THICKNESS


def expected(pitch_angle: float) -> np.ndarray:
    """Return the theoretical compliance of the spring, as `compliance` does."""
    sine, cosine = math.sin(math.radians(pitch_angle)), math.cos(math.radians(pitch_angle))
    twisting, bending, axial = _stiffnesses()
    length = 2.0 * math.pi * RADIUS * TURNS / cosine
    pull = RADIUS**2 * (cosine**2 / twisting + sine**2 / bending) + sine**2 / axial
    both = RADIUS * sine * cosine * (1.0 / twisting - 1.0 / bending)
    return length * np.array([[pull, both], [both, sine**2 / twisting + cosine**2 / bending]])


FIGURES = {
    "extension under a force": (0, 0, "m/N"),
    "rotation under a force": (1, 0, "rad/N"),
    "rotation under a moment": (1, 1, "rad/(N m)"),
}
"""Row and column of the compliance, and unit. What a moment extends is what a force turns (Betti)."""


def _case(pitch_angle: float, model: str, pairs: bool, figure: str, limit: float) -> Case:
    row, column, unit = FIGURES[figure]
    scale = None
    if row != column:  # twist and bending nearly cancel: by the part of the twist
        scale = 2.0 * math.pi * RADIUS**2 * TURNS * math.sin(math.radians(pitch_angle)) / _stiffnesses()[0]

    def measure() -> tuple[float, float]:
        return compliance(pitch_angle, model, pairs)[row, column], expected(pitch_angle)[row, column]

    name = f"paths/spring of {pitch_angle:g}°, {'two layers' if pairs else 'one layer'}, {model}/{figure}"
    long = model == "two_rod" and pitch_angle < PITCH_ANGLES[-1]
    return Case(name, "Kirchhoff's theory for small loads", limit, measure, unit, scale, long)


def order_in_space() -> tuple[float, float]:
    """Return the order at which the error of the extension falls; 2."""
    theory = expected(PITCH_ANGLES[0])[0, 0]
    coarse, fine = (
        abs(compliance(PITCH_ANGLES[0], "laminate", False, edges)[0, 0] - theory)
        for edges in (EDGES_PER_TURN // 2, EDGES_PER_TURN)
    )
    return math.log2(coarse / fine), 2.0


LIMITS = {("laminate", False): 3e-3, ("laminate", True): 3e-3, ("two_rod", True): 0.01}
"""By model, and whether there are two layers. Clamps hold back a part of the twist of two rods (`model.twisted`)."""
CASES = [
    *(
        _case(pitch_angle, *kind, figure, limit)
        for kind, limit in LIMITS.items()
        for pitch_angle in PITCH_ANGLES
        for figure in FIGURES
    ),
    Case("paths/spring/order in space", "order 2 of bending and twist", 0.1, order_in_space, scale=1.0),
]

"""Wide strips: curvature and twist of free ones that swell, also after they were held flat, with fibres or of unlike
Poisson's ratios, and their stiffness in bending.
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.kinematics.frame_strains import rest_strains
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import PlateStrip
from bilayer_core.verification.validate.motion import put
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

WIDTH, THICKNESS = 20e-3, 0.2e-3
RATIOS = (0.1, 1, 3, 6, 10, 36, 100)
"""w²κ₀/H, with the curvature κ₀ of a narrow strip."""
SLANTS = (0.5, 1, 2)
"""τ/κ of developable ribbons."""
BENT = (1, 5, 36)
"""w²κ/H of a straight strip that a moment bends about as far."""


def _simulator(poisson: float, dimension: int, gain: float = 0.0, length: float = 0.2, **more) -> Simulator:
    law = {"stimulus": "heat", "gain": gain}
    layers = [layer("bottom", 0.5 * THICKNESS, eigenstrain=law), layer("top", 0.5 * THICKNESS)]
    return _loaded(layers, {"gel": poisson}, dimension, length, **more)


def _loaded(
    layers: list[dict], ratios: dict[str, float], dimension: int = 3, length: float = 0.2, stations: int = 21, **more
) -> Simulator:
    strip = rod(layers, length, stations, width=WIDTH, section="strip", clamp_start="wall", **more.pop("held", {}))
    content = scene(
        [strip],
        bodies=[fixed(), *more.pop("bodies", [])],
        materials={name: {**GEL, "poisson_ratio": poisson} for name, poisson in ratios.items()},
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


def _rest(simulator: Simulator, values: tuple[float, ...] = (1.0,)) -> tuple[float, float]:
    """Return the curvature and twist [1/m] in the middle of a strip, at rest after each value of its stimulus."""
    for value in values:
        simulator.set_stimulus("heat", value)
        simulator.solve_static()
    strip = simulator.rods["rod"]
    node = len(strip.nodes) // 2
    edges, normals = np.diff(strip.positions[node - 1 : node + 2], axis=0), strip.directors[node - 1 : node + 1]
    tangents = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    strains = rest_strains(tangents[:1], normals[:1], tangents[1:], normals[1:])[0]
    return strip.curvature[node], strains[2] / (strip.arc_length[node + 1] - strip.arc_length[node])


def crossed(degrees: float, ratio: float, stiffness: float = 1.0, patch: bool = False) -> tuple[float, float]:
    """Return κ/κ₀ and τ/κ₀ of two layers with fibres at right angles, along which they do not swell, by w²κ₀/H: the
    lower one swells at the angle to the strip. At 45° a wide one may bend either way: κ is its size, of one joint. A
    patch is the middle of a strip whose lower layer is no longer, so that the curve is on the axis of the upper one.
    """
    thickness = 0.1 * THICKNESS * min(1.0, 100.0 / ratio)  # so thin that its borders matter little in twist
    curvature = ratio * thickness / WIDTH**2
    law = {"stimulus": "heat", "gain": curvature * thickness / 1.5}
    along = {"swelling": 0.0, "stiffness": stiffness}
    layers = [
        layer(name, 0.5 * thickness, eigenstrain=law, fibres={"angle": math.radians(angle), "along": along})
        for name, angle in (("bottom", degrees - 90.0), ("top", degrees))
    ]
    if patch:
        layers[0]["interval"] = [0.06, 0.14]
    simulator = _loaded(layers, {"gel": 0.3}, stations=3 if degrees == 45.0 else 21)
    # in steps: a strip that is flat while it swells may go to another shape at rest
    bend, twist = _rest(simulator, tuple(np.geomspace(min(0.1, 1.0 / ratio), 1.0, 60)))
    return (abs(bend) if degrees == 45.0 else bend) / curvature, twist / curvature


def naturally_twisted(ratio: float) -> tuple[float, float]:
    """Return the twist of a strip of one layer, and that of the layer by itself, by its w²τ̄/H."""
    twist = ratio * THICKNESS / WIDTH**2
    return _rest(_loaded([layer("only", THICKNESS, natural_twist=twist)], {"gel": 0.3}))[1], twist


def of_unlike_ratios(ratio: float) -> float:
    """Return κ/κ₀ of two layers of unlike Poisson's ratios and one modulus, the lower one of which swells."""
    curvature = ratio * THICKNESS / WIDTH**2
    law = {"stimulus": "heat", "gain": curvature * THICKNESS / 1.5}
    layers = [layer("bottom", 0.5 * THICKNESS, "low", eigenstrain=law), layer("top", 0.5 * THICKNESS, "high")]
    return _rest(_loaded(layers, UNLIKE, 2), tuple(np.geomspace(0.05, 1.0, 20)))[0] / curvature


def developable(slant: float, ratio: float) -> float:
    """Return the energy of a very thin ribbon in a helix, of the twist over the curvature `slant`, over Sadowsky's
    ½ D w (κ² + τ²)²/κ², by its w²κ/H.
    """
    thickness, edges, poisson = 1e-4 * WIDTH, 40, 0.3
    curvature, turned = ratio * thickness / WIDTH**2, 5e-3  # of each joint
    length = edges * turned / curvature
    ribbon = rod([layer("only", thickness)], length, edges + 1, width=WIDTH, section="strip")
    gel = {"gel": {**GEL, "poisson_ratio": poisson}}
    simulator = Simulator(load_scene(scene([ribbon], materials=gel)), model="laminate", dimension=3)
    turns = [np.eye(3)]
    for _ in range(edges - 1):
        turns.append(turns[-1] @ rotation_matrix(turned * np.array([slant, -1.0, 0.0])))
    tangents, normals = np.array(turns)[:, :, 0], np.array(turns)[:, :, 2]
    ends = np.cumsum(tangents, axis=0) * length / edges
    put(simulator, position=np.concatenate([np.zeros((1, 3)), ends]), director1=normals)
    plate = GEL["youngs_modulus"] * thickness**3 / (12.0 * (1.0 - poisson**2))
    bent = 0.5 * plate * WIDTH * curvature**2 * (1.0 + slant**2) ** 2 * length * (edges - 1) / edges
    return sum(simulator.energy().values()) / bent


UNLIKE = {"low": 0.1, "high": 0.49}
RESTS = {
    (30.0, 1.0): {
        1: (0.48988, 0.84841),
        3: (0.43804, 0.75515),
        6: (0.37095, 0.62176),
        10: (0.32820, 0.50658),
        36: (0.49633, 0.36258),
        100: (0.51746, 0.33718),
    },
    (45.0, 1.0): {
        1: (0.0, 0.97963),
        3: (0.0, 0.87110),
        6: (0.0, 0.71495),
        10: (0.0, 0.57914),
        36: (0.29856, 0.39896),
        100: (0.34301, 0.38209),
    },
    (30.0, 8.0): {
        1: (0.35831, 0.62061),
        3: (0.34404, 0.59490),
        6: (0.31581, 0.53747),
        10: (0.28993, 0.46666),
        36: (0.45188, 0.33335),
        100: (0.48646, 0.31483),
    },
}
"""(κ, τ)/κ₀ of crossed layers, by angle and stiffness of the fibres over that across them, and by w²κ₀/H."""
UNLIKE_RESTS = {1: 0.96878, 3: 0.90217, 6: 0.81686, 10: 0.96393, 36: 1.17606, 100: 1.21863}
"""κ/κ₀ of layers of the ratios `UNLIKE`. All are those of a plate strip solved across its width, by
`tests/oracles/plate_strip_across.py`.
"""


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


def _crossed_case(degrees: float, stiffness: float, ratio: float, which: int) -> Case:
    """Return the case of a curvature (0) or twist (1), in parts of κ₀."""
    told = f"fibres {stiffness:g} times as stiff, " if stiffness != 1.0 else ""

    def measure() -> tuple[float, float]:
        return crossed(degrees, ratio, stiffness)[which], RESTS[degrees, stiffness][ratio][which]

    name = f"strips/crossed layers, {told}cut at {degrees:g}°/w²κ₀/H {ratio:g}/{('curvature', 'twist')[which]}"
    return Case(name, PLATE, 1e-3, measure, scale=1.0)


def _narrow_case(degrees: float, which: int) -> Case:
    angle = math.radians(2.0 * degrees)
    answer = (math.cos(angle), math.sin(angle))[which]
    return Case(
        f"strips/crossed layers, cut at {degrees:g}°/w²κ₀/H 0.1/{('curvature', 'twist')[which]}",
        "κ₀ cos 2θ and κ₀ sin 2θ of narrow strips",
        1e-3,
        lambda: (crossed(degrees, 0.1)[which], answer),
        scale=1.0,
    )


CASES += [
    Case(
        f"strips/crossed layers in a patch, fibres 8 times as stiff, cut at 30°/w²κ₀/H 6/{name}",
        PLATE,
        1e-3,
        lambda which=which: (crossed(30.0, 6, 8.0, patch=True)[which], RESTS[30.0, 8.0][6][which]),
        scale=1.0,
    )
    for which, name in enumerate(("curvature", "twist"))
]
CASES += [
    Case(
        f"strips/natural twist/w²τ̄/H {ratio:g}",
        "that of the layer by itself",
        1e-6,
        lambda ratio=ratio: naturally_twisted(ratio),
        "1/m",
    )
    for ratio in (0.1, 3)
]
CASES += [_narrow_case(degrees, which) for degrees in (30.0, 45.0, -20.0) for which in (0, 1)]
CASES += [
    _crossed_case(degrees, stiffness, ratio, which)
    for (degrees, stiffness), rests in RESTS.items()
    for ratio in rests
    for which in (0, 1)
]
CASES += [
    Case(
        f"strips/crossed layers, cut at 30°/wide/{name}",
        "a cylinder of radius 1/((1 − ν) κ₀) round a direction of swelling",
        1e-2,
        lambda which=which, answer=answer: (crossed(30.0, 3e3)[which], answer),
        scale=1.0,
    )
    for which, name, answer in ((0, "curvature", 0.7 * 0.75), (1, "twist", 0.7 * math.sqrt(3.0) / 4.0))
]
CASES += [
    Case(
        f"strips/developable ribbon, τ/κ {slant:g}/w²κ/H 1e6",
        "Sadowsky's ½ D w (κ² + τ²)²/κ²",
        2e-3,
        lambda slant=slant: (developable(slant, 1e6), 1.0),
    )
    for slant in SLANTS
]
CASES += [
    Case(
        f"strips/unlike ratios, ν 0.1 and 0.49/w²κ₀/H {ratio:g}",
        PLATE,
        1e-3,
        lambda ratio=ratio, answer=answer: (of_unlike_ratios(ratio), answer),
    )
    for ratio, answer in UNLIKE_RESTS.items()
]

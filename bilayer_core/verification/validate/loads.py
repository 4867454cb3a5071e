"""Forces on a cantilever: small ones against beam theory, large ones against the elastica; a mass at its tip."""

from __future__ import annotations

from functools import cache

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.beams import BENDING, LENGTH, SOFT, THICKNESS, beam
from bilayer_core.verification.validate.closed_forms import end_loaded_cantilever
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

LARGE = 2.0
"""F L²/EI; the tip moves by about half the length."""
SMALL = 3e-4
EDGES = 80


def _settled(layers: list[dict] | None, place: float, **force) -> Simulator:
    load = {"name": "pull", "rod": "rod", "position": place, **force}
    config = beam(EDGES + 1, loads=[load])
    if layers:
        config["rods"] = [rod(layers, LENGTH, EDGES + 1, clamp_start="wall")]
    simulator = Simulator(load_scene(config))
    simulator.solve_static()
    return simulator


def small_force(layers: list[dict] | None, place: float) -> tuple[float, float]:
    """Return the deflection of the tip [µm] under a small force at `place` [m]: F a² (3 L − a)/6EI."""
    force = SMALL * BENDING / LENGTH**2
    simulator = _settled(layers, place, force=[0, 0, force])
    moved = simulator.positions[-1, 2] - simulator.model.start_position[-1, 2]
    return 1e6 * moved, 1e6 * force * place**2 / (6.0 * BENDING) * (3.0 * LENGTH - place)


@cache
def _large_force(follower: bool) -> tuple[float, float]:
    size = LARGE * BENDING / LENGTH**2
    force = {"force": [0, size, 0], "frame": "material"} if follower else {"force": [0, 0, size]}
    return tuple(_settled(None, LENGTH, **force).positions[-1, [0, 2]])


def large_force(follower: bool, axis: int) -> tuple[float, float]:
    """Return the coordinate of the tip [mm] under a large force, of fixed direction or following the normal."""
    return 1e3 * _large_force(follower)[axis], 1e3 * LENGTH * end_loaded_cantilever(LARGE, follower)[axis]


def tip_weight() -> tuple[float, float]:
    """Return the sinking of the tip [µm] of a massless strip under the weight of a point mass: m g L³/3EI."""
    mass, gravity = 1e-3, 0.1
    light = {"gel": {"youngs_modulus": 1e3 * SOFT, "poisson_ratio": 0.5, "density": 1e-3}}
    config = scene(
        [rod([layer(thickness=THICKNESS)], LENGTH, EDGES + 1, clamp_start="wall")],
        bodies=[fixed()],
        materials=light,
        gravity=[0, 0, -gravity],
        masses=[{"name": "tip", "rod": "rod", "position": LENGTH, "mass": mass}],
    )
    simulator = Simulator(load_scene(config))
    simulator.solve_static()
    return -1e6 * simulator.positions[-1, 2], 1e6 * mass * gravity * LENGTH**3 / (3.0 * 1e3 * BENDING)


HALVES = [layer("bottom"), layer("top")]
CASES = [
    *cases(
        "loads/small force/{}",
        "F a² (3 L − a)/6EI",
        1e-3,
        lambda _name, arguments: small_force(*arguments),
        {
            "at the tip": (None, LENGTH),
            "at the tip, two layers": (HALVES, LENGTH),
            "between two stations": (None, 0.6135 * LENGTH),
        }.items(),
        unit="µm",
    ),
    *(
        Case(
            f"loads/large force/{'following' if follower else 'fixed'}/tip {axis}",
            "inextensible elastica, by shooting",
            2e-4,
            lambda follower=follower, k=k: large_force(follower, k),
            "mm",
            scale=1e3 * LENGTH,
        )
        for follower in (False, True)
        for k, axis in enumerate("xz")
    ),
    Case("loads/point mass", "m g L³/3EI", 1e-3, tip_weight, "µm"),
]

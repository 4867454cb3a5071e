"""Free curvature of a bilayer strip of which one layer grows (paper, section 3.1, Fig. 3).

Both models compute it: two bonded rods, and the planar beam of Appendix A. The strip is 2 mm thick and clamped at one
end; the curvature is that of its middle.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.beam2d.scene import beam_of, set_stimuli
from bilayer_core.verification.validate.closed_forms import timoshenko
from bilayer_core.verification.validate.parts import GEL, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

RATIOS = np.logspace(-1.0, 1.0, 15)
FIGURE_STRAIN = 0.01
PAIRS = ((1.0, 1.0), (2.0, 1.0), (1.0, 2.0), (5.0, 0.5), (0.2, 3.0))
"""(m, n) of `docs/equations.md`: 1.5, 1.45455, 1.33333, 1.49584, 1.47541."""
THICKNESS, STATIONS = 2e-3, 41


def strip(m: float, n: float, eigenstrain: float, stations: int = STATIONS) -> dict:
    """Return a clamped bilayer of m = E₂/E₁, n = h₂/h₁ (bottom over top), whose top layer grows by `eigenstrain`."""
    top = THICKNESS / (1.0 + n)
    layers = [
        layer("bottom", thickness=n * top, material="base"),
        layer("top", thickness=top, eigenstrain={"stimulus": "heat", "gain": eigenstrain}),
    ]
    return scene(
        [rod(layers, length=0.05, stations=stations, clamp_start="wall")],
        bodies=[fixed()],
        materials={"gel": GEL, "base": {**GEL, "youngs_modulus": m * GEL["youngs_modulus"]}},
        stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}},
    )


@cache
def two_rod(m: float, n: float, eigenstrain: float) -> float:
    """Return κH/η from two bonded rods."""
    simulator = Simulator(load_scene(strip(m, n, eigenstrain)))
    simulator.solve_static()
    return -simulator.curvatures[STATIONS // 2] * THICKNESS / eigenstrain


@cache
def beam2d(m: float, n: float, eigenstrain: float) -> float:
    """Return κH/η from the planar beam."""
    config = load_scene(strip(m, n, eigenstrain))
    beam = beam_of(config)
    set_stimuli(beam, config, {"heat": 1.0})
    beam.solve_static()
    return -beam.curvatures[STATIONS // 2] * THICKNESS / eigenstrain


@cache
def softened(n: float, multiple: float) -> float:
    """Return κH/η where a second stimulus takes the moduli of the top layer from those of the bottom one to a multiple
    of them, after it has grown.
    """
    content = strip(1.0, n, FIGURE_STRAIN)
    content["rods"][0]["layers"][1]["stiffness_change"] = {"stimulus": "warmth", "gain": multiple - 1.0}
    content["stimuli"]["warmth"] = {"schedule": {"type": "hold", "value": 0}}
    simulator = Simulator(load_scene(content))
    simulator.solve_static()
    simulator.set_stimulus("warmth", 1.0)
    simulator.solve_static()
    return -simulator.curvatures[STATIONS // 2] * THICKNESS / FIGURE_STRAIN


def across(model: str, of_path: float, of_layers: float) -> tuple[float, float]:
    """Return the distance of the ends [m] of a strip that is bent across its width [1/m], and has rest at another."""
    length, angle = 0.1, of_path * np.linspace(0.0, 0.1, STATIONS)
    ribbon = rod(
        [layer(name, natural_curvature_across=of_layers) for name in "ab"], length, STATIONS, clamp_start="wall"
    )
    if of_path:
        points = np.stack([np.sin(angle), np.cos(angle) - 1.0, 0.0 * angle], axis=1) / of_path
        ribbon["path"] = {"shape": "spline", "points": points.tolist()}
    simulator = Simulator(load_scene(scene([ribbon], bodies=[fixed()])), model=model)
    simulator.solve_static()
    ends = simulator.positions.reshape(-1, STATIONS, 3).mean(axis=0)[[0, -1]]
    chord = 2.0 * np.sin(0.5 * of_layers * length) / of_layers if of_layers else length
    return float(np.linalg.norm(ends[1] - ends[0])), chord


MODELS = {"two_rod": (two_rod, 0.01), "beam2d": (beam2d, 0.001)}
SWEEPS = {
    "m": [(ratio, 1.0) for ratio in RATIOS],
    "n": [(1.0, ratio) for ratio in RATIOS],
}


def _case(name: str, model: str, m: float, n: float, eigenstrain: float) -> Case:
    compute, limit = MODELS[model]
    return Case(
        name,
        "Timoshenko's bilayer (1925), formula corrected",
        limit,
        lambda: (compute(m, n, eigenstrain), timoshenko(m, n)),
    )


CASES = (
    [
        _case(f"bending/{model}/{sweep} = {dict(m=m, n=n)[sweep]:.3g}", model, m, n, FIGURE_STRAIN)
        for sweep, ratios in SWEEPS.items()
        for model in MODELS
        for m, n in ratios
    ]
    + [
        _case(f"bending/pair m = {m:g}, n = {n:g}/{100 * strain:g} %", "two_rod", m, n, strain)
        for m, n in PAIRS
        for strain in (0.005, 0.05)
    ]
    + [
        Case(
            f"bending/top layer of moduli times {multiple:g}/n = {n:g}",
            "Timoshenko's bilayer at these moduli",
            0.001,
            lambda n=n, multiple=multiple: (softened(n, multiple), timoshenko(1.0 / multiple, n)),
        )
        for multiple in (0.1, 0.5, 3.0)
        for n in (0.5, 2.0)
    ]
    + [
        Case(
            f"bending/across the width/{what}, {model}",
            "chord of the circle that the layers have by themselves",
            1e-3,
            lambda model=model, curvatures=curvatures: across(model, *curvatures),
            "m",
        )
        for what, curvatures in (("cut straight", (0.0, 12.0)), ("cut along a circle", (12.0, 0.0)))
        for model in ("laminate", "two_rod")
    ]
)

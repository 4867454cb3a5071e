"""Diffusion through layers and along a strip: series, other discretisations, and what follows from the thickness."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import timoshenko
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case

Array = np.ndarray
LENGTH, THICKNESS, GAIN = 0.05, 1e-3, 1e-3
TIME = 100.0
"""h²/D of a layer [s]."""
TIMES = (0.003, 0.01, 0.1, 0.5)
"""D t/h² at which the field is looked at."""
WET, COOLED = {}, {"sees": "ambient", "exchange": 5e-5}
TERMS = 4000


def film(layers: list[dict], field: dict, stations: int = 11, **more) -> dict:
    """Return a strip whose layers follow a stimulus, 0 at the start, by a field."""
    content = {
        "bodies": [fixed()],
        "stimuli": {"water": {"schedule": {"type": "hold", "value": 0}}},
    }
    strip = rod(layers, length=LENGTH, stations=stations, clamp_start="wall", diffusion={"stimulus": "water", **field})
    return scene([strip], **(content | more))


def one_layer(field: dict, **more) -> dict:
    """Return a strip of one layer with D = h²/`TIME`."""
    growing = layer(eigenstrain={"stimulus": "water", "gain": GAIN})
    return film([growing], {"diffusivity": {"only": THICKNESS**2 / TIME}, **field}, **more)


@cache
def _films() -> dict[str, dict]:
    exchange = 2.0 * THICKNESS / TIME  # so that h d/D = 2 for the thickness d
    both = {"bottom": WET, "top": WET}
    return {
        "one wet face": one_layer({"top": WET}),
        "two wet faces": one_layer(both),
        "exchange at one face": one_layer({"top": {"exchange": exchange}}),
        "heated layer": one_layer({"top": {**COOLED, "exchange": exchange}, "source": {"layer": "only", "rate": 0.02}}),
    }


def _series(name: str, time: float) -> tuple[float, float]:
    """Return the mean of the field of a film over the stimulus, and its gradient, at a time D t/h².

    With eigenfunctions cos μz from a closed face z = 0 on, in units of h: a = f − Σ c_μ cos(μz) exp(−μ²t).
    """
    k = np.arange(TERMS)
    if name == "two wet faces":
        odd = (2 * k + 1) * math.pi
        return 1.0 - float(np.sum(8.0 / odd**2 * np.exp(-(odd**2) * time))), 0.0
    if name == "one wet face":
        mu, mean, gradient = (k + 0.5) * math.pi, 1.0, 0.0
        part = 2.0 * np.sin(mu) / mu
    else:
        mu = np.array([_root(n) for n in range(200)])
        norm = 0.5 + np.sin(2.0 * mu) / (4.0 * mu)
        part, mean, gradient = np.sin(mu) / (mu * norm), 1.0, 0.0
        if name == "heated layer":  # a → r (1 − z²)/2 + r/2 with r h²/D = 2: coefficients are 2/μ² times those of 1
            part, mean, gradient = part * 2.0 / mu**2, 2.0 / 3.0 + 1.0, -0.5
    decayed = part * np.exp(-(mu**2) * time)
    slopes = 3.0 * (np.sin(mu) / mu - 2.0 * (1.0 - np.cos(mu)) / mu**2)
    return mean - float(np.sum(decayed * np.sin(mu) / mu)), gradient - float(np.sum(decayed * slopes))


def _root(n: int) -> float:
    """Return the root of μ tan μ = 2 in the branch n."""
    return brentq(lambda mu: mu * math.tan(mu) - 2.0, n * math.pi + 1e-9, (n + 0.5) * math.pi - 1e-9)


def _strains(simulator: Simulator) -> tuple[float, float]:
    """Return the strain of a strip of one layer over its gain, and −κh over its gain at its middle."""
    edges = np.linalg.norm(np.diff(simulator.positions, axis=0), axis=1)
    return (edges.sum() / LENGTH - 1.0) / GAIN, -float(simulator.curvatures[5]) * THICKNESS / GAIN


@cache
def _wetted(name: str, model: str, dimension: int) -> list[tuple[float, float]]:
    """Return strain and curvature of a film at `TIMES` after its stimulus has jumped to 1."""
    return _looked_at(_films()[name], model, dimension)


def _looked_at(content: dict, model: str, dimension: int) -> list[tuple[float, float]]:
    simulator = Simulator(load_scene(content), model=model, dimension=dimension, dt=0.1)
    simulator.set_stimulus("water", 1.0)
    found = []
    for time in TIMES:
        simulator.run(time * TIME - simulator.time)
        found.append(_strains(simulator))
    return found


def _peak() -> float:
    return max(_series("one wet face", time)[1] for time in np.linspace(0.05, 0.15, 101))


def through_layer(name: str, at: int, which: int, model: str, dimension: int) -> tuple[float, float]:
    """Return mean (0) or gradient (1) of the field of a film as the strip shows it, and by its series."""
    return _wetted(name, model, dimension)[at][which], _series(name, TIMES[at])[which]


def overshoot() -> tuple[float, float]:
    """Return the largest curvature of a strip that is wetted on one side, times h over the gain; it ends straight."""
    simulator = Simulator(load_scene(one_layer({"top": WET}, duration=30.0)), model="laminate", dt=0.05)
    simulator.set_stimulus("water", 1.0)
    largest = 0.0
    while simulator.time < 0.2 * TIME:
        simulator.step()
        largest = max(largest, _strains(simulator)[1])
    return largest, _peak()


CURVE = (0.2, 1.0, 2.0)
"""D over h²/`TIME` at the contents 0, ½ and 1, linear between them."""


@cache
def _varied(time: float) -> tuple[float, float]:
    """Return mean and gradient of a field with the diffusivity `CURVE` at D t/h², by finite volumes."""
    cells = 400 if time < 0.05 else 100
    found = [np.array(_of_varied_volumes(time, count)) for count in (cells // 2, cells)]
    return tuple((found[1] + (found[1] - found[0]) / 3.0).tolist())


def _of_varied_volumes(time: float, cells: int) -> tuple[float, float]:
    def rates(_: float, a: Array) -> Array:
        beyond = np.append(a, 2.0 - a[-1])  # mirrored, so that the face has 1
        between = np.interp(0.5 * (beyond[1:] + beyond[:-1]), (0.0, 0.5, 1.0), CURVE)
        return np.diff(between * np.diff(beyond) * cells, prepend=0.0) * cells

    settings = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-10, "lband": 1, "uband": 1}
    found = solve_ivp(rates, (0.0, time), np.zeros(cells), **settings)
    zeta = (np.arange(cells) + 0.5) / cells * 2.0 - 1.0
    return float(found.y[:, -1].mean()), float(3.0 * np.mean(found.y[:, -1] * zeta))


@cache
def _varied_film(model: str, dimension: int) -> list[tuple[float, float]]:
    unit = THICKNESS**2 / TIME
    content = one_layer({"top": WET})
    curve = {"at": [0.0, 0.5, 1.0], "value": [unit * value for value in CURVE]}
    content["rods"][0]["diffusion"]["diffusivity"]["only"] = curve
    return _looked_at(content, model, dimension)


def with_varied_diffusivity(at: int, which: int, model: str, dimension: int) -> tuple[float, float]:
    """Return mean (0) or gradient (1) of the field of a film in which water moves the faster the more of it there is,
    and by finite volumes.
    """
    return _varied_film(model, dimension)[at][which], _varied(TIMES[at])[which]


THICK = 0.6e-3
ACTIVE, PASSIVE = 2e-9, 6e-9
PARTITION = 0.4


def bilayer(field: dict | None = None, scale: float = 1.0) -> dict:
    """Return a strip of an active layer, on top, and a passive one that takes up water as well."""
    layers = [
        layer("passive", 1e-3 * scale),
        layer("active", THICK * scale, eigenstrain={"stimulus": "water", "gain": GAIN}),
    ]
    diffusivity = {"passive": PASSIVE, "active": ACTIVE}
    return film(layers, {"diffusivity": diffusivity, "partition": PARTITION, "bottom": WET, **(field or {})})


@cache
def _by_volumes(time: float, cells: int = 300) -> tuple[float, float]:
    """Return mean and gradient of the field in the active layer by finite volumes, extrapolated to zero width."""
    found = [np.array(_of_volumes(time, count)) for count in (cells // 2, cells)]
    return tuple((found[1] + (found[1] - found[0]) / 3.0).tolist())


def _of_volumes(time: float, cells: int) -> tuple[float, float]:
    width = np.repeat([1e-3 / cells, THICK / cells], cells)
    content, diffusivity = np.repeat([1.0, PARTITION], cells), np.repeat([PASSIVE, ACTIVE], cells)
    resistance = 0.5 * width / (content * diffusivity)
    between = 1.0 / np.concatenate([[resistance[0]], resistance[:-1] + resistance[1:]])
    root = np.sqrt(content * width)
    matrix = np.zeros((2 * cells, 2 * cells))
    diagonal = between.copy()
    diagonal[:-1] += between[1:]
    np.fill_diagonal(matrix, diagonal)
    index = np.arange(2 * cells - 1)
    matrix[index, index + 1] = matrix[index + 1, index] = -between[1:]
    rates, modes = np.linalg.eigh(matrix / np.outer(root, root))
    field = 1.0 - (modes @ (np.exp(-rates * time) * (modes.T @ root))) / root
    zeta = (np.arange(cells) + 0.5) / cells * 2.0 - 1.0
    return float(field[cells:].mean()), float(3.0 * np.mean(field[cells:] * zeta))


def through_bilayer(model: str, dimension: int, time: float) -> tuple[float, float]:
    """Return the curvature of a bilayer that water reaches from its passive side, times H over the gain.

    It is the sum of Timoshenko's for the mean of the active layer, and of −G/h for its gradient, by its share of the
    bending stiffness.
    """
    simulator = Simulator(load_scene(bilayer()), model=model, dimension=dimension, dt=0.05)
    simulator.set_stimulus("water", 1.0)
    simulator.run(time)
    mean, gradient = _by_volumes(time)
    thickness = np.array([1e-3, THICK])
    height = np.array([0.5e-3, 1e-3 + 0.5 * THICK])
    axis = thickness @ height / thickness.sum()
    stiffness = float(np.sum(thickness**3 / 12.0 + thickness * (height - axis) ** 2))
    bent = THICK * (height[1] - axis) * mean + THICK**2 / 12.0 * gradient
    return -float(simulator.curvatures[5]) / GAIN * 1e-3, bent / stiffness * 1e-3


def _half_time(scale: float) -> float:
    """Return the time in which a bilayer that water reaches from both sides bends half of all that it will [s]."""
    simulator = Simulator(load_scene(bilayer({"top": WET}, scale)), model="laminate", dt=0.02 * scale**2)
    simulator.set_stimulus("water", 1.0)
    half = 0.5 * timoshenko(1.0, 1.0 / 0.6) * GAIN / (1.6e-3 * scale)
    bent = [0.0]
    while bent[-1] < half:
        simulator.step()
        bent.append(-float(simulator.curvatures[5]))
    return simulator.time - simulator.dt * (bent[-1] - half) / (bent[-1] - bent[-2])


def exponent_of_thickness(scale: float) -> tuple[float, float]:
    """Return the power of the thickness with which the time to bend half of all grows."""
    return math.log(_half_time(scale) / _half_time(1.0)) / math.log(scale), 2.0


def heated_patch(at: float, model: str) -> tuple[float, float]:
    """Return the strain over the gain at a place of a strip whose first third is heated, when it has settled.

    D a″ − (h_e/h) a + r [s < L/3] = 0 with closed ends: a fin; its thickness is small against √(D h/h_e).
    """
    third, count = LENGTH / 3.0, 60
    diffusivity, exchange, rate = 1e-6, 1e-6, 1e-3
    field = {
        "diffusivity": {"only": diffusivity},
        "top": {"sees": "ambient", "exchange": exchange},
        "source": {"layer": "only", "rate": rate},
        "along": True,
        "interval": [0.0, third],
    }
    growing = layer(eigenstrain={"stimulus": "water", "gain": GAIN})
    simulator = Simulator(load_scene(film([growing], field, stations=count + 1)), model=model, dt=100.0)
    simulator.set_stimulus("water", 1.0)
    simulator.run(2e4)
    lengths = np.linalg.norm(np.diff(simulator.positions[: count + 1], axis=0), axis=1)
    strain = lengths / (LENGTH / count) - 1.0
    place = (np.arange(count) + 0.5) * LENGTH / count
    m = math.sqrt(exchange / THICKNESS / diffusivity)
    full = rate * THICKNESS / exchange
    inside = full * (1.0 - math.sinh(m * (LENGTH - third)) / math.sinh(m * LENGTH) * math.cosh(m * at))
    outside = full * math.sinh(m * third) / math.sinh(m * LENGTH) * math.cosh(m * (LENGTH - at))
    return float(np.interp(at, place, strain)) / GAIN, inside if at < third else outside


CASES: list[Case] = [
    *(
        Case(
            f"diffusion/{name}/{('mean', 'gradient')[which]}, D t/h² {time:g}/{model}, {dimension}-D",
            "series of cosines",
            1e-3,
            lambda name=name, at=at, which=which, model=model, dimension=dimension: through_layer(
                name, at, which, model, dimension
            ),
            scale=(1.0, 0.48006)[which],
        )
        for name, model, dimension in (
            ("one wet face", "laminate", 2),
            ("one wet face", "laminate", 3),
            ("one wet face", "two_rod", 2),
            ("two wet faces", "laminate", 2),
            ("exchange at one face", "laminate", 2),
            ("heated layer", "laminate", 2),
        )
        for which in (0, 1)
        for at, time in enumerate(TIMES)
    ),
    *(
        Case(
            f"diffusion/diffusivity 1 to 10/{('mean', 'gradient')[which]}, D t/h² {time:g}/{model}, {dimension}-D",
            "finite volumes, at least 100 and 50, extrapolated; LSODA to 1e-8",
            1e-3,
            lambda at=at, which=which, model=model, dimension=dimension: with_varied_diffusivity(
                at, which, model, dimension
            ),
            scale=(1.0, 0.576)[which],
        )
        for model, dimension in (("laminate", 2), ("two_rod", 3))
        for which in (0, 1)
        for at, time in enumerate(TIMES)
    ),
    Case("diffusion/one wet face/overshoot", "largest gradient of the series", 1e-3, overshoot),
    *(
        Case(
            f"diffusion/bilayer wet below/{model}, {dimension}-D, {time:g} s",
            "finite volumes, 300 and 150 a layer, extrapolated; moments of the section",
            1e-3,
            lambda model=model, dimension=dimension, time=time: through_bilayer(model, dimension, time),
            scale=0.72,
        )
        for model, dimension in (("laminate", 2), ("laminate", 3), ("two_rod", 2))
        for time in (10.0, 100.0, 400.0)
    ),
    *(
        Case(
            f"diffusion/time to bend half/{scale:g} times as thick",
            "the second power of the thickness",
            1e-3,
            lambda scale=scale: exponent_of_thickness(scale),
        )
        for scale in (2.0, 4.0)
    ),
    *(
        Case(
            f"diffusion/heated third of a strip/{1e3 * at:g} mm/{model}",
            "a fin: cosh and sinh",
            1e-3,
            lambda at=at, model=model: heated_patch(at, model),
            scale=1.0,
        )
        for at in (5e-3, 12e-3, 20e-3, 40e-3)
        for model in ("laminate", "two_rod")
    ),
]

"""Closed rods: rings that vibrate, are pinched, grow, are twisted, and roll.

A ring of radius R in its plane, of mass ρA and bending stiffness EI per length.

*Vibration* without stretching (Hoppe 1871): ω² = EI/(ρA R⁴) n² (n² − 1)²/(n² + 1), n waves round it, with the
displacement cos nθ outwards and −sin(nθ)/n along.

*Pulling* by two opposite forces P: a quarter is an elastica of length πR/2 between tangents at a right angle,

    EI θ″ = −½ P cos θ,   θ(0) = 0,   θ(πR/2) = π/2,   height ∫ sin θ ds,

for small forces of either sign a diameter longer by (π/4 − 2/π) P R³/EI. What the ring's curvature is without stress
does not enter. (A free ring pinched by forces of fixed direction turns over until these pull.)

*Growth* of one of two layers by η cannot bend it, since its curve turns by a full turn whatever happens: it stays a
circle, stretched by ε = η EA₁/(EA₁ + EA₂), with the energy ½ η² EA₁EA₂/(EA₁ + EA₂) per length. Of that bending would
release ½ M²/D if there were ends, M = η d EA₁EA₂/(EA₁ + EA₂) with layers d apart, D the bonded bending stiffness: this
part alone is an energy in `laminate`.

*Twist* (Michell 1889, Zajac 1962): a ring of straight rod, of equal bending stiffness B about both axes, stays in its
plane until the torque C τ exceeds √3 B/R. A natural twist τ has the same torque.

*Rolling*: a hoop that is set down with the spin Ω slides until it rolls at Ω R/2, by angular momentum about a point of
the ground, whatever the friction is. One that rolls keeps its speed.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import bonded_bending_stiffness, strip_torsion
from bilayer_core.verification.validate.motion import let_go
from bilayer_core.verification.validate.parts import GEL, GROUND, contact, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

Array = np.ndarray
RADIUS, WIDTH, THICKNESS = 0.05, 4e-3, 0.5e-3
EDGES = 80
HOOP, BARRIER = 2e-3, 1e-4
HEIGHT = RADIUS + HOOP / 2 + BARRIER
"""Thickness of a hoop that rolls, barrier distance, and height of its middle at the start [m]."""
BENDING = GEL["youngs_modulus"] * WIDTH * THICKNESS**3 / 12.0
"""EI [N m²] of the ring of one layer, and of two bonded ones of half its thickness."""
ONE, PAIR = [layer(thickness=THICKNESS)], [layer("inner", THICKNESS / 2), layer("outer", THICKNESS / 2)]
KINDS = {"laminate, 2-D": (ONE, "laminate", 2), "laminate": (PAIR, "laminate", 3), "two_rod": (PAIR, "two_rod", 3)}
"""Layers, model and dimension."""


def ring(layers: list[dict], edges: int = EDGES, **more) -> dict:
    """Return a ring round the y axis, its normal inwards."""
    path = {"shape": "arc", "start": [RADIUS, 0, 0], "direction": [0, 0, 1], "closed": True}
    path |= {"radius": RADIUS, "angle": "360 deg"}
    whole = rod(layers, stations=edges + 1, **({"width": WIDTH} | more))
    return whole | {"path": path, "normal": [-1, 0, 0]}


def _circle(simulator: Simulator) -> tuple[Array, Array, Array]:
    """Return the angles of nodes round the axis at the start, shape (n_node,), and directions outwards and along,
    shapes (n_node, 3).
    """
    start = simulator.model.start_position
    angle = np.arctan2(start[:, 2], start[:, 0])
    cosine, sine, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    return angle, np.stack([cosine, zero, sine], axis=1), np.stack([-sine, zero, cosine], axis=1)


@cache
def frequency(kind: str, waves: int, edges: int = EDGES, steps: int = 400) -> tuple[float, float]:
    """Return the frequency of a mode of n waves [Hz], by the end of a first period of `steps` steps, and Hoppe's."""
    layers, model, dimension = KINDS[kind]
    line = GEL["density"] * WIDTH * THICKNESS
    rate = math.sqrt(BENDING / line) / RADIUS**2 * waves * (waves**2 - 1) / math.sqrt(waves**2 + 1)
    dt = 2.0 * math.pi / rate / steps
    solver = {"integrator": "implicit_midpoint", "newton_tolerance": 1e-12, "dt": dt}
    simulator = Simulator(load_scene(scene([ring(layers, edges)], solver)), model=model, dimension=dimension)
    angle, outward, along = _circle(simulator)
    shape = np.cos(waves * angle)[:, None] * outward - np.sin(waves * angle)[:, None] * along / waves
    let_go(simulator, 1e-4 * RADIUS * rate * shape)
    start, mass = simulator.positions, simulator.model.rods.node_mass

    def amplitude() -> float:
        return float(mass @ ((simulator.positions - start) * shape).sum(axis=1))

    simulator.run(round(0.9 * steps) * dt)
    before = amplitude()
    while (after := _next(simulator, dt, amplitude)) < 0.0:
        before = after
    return 1.0 / (simulator.time - dt * after / (after - before)), rate / (2.0 * math.pi)


def _next(simulator: Simulator, dt: float, figure) -> float:
    """Return a figure after one more step."""
    simulator.run(dt)
    return figure()


def _pulled_height(force: float) -> float:
    """Return half the height of a pulled ring [m], from the equation of its quarter."""
    length, pull = 0.5 * math.pi * RADIUS, 0.5 * force / BENDING

    def quarter(curvature: float) -> Array:
        solution = solve_ivp(
            lambda s, y: (y[1], -pull * math.cos(y[0]), math.sin(y[0])),
            (0.0, length),
            (0.0, curvature, 0.0),
            rtol=1e-11,
            atol=1e-13,
        )
        return solution.y[:, -1]

    least, most = 1.0 / RADIUS, 1.0 / RADIUS + pull * length
    return float(quarter(brentq(lambda k: quarter(k)[0] - 0.5 * math.pi, least, most, xtol=1e-12))[2])


@cache
def pulled(kind: str, part: float, edges: int = EDGES) -> float:
    """Return the diameter between two opposite forces of a part of EI/R², outwards [m]; the ring is free."""
    layers, model, dimension = KINDS[kind]
    half, force = math.pi * RADIUS, part * BENDING / RADIUS**2
    loads = [
        {"name": name, "rod": "rod", "position": place, "force": [sign * force, 0, 0]}
        for name, place, sign in (("near", 0.0, 1.0), ("far", half, -1.0))
    ]
    content = scene([ring(layers, edges)], {"newton_tolerance": 1e-11}, loads=loads)
    simulator = Simulator(load_scene(content), model=model, dimension=dimension)
    simulator.solve_static()
    strands = [simulator.positions[s.first_node :] for s in simulator.model.strands]
    return float(np.mean([strand[0, 0] - strand[edges // 2, 0] for strand in strands]))


def softness(kind: str) -> tuple[float, float]:
    """Return the change of the diameter with small forces, in R³/EI; what is quadratic in the force has dropped out."""
    part = 1e-3
    return (pulled(kind, part) - pulled(kind, -part)) / (2.0 * part * RADIUS), math.pi / 4.0 - 2.0 / math.pi


LARGE = (2.0, 8.0)
"""Forces in EI/R² under which a ring is far from round."""


def stretched(kind: str, part: float) -> tuple[float, float]:
    """Return the diameter under a large force [m]."""
    return pulled(kind, part), 2.0 * _pulled_height(part * BENDING / RADIUS**2)


def order_in_space() -> tuple[float, float]:
    """Return the order at which the diameter's changes fall when edges are halved, twice."""
    coarse, middle, fine = (pulled("laminate, 2-D", LARGE[0], part * EDGES) for part in (2, 4, 8))
    return math.log2((coarse - middle) / (middle - fine)), 2.0


STRAIN = 0.02
"""Of one layer of a pair, whose other one has half its modulus."""


@cache
def strained(model: str, dimension: int) -> tuple[float, float, float]:
    """Return the stretch, departure from a circle over the radius, and energy [J] of a ring whose inner layer is
    strained.
    """
    inner = layer("inner", THICKNESS / 2, eigenstrain={"stimulus": "heat", "gain": STRAIN})
    layers = [inner, layer("outer", THICKNESS / 2, stiffness=0.5)]
    heat = {"heat": {"schedule": {"type": "hold", "value": 1.0}}}
    content = scene([ring(layers)], {"newton_tolerance": 1e-11}, stimuli=heat)
    simulator = Simulator(load_scene(content), model=model, dimension=dimension)
    nodes = simulator.model.strands[0].first_node + 1 + np.arange(EDGES)
    before = np.linalg.norm(simulator.positions[nodes], axis=1)
    simulator.solve_static()
    apart = simulator.positions[nodes] - simulator.positions[nodes].mean(axis=0)
    radius = np.linalg.norm(apart, axis=1)
    return float(radius.mean() / before.mean() - 1.0), float(np.ptp(radius) / RADIUS), sum(simulator.energy().values())


def _energy_of_pair(model: str) -> float:
    """Return the energy of a ring whose inner layer has an eigenstrain [J]."""
    modulus, half, length = GEL["youngs_modulus"], THICKNESS / 2, 2.0 * math.pi * RADIUS
    reduced = modulus * WIDTH * half / 3.0
    if model == "two_rod":
        return 0.5 * STRAIN**2 * reduced * length
    bending = bonded_bending_stiffness((modulus, 0.5 * modulus), (half, half), WIDTH)
    return 0.5 * (STRAIN * reduced * half) ** 2 / bending * length


@cache
def largest_flat_twist(edges: int) -> float:
    """Return the torque in B/R up to which a twisted ring of straight square rod is stable in its plane."""
    side, modulus = 1e-3, GEL["youngs_modulus"]
    shear = modulus / (2.0 * (1.0 + GEL["poisson_ratio"]))
    torsion = strip_torsion((shear, shear), (side / 2, side / 2), side)["laminate"]
    bending = modulus * side**4 / 12.0
    low, high = 1.0, 2.5
    for _ in range(12):
        middle = 0.5 * (low + high)
        twisted = layer(thickness=side, natural_curvature=0.0, natural_twist=middle * bending / (torsion * RADIUS))
        content = scene([ring([twisted], edges, width=side)], {"newton_tolerance": 1e-11})
        simulator = Simulator(load_scene(content), model="laminate", dimension=3)
        report = simulator.solve_static()
        flat = np.ptp(simulator.positions[:, 1]) < 1e-6 * RADIUS
        low, high = (middle, high) if report.stable and flat else (low, middle)
    return 0.5 * (low + high)


@cache
def rolling(coefficient: float) -> tuple[float, float]:
    """Return the speed of a hoop that was set down spinning, when it has just ceased to slide, and ΩR/2 [m/s]."""
    spin = 10.0
    simulator = _hoop(coefficient, spin, 0.0)
    simulator.run(1.2 * 0.5 * spin * RADIUS / (coefficient * 9.81))
    return _speed(simulator), 0.5 * spin * RADIUS


def rolling_on(speed: float = 0.03) -> tuple[float, float]:
    """Return the speed of a rolling hoop that is farthest from that of its start, while it rolls over six of its edges,
    and that one [m/s].

    With contact at stations alone its height would change by ⅛ l²/R = 0.15 mm, more than its energy suffices for.
    """
    simulator, found = _hoop(0.5, speed / HEIGHT, speed), [speed]
    for _ in range(40):
        simulator.run(0.04)
        found.append(_speed(simulator))
    return max(found, key=lambda of: abs(of - speed)), speed


def _hoop(coefficient: float, spin: float, speed: float) -> Simulator:
    """Return a stiff hoop of forty edges on the ground that turns with `spin` [rad/s] and moves with `speed` [m/s]."""
    stiff, hoop = {"gel": GEL | {"youngs_modulus": 1e9}}, ring([layer(thickness=HOOP)], EDGES // 2)
    hoop["path"] |= {"start": [RADIUS, 0, HEIGHT]}
    content = scene(
        [hoop],
        materials=stiff,
        gravity=[0, 0, -9.81],
        obstacles=[GROUND],
        contact=contact(BARRIER, coefficient, 1e-3),
    )
    content["solver"] = {"tolerance": 1e-5}
    simulator = Simulator(load_scene(content), model="laminate", dimension=2)
    let_go(simulator, np.cross([0.0, spin, 0.0], simulator.positions - [0, 0, HEIGHT]) + [speed, 0, 0])
    return simulator


def _speed(simulator: Simulator) -> float:
    """Return the speed of the mass centre along the ground [m/s]."""
    mass = simulator.model.rods.node_mass
    return float(mass @ simulator.velocities[:, 0] / mass.sum())


HOPPE = "Hoppe's ring (1871), ω² = EI/ρAR⁴ n²(n² − 1)²/(n² + 1)"
PULLED = "elastica of a quarter"
MICHELL = "√3 B/R (Michell 1889, Zajac 1962), by the stability of the flat ring"
CASES = [
    *(
        Case(
            f"rings/vibration/{kind}/n = {n}",
            HOPPE,
            0.01,
            lambda kind=kind, n=n: frequency(kind, n),
            "Hz",
            long=(kind, n) == ("two_rod", 3),
        )
        for kind in KINDS
        for n in (2, 3)
    ),
    *cases("rings/pulled gently/{}", "π/4 − 2/π", 0.01, softness, KINDS),
    *cases("rings/pulled by {1:g} EI per R²/{0}", PULLED, 0.005, stretched, product(KINDS, LARGE), unit="m"),
    Case("rings/pulled/order in space", "order 2 of bending", 0.1, order_in_space, scale=1.0),
    *(
        Case(
            f"rings/one layer grows/{model}, {dimension}-D/{what}",
            answer,
            limit,
            lambda m=model, d=dimension, k=k: (strained(m, d)[k], (STRAIN / 1.5, 0.0, _energy_of_pair(m))[k]),
            unit,
            scale,
        )
        for model, dimension in (("laminate", 2), ("laminate", 3), ("two_rod", 2), ("two_rod", 3))
        for k, (what, answer, limit, unit, scale) in enumerate(
            (
                ("stretch", "η EA₁/(EA₁ + EA₂)", 0.005, "1", None),
                ("roundness", "a circle stays one", 1e-9, "1", 1.0),
                ("energy", "what bending cannot release", 0.01, "J", None),
            )
        )
    ),
    *(
        Case(f"rings/twisted/{edges} edges", MICHELL, limit, lambda e=edges: (largest_flat_twist(e), math.sqrt(3.0)))
        for edges, limit in ((40, 0.03), (80, 0.01))
    ),
    *cases("rings/rolling/friction {:g}", "a sliding hoop's ΩR/2", 0.01, rolling, (0.2, 0.5), unit="m/s"),
    Case("rings/rolling on", "the speed of the start", 0.01, rolling_on, "m/s"),
]

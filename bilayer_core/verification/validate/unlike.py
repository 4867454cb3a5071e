"""Rods of unlike layers: weight, inertia, loads and fluids act where they belong, off the neutral axis.

In the laminate the curve lies on the neutral axis. The judges know none (`unlike_rods`), or are closed forms.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq

from bilayer_core.model.build_model import build_model
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.linearised import Linearised
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.motion import let_go
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene
from bilayer_core.verification.validate.unlike_rods import Section, end_of_rod
from bilayer_core.verification.validate.validation_case import Case, cases

Array = np.ndarray
LENGTH, EDGES, WIDTH, GRAVITY = 0.1, 80, 0.01, 9.81
LIMIT = 1e-3
FILM = Section(WIDTH, (1e5, 2.5e9), (1000.0, 1400.0), (4e-3, 12e-6))
STIFF_TOP = Section(WIDTH, (1e5, 1e6), (1000.0, 1000.0), (3e-3, 1e-3))
HEAVY_TOP = Section(WIDTH, (1e6, 1e6), (1000.0, 3000.0), (2e-3, 2e-3))
TEE = Section((WIDTH, 0.2 * WIDTH), (1e6, 1e6), (1000.0, 1000.0), (1e-3, 4e-3))
DIRECTIONS = {"along": (GRAVITY, 0.0), "against": (-GRAVITY, 0.0), "across": (0.0, -GRAVITY)}
ALONG, ACROSS = DIRECTIONS["along"], DIRECTIONS["across"]


def scene_of(section: Section, edges: int = EDGES, length: float = LENGTH, held: bool = True, **more) -> dict:
    """Return a strip along x whose normal is z, with a solver that follows it in its plane as a laminate."""
    materials = {
        name: {"youngs_modulus": modulus, "poisson_ratio": 0.45, "density": density}
        for name, modulus, density in zip(("first", "second"), section.modulus, section.density, strict=True)
    }
    own = section.width if isinstance(section.width, tuple) else (None, None)
    layers = [
        layer(name, thickness, name, width=width)
        for name, thickness, width in zip(("first", "second"), section.thickness, own, strict=True)
        if thickness
    ]
    width = None if all(own) else section.width
    clamp = {"clamp_start": "wall"} if held else {}
    solver = {"model": "laminate", "dimension": 2, "integrator": "sdirk2", **more.pop("solver", {})}
    whole = scene([rod(layers, length, edges + 1, width=width, **clamp)], materials=materials, solver=solver, **more)
    return whole | ({"bodies": [fixed()]} if held and "bodies" not in more else {})


def in_space(vector: tuple[float, float]) -> list[float]:
    """Return a vector of the plane of path and normal in the world."""
    return [vector[0], 0.0, vector[1]]


def end_of(simulator: Simulator, axis: float) -> Array:
    """Return the end of the path (x, z) [m] from the curve, `axis` over it, and the director of its last edge."""
    return (simulator.positions[-1] - axis * simulator._state.director1[-1])[[0, 2]]


@cache
def _hanging(section: Section, direction: str, edges: int) -> tuple[Array, Array]:
    """Return the end of the path at rest under its weight, as computed and by the judge [m]."""
    gravity = DIRECTIONS[direction]
    simulator = Simulator(load_scene(scene_of(section, edges, gravity=in_space(gravity))))
    simulator.solve_static()
    return end_of(simulator, section.axis), end_of_rod([(LENGTH, section)], gravity)[:2]


def hanging(section: Section, direction: str, axis: int) -> tuple[float, float]:
    """Return the coordinate of the end of a strip under its weight [mm]."""
    found, answer = _hanging(section, direction, EDGES)
    return 1e3 * found[axis], 1e3 * answer[axis]


def order_in_the_mesh(section: Section, direction: str) -> tuple[float, float]:
    """Return the order at which the end of a strip under its weight comes near the judge's."""
    errors = [np.linalg.norm(np.subtract(*_hanging(section, direction, edges))) for edges in (EDGES, 2 * EDGES)]
    return math.log2(errors[0] / errors[1]), 2.0


def covered_part() -> tuple[float, float]:
    """Return the sinking of the end of a strip with a stiff and heavy layer on the middle 40 % [mm]."""
    whole = Section(WIDTH, (1e6, 1e6), (1000.0, 3000.0), (3e-3, 1e-3))
    bare = Section(WIDTH, (1e6, 1e6), (1000.0, 3000.0), (3e-3, 0.0))
    config = scene_of(whole, gravity=in_space(ACROSS))
    config["rods"][0]["layers"][1]["interval"] = [0.3 * LENGTH, 0.7 * LENGTH]
    simulator = Simulator(load_scene(config))
    simulator.solve_static()
    curve = -simulator.model.start_position[-1, 2]
    pieces = [(0.3 * LENGTH, bare), (0.4 * LENGTH, whole), (0.3 * LENGTH, bare)]
    return 1e3 * end_of(simulator, -curve)[1], 1e3 * end_of_rod(pieces, ACROSS)[1]


def end_force(section: Section, force: tuple[float, float], follower: bool) -> tuple[float, float]:
    """Return the way of the end across the strip under a force on its path [mm]; components along path and normal."""
    load = {"name": "pull", "rod": "rod", "position": LENGTH, "force": in_space(force)}
    if follower:
        load |= {"frame": "material", "force": [*force, 0.0]}
    simulator = Simulator(load_scene(scene_of(section, loads=[load])))
    simulator.solve_static()

    def at_end(angle: Array) -> Array:
        cosine, sine = (np.cos(angle), np.sin(angle)) if follower else (np.ones_like(angle), np.zeros_like(angle))
        return np.array([force[0] * cosine - force[1] * sine, force[0] * sine + force[1] * cosine])

    answer = end_of_rod([(LENGTH, section)], end=at_end)
    return 1e3 * end_of(simulator, section.axis)[1], 1e3 * answer[1]


def secant() -> tuple[float, float]:
    """Return the way of the end of a column at half its Euler load, on the path [mm]: e (sec(L √(P/EI)) − 1), about the
    axis.
    """
    section = Section(WIDTH, (1e7, 1e8), (1000.0, 1000.0), (2e-3, 2e-3))
    load = 0.5 * (0.5 * math.pi / LENGTH) ** 2 * section.bending
    config = scene_of(section, loads=[{"name": "press", "rod": "rod", "position": LENGTH, "force": [-load, 0.0, 0.0]}])
    simulator = Simulator(load_scene(config))
    simulator.solve_static()
    moved = simulator.positions[-1, 2] - simulator.model.start_position[-1, 2]
    bent = end_of_rod([(LENGTH, section)], end=lambda angle: np.array([[-load], [0.0]]) + 0.0 * angle)
    return 1e3 * moved, 1e3 * (bent[1] + section.axis * math.cos(bent[2]) - section.axis)


def point_mass() -> tuple[float, float]:
    """Return the way aside of the end of a strip that hangs with a mass of ten times its own at the end of its path
    [mm].
    """
    section, mass = STIFF_TOP, 10.0 * STIFF_TOP.mass * LENGTH
    config = scene_of(
        section, gravity=in_space(ALONG), masses=[{"name": "lead", "rod": "rod", "position": LENGTH, "mass": mass}]
    )
    simulator = Simulator(load_scene(config))
    simulator.solve_static()
    weight = np.array([[mass * GRAVITY], [0.0]])
    answer = end_of_rod([(LENGTH, section)], ALONG, end=lambda angle: weight + 0.0 * angle)
    return 1e3 * end_of(simulator, section.axis)[1], 1e3 * answer[1]


def frequency_with_mass(mode: int, stations: int = EDGES + 1) -> tuple[float, float]:
    """Return a frequency of a cantilever with a mass of five times its own on its path, off the axis [rad/s].

    With β⁴ = ρA ω²/EI, k² = ρA ω²/EA and the height e of the path over the axis, w = C₁ (cosh − cos) + C₂ (sinh − sin)
    of β x, u = C₃ sin k x, and at the end EA u′ = m ω² (u − e w′), EI w″ = −e m ω² (u − e w′), −EI w‴ = m ω² w.
    """
    section = Section(WIDTH, (1e8, 1e8), (1000.0, 1000.0), (1e-3, 4e-3))
    mass, linear = 5.0 * section.mass * LENGTH, section.mass
    point = {"name": "lead", "rod": "rod", "position": LENGTH, "mass": mass}
    simulator = Simulator(load_scene(scene_of(section, stations - 1, masses=[point])))
    space = build_model(simulator.scene, "laminate", 3)
    matrices = Linearised(space, simulator._state, np.zeros(0), simulator.model)
    found = np.sqrt(eigh(matrices.stiffness.toarray(), matrices.mass.toarray(), eigvals_only=True)[mode])
    stretching, bending, height = 1e8 * WIDTH * 5e-3, section.bending, 1.5e-3

    def at_end(frequency: float) -> float:
        k, beta = frequency * math.sqrt(linear / stretching), (linear * frequency**2 / bending) ** 0.25
        x, load = beta * LENGTH, mass * frequency**2
        cosh, sinh, cos, sin = math.cosh(x), math.sinh(x), math.cos(x), math.sin(x)
        across, turn = np.array([cosh - cos, sinh - sin]), beta * np.array([sinh + sin, cosh - cos])
        bend, shear = beta**2 * np.array([cosh + cos, sinh + sin]), beta**3 * np.array([sinh - sin, cosh + cos])
        along, strain = math.sin(k * LENGTH), k * math.cos(k * LENGTH)
        rows = [
            np.array([stretching * strain - load * along, *(load * height * turn)]) * LENGTH / stretching,
            np.array([height * load * along, *(bending * bend - height**2 * load * turn)]) * LENGTH**2 / bending,
            np.array([0.0, *(bending * shear + load * across)]) * LENGTH**3 / bending,
        ]
        return float(np.linalg.det(rows)) / cosh**2

    tried = np.linspace(5.0, 3000.0, 3000)
    signs = np.sign([at_end(frequency) for frequency in tried])
    first = tried[np.flatnonzero(np.diff(signs))[mode]]
    return float(found), brentq(at_end, first, first + tried[1] - tried[0])


def drag() -> tuple[float, float]:
    """Return the way aside of the end of a strip in a flow along it, which rubs on the middle of the section [mm]."""
    section, speed, along = STIFF_TOP, 0.3, 0.5
    fluid = {"density": 1000.0, "drag_along": along, "drag_across": 0.0, "velocity": [speed, 0.0, 0.0]}
    fluid["added_mass"] = False
    config = scene_of(section, 40, fluid=fluid, damping={"mass": 15.0}, solver={"dt": 0.01})
    simulator = Simulator(load_scene(config))
    simulator.run(6.0)

    def rubbed(angle: Array) -> Array:
        slip = speed * np.cos(angle)
        return 0.5 * 1000.0 * WIDTH * along * np.abs(slip) * slip * np.array([np.cos(angle), np.sin(angle)])

    return 1e3 * end_of(simulator, section.axis)[1], 1e3 * end_of_rod([(LENGTH, section)], drag=rubbed)[1]


def shaken() -> tuple[float, float]:
    """Return the amplitude across [µm] of the end of a viscous strip whose hub, far heavier, is shaken along it.

    Inertia at the height c is a couple of the density λ c a per length, that is, a force λ c a across at the free end.
    """
    frequency, lag, hub_mass, push = 8.0, 4e-3, 10.0, 5.0
    section, period = Section(WIDTH, (1e8, 1e8), (1000.0, 3000.0), (2e-3, 2e-3)), 1.0 / frequency
    hub = fixed() | {"motion": {"type": "guided", "axis": [1, 0, 0], "mass": hub_mass}}
    wave = {"type": "sine", "mean": 0, "amplitude": 1, "period": period}
    load = {"name": "shake", "body": "wall", "force": [push, 0, 0], "schedule": wave}
    solver = {"dt": period / 256, "integrator": "tr_bdf2", "newton_tolerance": 1e-10}
    config = scene_of(section, bodies=[hub], loads=[load], solver=solver)
    for material in ("first", "second"):
        config["materials"][material]["retardation_time"] = lag
    simulator, found = Simulator(load_scene(config)), []
    simulator.run(12 * period)
    for _ in range(64):
        simulator.run(period / 64)
        found.append(simulator.positions[-1, 2] - simulator.model.start_position[-1, 2])
    amplitude = 2.0 * abs(np.mean(np.array(found) * np.exp(-2j * math.pi / 64 * np.arange(64))))
    omega, height = 2.0 * math.pi * frequency, section.centre - section.axis
    force = section.mass * height * push / (hub_mass + section.mass * LENGTH)
    bending = section.bending * (1.0 + 1j * omega * lag)
    b = (section.mass * omega**2 / bending) ** 0.25
    x = b * LENGTH
    way = (np.cosh(x) * np.sin(x) - np.sinh(x) * np.cos(x)) / (1.0 + np.cosh(x) * np.cos(x)) / (bending * b**3)
    return 1e6 * amplitude, 1e6 * abs(force * way)


def pendulum() -> tuple[float, float]:
    """Return the angle [rad] after 0.25 s of a stiff strip on a hinge, let go where its axis hangs straight down."""
    section = Section(WIDTH, (1e10, 1e10), (1000.0, 6000.0), (4e-3, 4e-3))
    hinge = {"name": "wall", "position": [0, 0, 0], "motion": {"type": "guided", "hinge": [0, 1, 0], "mass": 1e-9}}
    hinge["motion"]["inertia"] = [1e-12, 1e-12, 1e-12]
    config = scene_of(section, 40, bodies=[hinge], gravity=in_space(ALONG), solver={"dt": 1e-3})
    simulator = Simulator(load_scene(config))
    simulator.run(0.25)
    chord = simulator.positions[-1] - simulator.positions[0]
    height = section.centre  # the hinge is on the path
    inertia = section.mass * LENGTH * (LENGTH**2 / 3.0 + height**2)
    moment = section.mass * LENGTH * GRAVITY

    def slope(_: float, y: Array) -> list[float]:
        return [y[1], -moment * (0.5 * LENGTH * math.sin(y[0]) + height * math.cos(y[0])) / inertia]

    answer = solve_ivp(slope, (0.0, 0.25), [0.0, 0.0], rtol=1e-10, atol=1e-12).y[0, -1]
    return math.atan2(chord[2], chord[0]), answer


def rolling() -> tuple[float, float]:
    """Return the angle [rad] by which a strip rolls in 10 ms that a force per mass drives sideways through a fluid.

    Its own mass at the height c and the fluid's at z have T = ½ m (v − c ω)² + ½ J ω² + ½ m₂ (v − z ω)² + ½ j ω².
    """
    section, push, time = Section(WIDTH, (1e6, 1e6), (1000.0, 3000.0), (2e-3, 4e-3)), 0.5, 0.01
    fluid = {"drag_along": 0.0, "drag_across": 0.0, "added_mass": True}
    solver = {"dimension": 3, "dt": 1e-3}
    config = scene_of(section, 10, held=False, fluid=fluid, gravity=[0.0, push, 0.0], solver=solver)
    simulator = Simulator(load_scene(config))
    simulator.run(time)
    director = simulator._state.director1[5]
    thickness, c, z = sum(section.thickness), section.centre - section.axis, section.middle - section.axis
    own = sum(
        WIDTH * rho * h * ((WIDTH**2 + h**2) / 12.0 + (side * h - section.centre) ** 2)
        for rho, h, side in zip(section.density, section.thickness, (-0.5, 0.5), strict=True)
    )
    sideways = 0.25 * math.pi * 1000.0 * thickness**2
    turning = math.pi * 1000.0 * (WIDTH**2 - thickness**2) ** 2 / 128.0
    mass = np.array(
        [
            [section.mass + sideways, -(section.mass * c + sideways * z)],
            [-(section.mass * c + sideways * z), own + section.mass * c**2 + sideways * z**2 + turning],
        ]
    )
    _, spin = np.linalg.solve(mass, section.mass * push * np.array([1.0, -c]))
    return math.atan2(-director[1], director[2]), 0.5 * spin * time**2


@cache
def _spun(integrator: str, dt: float) -> tuple[float, float]:
    """Return the parts of its momentum and angular momentum by which a free strip that spins in its plane changes."""
    solver = {"dt": dt, "integrator": integrator, "newton_tolerance": 1e-11}
    simulator = Simulator(load_scene(scene_of(STIFF_TOP, 10, held=False, solver=solver)))
    let_go(simulator, np.cross([0.0, 20.0, 0.0], simulator.positions - simulator.com) + [0.3, 0.0, 0.1])
    before = simulator.momentum, simulator.angular_momentum
    simulator.run(0.05)
    after = simulator.momentum, simulator.angular_momentum
    lost, spun = (float(np.linalg.norm(b - a) / np.linalg.norm(a)) for a, b in zip(before, after, strict=True))
    return lost, spun


def order_of_spin(integrator: str) -> tuple[float, float]:
    """Return the order in time at which a free strip keeps its angular momentum."""
    return math.log2(_spun(integrator, 1e-3)[1] / _spun(integrator, 5e-4)[1]), 0.0


CASES = [
    *cases(
        "unlike layers/weight/{}",
        "equilibrium of forces and moments along the path, by collocation",
        LIMIT,
        lambda _name, section, direction, axis: hanging(section, direction, axis),
        (
            ("film on a slab, hanging, aside", FILM, "along", 1),
            ("moduli 1:10, horizontal, down", STIFF_TOP, "across", 1),
            ("moduli 1:10, horizontal, along", STIFF_TOP, "across", 0),
            ("densities 1:3, hanging, aside", HEAVY_TOP, "along", 1),
            ("widths 5:1, a T, horizontal, down", TEE, "across", 1),
            ("widths 5:1, a T, horizontal, along", TEE, "across", 0),
        ),
        unit="mm",
    ),
    Case(
        "unlike layers/weight/order in the mesh",
        "second",
        0.1,
        lambda: order_in_the_mesh(STIFF_TOP, "across"),
    ),
    Case(
        "unlike layers/weight/layer on the middle 40 %",
        "equilibrium along the path, piece by piece",
        LIMIT,
        covered_part,
        "mm",
    ),
    Case("unlike layers/load/column at half its Euler load", "secant formula, by collocation", LIMIT, secant, "mm"),
    Case(
        "unlike layers/load/across and along",
        "equilibrium along the path",
        LIMIT,
        lambda: end_force(STIFF_TOP, (0.01, 0.002), False),
        "mm",
    ),
    Case(
        "unlike layers/load/follower along the path",
        "equilibrium along the path",
        LIMIT,
        lambda: end_force(STIFF_TOP, (0.02, 0.0), True),
        "mm",
    ),
    Case("unlike layers/point mass", "equilibrium along the path", LIMIT, point_mass, "mm"),
    *cases(
        "unlike layers/mass off the axis at the end/{1}",
        "Euler–Bernoulli beam that stretches, small vibrations",
        LIMIT,
        lambda mode, _name: frequency_with_mass(mode),
        ((0, "bending"), (2, "stretching")),
        unit="rad/s",
    ),
    Case("unlike layers/drag along", "equilibrium along the path", LIMIT, drag, "mm"),
    Case("unlike layers/pendulum", "compound pendulum, by Runge–Kutta", LIMIT, pendulum, "rad"),
    Case(
        "unlike layers/hub shaken along the strip",
        "Euler–Bernoulli beam with a force at its end",
        LIMIT,
        shaken,
        "µm",
        long=True,
    ),
    Case("unlike layers/added mass/roll", "two degrees of freedom, small angle", LIMIT, rolling, "rad"),
    *cases(
        "unlike layers/free flight/momentum, {}",
        "what it was",
        1e-9,
        lambda integrator: (_spun(integrator, 5e-4)[0], 0.0),
        ("implicit_euler", "implicit_midpoint", "sdirk2", "tr_bdf2"),
        scale=1.0,
    ),
    *(
        Case(
            f"unlike layers/free flight/angular momentum, {integrator}",
            f"order {order:g}",
            0.35,
            lambda integrator=integrator, order=order: (order_of_spin(integrator)[0], order),
            scale=1.0,
        )
        for integrator, order in {"implicit_euler": 1.0, "implicit_midpoint": 1.0, "tr_bdf2": 2.0}.items()
    ),
]

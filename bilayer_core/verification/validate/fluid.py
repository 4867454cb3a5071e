"""The inertia of a fluid that a strip takes along."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_bvp

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.closed_forms import kirchhoff_plate
from bilayer_core.verification.validate.motion import let_go
from bilayer_core.verification.validate.parts import GEL, contact, fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

WIDTH, THICKNESS, DENSITY = 0.01, 2e-3, 1000.0
OWN = DENSITY * WIDTH * THICKNESS
ADDED = {
    "through": 0.25 * math.pi * DENSITY * WIDTH**2,
    "sideways": 0.25 * math.pi * DENSITY * THICKNESS**2,
    "along": 0.0,
}
"""Mass per length that an ellipse of the strip's axes takes along [kg/m] (Lamb 1932)."""
AXES = {"through": 2, "sideways": 1, "along": 0}
WATER = {"drag_along": 0.0, "drag_across": 0.0, "added_mass": True}
LENGTH, EDGES = 0.05, 10
SOFT, SOFT_LENGTH, SOFT_THICKNESS, ALONG, ACROSS = 1e6, 0.1, 1e-3, 0.05, 2.0
"""Of a strip across a flow: modulus [Pa], length and thickness [m], coefficients of drag."""


WHOLE, HALVES = [layer(thickness=THICKNESS)], [layer("bottom"), layer("top")]


def strip(layers: list[dict], **more) -> dict:
    """Return a free strip in a fluid without drag."""
    return scene([rod(layers, LENGTH, EDGES + 1)], fluid=WATER, **more)


def acceleration(direction: str, layers: list[dict]) -> tuple[float, float]:
    """Return the acceleration [m/s²], measured and expected, of a strip driven by a force per own mass of 1 m/s²."""
    axis = AXES[direction]
    simulator = Simulator(load_scene(strip(layers, gravity=[float(k == axis) for k in range(3)])))
    simulator.run(0.1)
    return simulator.velocities[:, axis].mean() / 0.1, OWN / (OWN + ADDED[direction])


def munk(across: float) -> tuple[float, float]:
    """Return the angle [rad] to which a stiff strip turns in 0.1 s that is thrown aslant."""
    stiff = {"gel": {**GEL, "youngs_modulus": 1e10}}
    solver = {"dt": 5e-4, "newton_tolerance": 1e-9, "integrator": "sdirk2"}
    simulator = Simulator(load_scene(strip(WHOLE, materials=stiff, solver=solver)))
    let_go(simulator, np.tile([0.3, 0.0, across], (EDGES + 1, 1)))
    simulator.run(0.1)
    chord = simulator.positions[-1] - simulator.positions[0]
    weights = simulator.model.rods.node_mass / simulator.model.rods.node_mass.sum()
    arms = np.linspace(-0.5, 0.5, EDGES + 1) * LENGTH
    own, whole = OWN * LENGTH, (OWN + ADDED["through"]) * LENGTH
    expected = kirchhoff_plate((0.3, across), own, whole, whole * float(weights @ arms**2), 0.1)
    return math.atan2(chord[2], chord[0]), expected


def turning(layers: list[dict]) -> tuple[float, float]:
    """Return the spin [rad/s] of a free strip that turns about its axis, after 0.1 s: ω₀/(1 + ω₀ c t/J) under the
    moment c ω².
    """
    coefficient, spin, time = 2.0, 50.0, 0.1
    water = {"drag_along": 0.0, "drag_across": 0.0, "drag_turning": coefficient}
    content = scene([rod(layers, LENGTH, EDGES + 1)], fluid=water, solver={"dimension": 3, "dt": 1e-3})
    simulator = Simulator(load_scene(content), integrator="sdirk2")
    model = simulator.model
    simulator._state.spin[:] = spin
    let_go(simulator, np.cross([spin, 0.0, 0.0], model.start_position))
    simulator.run(time)
    moment = DENSITY * coefficient * WIDTH**4 / 64.0
    inertia = OWN * (WIDTH**2 + THICKNESS**2) / 12.0
    return float(simulator._state.spin.mean()), spin / (1.0 + spin * time * moment / inertia)


def sinking_ball() -> tuple[float, float]:
    """Return the speed [m/s] of a ball that has fallen through a fluid for 0.2 s: v tanh(g t/v), v its terminal
    speed.
    """
    radius, mass, coefficient, gravity, time = 0.01, 6e-3, 0.47, 9.81, 0.2
    ball = {
        "name": "ball",
        "position": [0.0, 0.0, 0.5],
        "motion": {"type": "free", "mass": mass},
        "surface": {"shape": "sphere", "radius": radius},
        "drag": {"coefficient": coefficient},
    }
    content = scene(
        [rod(WHOLE, LENGTH, EDGES + 1, clamp_start="wall")],
        bodies=[fixed("wall"), ball],
        contact=contact(),
        fluid={"drag_along": 0.0, "drag_across": 0.0},
        gravity=[0.0, 0.0, -gravity],
        solver={"dt": 1e-3},
    )
    simulator = Simulator(load_scene(content), integrator="sdirk2")
    simulator.run(time)
    terminal = math.sqrt(2.0 * mass * gravity / (DENSITY * coefficient * math.pi * radius**2))
    return -float(simulator._state.body_velocity[1, 2]), terminal * math.tanh(gravity * time / terminal)


def across_a_flow(speed: float, added: bool) -> tuple[float, float]:
    """Return how far the tip of a soft cantilever across a flow bends along it [m], at rest."""
    content = scene(
        [rod([layer(thickness=SOFT_THICKNESS)], SOFT_LENGTH, 81, clamp_start="wall")],
        bodies=[fixed("wall")],
        materials={"gel": {**GEL, "youngs_modulus": SOFT}},
        fluid={"drag_along": ALONG, "drag_across": ACROSS, "velocity": [0.0, 0.0, speed], "added_mass": added},
        solver={"dimension": 2},
    )
    simulator = Simulator(load_scene(content))
    simulator.solve_static()
    return float(simulator.positions[-1, 2]), strip_across_a_flow(speed, added)


def strip_across_a_flow(speed: float, added: bool) -> float:
    """Return the same of an extensible elastica, by collocation and continuation in the speed.

    EI θ″ = m₁ a c − (1 + ε) N·n, N′ = −½ ρ w (C∥ |c| c t + C⊥ |a| a n), ε = N·t/EA, with c = U·t, a = U·n and added
    mass m₁ per length; x′ = (1 + ε) t; clamped at 0, free at L.
    """
    stretching, bending = SOFT * WIDTH * SOFT_THICKNESS, SOFT * WIDTH * SOFT_THICKNESS**3 / 12.0
    half, mass = 0.5 * DENSITY * WIDTH, added * ADDED["through"]
    mesh, shape, status = np.linspace(0.0, SOFT_LENGTH, 400), np.zeros((5, 400)), 0
    for flow in (*(part for part in (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7) if part < speed), speed):

        def slopes(_: np.ndarray, y: np.ndarray, flow: float = flow) -> np.ndarray:
            angle, pull = y[1], y[3:]
            tangent, normal = np.stack([np.cos(angle), np.sin(angle)]), np.stack([-np.sin(angle), np.cos(angle)])
            along, across = flow * tangent[1], flow * normal[1]
            drag = half * (ALONG * np.abs(along) * along * tangent + ACROSS * np.abs(across) * across * normal)
            longer = 1.0 + (pull * tangent).sum(axis=0) / stretching
            turning = (mass * across * along - longer * (pull * normal).sum(axis=0)) / bending
            return np.vstack([longer * tangent[1], y[2], turning, -drag])

        def ends(start: np.ndarray, end: np.ndarray) -> np.ndarray:
            return np.array([start[0], start[1], end[2], end[3], end[4]])

        found = solve_bvp(slopes, ends, mesh, shape, tol=1e-5, max_nodes=50_000)
        mesh, shape, status = found.x, found.y, max(status, found.status)
    if status > 0:
        raise ArithmeticError("the elastica in a flow was not found")
    return float(shape[0, -1])


CASES = [
    *(
        Case(
            f"fluid/strip across a flow/{speed:g} m/s, {'drag and added mass' if added else 'drag'}",
            "extensible elastica, by collocation",
            5e-4,
            lambda speed=speed, added=added: across_a_flow(speed, added),
            "m",
        )
        for speed, added in ((0.1, True), (0.3, False), (0.5, True), (1.0, False))
    ),
    *cases(
        "fluid/turning strip/{}",
        "ω₀/(1 + ω₀ c t/J), c = ρ C w⁴/64 per length",
        1e-3,
        lambda _name, layers: turning(layers),
        (("one layer", WHOLE), ("two layers", HALVES)),
        unit="rad/s",
    ),
    Case("fluid/sinking ball", "v tanh(g t/v), v = √(2 m g/ρ C π r²)", 1e-4, sinking_ball, "m/s"),
    *cases(
        "fluid/acceleration/{}, {}",
        "own mass over the sum with that of an ellipse's fluid",
        1e-9,
        lambda direction, _name, layers: acceleration(direction, layers),
        [
            (direction, name, layers)
            for direction in AXES
            for name, layers in (("one layer", WHOLE), ("two layers", HALVES))
        ],
        unit="m/s²",
    ),
    *cases(
        "fluid/Munk's moment/{}",
        "Kirchhoff's equations of a rigid plate, by Runge–Kutta",
        0.002,
        lambda _name, across: munk(across),
        (("from below", 0.2), ("from above", -0.2)),
        unit="rad",
    ),
]

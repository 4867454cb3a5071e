"""Motion: free flight, spin, sinking in a fluid, damping, and the order of each integrator in time."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import fixed, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

Array = np.ndarray


def let_go(simulator: Simulator, velocity: Array) -> None:
    """Give the nodes of a scene at its start velocities [m/s], shape (n_node, 3)."""
    put(simulator, velocity=velocity)


def put(simulator: Simulator, **parts: Array) -> None:
    """Replace parts of the state by their names."""
    state, begin = simulator.save_state(), 0
    for name, shape in simulator.description.state_layout:
        size = int(np.prod(shape))
        if name in parts:
            state[begin : begin + size] = np.asarray(parts[name]).ravel()
        begin += size
    simulator.load_state(state)


def free_bilayer(**solver) -> Simulator:
    """Return a simulator of a strip of two layers, 20 mm long, in free space."""
    layers = [layer("passive"), layer("active", thickness=1.5e-3)]
    return Simulator(load_scene(scene([rod(layers, length=0.02, stations=9)], solver=solver)))


def momentum_lost(integrator: str) -> tuple[float, float]:
    """Return the change of linear momentum of a strip in violent vibration, over the momentum."""
    simulator = free_bilayer(dt=1e-4, integrator=integrator)
    rng = np.random.default_rng(3)
    let_go(simulator, 0.2 * rng.standard_normal((simulator.model.node_count, 3)))
    before = simulator.model.rods.node_mass @ simulator.velocities
    simulator.run(0.02)
    after = simulator.model.rods.node_mass @ simulator.velocities
    return float(np.abs(after - before).max() / np.linalg.norm(before)), 0.0


@cache
def _spin_lost(integrator: str, dt: float) -> float:
    """Return the change of angular momentum of a soft strip that spins about its normal at 20 rad/s for 50 ms, over its
    own.
    """
    ribbon = rod([layer(thickness=2e-3)], length=0.1, stations=11, start=(-0.05, 0, 0))
    gel = {"youngs_modulus": 1e5, "poisson_ratio": 0.5, "density": 1000.0}
    solver = {"dt": dt, "integrator": integrator, "newton_tolerance": 1e-11}
    simulator = Simulator(load_scene(scene([ribbon], materials={"gel": gel}, solver=solver)))
    return change_of_spin(simulator, 0.0, 0.05)


def change_of_spin(simulator: Simulator, settling: float, duration: float) -> float:
    """Let a strip go at 20 rad/s; return the change of its angular momentum in a time [s] after another, over it."""
    let_go(simulator, np.cross([0, 0, 20.0], simulator.positions))

    def momentum() -> float:
        return float(simulator.model.rods.node_mass @ np.cross(simulator.positions, simulator.velocities)[:, 2])

    if settling:
        simulator.run(settling)
    before = momentum()
    simulator.run(duration)
    return momentum() / before - 1.0


def order_of_spin(integrator: str) -> tuple[float, float]:
    """Return the order at which the loss of angular momentum falls with the step."""
    coarse, fine = (abs(_spin_lost(integrator, dt)) for dt in (2e-4, 1e-4))
    return math.log2(coarse / fine), float(INTEGRATORS[integrator].order)


@cache
def precession() -> tuple[float, float]:
    """Return the angle [rad] by which the axis of a stiff rod goes round its angular momentum L, of which its spin is a
    part.

    A rigid top with the moments of inertia J about its axis and I across it: |L|/I, L = J ω t + I ω₁. A rod resists
    turns across itself by the masses of its nodes, I = m (L² + 2 l²)/12 with edges of length l.
    """
    length, width, edges, spin, across, time = 0.05, 4e-3, 20, 500.0, 10.0, 0.1
    stick = rod([layer(thickness=width)], length, edges + 1, start=(-0.5 * length, 0, 0), width=width)
    solver = {"model": "laminate", "dimension": 3, "integrator": "sdirk2", "dt": 5e-4}
    simulator = Simulator(load_scene(scene([stick], solver, angular_velocity=[spin, across, 0.0])))
    simulator.run(time)
    lean = 2.0 * width**2 / (length**2 * (1.0 + 2.0 / edges**2)) * spin  # J ω/I
    rate = math.hypot(lean, across)
    axis, start = np.array([lean, across, 0.0]) / rate, np.array([1.0, 0.0, 0.0])
    along = simulator.positions[-1] - simulator.positions[0]
    aside = np.cross(axis, start)
    turned = math.atan2(along @ aside, along @ np.cross(aside, axis))
    return turned, rate * time


STEPS = (1e-3, 5e-4, 2.5e-4)


def order_in_time(integrator: str) -> tuple[float, float]:
    """Return the order in time from the tip of a soft bilayer that a smooth force swings far, at successively halved
    steps.
    """
    config = scene(
        [rod([layer("bottom"), layer("top")], length=0.06, stations=11, clamp_start="wall")],
        bodies=[fixed()],
        materials={"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}},
        loads=[
            {
                "name": "swing",
                "rod": "rod",
                "position": 0.06,
                "force": [0, 2e-3, 4e-3],
                "schedule": {"type": "sine", "mean": 1, "amplitude": 1, "period": 0.1, "phase": -0.5 * math.pi},
            }
        ],
        solver={"newton_tolerance": 1e-10, "integrator": integrator},
    )
    tips = []
    for dt in STEPS:
        simulator = Simulator(load_scene(config), dt=dt)
        simulator.run(0.1)
        tips.append(simulator.positions[10])
    differences = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    return math.log2(differences[0] / differences[1]), float(INTEGRATORS[integrator].order)


DRIVE, FLOW = 5.0, (0.2, 0.1, -0.3)
"""Acceleration that sinks the strip [m/s²], and velocity of the fluid [m/s]."""
WHOLE, HALVES = [layer(thickness=2e-3)], [layer("bottom"), layer("top")]
SINKING = {
    "along": (0, WHOLE, 0.01, 0.4),
    "sideways": (1, WHOLE, 2e-3, 1.2),
    "across the face": (2, WHOLE, 0.01, 1.2),
    "across the face, two layers": (2, HALVES, 0.01, 1.2),
}
"""Axis of the drive, layers, area per length [m] and coefficient of drag."""


def terminal_velocity(direction: str) -> tuple[float, float]:
    """Return the terminal velocity of a sinking strip in a flowing fluid [m/s]: of its slowest node, and expected."""
    axis, layers, area, coefficient = SINKING[direction]
    gravity = [DRIVE * (k == axis) for k in range(3)]
    fluid = {"density": 800.0, "drag_along": 0.4, "drag_across": 1.2, "velocity": FLOW}
    sinking = scene([rod(layers, length=0.05, stations=11)], gravity=gravity, fluid=fluid)
    simulator = Simulator(load_scene(sinking), dt=5e-3)
    simulator.run(10.0)
    speed = math.sqrt(DRIVE * 1000.0 * 0.01 * 2e-3 / (0.5 * 800.0 * area * coefficient))
    return float(simulator.velocities[:, axis].min()), FLOW[axis] + speed


def slowing() -> tuple[float, float]:
    """Return the speed [m/s] of a strip that a fluid at rest has slowed for 20 ms from 2 m/s: v = v₀/(1 + k v₀ t)."""
    strip = rod([layer()], length=0.05, stations=5)
    simulator = Simulator(load_scene(scene([strip], fluid={"drag_along": 0.5, "drag_across": 1.0})), dt=2e-5)
    let_go(simulator, np.tile([0.0, 0.0, 2.0], (5, 1)))
    simulator.run(0.02)
    rate = 0.5 * 1000.0 * 0.01 * 1.0 / (1000.0 * 0.01 * 1e-3)  # ½ ρ_f w C/(ρ w h)
    return float(simulator.velocities[:, 2].mean()), 2.0 / (1.0 + 2.0 * rate * 0.02)


def damped_fall() -> tuple[float, float]:
    """Return the speed [m/s] of a strip that falls against mass damping α = 3/s for 0.4 s: −(g/α)(1 − e^(−α t))."""
    strip = rod([layer()], length=0.05, stations=5)
    falling = scene([strip], damping={"mass": 3.0}, gravity=[0, 0, -10.0])
    simulator = Simulator(load_scene(falling), dt=1e-3)
    simulator.run(0.4)
    return float(simulator.velocities[:, 2].mean()), -10.0 / 3.0 * (1.0 - math.exp(-3.0 * 0.4))


WEAK = 1e-3
"""Gravity of free falls [m/s²]: a few of the forces, and all but none of the speeds, of a scene on Earth."""


def _way_fallen(duration: float, dimension: int, **steps) -> float:
    """Return the height [m] by which a strip 1 m from the origin falls under weak gravity, with the digits of
    `position_low`.
    """
    strip = rod([layer("bottom"), layer("top")], start=(1.0, 0.0, 0.7), stations=11)
    falling = scene([strip], gravity=[0, 0, -WEAK])
    falling["solver"] = {"model": "laminate", "dimension": dimension, **steps}
    simulator = Simulator(load_scene(falling))
    state = simulator._state
    before = state.position[:, 2].copy()
    simulator.run(duration)
    return float(np.max((before - state.position[:, 2]) - state.position_low[:, 2]))


def fall_in_short_steps(integrator: str) -> tuple[float, float]:
    """Return the fall in 200 steps of 1 µs; implicit Euler falls by ½ g t (t + h)."""
    dt, steps = 1e-6, 200
    time = steps * dt
    late = dt if INTEGRATORS[integrator].order == 1 else 0.0
    return _way_fallen(time, 3, integrator=integrator, dt=dt), 0.5 * WEAK * time * (time + late)


def fall_by_default() -> tuple[float, float]:
    """Return the fall in half a second of adaptive steps."""
    return _way_fallen(0.5, 2), 0.125 * WEAK


# A method that keeps angular momentum exactly has no order of its loss.
_LOSING = [name for name in INTEGRATORS if name != "implicit_midpoint"]
CASES = [
    *cases("motion/linear momentum/{}", "conserved in free flight", 1e-9, momentum_lost, INTEGRATORS, scale=1.0),
    *cases(
        "motion/angular momentum/{}/order",
        "its loss falls at the integrator's order",
        0.15,
        order_of_spin,
        _LOSING,
        scale=1.0,
    ),
    Case(
        "motion/angular momentum/implicit_midpoint",
        "conserved in free flight",
        1e-7,
        lambda: (_spin_lost("implicit_midpoint", 2e-4), 0.0),
        scale=1.0,
    ),
    Case("motion/precession", "torque-free motion of a rigid top", 1e-3, precession, "rad"),
    *cases(
        "motion/order in time/{}",
        "the integrator's order, at a swinging bilayer's tip",
        0.15,
        order_in_time,
        INTEGRATORS,
        scale=1.0,
        long=True,
    ),
    *cases(
        "motion/terminal velocity/{}",
        "weight = ½ ρ_f w L C v², relative to the flow",
        0.001,
        terminal_velocity,
        SINKING,
        unit="m/s",
    ),
    *cases(
        "motion/free fall/{}",
        "½ g t² under 1 mm/s² in steps of 1 µs, ½ g t (t + h) with implicit Euler",
        1e-9,
        fall_in_short_steps,
        _LOSING,
        unit="m",
    ),
    Case("motion/free fall/by default", "½ g t² under 1 mm/s²", 1e-9, fall_by_default, "m"),
    Case("motion/drag", "v₀/(1 + k v₀ t)", 0.01, slowing, "m/s"),
    Case("motion/mass damping", "(g/α)(1 − e^(−α t))", 0.005, damped_fall, "m/s"),
]

"""Impacts of bodies: how fast they rebound, and that no step makes energy."""

from __future__ import annotations

from bilayer_core.engine.energy_account import FREE, LARGEST, LOWEST
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.parts import GROUND, contact, layer, rod, scene
from bilayer_core.verification.validate.validation_case import Case, cases

SPEED, BARRIER = 10.0, 1e-4
"""Of the ball before it meets the table [m/s], and the barrier distance [m]."""
TOLERANCES = {"sdirk2": 1e-4, "tr_bdf2": 1e-4, "generalised_alpha": 1e-5}


def thrown(stiffness: float, dimension: int, **contact_keys) -> dict:
    """Return a scene with a ball of 2.7 g, 1 mm over a table, that flies towards it without gravity."""
    motion = {"type": "free", "mass": 2.7e-3, "velocity": [0, 0, -SPEED], "inertia": [4.3e-7] * 3}
    surface = {"shape": "sphere", "radius": 0.02}
    ball = {"name": "ball", "position": [0.05, 1.0, 0.021], "motion": motion, "surface": surface}
    return scene(
        [rod([layer()], start=(0, 1.0, 0.5))],
        solver={"dt": None, "model": "laminate", "dimension": dimension, "integrator": "sdirk2"},
        duration=2e-3,
        bodies=[ball],
        obstacles=[GROUND],
        contact=contact(BARRIER) | {"stiffness": stiffness} | contact_keys,
    )


def rebound(dimension: int, integrator: str, tolerance: float, stiffness: float = 1e9, **contact_keys) -> float:
    """Return the speed after the impact over that before."""
    content = thrown(stiffness, dimension, **contact_keys)
    simulator = Simulator(load_scene(content), integrator=integrator, tolerance=tolerance)
    simulator.run(1.8e-3)
    height = float(simulator.bodies["ball"].position[2])
    simulator.run(2e-4)
    return (float(simulator.bodies["ball"].position[2]) - height) / (2e-4 * SPEED)


def most_made(integrator: str, dt: float) -> float:
    """Return the energy that steps of a length made of nothing in an impact that the barrier cannot resolve, over the
    largest.
    """
    simulator = Simulator(load_scene(thrown(1e9, 2)), integrator=integrator, dt=dt)
    most = 0.0
    while simulator.time < 1.2e-3:
        simulator.step()
        account = simulator.energy_account
        most = max(most, (account[FREE] - account[LOWEST]) / account[LARGEST])
    return most


CASES = [
    *cases(
        "impacts/ball of 10 m/s/{}-D {}",
        "an elastic barrier gives the speed back",
        0.02,
        lambda dimension, integrator, tolerance: (
            rebound(dimension, integrator, tolerance),
            1.0,
        ),
        [(dimension, integrator, tolerance) for dimension in (2, 3) for integrator, tolerance in TOLERANCES.items()],
    ),
    *cases(
        "impacts/restitution {:g}/{}-D {}",
        "speed after the impact over that before",
        0.02,
        lambda restitution, dimension, integrator, tolerance: (
            rebound(dimension, integrator, tolerance, restitution=restitution),
            restitution,
        ),
        [
            (restitution, dimension, integrator, tolerance)
            for restitution in (0.0, 0.1, 0.5, 0.9)
            for dimension in (2, 3)
            for integrator, tolerance in TOLERANCES.items()
        ],
        scale=1.0,
    ),
    *(
        Case(
            f"impacts/no energy from nothing/{integrator} {1e6 * dt:g} us",
            "energy that the steps of an impact make, over the largest",
            1e-3,
            lambda integrator=integrator, dt=dt: (most_made(integrator, dt), 0.0),
            scale=1.0,
        )
        for integrator in ("implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha", "implicit_midpoint")
        for dt in (1e-5, 1e-6)
    ),
]

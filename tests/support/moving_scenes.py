"""Small scenes that move smoothly, for integrators to follow, and parts of the state of a run."""

import math

import numpy as np
from support.sample_scenes import GROUND, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.integrators.integrator_register import INTEGRATORS

SOFT = {"gel": {"youngs_modulus": 1e4, "poisson_ratio": 0.5, "density": 1000.0}}
EXACT = {"newton_tolerance": 1e-10}


def sine(period):
    """From 0 to 1 and back, beginning without a jump of its rate."""
    return {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": period, "phase": "-90 deg"}


def cantilever():
    """A thick soft strip that a force swings out of both planes, so that all its vibrations last many steps."""
    pull = {"name": "pull", "rod": "rod", "position": 0.03, "force": [0, 3e-4, -8e-4], "schedule": sine(0.2)}
    strip = rod([layer(thickness=4e-3)], length=0.03, stations=4, clamp_start="wall")
    return scene([strip], bodies=[fixed()], materials=SOFT, loads=[pull], solver=EXACT)


def driven(**fluid):
    """A bilayer that bends as its upper layer grows, with damping and drag."""
    growth = {"stimulus": "heat", "gain": 0.1, "time_constant": 0.02}
    layers = [layer("bottom", thickness=2e-3), layer("top", thickness=2e-3, eigenstrain=growth)]
    return scene(
        [rod(layers, length=0.03, stations=4, clamp_start="wall")],
        bodies=[fixed()],
        materials=SOFT,
        stimuli={"heat": {"schedule": sine(0.2)}},
        damping={"mass": 2.0},
        fluid={"density": 300.0, "drag_along": 0.1, "drag_across": 1.0, **fluid},
        solver=EXACT,
    )


def jet():
    """A strip pushed by a force and a body turned by a moment that turn with them, on a hub that is moved."""
    push = {"name": "push", "rod": "rod", "position": 0.03, "force": [0, 3e-4, -8e-4], "frame": "material"}
    path = {"type": "prescribed", "times": [0.0, 0.2], "displacements": [[0, 0, 0], [0, 5e-3, 5e-3]]}
    strip = rod([layer(thickness=4e-3)], length=0.03, stations=4, clamp_start="hub")
    hub = {"name": "hub", "position": [0, 0, 0], "motion": path}
    return scene([strip], bodies=[hub], materials=SOFT, loads=[{**push, "schedule": sine(0.2)}], solver=EXACT)


def spinner():
    """A body with three different moments of inertia and a strip that is clamped in it, without forces from outside.

    It is soft enough for the steps to follow the vibrations with which it gives way to the spin.
    """
    free = {"type": "free", "mass": 2e-3, "inertia": [1e-7, 2e-7, 2.5e-7]}
    free |= {"angular_velocity": [2.0, 4.0, 1.5], "velocity": [0.1, 0, 0.2]}
    strip = rod([layer(thickness=4e-3)], length=0.012, stations=3, start=(0.004, 0.001, 0), clamp_start="hub")
    softer = {"gel": {**SOFT["gel"], "youngs_modulus": 1e3}}
    hub = {"name": "hub", "position": [0, 0, 0], "motion": free}
    return scene([strip], bodies=[hub], materials=softer, solver=EXACT)


PROBLEMS = {
    "cantilever": (cantilever(), 0.06),
    "driven bilayer": (driven(), 0.06),
    "driven bilayer with added mass": (driven(added_mass=True), 0.06),
    "jet": (jet(), 0.06),
    "spinning body": (spinner(), 0.06),
}


ADAPTIVE = [name for name, method in INTEGRATORS.items() if method.estimate is not None]
"""Names of the integrators that have an estimate of their error."""


def simulate(description, duration=None, **settings):
    """A simulator, after `duration` [s]."""
    simulator = Simulator(load_scene(description), **settings)
    if duration:
        simulator.run(duration)
    return simulator


def falling(obstacles=(GROUND,), **solver):
    """A ball 28 mm above the ground, with a distant strip because a scene must have one."""
    strip = rod([layer()], start=(1, 0, 1), length=0.05, stations=3, clamp_start="wall")
    return scene(
        [strip],
        gravity=[0, 0, -9.81],
        bodies=[fixed("wall", (1, 0, 1)), ball((0, 0, 0.05))],
        obstacles=list(obstacles),
        contact=contact(barrier_distance=1e-3),
        solver={"newton_tolerance": 1e-9, **solver},
    )


def part(simulator, name):
    """A part of the state."""
    state, start = simulator.save_state(), 0
    for own, shape in simulator._state.layout():
        size = math.prod(shape)
        if own == name:
            return state[start : start + size].reshape(shape)
        start += size
    raise KeyError(name)


def with_parts(simulator, **values):
    """Put parts of the state to values."""
    state, start = simulator.save_state(), 0
    for own, shape in simulator._state.layout():
        size = math.prod(shape)
        if own in values:
            state[start : start + size] = np.asarray(values[own]).ravel()
        start += size
    simulator.load_state(state)

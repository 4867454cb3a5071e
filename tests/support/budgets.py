"""Small scenes and runs whose energy budget is kept."""

import math

import numpy as np
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene

SOFT = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}
EXACT = {"newton_tolerance": 1e-10}


def run(description, duration, dt, velocity=None, integrator="implicit_euler"):
    """A simulator with its budget kept, after `duration` [s]; `velocity` of nodes at the start [m/s]."""
    simulator = Simulator(load_scene(description), dt=dt, integrator=integrator, budget=True)
    if velocity is not None:
        throw(simulator, np.broadcast_to(velocity, (simulator.model.node_count, 3)))
    simulator.run(duration)
    return simulator


def throw(simulator, velocity):
    """Give all nodes velocities [m/s], shape (n_node, 3); the budget starts anew."""
    state = simulator.save_state()
    parts = simulator._state.layout()
    sizes = [int(np.prod(shape)) for _, shape in parts]
    start = sum(sizes[: [name for name, _ in parts].index("velocity")])
    state[start : start + velocity.size] = np.asarray(velocity).ravel()
    simulator.load_state(state)


def driven(stations=9, gain=0.02, **more):
    """A clamped bilayer whose upper layer grows smoothly."""
    layers = [layer("lower"), layer("upper", eigenstrain={"stimulus": "heat", "gain": gain})]
    wave = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.4, "phase": -math.pi / 2}
    more = {"bodies": [fixed()], "materials": SOFT, "solver": EXACT, **more}
    strip = rod(layers, length=0.04, stations=stations, clamp_start="wall")
    return scene([strip], stimuli={"heat": {"schedule": wave}}, **more)


def clamped(gravity, **path):
    """A soft strip, clamped at one end."""
    strip = rod([layer(thickness=2e-3)], length=0.05, stations=9, clamp_start="wall")
    if path:
        strip["path"] = {"start": [0, 0, 0], "direction": [1, 0, 0], **path}
    return scene([strip], gravity=list(gravity), bodies=[fixed()], materials=SOFT, solver=EXACT)


def moving(name, position, displacement, duration):
    """A body on a prescribed path."""
    path = {"times": [0.0, duration], "displacements": [[0, 0, 0], list(displacement)]}
    return {"name": name, "position": list(position), "motion": {"type": "prescribed", **path}}


def extrapolated(measure, dt):
    """Limit for small steps of a figure that has an error of first order."""
    return 2.0 * measure(dt / 2) - measure(dt)

"""Newton's method by itself: where each of its corrections leads."""

import math

import numpy as np
import pytest
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.request_modes import SETTLE
from bilayer_core.model.records.status import CONVERGED, MAX_ITERATIONS

INERTIA_OVER = 0.01
"""[s]: many times the period of the strip, so that a correction goes far."""
ROUNDING = 1e-12


def coiling(turns, model, dimension):
    """A straight strip, held at one end, that wants to be a coil; a round of statics takes one correction, or two."""
    layers = [layer("low", 0.5e-3), layer("high", 0.5e-3)]
    for one in layers:
        one["natural_curvature"] = 2.0 * math.pi * turns / 0.05
    strip = rod(layers, length=0.05, stations=21, clamp_start="wall")
    solver = {"model": model, "dimension": dimension, "max_newton_iterations": 2}
    return Simulator(load_scene(scene([strip], bodies=[fixed()], solver=solver)))


@pytest.mark.parametrize("turns", [0.3, 1.0, -2.0])
@pytest.mark.parametrize(("model", "dimension"), [("laminate", 2), ("laminate", 3), ("two_rod", 3)])
def test_no_correction_of_newtons_method_raises_the_potential(model, dimension, turns):
    """Whole corrections would, from a straight strip: they stretch what turns far, for hundreds of times its energy."""
    simulator = coiling(turns, model, dimension)
    stepper, state = simulator._stepper, simulator._state
    energies = [sum(simulator.energy().values())]
    for _ in range(12):
        stepper.engine.set_drive(state, stepper.surroundings.load_factor(state))
        found = stepper.engine.do_once(state, SETTLE, INERTIA_OVER, 1e-12)
        assert found.status in (CONVERGED, MAX_ITERATIONS)
        stepper.evaluate(state)
        energies.append(sum(simulator.energy().values()))
    assert (np.diff(energies) < ROUNDING * energies[0]).all()
    assert energies[-1] < 0.95 * energies[0]  # it goes somewhere

"""The bundled scenes of fibres at an angle: a ribbon that winds up, and a pod whose valves do so as mirror images."""

import math

import numpy as np
import pytest
from oracles.plate_strip_across import Strip, isotropic

from bilayer_core import Simulator, load_scene
from bilayer_core.verification.validate.helix import screw

HUMIDITY = 0.3, 1.0


def plate(value):
    """Radius and pitch [m] of a plate strip like the ribbon at a stimulus."""
    layers = [(0.15e-3, isotropic(100e6, 0.3), (0.0, 0.03 * value), math.radians(degrees)) for degrees in (-60.0, 30.0)]
    curvature, twist = Strip(8e-3, layers).rest(75.0 * value * np.array([1.0, 0.7]))
    longer = 1.0 + 0.015 * value  # half of the swelling of the layers, on average of both
    return longer / (curvature**2 + twist**2) * np.array([curvature, 2.0 * math.pi * twist])


def test_the_ribbon_winds_up_to_the_radius_and_pitch_of_a_plate_at_each_stimulus():
    config = load_scene("helical_ribbon", ["rods.ribbon.stations=161"])
    found = []
    for value in HUMIDITY:
        simulator = Simulator(config)
        simulator.run(4.0 * value)
        simulator.set_stimulus("humidity", value)
        simulator.solve_static()
        found.append(screw(simulator.positions[60:91:10]))
        # a plate lacks the borders of the section, 2.4 % of its torsional stiffness
        assert np.array(found[-1]) == pytest.approx(plate(value), rel=1.5e-2)
        assert "folded" not in " ".join(simulator.summary()["warnings"])
    assert found[0][1] / found[0][0] > 2.0 * found[1][1] / found[1][0]


def test_the_valves_of_the_pod_coil_up_as_mirror_images_and_keep_apart():
    simulator = Simulator(load_scene("chiral_pod"))
    simulator.run()
    left, right = (simulator.rods[name].positions for name in ("valve_0", "valve_1"))
    assert left * [-1, 1, 1] == pytest.approx(right, abs=1e-8)
    assert np.linalg.norm(left[-1] - left[0]) < 0.75 * 0.12
    assert np.linalg.norm(left[5:, None] - right[None, 5:], axis=2).min() > 2e-3
    assert "folded" not in " ".join(simulator.summary()["warnings"])

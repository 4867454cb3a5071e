"""Equilibria with a known answer. They are reached with few, long, damped steps of implicit Euler."""

import numpy as np
import pytest
from sample_scenes import GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene

STILL = {"dt": 1.0, "tolerance": 1e-11}  # a second is long compared with all that moves here


def timoshenko(m, n):
    """κH/η of a bilayer whose top layer grows, m = E2/E1, n = h2/h1 (bottom over top)."""
    return 6 * (1 + n) ** 2 / (3 * (1 + n) ** 2 + (1 + m * n) * (n**2 + 1 / (m * n)))


def bending(m, n, eigenstrain, stations=41):
    """A clamped bilayer strip, 2 mm thick; its top layer grows."""
    top = 2e-3 / (1 + n)
    layers = [
        layer("bottom", thickness=n * top, material="base"),
        layer("top", thickness=top, eigenstrain={"stimulus": "heat", "gain": eigenstrain}),
    ]
    gel = {"youngs_modulus": 1e8, "poisson_ratio": 0.5, "density": 1000.0}
    return scene(
        [rod(layers, length=0.05, stations=stations, clamp_start="wall")],
        bodies=[fixed()],
        materials={"gel": gel, "base": {**gel, "youngs_modulus": m * 1e8}},
        stimuli={"heat": {"schedule": {"type": "ramp", "start": 0, "end": 5, "from": 0, "to": 1}}},
        solver=STILL,
    )


@pytest.mark.parametrize("eigenstrain", [0.005, 0.05])
@pytest.mark.parametrize(("m", "n"), [(1.0, 1.0), (5.0, 0.5), (0.2, 3.0)])
def test_free_curvature_of_a_bilayer_is_timoshenkos(m, n, eigenstrain):
    simulator = Simulator(load_scene(bending(m, n, eigenstrain)))
    simulator.run(25.0)
    inner = simulator.curvatures[8:34]  # of the bottom layer; ends have no bending element of their own
    expected = -timoshenko(m, n) * eigenstrain / 2e-3  # a growing top layer bends downwards: χ < 0
    assert np.abs(inner / expected - 1.0).max() < 0.01


def cantilever(stations):
    """The common cantilever under its own weight."""
    material = {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}
    return scene(
        [rod([layer(thickness=2e-3)], stations=stations, clamp_start="wall")],
        gravity=[0, 0, -9.81],
        bodies=[fixed()],
        materials={"gel": material},
        solver=STILL,
    )


def test_tip_of_a_heavy_cantilever_converges_at_second_order_to_the_extensible_elastica():
    reference = np.array([0.0347151882735, 0.0, -0.0871807525051])
    errors = []
    for stations in (51, 101, 201):
        simulator = Simulator(load_scene(cantilever(stations)))
        simulator.run(60.0)
        errors.append(np.linalg.norm(simulator.positions[-1] - reference) / 0.1)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 1e-4
    assert orders[-1] == pytest.approx(2.0, abs=0.1), errors


@pytest.mark.parametrize("stations", [11, 21, 41])
def test_a_ribbon_rests_at_the_same_gap_on_every_mesh_and_its_weight_on_the_ground(stations):
    layers = [layer("bottom"), layer("top")]
    strip = rod(layers, stations=stations, start=(0, 0, 2e-3))
    simulator = Simulator(
        load_scene(
            scene(
                [strip],
                gravity=[0, 0, -9.81],
                obstacles=[GROUND],
                contact=contact(),
                solver={"dt": 0.01, "tolerance": 1e-10},
            )
        )
    )
    simulator.run(2.0)
    bottom = simulator.positions[:stations, 2] - 0.5e-3
    assert 1e-3 - bottom == pytest.approx(np.full(stations, 1e-3 - 0.9974448e-3), rel=0.01)
    weight = 9.81 * 1000.0 * 0.01 * 2e-3 * 0.1
    assert simulator.contact_forces[:, 2].sum() == pytest.approx(weight, rel=1e-6)
    assert np.abs(simulator.contact_forces[:, :2]).max() < 1e-12

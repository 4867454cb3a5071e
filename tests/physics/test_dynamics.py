"""An impact, and a layer that lags; motions with a known answer are in `bilayer_core.verification.validate`."""

import math

import numpy as np
import pytest
from support.sample_scenes import GROUND, contact, layer, rod, scene

from bilayer_core import Simulator, load_scene


def test_no_node_crosses_the_ground_however_fast_it_falls():
    strip = rod([layer()], length=0.05, stations=11, start=(0, 0, 0.3))
    simulator = Simulator(load_scene(scene([strip], gravity=[0, 0, -2e4], obstacles=[GROUND], contact=contact())))
    lowest = math.inf
    for _ in range(60):
        simulator.step()  # at impact a node would travel 100 mm in a step
        lowest = min(lowest, simulator.positions[:, 2].min() - 0.5e-3)
    assert 0.0 < lowest < 1e-3
    assert simulator.statistics.min_gap > 0.0


def test_a_lagging_layer_follows_its_stimulus_with_its_time_constant_whatever_the_step():
    lagging = [layer(eigenstrain={"stimulus": "heat", "gain": 0.01, "time_constant": 0.05})]
    for dt in (1e-3, 1e-2):
        simulator = Simulator(
            load_scene(
                scene(
                    [rod(lagging, length=0.02, stations=5)],
                    stimuli={"heat": {"schedule": {"type": "hold", "value": 0}}},
                    damping={"mass": 1e5},
                )
            ),
            dt=dt,
        )
        simulator.set_stimulus("heat", 1.0)
        simulator.run(0.05)
        strain = simulator.frame().strain
        assert strain == pytest.approx(np.full(5, 0.01 * (1 - math.exp(-1.0))), rel=2e-3)

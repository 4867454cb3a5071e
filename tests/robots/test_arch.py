"""The bundled arch: it snaps through once, and stays."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_an_arch_snaps_through_as_it_warms_and_stays_as_it_cools(model):
    simulator = Simulator(load_scene("arch"), model=model)
    middle = [node for strand in simulator.model.strands for node in [strand.first_node + strand.node_count // 2]]
    heights, temperatures = [], []
    while simulator.time < 3.0 - 1e-9:
        simulator.run(0.05)
        heights.append(float(np.mean(simulator.positions[middle, 2])))
        temperatures.append(simulator.stimulus["temperature"])
    heights = np.array(heights)
    assert heights[0] > 6e-3 and heights[-1] < -6e-3
    assert (np.diff(np.sign(heights)) != 0).sum() == 1  # once
    snap = int(np.argmax(heights < 0.0))
    assert 44.0 < temperatures[snap] < 54.0
    assert heights[:snap].max() > heights[0] + 1e-3  # it rises before
    left, right = (simulator.bodies[name].clamp_wrench for name in ("left", "right"))
    weight = float(simulator.model.rods.node_mass.sum()) * 9.81
    assert left[2] == pytest.approx(-0.5 * weight, rel=0.02)
    assert right[2] == pytest.approx(-0.5 * weight, rel=0.02)
    assert left[0] == pytest.approx(-right[0], rel=0.02)
    for wrench in (left, right):  # what is left turns the half edges at the hinges
        assert abs(wrench[4]) < 1e-6 * weight * 0.1


def test_both_shapes_are_equilibria_of_the_cold_arch():
    up, down = (Simulator(load_scene("arch")) for _ in range(2))
    down.run()
    for simulator, sign in ((up, 1.0), (down, -1.0)):
        simulator.set_stimulus("temperature", 20.0)
        assert simulator.solve_static().stable
        assert sign * simulator.positions[20, 2] > 5e-3

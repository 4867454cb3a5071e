"""The bundled ring: it rolls towards the light where there is friction, and turns back at the shade."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene

OPEN = ["obstacles.roof.position=[10, 0, 0.1]"]  # far away, out of the light
TURNED = ["stimuli.sun.light.from=[-1, 0, 1]"]


def way(duration, changes=(), **choices):
    """Mass centre every half second from 1 s on [m], shape (n, 3), and the simulator."""
    simulator = Simulator(load_scene("ring", [*OPEN, *changes]), **choices)
    simulator.run(1.0)
    found = [simulator.com]
    while simulator.time < duration - 1e-9:
        simulator.run(0.5)
        found.append(simulator.com)
    return np.array(found), simulator


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_the_ring_rolls_towards_the_light_with_friction(model):
    found, simulator = way(5.0, model=model)
    speed = np.diff(found[:, 0]) / 0.5
    assert np.all(speed > 0.003) and 0.020 < (found[-1, 0] - found[0, 0]) / 4.0 < 0.030  # in pulses
    assert simulator.summary()["converged"] is True


def test_without_friction_it_stays_where_it_is():
    found, _ = way(3.0, ["contact.friction.coefficient=0"])
    assert np.abs(found[:, 0]).max() < 1e-4


def test_without_light_it_stays_where_it_is():
    found, _ = way(3.0, ["stimuli.sun.schedule={type: hold, value: 0}"])
    assert np.abs(found[:, 0]).max() < 1e-4


def test_light_from_the_other_side_rolls_it_the_other_way():
    there, _ = way(3.0)
    back, _ = way(3.0, TURNED)
    assert back[:, 0] == pytest.approx(-there[:, 0], abs=1e-3)


def test_a_layer_that_shrinks_in_light_rolls_away_from_it():
    found, _ = way(4.0, ["rods.ring.layers.outer.eigenstrain.gain=-0.018"])
    assert found[-1, 0] < -0.03


def test_a_mesh_twice_as_fine_rolls_as_far():
    coarse, fine = way(4.0)[0], way(4.0, ["rods.ring.stations=241"])[0]
    assert fine[-1, 0] == pytest.approx(coarse[-1, 0], rel=0.03)


def test_the_ring_turns_back_at_the_shade():
    simulator = Simulator(load_scene("ring"))
    way = []
    while simulator.time < 5.0 - 1e-9:
        simulator.run(0.25)
        way.append(float(simulator.com[0]))
    blind = Simulator(load_scene("ring", ["stimuli.sun.light.shadow=false"]))
    blind.run(5.0)
    assert 0.06 < max(way) < 0.09 and way[-1] < max(way) - 0.02
    assert blind.com[0] > max(way) + 0.02

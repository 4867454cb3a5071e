"""The heated finger curls up in seconds while a current flows, and comes back."""

import numpy as np

from bilayer_core import Simulator, load_scene
from bilayer_core.scene.loader import scene_content


def turns(simulator, times):
    """How far the end has turned at some times [degrees]."""
    angles = []
    for time in times:
        simulator.run(time - simulator.time)
        along = simulator.positions[40] - simulator.positions[39]
        angles.append(float(np.degrees(np.arctan2(along[0], -along[2]))))
    return angles


def test_the_end_turns_by_seventy_degrees_and_back():
    quick, late, back = turns(Simulator("heated_finger"), (1.0, 8.0, 16.0))
    assert 30.0 < quick < 40.0 and 71.0 < late < 73.0 and 0.0 < back < 4.0


def test_a_finger_that_keeps_its_modulus_turns_farther():
    content = scene_content(load_scene("heated_finger"))
    content["rods"][0]["layers"][1]["stiffness_change"] = None
    content["solver"] = content.get("solver", {}) | {"model": "two_rod"}
    (stiff,) = turns(Simulator(load_scene(content)), (8.0,))
    assert 74.0 < stiff < 76.0

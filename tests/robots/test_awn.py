"""The bundled awn: it unwinds as its inner layer grows."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.kinematics.rotation import matrix_from_quaternion, rotation_vector
from bilayer_core.model.twisted import helix_error
from bilayer_core.verification.validate.helix import screw


def turns_of_the_seed(simulator):
    """By which the seed has turned about the axis at the end."""
    angle, before = 0.0, np.eye(3)
    for _ in range(40):
        simulator.run(0.1)
        now = matrix_from_quaternion(simulator.frame().body_quaternions[1])
        angle += rotation_vector(now @ before.T)[2]
        before = now
    return angle / (2.0 * np.pi)


@pytest.mark.parametrize("model", ["two_rod", "laminate"])
def test_an_awn_loses_half_its_turns_and_lets_the_seed_down(model):
    simulator = Simulator(load_scene("awn"), model=model)
    start, length = simulator.frame().body_positions[1, 2], simulator.scene.rods[0].path.length
    (curvature, _, twist), change = simulator.scene.rods[0].curvatures_at(np.zeros(1))[0], 1.5 * 0.05 / 0.4e-3
    before, after = (length * np.hypot(chi, twist) / (2.0 * np.pi) for chi in (curvature, curvature - change))
    assert before == pytest.approx(5.0)
    assert turns_of_the_seed(simulator) == pytest.approx(before - after, rel=0.1)
    assert simulator.frame().body_positions[1, 2] < start - 0.03


def test_one_curve_misses_its_radius_by_what_the_choice_of_the_model_says():
    scene = load_scene("awn", ["gravity=[0, 0, 0]"])
    radii = []
    for model in ("laminate", "two_rod"):
        simulator = Simulator(scene, model=model)
        simulator.run()
        curve = simulator.positions.reshape(-1, 151, 3).mean(axis=0)
        radii.append(screw(curve[60:76:5])[0])
    assert radii[0] / radii[1] - 1.0 == pytest.approx(helix_error(scene, scene.rods[0]), rel=0.2)

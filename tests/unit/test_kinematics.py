"""Rotations and schedules of bodies by themselves."""

import numpy as np
import pytest
from oracles.prescribed_motion import angular_velocity, between_keyframes

from bilayer_core.kinematics.rotation import rotation_matrix, rotation_vector


@pytest.mark.parametrize("size", [1e-6, 0.3, 2.5])
def test_angular_velocity_is_the_rate_at_which_the_rotation_of_a_changing_vector_turns(size):
    vector, rate, step = size * np.array([0.6, -0.48, 0.64]), np.array([0.3, 1.1, -0.7]), 1e-5
    before, after = (rotation_matrix(vector + s * step * rate) for s in (-0.5, 0.5))
    assert angular_velocity(vector, rate) == pytest.approx(rotation_vector(after @ before.T) / step, rel=1e-8, abs=1e-9)


def test_the_rate_between_keyframes_is_that_of_the_value():
    times, values = np.array([0.0, 0.1, 0.4]), np.array([[0.0, 0, 0], [0.2, 0, -0.1], [0.2, 0.3, 0.1]])
    for time in (0.03, 0.25, 0.39):
        before, after = (between_keyframes(times, values, time + s * 1e-6)[0] for s in (-0.5, 0.5))
        assert between_keyframes(times, values, time)[1] == pytest.approx((after - before) / 1e-6, abs=1e-8)
    for time in (-1.0, 0.0, 0.1, 0.4, 1.0):
        assert not between_keyframes(times, values, time)[1].any()

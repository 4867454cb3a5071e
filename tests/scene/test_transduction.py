import numpy as np
from scipy.integrate import solve_ivp

from bilayer_core.scene.transduction import follow


def test_the_lag_over_one_step_is_the_solution_of_its_equation():
    start, target, lag, dt = np.array([0.2, 0.9, 0.0]), np.array([1.0, 0.1, 0.5]), np.array([0.3, 0.01, 5.0]), 0.05
    exact = solve_ivp(lambda t, y: (target - y) / lag, (0.0, dt), start, rtol=1e-11, atol=1e-13, method="DOP853")
    np.testing.assert_allclose(follow(start, target, lag, dt), exact.y[:, -1], rtol=1e-9)


def test_without_a_time_constant_the_material_follows_at_once():
    np.testing.assert_array_equal(
        follow(np.array([0.2, 0.3]), np.array([1.0, 0.7]), np.array([0.0, 0.0]), 1e-3), [1.0, 0.7]
    )


def test_two_half_steps_are_one_step():
    start, target, lag = np.array([0.1]), np.array([0.8]), np.array([0.02])
    halves = follow(follow(start, target, lag, 0.005), target, lag, 0.005)
    np.testing.assert_allclose(halves, follow(start, target, lag, 0.01), rtol=1e-14)


def test_a_step_much_longer_than_the_lag_ends_at_the_stimulus():
    np.testing.assert_array_equal(follow(np.array([0.0]), np.array([0.6]), np.array([1e-9]), 1.0), [0.6])

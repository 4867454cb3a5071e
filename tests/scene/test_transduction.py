import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bilayer_core.scene.transduction import free_strain, lagged

first_order_lag = np.vectorize(lagged)


@pytest.mark.parametrize("change", [0.0, 0.2], ids=["held", "linear"])
def test_the_lag_over_one_step_is_the_solution_of_its_equation_rising_and_falling(change):
    start, last, dt = np.array([0.2, 0.9, 0.0]), np.array([1.0, 0.1, 0.5]), 0.05
    first = last - change
    rising, falling = np.array([0.3, 7.0, 5.0]), np.array([7.0, 0.01, 9.0])
    acting = np.array([0.3, 0.01, 5.0])

    def rate(t, y):
        return (first + (last - first) * t / dt - y) / acting

    exact = solve_ivp(rate, (0.0, dt), start, rtol=1e-11, atol=1e-13, method="DOP853")
    # The reference is known to its own tolerance of 1e-11 a step, over some hundred steps.
    np.testing.assert_allclose(first_order_lag(start, first, last, rising, falling, dt), exact.y[:, -1], rtol=1e-9)


def test_without_a_time_constant_the_material_follows_at_once():
    now = np.zeros(2)
    np.testing.assert_array_equal(
        first_order_lag(np.array([0.2, 0.9]), np.zeros(2), np.array([1.0, 0.7]), now, now, 1e-3), [1.0, 0.7]
    )


@pytest.mark.parametrize("target", [0.8, 0.0])
def test_a_hundred_steps_are_one_step(target):
    start, target, rising, falling = np.array([0.1]), np.array([target]), np.array([0.02]), np.array([0.05])
    filtered = start
    for _ in range(100):
        filtered = first_order_lag(filtered, target, target, rising, falling, 1e-4)
    # A hundred roundings of 1e-16 each.
    np.testing.assert_allclose(filtered, first_order_lag(start, target, target, rising, falling, 1e-2), rtol=1e-13)


def test_a_step_much_longer_than_the_lag_ends_at_the_stimulus():
    lag = np.array([1e-9])
    np.testing.assert_array_equal(
        first_order_lag(np.array([0.0]), np.array([0.6]), np.array([0.6]), lag, lag, 1.0), [0.6]
    )


def test_without_saturation_the_strain_is_linear_about_the_reference():
    filtered = np.array([-1.0, 0.25, 3.0])
    strain = free_strain(filtered, np.full(3, 0.04), np.full(3, 0.25), np.full(3, np.inf))
    np.testing.assert_array_equal(strain, 0.04 * (filtered - 0.25))


@pytest.mark.parametrize("gain", [0.5, -0.5])
def test_a_saturated_strain_has_its_gain_at_the_reference_and_tends_to_its_limit(gain):
    def strain(stimulus):
        return free_strain(np.array([stimulus]), np.array([gain]), np.array([0.3]), np.array([0.1]))[0]

    assert strain(0.3) == 0.0
    # Central difference: its error is a third of the cubed argument, (0.5e-3/0.1)²/3 = 1e-5 of the slope at most.
    assert (strain(0.301) - strain(0.299)) / 0.002 == pytest.approx(gain, rel=1e-5)
    assert strain(0.5) == pytest.approx(np.sign(gain) * 0.1 * np.tanh(1.0), rel=1e-14)
    assert strain(100.0) == pytest.approx(np.sign(gain) * 0.1, rel=1e-12)
    assert strain(-100.0) == pytest.approx(-np.sign(gain) * 0.1, rel=1e-12)


def test_saturation_of_one_law_leaves_the_others_linear():
    strain = free_strain(np.full(2, 2.0), np.full(2, 0.1), np.zeros(2), np.array([0.05, np.inf]))
    np.testing.assert_allclose(strain, [0.05 * np.tanh(4.0), 0.2], rtol=1e-14)

"""Intervals of linear models, against formulas and against repetition."""

import numpy as np
import pytest
from scipy import stats

from bilayer_core.studies.fitting.intervals import spread_of

RANDOM = np.random.default_rng(11)
MATRIX = np.stack([np.ones(8), np.linspace(0.0, 1.0, 8)], axis=1)


def test_intervals_of_a_line_are_those_of_linear_regression():
    values = 2.0 + 3.0 * MATRIX[:, 1] + 0.1 * RANDOM.normal(size=8)
    line = stats.linregress(MATRIX[:, 1], values)
    spread = spread_of(MATRIX, values - line.intercept - line.slope * MATRIX[:, 1], False, 0.0)
    assert spread.deviations == pytest.approx([line.intercept_stderr, line.stderr], rel=1e-12)
    assert spread.wide == pytest.approx(stats.t.ppf(0.975, 6), rel=1e-12) and spread.freedom == 6


def test_with_known_noise_they_do_not_depend_on_residuals():
    one, other = (spread_of(MATRIX, residuals, True, 0.0) for residuals in (np.zeros(8), np.full(8, 7.0)))
    np.testing.assert_array_equal(one.covariance, other.covariance)
    assert one.covariance == pytest.approx(np.linalg.inv(MATRIX.T @ MATRIX)) and one.wide == pytest.approx(1.959964)


def test_correlations_have_ones_on_the_diagonal_and_the_sign_of_the_covariance():
    spread = spread_of(MATRIX, RANDOM.normal(size=8), False, 0.0)
    assert np.diag(spread.correlations).tolist() == [1.0, 1.0]
    assert -1.0 < spread.correlations[0, 1] < -0.5 and spread.covariance[0, 1] < 0.0


def test_intervals_are_never_narrower_than_the_numerical_noise_of_runs_makes_them():
    exact, rough = (spread_of(MATRIX, np.zeros(8), False, noise) for noise in (0.0, 0.5))
    assert exact.deviations.tolist() == [0.0, 0.0]
    assert rough.deviations == pytest.approx(0.5 * spread_of(MATRIX, np.zeros(8), True, 0.0).deviations)


@pytest.mark.parametrize("known", [True, False])
def test_intervals_of_a_linear_model_cover_the_truth_as_often_as_they_say(known):
    covered = []
    for _ in range(4000):
        values = RANDOM.normal(size=8)
        found = np.linalg.lstsq(MATRIX, values, rcond=None)[0]
        spread = spread_of(MATRIX, values - MATRIX @ found, known, 0.0)
        covered.append(np.abs(found) <= spread.wide * spread.deviations)
    assert np.mean(covered, axis=0) == pytest.approx([0.95, 0.95], abs=4.0 * np.sqrt(0.95 * 0.05 / 4000))

"""Twelve fits of the study of coverage; `python tests/benchmarks/fit_coverage.py` makes its 500."""

import numpy as np
import pytest
from benchmarks.fit_coverage import SEED, TRUTH, study
from scipy import stats

FITS = 12
BY_CHANCE = 1e-3
"""Probability of a result outside of the limits if intervals are right; the noise is the same each time."""


@pytest.mark.verify
@pytest.mark.timeout(1200)
def test_intervals_of_twelve_fits_cover_the_truth_and_are_as_wide_as_fits_scatter():
    found = study(FITS, SEED + 1)
    assert np.isfinite(found.values).all()
    fewest = stats.binom.ppf(BY_CHANCE, FITS, 0.95)
    assert (found.covered.sum(axis=0) >= fewest).all()
    # that they are not too wide is told by the scatter of the values, which is that of normal numbers
    freedom = FITS - 1
    limits = np.sqrt(stats.chi2.ppf([BY_CHANCE, 1.0 - BY_CHANCE], freedom) / freedom)
    halves = np.ptp(found.intervals, axis=2).mean(axis=0) / 2.0
    expected = halves / stats.t.ppf(0.975, 2 * 8 - len(TRUTH))
    scatter = found.values.std(axis=0, ddof=1)
    assert ((scatter > limits[0] * expected) & (scatter < limits[1] * expected)).all()
    assert np.abs(found.values.mean(axis=0) - 1.0).max() < 4.0 * expected.max() / np.sqrt(FITS)

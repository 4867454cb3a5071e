"""What the data can tell apart, by Jacobians of which that is known."""

import pickle

import numpy as np
import pytest

from bilayer_core.errors import InputError
from bilayer_core.studies.fitting.identify import (
    NotIdentifiable,
    refuse_undetermined,
    refuse_unseen,
    refuse_without_influence,
)
from bilayer_core.studies.fitting.intervals import spread_of
from bilayer_core.studies.fitting.parameters import Parameter

RANDOM = np.random.default_rng(3)
COLUMNS = RANDOM.normal(size=(30, 4))


def parameters(count, low=1.0, high=3.0):
    return [Parameter(f"p{k}", low, high, 2.0, logarithmic=False) for k in range(count)]


def named(matrix, errors, count, **bounds):
    with pytest.raises(NotIdentifiable) as refused:
        refuse_unseen(parameters(count, **bounds), np.full(count, 0.5), matrix, errors, "at the start")
    return [direction.changes for direction in refused.value.directions], str(refused.value)


def test_independent_columns_are_told_apart():
    assert refuse_unseen(parameters(4), np.full(4, 0.5), COLUMNS, np.full(4, 1e-3), "at the start") is None


@pytest.mark.parametrize("power", [1.0, 3.0, -0.5])
def test_a_pair_whose_product_alone_acts_is_named_with_its_power(power):
    matrix = np.stack([COLUMNS[:, 0], power * COLUMNS[:, 0], COLUMNS[:, 1]], axis=1)
    (changes,), text = named(matrix + 1e-6 * RANDOM.normal(size=matrix.shape), np.full(3, 1e-5), 3)
    assert list(changes) == ["p0", "p1"]
    assert changes["p1"] == pytest.approx(-1.0 / power, rel=1e-3)
    assert f"p0 and p1: the data tell only p0 · p1^{power:.3g}" in text


def test_three_that_change_together_are_named_with_their_parts():
    matrix = np.stack([COLUMNS[:, 0], COLUMNS[:, 1], COLUMNS[:, 0] + 2.0 * COLUMNS[:, 1], COLUMNS[:, 2]], axis=1)
    (changes,), text = named(matrix, np.full(4, 1e-8), 4)
    assert changes == pytest.approx({"p0": 1.0, "p1": 2.0, "p2": -1.0})
    assert "p0 by +1 %, p1 by +2 %, p2 by -1 %" in text


def test_two_pairs_are_named_as_two_pairs():
    matrix = np.stack([COLUMNS[:, 0], COLUMNS[:, 0], COLUMNS[:, 1], 2.0 * COLUMNS[:, 1]], axis=1)
    found, _ = named(matrix, np.full(4, 1e-8), 4)
    assert sorted(tuple(changes) for changes in found) == [("p0", "p1"), ("p2", "p3")]


def test_fewer_values_than_parameters_leave_directions_that_are_named():
    (changes,), _ = named(COLUMNS[:3], np.full(4, 1e-8), 4)
    assert set(changes) == {"p0", "p1", "p2", "p3"}


def test_a_direction_is_seen_from_four_times_its_error_on():
    weak = COLUMNS.copy()
    weak[:, 2] *= 1e-4
    size = np.linalg.svd(weak, compute_uv=False)[-1]
    errors = np.array([1e-12, 1e-12, size / 6.0, 1e-12])
    refuse_unseen(parameters(4), np.full(4, 0.5), weak, errors, "at the start")
    (changes,), text = named(weak, 3.0 * errors, 4)
    assert list(changes) == ["p2"] and "p2: the data tell nothing of it" in text


def test_parameters_of_which_one_is_zero_are_told_by_their_changes():
    matrix = np.stack([COLUMNS[:, 0], COLUMNS[:, 0]], axis=1)
    (changes,), text = named(matrix, np.full(2, 1e-8), 2, low=-1.0, high=1.0)
    assert changes == {"p0": 1.0, "p1": pytest.approx(-1.0)}
    assert "change together, p0 by +1, p1 by -1" in text


def test_a_parameter_on_which_nothing_depends_is_bad_input():
    matrix = COLUMNS.copy()
    matrix[:, 1] = 1e-13
    with pytest.raises(InputError, match="parameter p1: has no influence on any value of the data"):
        refuse_without_influence(parameters(4), matrix)
    refuse_without_influence(parameters(4), COLUMNS)


@pytest.mark.parametrize("noise,refused", [(0.05, False), (1.0, True)])
def test_a_direction_whose_interval_is_as_wide_as_the_bounds_is_named(noise, refused):
    matrix = np.stack([COLUMNS[:, 0], COLUMNS[:, 0] + 0.1 * COLUMNS[:, 1]], axis=1)
    spread = spread_of(matrix, noise * RANDOM.normal(size=30), False, 0.0)
    given = parameters(2), np.full(2, 0.5), spread.covariance, spread.wide, "at the solution"
    if not refused:
        refuse_undetermined(*given)
        return
    with pytest.raises(NotIdentifiable, match="intervals would be wider than their bounds") as found:
        refuse_undetermined(*given)
    assert found.value.exit_code == 1 and list(found.value.directions[0].changes) == ["p0", "p1"]


def test_the_error_goes_between_processes_whole():
    with pytest.raises(NotIdentifiable) as found:
        refuse_unseen(parameters(2), np.full(2, 0.5), COLUMNS[:, [0, 0]], np.full(2, 1e-8), "at the start", "; note")
    again = pickle.loads(pickle.dumps(found.value))
    assert str(again) == str(found.value) and again.directions == found.value.directions

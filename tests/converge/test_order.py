"""Observed orders and error bars, on sequences whose limit is known."""

import math

import pytest

from bilayer_core.studies.converge.order import SAFETY_WITH_ORDER, SAFETY_WITHOUT, estimate, observed_order


@pytest.mark.parametrize("order", [1.0, 1.7, 2.0, 4.0])
@pytest.mark.parametrize("sizes", [(2.0, 1.0, 0.5), (1 / 24, 1 / 49, 1 / 98)])
def test_the_order_of_a_power_law_is_found_and_its_error_bar_holds_the_limit(order, sizes):
    values = tuple(3.0 - 0.2 * size**order for size in sizes)
    found = estimate(sizes, values)
    assert found.order == pytest.approx(order, abs=1e-6)
    assert found.bar == pytest.approx(SAFETY_WITH_ORDER * 0.2 * sizes[1] ** order)


@pytest.mark.parametrize(
    "values",
    [(1.0, 2.0, 1.5), (1.0, 1.0, 1.0), (1.0, 1.1, 1.5), (0.0, 1.0, 1.0 + 1e-12)],
    ids=["oscillating", "equal", "diverging", "rounding"],
)
def test_no_order_is_claimed_for_values_off_a_power_law(values):
    assert observed_order((2.0, 1.0, 0.5), values) is None


def test_without_an_order_the_error_bar_is_that_of_order_one_three_times():
    found = estimate((None, 1.0, 0.5), (None, 2.0, 1.9))
    assert found.order is None
    assert found.change == pytest.approx(-0.05)
    assert found.bar == pytest.approx(SAFETY_WITHOUT * 0.2)


def test_a_figure_that_leaves_zero_has_changed_infinitely():
    assert math.isinf(estimate((2.0, 1.0, 0.5), (0.0, 0.0, 1e-3)).change)

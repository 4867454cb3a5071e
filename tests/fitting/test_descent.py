"""Descents to the least sum of squares, of functions that are known."""

import numpy as np
import pytest

from bilayer_core.studies.fitting.descent import descend


def valley(u):
    """Rosenbrock's residuals, with the solution at a half of both ways."""
    x, y = 4.0 * u - 1.0
    return np.array([10.0 * (y - x**2), 1.0 - x])


def slopes_of_valley(u):
    return 4.0 * np.array([[-20.0 * (4.0 * u[0] - 1.0), 10.0], [-1.0, 0.0]])


@pytest.mark.parametrize("start", [(0.05, 0.5), (0.0, 1.0), (1.0, 0.0), (0.9, 0.1)])
def test_the_end_of_a_curved_valley_is_found_from_afar_and_from_bounds(start):
    found = descend(valley, slopes_of_valley, np.array(start), 1e-6)
    assert found.converged
    assert found.parts == pytest.approx([0.5, 0.5], abs=1e-8)


def test_a_solution_beyond_a_bound_leaves_the_other_parameter_best_there():
    matrix = np.array([[1.0, 1.0], [0.0, 1.0], [1.0, -1.0]])
    found = descend(lambda u: matrix @ u - [3.0, 0.5, 1.5], lambda u: matrix, np.array([0.2, 0.9]), None)
    free = np.linalg.lstsq(matrix[:, 1:], np.array([2.0, 0.5, 0.5]), rcond=None)[0]
    assert found.parts == pytest.approx([1.0, free[0]], abs=1e-9)


def test_where_there_are_no_residuals_steps_get_shorter():
    def residuals(u):
        return np.array([np.inf]) if u[0] > 0.6 else np.array([u[0] ** 2 - 0.25])

    found = descend(residuals, lambda u: 2.0 * u[None], np.array([0.01]), 1.0e-9)
    assert found.parts == pytest.approx([0.5], abs=1e-9)

"""Dense systems of the border."""

import numpy as np
import pytest

from bilayer_core.engine.linear import dense
from bilayer_core.jit import piece, record
from bilayer_core.jit.record import Matrix


@record
class Square:
    matrix: Matrix


@piece(int, Square, int)
def count_for_a_test(square, n):
    return dense.count_negative_dense(square.matrix, n)


def count_negative_dense(matrix, n):
    """The count by compiled code, which is kept for the next run of this test."""
    return count_for_a_test(Square(matrix=matrix), n)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("n", [1, 2, 3, 7, 24])
def test_negative_eigenvalues_are_counted(n, seed):
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((n + 2, n + 2))  # with room that is not in use
    matrix += matrix.T
    expected = np.count_nonzero(np.linalg.eigvalsh(matrix[:n, :n]) < 0.0)
    assert count_negative_dense(matrix, n) == expected


def test_eigenvalues_of_a_matrix_without_a_diagonal_come_in_pairs():
    assert count_negative_dense(np.array([[0.0, 2.0], [2.0, 0.0]]), 2) == 1
    assert count_negative_dense(np.kron(np.eye(3), [[0.0, 1.0], [1.0, 0.0]]), 6) == 3


def test_eigenvalues_that_are_zero_are_not_negative():
    vector = np.arange(1.0, 5.0)
    assert count_negative_dense(np.outer(vector, vector), 4) == 0
    assert count_negative_dense(-np.outer(vector, vector), 4) == 1
    assert count_negative_dense(np.zeros((3, 3)), 3) == 0


def test_a_matrix_that_is_not_finite_has_no_count():
    matrix = np.eye(3)
    matrix[2, 0] = np.nan
    assert count_negative_dense(matrix, 3) == -1

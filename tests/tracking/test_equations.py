"""Small equations written out: what numpy finds, and nothing where there is nothing to find."""

import numpy as np
import pytest

from towval.tracking.equations import inverse_of, product_of, root_of, solved


def positive(n, seed):
    """A symmetric positive definite matrix (n, n) whose units differ by a million from row to row, and its scales."""
    rng = np.random.default_rng(seed)
    scales = 10.0 ** rng.uniform(-3, 3, n)
    rows = rng.normal(size=(4 * n, n)) * scales
    return rows.T @ rows, scales


@pytest.mark.parametrize("n", [1, 3, 5, 9])
def test_roots_solutions_and_inverses_are_those_of_numpy(n):
    matrix, scales = positive(n, seed=n)
    root, right = root_of(matrix), np.random.default_rng(n).normal(size=n) * scales
    np.testing.assert_allclose(root, np.linalg.cholesky(matrix), rtol=1e-9, atol=1e-12 * scales.min())
    np.testing.assert_allclose(solved(root, right) * scales, np.linalg.solve(matrix, right) * scales, rtol=1e-9)
    unit = np.outer(scales, scales)
    np.testing.assert_allclose(inverse_of(root) * unit, np.linalg.inv(matrix) * unit, rtol=1e-9, atol=1e-12)


def test_products_are_those_of_numpy():
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(4, 3)), rng.normal(size=(3, 5))
    np.testing.assert_allclose(product_of(one, other), one @ other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("matrix", [np.diag([1.0, -1.0]), np.array([[1.0, 2.0], [2.0, 1.0]]), np.zeros((2, 2))])
def test_what_is_not_positive_definite_has_no_solution(matrix):
    assert not np.isfinite(solved(root_of(matrix), np.ones(2))).all()

"""Small symmetric positive definite equations inside compiled loops.

Written out they compile in a tenth of the time of calls of LAPACK, which a first run and every worker would wait for.
"""

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled


@compiled()
def root_of(matrix: Array) -> Array:
    """Cholesky's root L (n, n), lower, of a matrix (n, n) = L Lᵀ; NaN where it is not positive definite."""
    n = matrix.shape[0]
    root = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            left = matrix[i, j]
            for k in range(j):
                left -= root[i, k] * root[j, k]
            root[i, j] = np.sqrt(left) if i == j else left / root[j, j]
    return root


@compiled()
def solved(root: Array, right: Array) -> Array:
    """Solution (n,) of L Lᵀ x = ``right`` (n,) for a root L of :func:`root_of`."""
    n = root.shape[0]
    x = right.copy()
    for i in range(n):
        for k in range(i):
            x[i] -= root[i, k] * x[k]
        x[i] /= root[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= root[k, i] * x[k]
        x[i] /= root[i, i]
    return x


@compiled()
def inverse_of(root: Array) -> Array:
    """Inverse (n, n) of L Lᵀ for a root L of :func:`root_of`."""
    n = root.shape[0]
    inverse = np.empty((n, n))
    unit = np.zeros(n)
    for j in range(n):
        unit[j] = 1.0
        column = solved(root, unit)
        for i in range(n):
            inverse[i, j] = column[i]
        unit[j] = 0.0
    return inverse


@compiled()
def product_of(one: Array, other: Array) -> Array:
    """Matrix product (n, m) of two matrices (n, k) and (k, m)."""
    product = np.zeros((one.shape[0], other.shape[1]))
    for i in range(one.shape[0]):
        for k in range(one.shape[1]):
            for j in range(other.shape[1]):
                product[i, j] += one[i, k] * other[k, j]
    return product

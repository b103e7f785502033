"""Shares of an error's variance by input: first-order Sobol indices."""

import numpy as np
from scipy.linalg import lstsq

from towval.model import Array
from towval.model.results import UNEXPLAINED


def variance_shares(draws: Array, outputs: Array, inputs: dict[str, int]) -> dict[str, float]:
    """Shares of the outputs' variance that each input explains on its own: first-order Sobol indices.

    The outputs are regressed on Hermite polynomials of degree one and two of each draw, which are orthonormal for
    standard normal draws, so that a squared coefficient is a share of variance (Sudret 2008); indices of many outputs
    are weighted by their variances (Lamboni, Monod and Makowski 2011). The contribution of the regression's own noise
    to a squared coefficient, which grows as the coefficients become as many as the draws, is subtracted. The rest,
    "noise and interactions", is what no input explains alone; without more draws than coefficients it is all.

    ``draws`` (k, d) are standard normal numbers, ``outputs`` (k, m) their results, ``inputs`` the number of columns of
    ``draws`` by the name of the input. The shares by name, "noise and interactions" last, sum to one if anything
    varies.
    """
    k, d = draws.shape
    outputs = outputs - outputs.mean(axis=0)
    basis = np.concatenate([np.ones((k, 1)), draws, (draws**2 - 1) / np.sqrt(2)], axis=1)
    if k <= basis.shape[1]:
        return {**dict.fromkeys(inputs, 0.0), UNEXPLAINED: float(outputs.any())}
    coefficients, *_ = lstsq(basis, outputs, lapack_driver="gelsy")
    residual = float(np.sum((outputs - basis @ coefficients) ** 2)) / (k - basis.shape[1])
    noise = residual * np.diag(np.linalg.inv(basis.T @ basis))[1:]
    power = np.sum(coefficients[1:] ** 2, axis=1) - noise
    by_column = power[:d] + power[d:]
    starts = np.cumsum([0, *inputs.values()])[:-1]
    parts = [max(0.0, float(by_column[i : i + width].sum())) for i, width in zip(starts, inputs.values(), strict=True)]
    total = sum(parts) + residual
    if total == 0:
        return dict.fromkeys([*inputs, UNEXPLAINED], 0.0)
    return dict(zip([*inputs, UNEXPLAINED], [part / total for part in (*parts, residual)], strict=True))

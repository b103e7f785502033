"""Identification of one parameter from a profile of errors: value, deviation by resampling pushes, cross-validation.

The profile is (parameters, pushes); pushes are what is resampled, so no assumption on the errors' distribution enters,
and what is common to all pushes of a log (feet, height) does not show: only the scatter between logs does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from towval.model import Array


@dataclass(frozen=True)
class Identified:
    """``value`` with the deviations of jackknife and bootstrap, and the bootstrap's 95 % interval (2,)."""

    value: float
    jackknife_std: float
    bootstrap_std: float
    interval: tuple[float, float]
    at_bound: bool


def minimiser(grid: Array, profile: Array) -> float:
    """Where a profile (g,) over an increasing grid is least, by the parabola through the least three."""
    i = int(np.argmin(profile))
    if i in (0, len(grid) - 1):
        return float(grid[i])
    a, b, _ = np.polyfit(grid[i - 1 : i + 2] - grid[i], profile[i - 1 : i + 2], 2)
    step = -b / (2 * a) if a > 0 else 0.0
    return float(grid[i] + np.clip(step, grid[i - 1] - grid[i], grid[i + 1] - grid[i]))


def identified(grid: Array, errors: Array, seed: int = 2026, draws: int = 2000) -> Identified:
    """The parameter with the least mean error of a profile (g, n)."""
    n = errors.shape[1]
    value = minimiser(grid, errors.mean(axis=1))
    total = errors.sum(axis=1)
    left_out = np.array([minimiser(grid, (total - errors[:, i]) / (n - 1)) for i in range(n)])
    weights = np.random.default_rng(seed).multinomial(n, np.full(n, 1 / n), size=draws)
    drawn = np.array([minimiser(grid, profile) for profile in weights @ errors.T / n])
    low, high = np.quantile(drawn, [0.025, 0.975])
    return Identified(
        value,
        float(np.sqrt((n - 1) / n * ((left_out - left_out.mean()) ** 2).sum())),
        float(drawn.std(ddof=1)),
        (float(low), float(high)),
        bool(np.isin(value, (grid[0], grid[-1]))),
    )


def cross_validated(grid: Array, errors: Array, judged: Array, folds: int = 10, seed: int = 2026) -> Array:
    """Errors (n,) of each push at the parameter, of the grid, that the other folds' ``errors`` choose."""
    n = errors.shape[1]
    fold = np.random.default_rng(seed).permutation(n) % folds
    out = np.empty(n)
    for k in range(folds):
        best = int(np.argmin(errors[:, fold != k].mean(axis=1)))
        out[fold == k] = judged[best, fold == k]
    return out


def between_groups(values: Array, stds: Array) -> tuple[float, float, float]:
    """Mean, its deviation, and the scatter between groups beyond their own deviations (DerSimonian and Laird 1986)."""
    w = 1 / stds**2
    q = float((w * (values - (w @ values) / w.sum()) ** 2).sum())
    tau2 = max(0.0, (q - (len(values) - 1)) / (w.sum() - (w**2).sum() / w.sum()))
    w = 1 / (stds**2 + tau2)
    return float(w @ values / w.sum()), float(w.sum() ** -0.5), float(np.sqrt(tau2))

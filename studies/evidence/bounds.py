"""Check of the bounds of an error and of the test of a right model: how often they hold on fresh noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced, result_of
from towval.model import Array
from towval.validation import statistics
from towval.validation.statistics import RightModel, error_sizes

_TIMES, _DRAWS, _TRUTHS = 96, 400, 300
_CONFIDENCE = 0.95
_MM = 1e-3
_TIME = np.linspace(0, 1, _TIMES)
_EFFECTS = np.stack(
    [
        np.column_stack([np.ones(_TIMES), 0 * _TIME, 0 * _TIME]),
        np.column_stack([0 * _TIME, _TIME, _TIME]),
        np.column_stack([np.sin(6 * _TIME), _TIME**2, 0 * _TIME]),
    ]
)


def _noise(rng: np.random.Generator, count: int) -> Array:
    """A constant of each draw, and noise of frames."""
    return _MM * (0.3 * rng.standard_normal((count, 1, 3)) + 0.03 * rng.standard_normal((count, _TIMES, 3)))


def _covered(size: float, shared: bool) -> Array:
    """Shares (2, 6) of truths that upper and lower bounds of the sizes hold, for a truth of that size."""
    rng = np.random.default_rng(4)
    shape = _MM * size * np.column_stack([np.sin(5 * _TIME), _TIME, 0.5 * _TIME])
    draws, held = _noise(rng, _DRAWS), []
    for off in _noise(rng, _TRUTHS):
        error, truth = (shape, shape + off) if shared else (shape - off, shape)
        low, high = statistics.bounds(error, draws, _CONFIDENCE)
        held.append([high >= error_sizes(truth), low <= error_sizes(truth)])
    return np.asarray(100 * np.mean(held, axis=0))


def _alarms() -> float:
    """How often errors that the draws have not seen are rejected [%], over twelve sets of 256 draws."""
    fresh = _errors(4000, 99)[0]
    rejected = [RightModel.of(*_errors(256, seed), 0.99).rejects(-fresh).mean() for seed in range(12)]
    return 100 * float(np.mean(rejected))


def _errors(count: int, seed: int) -> tuple[Array, Array]:
    """Errors of three inputs, the last of which cannot be below zero, and of noise; and the inputs."""
    rng = np.random.default_rng(seed)
    inputs = rng.standard_normal((count, 3))
    acting = np.column_stack([inputs[:, :2], np.abs(inputs[:, 2])])
    wander = 0.2 * rng.standard_normal((count, 12, 3)).repeat(_TIMES // 12, axis=1)
    return _MM * (np.einsum("kj,jnc->knc", acting, _EFFECTS) + wander), inputs


def _bounds() -> Values:
    found: dict[str, float] = {}
    for name, shared in (("noise that both share", True), ("noise of the measurement alone", False)):
        held = np.array([_covered(size, shared) for size in (0.3, 1.0, 4.0)])
        found |= {f"{name}: upper bound of RMS and largest error holds, least": float(held[:, 0, :2].min())}
        found |= {f"{name}: upper bound of RMS and largest error holds, most": float(held[:, 0, :2].max())}
        found |= {f"{name}: lower bound of RMS and largest error holds, least": float(held[:, 1, :2].min())}
    return found | {"a right model is rejected": _alarms()}


def _half_way_up(found: Array) -> Array:
    """Lower bounds half-way to the upper ones."""
    low, high = found
    return np.array([(low + high) / 2, high])


def _lower_limits(original: Callable[..., Any]) -> Callable[..., Any]:
    def of(*given: Any) -> RightModel:
        right: RightModel = original(*given)
        return replace(right, limits=0.9 * right.limits)

    return of


BOUNDS = Check(
    _bounds,
    {
        "upper bounds are a tenth too small": replaced(
            statistics, "bounds", result_of(lambda found: found * [[1.0], [0.9]])
        ),
        "upper bounds are a tenth too large": replaced(
            statistics, "bounds", result_of(lambda found: found * [[1.0], [1.1]])
        ),
        "lower bounds are half-way to the upper ones": replaced(statistics, "bounds", result_of(_half_way_up)),
        "a right model's limits are a tenth too low": replaced(RightModel, "of", _lower_limits),
    },
)

"""Whether a difference of simulation and measurement came about while the object was out of sight."""

import numpy as np

from towval.model import Array, Finding, SimulatedMotion, Track
from towval.model.findings import finding
from towval.model.statement import Draws
from towval.validation.path_frame import PathFrame
from towval.validation.statistics import upper_limit

_SHARE = 0.5
"""Of the largest error, by which it changes while the object is out of sight: most of it then came about there."""


def changes_unseen(measured: Track, simulated: SimulatedMotion, draws: Draws, confidence: float) -> list[Finding]:
    """A finding where most of the error comes about while the object is out of sight, more than a right model's would.

    ``confidence`` is that with which no such change of a right model, of which there are draws, is as large. Whether
    somebody moved the object there or the model is wrong, nothing tells.
    """
    frame = PathFrame(measured, simulated.time_s[draws.rows])
    rows, time_s = frame.rows[frame.seen], simulated.time_s[draws.rows][frame.seen]
    unseen = np.concatenate([[0], np.cumsum(~measured.seen)])[rows]
    before = np.flatnonzero(np.diff(unseen) > 0)
    if not len(before):
        return []
    error, drawn = frame.error(simulated.pose[draws.rows])[frame.seen], draws.error[:, frame.seen]
    change, right = _size(error[before + 1] - error[before]), _size(drawn[:, before + 1] - drawn[:, before])
    usual = np.maximum(np.sqrt(np.mean(right**2, axis=0)), np.finfo(float).tiny)
    limit = upper_limit((right / usual).max(axis=(1, 2)), confidence)
    large = (change > limit * usual) & (change >= _SHARE * _size(error).max(axis=0))
    if not large.any():
        return []
    at = int(np.argmax(np.where(large, change / usual, 0.0).max(axis=1)))
    return [
        finding(
            "changed_unseen", first_s=time_s[before[at]], last_s=time_s[before[at] + 1], moved_mm=1e3 * change[at, 0],
            turned_deg=float(np.degrees(change[at, 1])),
        )
    ]  # fmt: skip


def _size(error: Array) -> Array:
    """Distances [m] and turns [rad] (..., 2) of errors (..., 3)."""
    return np.stack([np.hypot(error[..., 0], error[..., 1]), np.abs(error[..., 2])], axis=-1)

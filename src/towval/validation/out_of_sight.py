"""Whether a difference of simulation and measurement came about while the object was out of sight."""

import numpy as np

from towval.model import Array, Finding, SimulatedMotion, Track
from towval.model.findings import finding
from towval.model.statement import Draws
from towval.validation.path_frame import PathFrame

_SHARE = 0.5
"""Of the largest error, by which it changes while the object is out of sight: most of it then came about there."""

_DEVIATIONS = 3.0
"""Of such a change of a right model, which the draws have, beyond which it is none of a right model."""


def changes_unseen(measured: Track, simulated: SimulatedMotion, draws: Draws) -> list[Finding]:
    """A finding where most of the error comes about while the object is out of sight, more than a right model's would.

    Whether somebody moved it there or the model is wrong, nothing tells.
    """
    frame = PathFrame(measured, simulated.time_s[draws.rows])
    rows, time_s = frame.rows[frame.seen], simulated.time_s[draws.rows][frame.seen]
    unseen = np.concatenate([[0], np.cumsum(~measured.seen)])[rows]
    before = np.flatnonzero(np.diff(unseen) > 0)
    if not len(before):
        return []
    error, drawn = frame.error(simulated.pose[draws.rows])[frame.seen], draws.error[:, frame.seen]
    change = error[before + 1] - error[before]
    usual = np.sqrt(np.mean((drawn[:, before + 1] - drawn[:, before]) ** 2, axis=0))
    large = _size(change) >= np.maximum(_SHARE * _size(error).max(axis=0), _DEVIATIONS * _size(usual))
    if not large.any():
        return []
    worst = int(np.argmax(large.any(axis=1) * _size(change)[:, 0]))
    at, moved = before[worst], change[worst]
    return [
        finding(
            "changed_unseen", first_s=time_s[at], last_s=time_s[at + 1], moved_mm=1e3 * float(np.hypot(*moved[:2])),
            turned_deg=float(np.degrees(abs(moved[2]))),
        )
    ]  # fmt: skip


def _size(error: Array) -> Array:
    """Distances [m] and turns [rad] (..., 2) of errors (..., 3)."""
    return np.stack([np.hypot(error[..., 0], error[..., 1]), np.abs(error[..., 2])], axis=-1)

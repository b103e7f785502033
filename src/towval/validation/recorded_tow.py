"""A tow behind a recorded rover: where its object starts, and where the recording leaves its hinge unknown."""

import numpy as np

from towval.model import Array, Finding, FrictionSpecification, Ground, Tether, TimedPath, TowedObject
from towval.model.errors import RefusedError
from towval.model.findings import finding
from towval.model.geometry import transform
from towval.physics.splines import spline_through, spline_values
from towval.physics.tether import nearest_rest
from towval.validation.decimate import HIDDEN_M, missed_m
from towval.validation.simulate import WRONG_SHARE, nearer_findings


def gap_findings(times: Array, hinge: Array) -> list[Finding]:
    """A finding where the hinge (n, 2) [m] may have moved otherwise than its curve between two times (n,) [s]."""
    spline = spline_through(TimedPath(times, hinge))
    steps, found = np.diff(times), []
    for k in np.flatnonzero(spline.speed_limits * steps > HIDDEN_M):
        within = np.linspace(0.0, steps[k], 101)
        speed = np.hypot(*spline_values(spline, times[k] + within)[1].T)
        found.append((missed_m(within, speed), k))
    off_m, worst = max(found, default=(0.0, 0))
    if off_m <= HIDDEN_M:
        return []
    return [finding("tow_gap", time_s=times[worst], gap_s=steps[worst], off_mm=1000 * off_m)]


def start_at_rest(
    towed: TowedObject,
    friction: FrictionSpecification,
    tether: Tether,
    ground: Ground,
    hinge_height: float,
    hinge: Array,
    measured: Array,
) -> tuple[Array, list[Finding]]:
    """The pose (3,) [m, m, rad] from which the object starts at rest, and what is to be said of it.

    ``hinge`` (2,) [m] and ``measured`` (3,) are those of the recording. Raises `RefusedError` where the tether of the
    scene does not reach by more than lengths can be wrong by.
    """
    start = nearest_rest(towed, friction, tether, ground, hinge_height, hinge, measured)
    nearer_m = float(np.hypot(*(start - measured)[:2]))
    if nearer_m > WRONG_SHARE * tether.rest_length:
        apart_m = float(np.hypot(*(hinge - transform(measured, towed.anchor))))
        raise RefusedError(
            "the tether does not reach where the recording begins",
            got=f"hinge and anchor {apart_m:.2f} m apart",
            allowed=f"{apart_m - nearer_m:.2f} m, where friction holds the object at rest",
            remedy="give the campaign or scene of the recording; check rest length, hinge and anchor",
        )
    return start, nearer_findings(nearer_m)

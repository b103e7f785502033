"""A tow behind a recorded rover: its motion, its start, and where the recording leaves the hinge unknown."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from towval.model import (
    Array,
    Finding,
    FrictionSpecification,
    Ground,
    SimulatedMotion,
    Sliding,
    Tether,
    TimedPath,
    TowedObject,
)
from towval.model.errors import RefusedError
from towval.model.findings import finding
from towval.model.geometry import transform
from towval.model.results import STICKING
from towval.physics.creep import creep_length
from towval.physics.dynamics import feedback
from towval.physics.friction_laws import FittedLaw, fitted_law
from towval.physics.spatial.tow import Sticking
from towval.physics.splines import spline_through, spline_values
from towval.physics.tether import nearest_rest
from towval.validation.bridges import HIDDEN_M, missed_m
from towval.validation.decimate import DecimateSettings
from towval.validation.scene_model import hold_at_rest, risen_friction
from towval.validation.simulate import (
    PARKED_CREEP_M,
    STANDING_M_PER_S,
    WRONG_SHARE,
    hanging_findings,
    law_findings,
    nearer_findings,
)


def recorded_tow(
    towed: TowedObject,
    friction: FrictionSpecification,
    tether: Tether,
    ground: Ground,
    hinge_height: float,
    path: TimedPath,
    start: Array,
) -> SimulatedMotion:
    """Motion of the object behind a recorded path of the hinge, from a pose (3,) [m, m, rad] at rest.

    As the stage simulate does by itself, an object below the friction limit stays at rest where it would otherwise
    creep by more than :data:`towval.validation.simulate.PARKED_CREEP_M` while the rover stands.
    """

    def motion(law: FittedLaw, sticking: Sticking | None = None) -> SimulatedMotion:
        sliding = Sliding(law.law, friction.across_over_along, friction.radius_over_planar)
        return feedback(
            towed, sliding, tether, path, start, path.time_s, ground=ground, hinge_height=hinge_height,
            sticking=sticking,
        )  # fmt: skip

    law = fitted_law(friction)
    found = motion(law)
    parked = standing(path.time_s, path.position)[: len(found.time_s)]
    still = replace(found, twist=np.where(parked[:, None], found.twist, 0.0))
    if creep_length(still, towed, friction.stiction_velocity) > PARKED_CREEP_M:
        law = risen_friction(friction)
        found = motion(law, hold_at_rest(friction))
        found = replace(found, statistics={**found.statistics, STICKING: 1.0})
    hanging = hanging_findings(tether, hinge_height, towed.anchor_height, ground, found)
    return replace(found, findings=(*found.findings, *law_findings(law), *hanging))


def standing(times: Array, hinge: Array) -> NDArray[np.bool_]:
    """Whether a recorded hinge (n, 2) [m] stands at its times (n,) [s].

    Poses are noisy, and from one to the next that is faster than a rover that stands: its place is the mean over a
    pause of the stage decimate, and its speed that from before a time to after it. At the ends it is the nearest known.
    """
    span_s = DecimateSettings().pause_s
    inner = (times >= times[0] + span_s) & (times <= times[-1] - span_s)
    if not inner.any():
        return np.zeros(len(times), dtype=bool)
    gone = cumulative_trapezoid(hinge, times, axis=0, initial=0)
    before, at, after = (
        np.column_stack([np.interp(times[inner] + shift, times, column) for column in gone.T])
        for shift in (-span_s, 0.0, span_s)
    )
    speed = np.hypot(*(after - 2 * at + before).T) / span_s**2
    return np.asarray(np.interp(times, times[inner], speed) < STANDING_M_PER_S)


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

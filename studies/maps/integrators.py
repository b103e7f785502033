"""Where integrators of the towed object are right: over stiffness, tolerance or time step, stiction velocity and start.

Each scene is a curved tow that stops halfway and backs up, so that the tether slackens and tightens. The reference is
:func:`studies.worlds.reference.towed_box`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studies.comparators.integrators import (
    RUNGE_KUTTA_4,
    SEMI_IMPLICIT_EULER,
    fixed_steps,
    poses_of,
    scipy_steps,
    state_at_rest,
    tethered_scene,
)
from studies.frame import Maps, Part, Row, Settings, Study, judged
from studies.worlds.reference import Box, towed_box
from towval.model import Array, FrictionLaw, Patch, Tether, TimedPath, TowedObject
from towval.physics.dynamics import Accuracy, Outcome, feedback
from towval.physics.friction_laws import Coulomb
from towval.validation.simulate import SimulateSettings

SIDE, MASS, CENTRE, INERTIA, FRICTION, REST_LENGTH = 0.4, 5.0, (0.03, 0.02), 0.15, 0.35, 0.6
CUBE = TowedObject(
    Patch(SIDE / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])),
    MASS,
    np.array(CENTRE),
    INERTIA,
    np.array([SIDE / 2, 0.0]),
)
STARTS = {"slack": -0.05, "taut": 0.01}
"""Stretch of the tether at the start [m]."""

ALLOWED_M = 1e-3
DURATION_S = 5.0
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
STEPS_S = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)

STIFFNESS, STICTION = 1e3, 1e-3
"""Of the scenes in which the other of the two varies [N/m, m/s]."""


def _advance(time_s: float | Array) -> float | Array:
    backing = np.where((time_s > 1.25) & (time_s < 3.75), np.sin(np.pi * (time_s - 1.25) / 2.5) ** 2, 0.0)
    return 0.08 * time_s - 0.11 * backing


def hinge_place(time_s: float | Array, stretch: float) -> Array:
    """Place (..., 2) of the hinge [m]."""
    advance = _advance(np.asarray(time_s))
    return np.stack([0.8 + stretch + advance, 0.3 * advance**2 + 0.05 * advance], axis=-1)


def integrator_rows(start: str, stiffness: float, stiction: float, over: str, methods: list[str]) -> list[Row]:
    """Cells of one scene: each method at each of its tolerances or steps.

    ``over`` is "stiffness" or "stiction", what x is on the maps.
    """
    times, stretch = np.linspace(0, DURATION_S, 51), STARTS[start]
    fine = np.linspace(0, DURATION_S, 2501)
    tether, law = Tether(REST_LENGTH, stiffness), Coulomb(FRICTION, stiction)
    # The spline through so many points is the hinge's path to 1e-9 m.
    hinge = TimedPath(fine, hinge_place(fine, stretch))
    box = Box((SIDE, SIDE), MASS, CENTRE, INERTIA, (SIDE / 2, 0.0), FRICTION, stiction)
    truth = towed_box(
        box,
        lambda t: hinge_place(t, stretch),
        (REST_LENGTH, stiffness),
        (0, 0, 0),
        times,
        panels=(8, 8),
        order=4,
        tolerance=1e-7,
        longest_step_s=0.05,
    )
    x = {"stiffness": stiffness, "stiction": stiction}[over]
    rows = []
    for method in methods:
        for setting, flags, poses in _tried(method, tether, law, hinge, times):
            gap = np.linalg.norm(poses[:, :2] - truth[: len(poses), :2], axis=1)
            error = float(gap.max()) if len(poses) == len(times) else np.nan
            name = f"{method}, over v_s" if over == "stiction" else f"{method}, {start}"
            rows.append({"map": name, "x": x, "y": setting} | judged(error, ALLOWED_M, flags))
    return rows


def _tried(
    method: str, tether: Tether, law: FrictionLaw, hinge: TimedPath, times: Array
) -> Iterator[tuple[float, list[str], Array]]:
    """Tolerance or step, what was flagged, and the poses that were reached."""
    scene, state = tethered_scene(CUBE, law, tether, hinge), state_at_rest(CUBE, (0, 0, 0))
    if method == "towval":
        for tolerance in TOLERANCES:
            yield tolerance, *_own(tether, law, hinge, times, tolerance)
    elif method in ("LSODA", "RK45"):
        for tolerance in TOLERANCES:
            success, states = scipy_steps(method, scene, state, times, tolerance)
            yield tolerance, [] if success else ["failed"], poses_of(CUBE, states)
    else:
        scheme = {"Runge-Kutta 4": RUNGE_KUTTA_4, "semi-implicit Euler": SEMI_IMPLICIT_EULER}[method]
        for step in STEPS_S:
            finite, states = fixed_steps(scheme, scene, state, times, step)
            yield step, [] if finite else ["not_finite"], poses_of(CUBE, states)


def _own(tether: Tether, law: FrictionLaw, hinge: TimedPath, times: Array, tolerance: float) -> tuple[list[str], Array]:
    """Our motion with the checks of the stage simulate: its outcome, and a run at a hundredth of the tolerance."""
    motion, finer = (
        feedback(CUBE, law, tether, hinge, (0, 0, 0), times, accuracy=Accuracy(each))
        for each in (tolerance, tolerance / 100)
    )
    if motion.outcome != Outcome.CONVERGED or finer.outcome != Outcome.CONVERGED:
        return [str(motion.outcome)], motion.pose
    u_num = float(np.linalg.norm(motion.pose[:, :2] - finer.pose[:, :2], axis=1).max())
    return (["numerical_error"] if u_num > ALLOWED_M else []), motion.pose


def _parts(settings: Settings) -> dict[str, Part]:
    methods = ["towval", "LSODA", "Runge-Kutta 4", "semi-implicit Euler"]
    stiffnesses = [1e2, 1e4] if settings.quick else [1e2, 1e3, 1e4, 1e5, 1e6]
    stictions = [1e-3] if settings.quick else [1e-2, 1e-3, 1e-4, 1e-5]
    parts: dict[str, Part] = {}
    for start in STARTS:
        for kappa in stiffnesses:
            scene = {"start": start, "stiffness": kappa, "stiction": STICTION, "over": "stiffness", "methods": methods}
            parts[f"{start}_stiffness_{kappa:.0e}".replace("+", "")] = scene
    for velocity in stictions:
        scene = {"start": "slack", "stiffness": STIFFNESS, "stiction": velocity, "over": "stiction", "methods": methods}
        parts[f"slack_stiction_{velocity:.0e}"] = scene
    return parts


_STIFFNESS, _STICTION = "stiffness κ [N/m]", "stiction velocity v_s [m/s]"
_TOLERANCE, _STEP = "relative tolerance", "time step [s]"
_OWN = tuple(f"towval, {start}" for start in STARTS)
_SETTING = {"towval": "tolerance [m]", "LSODA": _TOLERANCE, "Runge-Kutta 4": _STEP, "semi-implicit Euler": _STEP}

STUDY = Study(
    parts=_parts,
    rows=integrator_rows,
    chart=Maps(
        title="Integrators of the towed object",
        axes={f"{method}, {start}": (_STIFFNESS, setting) for start in STARTS for method, setting in _SETTING.items()}
        | {f"{method}, over v_s": (_STICTION, setting) for method, setting in _SETTING.items()},
        note="Right: within 1 mm of the reference at all times. Flagged: a named outcome other than converged, or the "
        "stage's own estimate of its error above 1 mm; for SciPy, no success; for fixed steps, values that are not "
        "finite.",
        take="Take the package's integrator at its default tolerance: it reports what it does not solve. Fixed "
        "steps and SciPy's LSODA can miss the reference without reporting it.",
        default={name: {"y": SimulateSettings().tolerance_m} for name in (*_OWN, "towval, over v_s")},
    ),
)

"""Stage simulate: the towed object as the model says it moves behind the measured rover (FBD, the paper's 2.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, DecimatedTrack, Finding, Severity, SimulatedMotion, TimedPath, TowingScene
from towval.model.errors import InputError, RefusedError
from towval.model.findings import finding
from towval.model.geometry import transform
from towval.physics.creep import creep_length
from towval.physics.dynamics import Accuracy, Outcome
from towval.physics.friction_laws import FittedLaw, fitted_law
from towval.physics.ladder import RUNGS, LadderChoice, choose_rung, simulate_rung
from towval.physics.mass import towed_object

_HINGE_SAMPLES_PER_FRAME = 2
_LAW_RESIDUAL = 1e-3
"""Largest misfit of the friction law to the wished coefficients that needs no word."""


@dataclass(frozen=True)
class SimulateSettings:
    """Keys of ``config["simulate"]``.

    ``rung`` of the ladder of models, one of :data:`towval.physics.ladder.RUNGS`, or "auto": the simplest whose path
    stays within ``rung_tolerance_m`` [m] of every fuller one's on this very run. ``tolerance_m`` is the error that the
    integrator accepts in one step [m].
    """

    rung: str = "auto"
    rung_tolerance_m: float = 5e-4
    tolerance_m: float = 1e-7

    def __post_init__(self) -> None:
        if self.rung not in ("auto", *RUNGS):
            raise InputError("simulate.rung is unknown", got=self.rung, allowed=", ".join(("auto", *RUNGS)))
        if not 1e-12 <= self.tolerance_m <= 1e-3:
            raise InputError("simulate.tolerance_m is out of range", got=self.tolerance_m, allowed="1e-12 to 1e-3 m")
        if not 1e-9 <= self.rung_tolerance_m <= 1:
            raise InputError(
                "simulate.rung_tolerance_m is out of range", got=self.rung_tolerance_m, allowed="1e-9 to 1 m"
            )


def hinge_path(rover: DecimatedTrack, hinge: Array, times: Array) -> TimedPath:
    """Way of the tether's hinge along the rover's smoothed track, at and between ``times`` (n,) [s]."""
    fine = np.linspace(0, len(times) - 1, _HINGE_SAMPLES_PER_FRAME * (len(times) - 1) + 1)
    dense = np.interp(fine, np.arange(len(times)), times)
    return TimedPath(dense, transform(rover.spline()(dense), hinge))


def simulate(
    scene: TowingScene,
    rover: DecimatedTrack,
    towed: DecimatedTrack,
    times: ArrayLike,
    settings: SimulateSettings | None = None,
) -> SimulatedMotion:
    """Simulate the towed object on the measured way of the rover.

    Parameters
    ----------
    scene : TowingScene
        What the model is told.
    rover, towed : DecimatedTrack
        Thinned tracks; of the object only the first pose is used.
    times : array_like (n,)
        Times of the output [s]; those outside the rover's track are left out.
    settings : SimulateSettings, optional
        Tolerance of the integration.

    Returns
    -------
    SimulatedMotion
        On the given times that both tracks allow. ``statistics["u_num_m"]`` is the largest shift of the path that a
        hundred times tighter tolerance and the full dynamics make.

    Raises
    ------
    RefusedError
        When the load's weight is outside the footprint, the tracks do not overlap, or the integration ends early.
    """
    settings = settings or SimulateSettings()
    begin, end = max(rover.time_s[0], towed.time_s[0]), rover.time_s[-1]
    times = np.asarray(times, dtype=np.float64)
    inside = times[(times >= begin) & (times <= end)]
    if len(inside) < 2:
        raise RefusedError(
            "the tracks of rover and object do not overlap",
            got=f"{begin} s to {end} s",
            remedy="look at the findings of the stage track",
        )
    target, law = towed_object(scene), fitted_law(scene.friction)
    hinge = hinge_path(rover, scene.hinge, inside)
    given = (target, law.law, scene.tether, hinge, towed.spline()(inside[0]), inside)
    choice = choose_rung(*given, settings.rung_tolerance_m, accuracy=Accuracy(settings.tolerance_m))
    rung = choice.rung if settings.rung == "auto" else settings.rung
    motion = _whole(simulate_rung(rung, *given, accuracy=Accuracy(settings.tolerance_m)), inside)
    finer = _whole(simulate_rung(rung, *given, accuracy=Accuracy(settings.tolerance_m / 100)), inside)
    u_num = float(np.linalg.norm(motion.pose[:, :2] - finer.pose[:, :2], axis=1).max())
    statistics = {
        **motion.statistics,
        "u_num_m": float(np.hypot(u_num, choice.to_dynamics_m.get(rung, 0.0))),
        **{f"{lower} to dynamics, m": distance for lower, distance in choice.to_dynamics_m.items()},
    }
    findings = (
        *motion.findings,
        _rung_finding(choice, rung),
        *_error_findings(u_num, creep_length(motion, target, scene.friction.stiction_velocity), settings),
        *_findings(scene, law, motion, hinge, times, inside),
    )
    return replace(motion, findings=findings, statistics=statistics)


def _whole(motion: SimulatedMotion, times: Array) -> SimulatedMotion:
    if len(motion.time_s) < len(times):
        raise RefusedError(
            f"the simulation ended early: {motion.outcome}",
            got=f"{motion.time_s[-1]:.2f} s of {times[-1]:.2f} s",
            remedy=motion.advice,
        )
    return motion


def _rung_finding(choice: LadderChoice, rung: str) -> Finding:
    """What this scene needed: the rung taken, and what the next simpler and the fullest would have changed."""
    place = RUNGS.index(rung)
    changes = [
        f"{lower} would move the path by up to {1000 * choice.to_dynamics_m[lower]:.2f} mm"
        for lower in RUNGS[:place][-1:]
    ]
    if rung in choice.to_dynamics_m:
        changes.append(f"the full dynamics would move it by up to {1000 * choice.to_dynamics_m[rung]:.2f} mm")
    severity = Severity.NOTE if RUNGS.index(choice.rung) <= place else Severity.WARNING
    return finding("rung", severity, rung=rung, changes=", ".join(changes), allowed_mm=1000 * choice.tolerance_m)


def _error_findings(u_num: float, crept: float, settings: SimulateSettings) -> list[Finding]:
    """Where the integrator's tolerance or the regularised law moves the path by more than a simpler model may."""
    findings = []
    if u_num > settings.rung_tolerance_m:
        findings.append(finding("numerical_error", u_num_mm=1000 * u_num, allowed_mm=1000 * settings.rung_tolerance_m))
    if crept > settings.rung_tolerance_m:
        findings.append(finding("creep", crept_mm=1000 * crept))
    return findings


def _findings(
    scene: TowingScene, law: FittedLaw, motion: SimulatedMotion, hinge: TimedPath, asked: Array, used: Array
) -> list[Finding]:
    findings = []
    if motion.outcome != Outcome.CONVERGED:
        findings.append(finding("simulate_outcome", outcome=motion.outcome, advice=motion.advice))
    if law.residual > _LAW_RESIDUAL:
        findings.append(finding("friction_law", residual=law.residual))
    if len(used) < len(asked):
        findings.append(finding("simulate_cut", count=len(asked) - len(used)))
    anchor = transform(motion.pose[0], scene.anchor)
    stretch = float(np.linalg.norm(hinge.position[0] - anchor)) - scene.tether.rest_length
    if stretch > 0.05 * scene.tether.rest_length:
        findings.append(finding("taut_start", stretch_mm=1000 * stretch))
    return findings

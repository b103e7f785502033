"""Stage simulate: the motion that the model predicts behind the measured rover (FBD, the paper's 2.3)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Body, DecimatedTrack, Finding, Ground, Severity, SimulatedMotion, Tether, TowingScene
from towval.model.checks import within
from towval.model.errors import InputError, RefusedError
from towval.model.findings import finding
from towval.model.results import START_OFF, STICKING, TO_DYNAMICS
from towval.physics.creep import creep_length
from towval.physics.dynamics import Outcome
from towval.physics.friction_laws import FittedLaw
from towval.physics.ladder import DYNAMICS, RUNGS, LadderChoice, lowest_rung, path_difference, rung_names
from towval.physics.splines import spline_values
from towval.physics.tether import lowest_point
from towval.physics.trailing import TRAILING_RUNGS
from towval.validation.across import tether_across
from towval.validation.hinge_trajectory import hinge_trajectory
from towval.validation.scene_model import SceneModel
from towval.validation.slack import moved_while_slack

PARKED_CREEP_M = 5e-3
"""Creep while the rover stands, above which sticking is simulated: on all runs of the samples it is below 3 mm."""

STANDING_M_PER_S = 1e-3
"""Speed of the hinge below which the rover stands."""

_START_S = 0.2
_START_OFF_M = 0.005
"""How far a start from rest may lead the path of an object off that was moving: a quarter of the default tolerance. The
comparison takes a quarter of the one that is stated where that is less."""

_NEARER_M, _MUCH_NEARER_M = 1e-4, 0.005
"""By how much nearer to the rover an object starts that rests by a stiff tether, from which on that is noted, and
warned of: rest length, hinge and anchor to 1 mm and two places to 1 mm are 2.2 mm in all."""

WRONG_SHARE = 0.05
"""The same as a share of the rest length, from which on the run is not judged: no tape is that wrong."""

_LAW_RESIDUAL = 1e-3
"""Relative misfit of the friction law to the stated coefficients above which a finding is raised."""


@dataclass(frozen=True)
class SimulateSettings:
    """Keys of ``config["simulate"]``.

    ``rung`` of the ladder of models, one of :data:`towval.physics.ladder.RUNGS`, or "auto": the simplest whose path
    stays within ``rung_tolerance_m`` [m] of every fuller one's on this run. ``tolerance_m`` is the error that the
    integrator accepts in one step [m]. ``sticking``: whether an object below the friction limit stays at rest, true or
    false, or "auto": where it would otherwise creep by more than 5 mm while the rover stands.
    """

    rung: str = "auto"
    rung_tolerance_m: float = 5e-4
    tolerance_m: float = 1e-7
    sticking: bool | str = "auto"

    def __post_init__(self) -> None:
        if self.sticking not in (True, False, "auto"):
            raise InputError("simulate.sticking is unknown", got=self.sticking, allowed="auto, true, false")
        if self.rung not in ("auto", *RUNGS):
            raise InputError("simulate.rung is unknown", got=self.rung, allowed=", ".join(("auto", *RUNGS)))
        within(self, "simulate", "m", tolerance_m=(1e-12, 1e-3), rung_tolerance_m=(1e-9, 1.0))


def simulate(
    scene: TowingScene,
    rover: DecimatedTrack,
    towed: DecimatedTrack,
    times: ArrayLike,
    settings: SimulateSettings | None = None,
    body: Body | None = None,
    seen: NDArray[np.bool_] | None = None,
) -> SimulatedMotion:
    """Simulate the towed object behind the measured rover.

    Of the object's decimated track only the beginning drives the simulation; the rest is examined for motion that the
    tether did not cause. The motion is given at those of the ``times`` (n,) [s] from when both tracks have begun to the
    end of the rover's. ``statistics["u_num_m"]`` is the root sum of squares of the largest shifts of the path by a
    hundred times tighter tolerance, ``statistics["u_tolerance_m"]``, and by the full dynamics. With the ``body`` of the
    object a tether that lies across it is reported. ``seen`` (n,): whether the object was seen at these times, at all
    of them if not given; between them its track is a guess. `RefusedError` where the load's weight is outside the
    footprint, the tracks do not overlap, or the integration ends early.
    """
    return RunSimulation(scene, rover, towed, times, body, seen).simulate(settings or SimulateSettings())


class RunSimulation:
    """One run, prepared once; each model is integrated only once per tolerance.

    Parameters and errors are those of :func:`simulate`.
    """

    def __init__(
        self,
        scene: TowingScene,
        rover: DecimatedTrack,
        towed: DecimatedTrack,
        times: ArrayLike,
        body: Body | None = None,
        seen: NDArray[np.bool_] | None = None,
    ):
        begin, end = max(rover.time_s[0], towed.time_s[0]), rover.time_s[-1]
        self.asked = np.asarray(times, dtype=np.float64)
        inside = (self.asked >= begin) & (self.asked <= end)
        self.times = self.asked[inside]
        if len(self.times) < 2:
            raise RefusedError(
                "the tracks of rover and object do not overlap",
                got=f"{begin} s to {end} s",
                remedy="look at the findings of the stage track",
            )
        self.scene, self.model, self.body = scene, SceneModel(scene), body
        self.towed = self.model.towed
        self.hinge = hinge_trajectory(rover, scene.hinge, self.times)
        self.unpulled = moved_while_slack(scene, rover, towed, self.asked[inside if seen is None else inside & seen])
        self.start_pose = towed.poses_at(self.times[0])
        self.start_twist = towed.poses_and_rates_at(self.times[0])[3:]
        self.start_speed = _speed_at_start(towed, self.times[0])
        self._motions: dict[tuple[bool, str, float], SimulatedMotion] = {}

    def motion(self, rung: str, tolerance_m: float) -> SimulatedMotion:
        """The motion by one rung of the ladder, as far as it goes."""
        # The trailing rungs have no tolerance.
        key = self.model.sticking, rung, 0.0 if rung in TRAILING_RUNGS else tolerance_m
        if key not in self._motions:
            self._motions[key] = self.model.motion(rung, self.hinge, self.start_pose, self.times, tolerance_m)
        return self._motions[key]

    def path_shift_m(self, rung: str, tolerance_m: float, finer_m: float) -> float:
        """Largest shift of the path by a finer tolerance [m]."""
        both = (_whole(self.motion(rung, tolerance), self.times) for tolerance in (tolerance_m, finer_m))
        path, finer = (motion.pose[:, :2] for motion in both)
        return float(np.linalg.norm(path - finer, axis=1).max())

    def simulate(self, settings: SimulateSettings) -> SimulatedMotion:
        """The motion with these settings, its numerical uncertainty and findings."""
        tolerance = settings.tolerance_m
        self._choose_sticking(settings.sticking, tolerance)
        choice = lowest_rung(self.towed, settings.rung_tolerance_m, lambda rung: self.motion(rung, tolerance))
        rung = choice.rung if settings.rung == "auto" else settings.rung
        motion, to_dynamics = _whole(self.motion(rung, tolerance), self.times), dict(choice.to_dynamics_m)
        if rung not in (DYNAMICS, *to_dynamics):
            to_dynamics[rung] = path_difference(self.towed, motion, self.motion(DYNAMICS, tolerance))
        u_num = self.path_shift_m(rung, tolerance, tolerance / 100)
        start_off_m = self.start_off_m(tolerance)
        statistics = {
            **motion.statistics,
            START_OFF: start_off_m,
            "u_num_m": float(np.hypot(u_num, to_dynamics.get(rung, 0.0))),
            "u_tolerance_m": u_num,
            STICKING: float(self.model.sticking),
            **{f"{lower}{TO_DYNAMICS}": to_dynamics[lower] for lower in rung_names() if lower in to_dynamics},
        }
        findings = (
            *motion.findings,
            self._rung_finding(choice, motion, to_dynamics, tolerance),
            *_error_findings(u_num, settings),
            *self._findings(motion),
            *self._moving_start(start_off_m),
            *self._creep_findings(motion, settings),
        )
        return replace(motion, findings=findings, statistics=statistics)

    def _choose_sticking(self, asked: bool | str, tolerance: float) -> None:
        """Select the model that sticks where asked to, or where the other creeps too far while the rover stands."""
        sticking = bool(asked)
        if asked == "auto":
            self.model = SceneModel(self.scene)
            sticking = self._creep(self.motion(DYNAMICS, tolerance), standing=True) > PARKED_CREEP_M
        self.model = SceneModel(self.scene, sticking=sticking)

    def _creep(self, motion: SimulatedMotion, *, standing: bool) -> float:
        """Length of the path below the stiction velocity [m], in total or while the rover stands."""
        speed = np.linalg.norm(spline_values(self.hinge, motion.time_s)[1], axis=1)
        counted = speed < STANDING_M_PER_S if standing else np.ones(len(speed), dtype=bool)
        still = replace(motion, twist=np.where(counted[:, None], motion.twist, 0.0))
        return creep_length(still, self.towed, self.scene.friction.stiction_velocity)

    def _creep_findings(self, motion: SimulatedMotion, settings: SimulateSettings) -> list[Finding]:
        """A finding where the regularised law creeps farther than a simpler model may differ; a warning if at rest."""
        if self.model.sticking:
            return []
        crept, parked = self._creep(motion, standing=False), self._creep(motion, standing=True)
        severity = Severity.WARNING if parked > PARKED_CREEP_M else Severity.NOTE
        if crept <= settings.rung_tolerance_m:
            return []
        return [finding("creep", severity, crept_mm=1000 * crept, parked_mm=1000 * parked)]

    def _rung_finding(
        self, choice: LadderChoice, motion: SimulatedMotion, to_dynamics: dict[str, float], tolerance_m: float
    ) -> Finding:
        """The rung used on this scene, and the shift of the path by the next simpler rung and by the full dynamics."""
        names, rung = rung_names(), motion.rung
        place = names.index(rung)
        changes = []
        for lower in names[:place][-1:]:
            if lower in to_dynamics:  # else it was not simulated
                moved = path_difference(self.towed, self.motion(lower, tolerance_m), motion)
                changes.append(_moves(lower, "the path", moved))
        if rung in to_dynamics:
            changes.append(_moves("the full dynamics", "it", to_dynamics[rung]))
        severity = Severity.NOTE if names.index(choice.rung) <= place else Severity.WARNING
        return finding("rung", severity, rung=rung, changes=", ".join(changes), allowed_mm=1000 * choice.tolerance_m)

    def _findings(self, motion: SimulatedMotion) -> list[Finding]:
        findings = []
        if motion.outcome != Outcome.CONVERGED and not any(motion.advice in found.text for found in motion.findings):
            findings.append(finding("simulate_outcome", outcome=motion.outcome, advice=motion.advice))
        findings += law_findings(self.model.law)
        if len(self.times) < len(self.asked):
            findings.append(finding("simulate_cut", count=len(self.asked) - len(self.times)))
        scene = self.scene
        findings += hanging_findings(scene.tether, scene.hinge_height, scene.anchor_height, scene.ground, motion)
        findings += self.unpulled
        findings += tether_across(self.scene, self.body, motion) if self.body else []
        return findings + self._taut_start(motion)

    def _taut_start(self, motion: SimulatedMotion) -> list[Finding]:
        """A finding where the tether, as measured, is too short for an object at rest."""
        nearer = float(np.linalg.norm(motion.pose[0, :2] - self.start_pose[:2]))
        if nearer > WRONG_SHARE * self.scene.tether.rest_length:
            return [finding("taut_start", longer_mm=1000 * nearer)]
        return nearer_findings(nearer)

    def start_off_m(self, tolerance_m: float) -> float:
        """How far a start from rest leads the path off, because the object moves when the simulation begins [m].

        From a simulation that begins with the start's own motion. Where it sticks and slips a slow start does much:
        what it still slides shifts the phase of all that follows. Of an object at rest, friction leaves nothing of the
        noise of its curve's end.
        """
        if not self.start_twist.any():
            return 0.0
        start = self.hinge, self.start_pose, self.times, tolerance_m
        still, moving = self.motion(DYNAMICS, tolerance_m), self.model.motion(DYNAMICS, *start, self.start_twist)
        both = min(len(still.time_s), len(moving.time_s))
        return float(np.linalg.norm(still.pose[:both, :2] - moving.pose[:both, :2], axis=1).max())

    def _moving_start(self, off_m: float) -> list[Finding]:
        """A finding where the object moves when the simulation begins, at rest: it overtakes by 2 v/ω on its tether."""
        frequency = np.sqrt(self.scene.tether.stiffness / self.scene.mass)
        off_m = max(off_m, float(2 * self.start_speed / frequency))
        if off_m <= _START_OFF_M:
            return []
        speed = float(np.hypot(*self.start_twist[:2]))
        return [finding("moving_start", speed_mm_per_s=1000 * speed, off_mm=1000 * off_m)]


def _moves(model: str, what: str, moved_m: float) -> str:
    """By how much another model would move the path, in words; infinite where one of both ends early."""
    if np.isinf(moved_m):
        return f"{model} cannot be compared, since one of both ends early"
    return f"{model} would move {what} by up to {1000 * moved_m:.2f} mm"


def nearer_findings(nearer_m: float) -> list[Finding]:
    """A finding where an object starts nearer to the rover than it was measured, and rests there."""
    if nearer_m <= _NEARER_M:
        return []
    severity = Severity.NOTE if nearer_m <= _MUCH_NEARER_M else Severity.WARNING
    return [finding("start_nearer", severity, nearer_mm=1000 * nearer_m)]


def _speed_at_start(track: DecimatedTrack, begin_s: float) -> float:
    """Speed [m/s] with which a track begins: by its rate, and no more than it goes by, since a curve may swing in."""
    soon_s = min(begin_s + _START_S, track.time_s[-1])
    first, soon = track.poses_and_rates_at([begin_s, soon_s])
    gone = float(np.hypot(*(soon - first)[:2])) / max(soon_s - begin_s, 1e-9)
    return float(min(gone, np.hypot(*first[3:5])))


def _whole(motion: SimulatedMotion, times: Array) -> SimulatedMotion:
    if len(motion.time_s) < len(times):
        raise RefusedError(
            f"the simulation ended early: {motion.outcome}",
            got=f"{motion.time_s[-1]:.2f} s of {times[-1]:.2f} s",
            remedy=motion.advice,
        )
    return motion


def law_findings(law: FittedLaw) -> list[Finding]:
    """A finding where a friction law misses the stated coefficients."""
    return [finding("friction_law", percent=100 * law.residual)] if law.residual > _LAW_RESIDUAL else []


def hanging_findings(
    tether: Tether, hinge_height: float, anchor_height: float, ground: Ground, motion: SimulatedMotion
) -> list[Finding]:
    """A finding where a tether with mass would hang through the floor; heights are over the floor [m]."""
    if not tether.mass_per_length > 0:
        return []
    rise = hinge_height - anchor_height
    distances = np.sqrt(np.maximum(motion.tether_length**2 - rise**2, 0.0))
    below = np.array([lowest_point(tether, each, rise, ground.gravity) for each in distances])
    depth = below - anchor_height
    if not (depth > 0).any():
        return []
    return [finding("tether_on_floor", percent=100 * np.mean(depth > 0), depth_mm=1000 * depth.max())]


def _error_findings(u_num: float, settings: SimulateSettings) -> list[Finding]:
    """A finding where the integrator's tolerance moves the path by more than a simpler model may."""
    allowed = settings.rung_tolerance_m
    return [finding("numerical_error", u_num_mm=1000 * u_num, allowed_mm=1000 * allowed)] if u_num > allowed else []

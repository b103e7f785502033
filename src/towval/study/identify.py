"""Identification: inputs of the simulation fitted to measured runs, and each run predicted from the others.

Kept apart from the validation: the blind comparison uses what campaign.yaml says and nothing from here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from towval.errors import InputError, RefusedError
from towval.geometry import block_means, wrapped
from towval.physics.dynamics import Accuracy
from towval.physics.ladder import simulate_rung
from towval.physics.mass import towed_object
from towval.simulate import friction_law, hinge_path
from towval.types import (
    Array,
    DecimatedTrack,
    Finding,
    FrictionLaw,
    Identification,
    InputDeviations,
    Prediction,
    Scene,
    Severity,
    Track,
)

_STEP = 0.1
"""Step of the difference quotients, in units of a parameter's scale: below it the phase of stick and slip is noise."""

_VAGUE_SHARE = 0.25
"""A deviation of more than this share of the searched range fixes nothing."""

_TIED = 0.98
"""Correlation of two values from which on only a combination of them is known."""


@dataclass(frozen=True)
class Parameter:
    """An input that can be identified.

    ``unit`` of its value; ``value`` of a scene; ``given_std`` of campaign.yaml; ``changed`` the scene and law with
    another value; ``scale`` of a noticeable change and ``reach`` of the search to both sides, in the value's unit.
    """

    unit: str
    value: Callable[[Scene], float]
    given_std: Callable[[InputDeviations], float]
    changed: Callable[[Scene, FrictionLaw, float], tuple[Scene, FrictionLaw]]
    scale: Callable[[Scene], float]
    reach: Callable[[Scene], float]


def _load_at(axis: int) -> Parameter:
    def changed(scene: Scene, law: FrictionLaw, value: float) -> tuple[Scene, FrictionLaw]:
        at = scene.load.at.copy()
        at[axis] = value
        return replace(scene, load=replace(scene.load, at=at)), law

    return Parameter(
        unit="m",
        value=lambda scene: float(scene.load.at[axis]),
        given_std=lambda std: std.load_at,
        changed=changed,
        scale=lambda _: 5e-3,
        reach=lambda scene: float(0.25 * np.ptp(scene.patch.outline[:, axis])),
    )


def _friction(scene: Scene, law: FrictionLaw, value: float) -> tuple[Scene, FrictionLaw]:
    # γ1, γ4 and γ6 are the amplitudes of Makkar's law: scaling them scales static and kinetic friction alike.
    factor = value / scene.friction.kinetic
    return scene, FrictionLaw(law.gamma * np.array([factor, 1, 1, factor, 1, factor]))


PARAMETERS = {
    "friction": Parameter(
        unit="",
        value=lambda scene: scene.friction.kinetic,
        given_std=lambda std: std.friction,
        changed=_friction,
        scale=lambda scene: 0.02 * scene.friction.kinetic,
        reach=lambda scene: 0.5 * scene.friction.kinetic,
    ),
    "load_x": _load_at(0),
    "load_y": _load_at(1),
    "rest_length": Parameter(
        unit="m",
        value=lambda scene: scene.tether.rest_length,
        given_std=lambda std: std.rest_length,
        changed=lambda scene, law, value: (replace(scene, tether=replace(scene.tether, rest_length=value)), law),
        scale=lambda _: 2e-3,
        reach=lambda scene: 0.3 * scene.tether.rest_length,
    ),
    "stiffness": Parameter(
        unit="N/m",
        value=lambda scene: scene.tether.stiffness,
        given_std=lambda std: std.stiffness,
        changed=lambda scene, law, value: (replace(scene, tether=replace(scene.tether, stiffness=value)), law),
        scale=lambda scene: 0.02 * scene.tether.stiffness,
        reach=lambda scene: 0.5 * scene.tether.stiffness,
    ),
}
"""What can be identified, by the names of ``config["identify"]["parameters"]``."""


@dataclass(frozen=True)
class IdentifySettings:
    """Keys of ``config["identify"]``.

    ``parameters`` to fit, names of :data:`PARAMETERS`; none switches the identification off. ``tolerance_m`` of
    integration [m].
    """

    parameters: tuple[str, ...] = ()
    tolerance_m: float = 1e-6

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", tuple(self.parameters))
        unknown = [name for name in self.parameters if name not in PARAMETERS]
        if unknown or len(set(self.parameters)) < len(self.parameters):
            raise InputError(
                "identify.parameters is out of range", got=list(self.parameters), allowed=", ".join(PARAMETERS)
            )
        if not 1e-12 <= self.tolerance_m <= 1e-3:
            raise InputError("identify.tolerance_m is out of range", got=self.tolerance_m, allowed="1e-12 to 1e-3 m")


@dataclass(frozen=True)
class MeasuredRun:
    """What identification needs of a run.

    ``name``; the thinned tracks of both bodies and the object's track; ``time_s`` (n,) at which it was simulated and
    ``measurement`` (n, 3, 3) the covariance of the measured pose there; ``rung`` of the model that simulated it.
    """

    name: str
    rover: DecimatedTrack
    towed: DecimatedTrack
    object_track: Track
    time_s: Array
    measurement: Array
    rung: str


def identify(
    scene: Scene, deviations: InputDeviations, runs: Sequence[MeasuredRun], settings: IdentifySettings
) -> Identification:
    """Fit inputs to runs by least squares over the simulation, and predict each run from all others.

    The residual is the error's mean over 24 blocks of time, in which stick and slip average out, in units of the
    deviation u_D of the measurement there. How errors of the measurement hang together in time is not known here, so
    they are counted twice: once as independent from block to block, once as one unknown for all blocks of a run (a
    camera's, a start's). The covariance of the values is ``(JᵀJ)⁻¹ + A Σ Aᵀ`` with ``A = (JᵀJ)⁻¹Jᵀ`` and Σ the
    covariance of the residuals in the second case, times the reduced χ² where that exceeds one. What other inputs may
    be wrong by is not in it; the scatter of the values in the predictions shows some of that.

    Parameters
    ----------
    scene : Scene
        What campaign.yaml says; the fit starts there.
    deviations : InputDeviations
        How well that was known, for comparison only: the fit does not lean on it.
    runs : sequence of MeasuredRun
        One run or more.
    settings : IdentifySettings
        What to fit.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        When no parameter is named, or the place of a load that is not there.
    RefusedError
        When a simulation ends early within the searched range.
    """
    if not settings.parameters or not runs:
        raise InputError("there is nothing to identify", allowed=f"one or more of {', '.join(PARAMETERS)}, and a run")
    if scene.load.mass == 0 and any(name.startswith("load") for name in settings.parameters):
        raise InputError("the object has no load whose place could be identified", remedy="leave load_x, load_y out")
    fit = _Fit(scene, friction_law(scene).law, settings)
    values, covariance = fit.values(runs)
    identifiable, findings = _identifiability(settings.parameters, covariance, fit.reach)
    predictions = []
    for left_out in runs if len(runs) > 1 else ():
        others, _ = fit.values([run for run in runs if run is not left_out])
        pose = fit.simulated(left_out, others)
        predictions.append(
            Prediction(
                left_out.name,
                others,
                left_out.time_s,
                pose,
                given_rms_m=_path_rms(left_out, fit.simulated(left_out, fit.given)),
                predicted_rms_m=_path_rms(left_out, pose),
            )
        )
    if len(runs) == 1:
        text = "One run only: nothing is left that the identified values could predict."
        findings.append(Finding(Severity.WARNING, "identify_one_run", text))
    return Identification(
        parameters=tuple(_titled(name) for name in settings.parameters),
        runs=tuple(run.name for run in runs),
        given=fit.given,
        given_std=np.array([PARAMETERS[name].given_std(deviations) for name in settings.parameters]),
        values=values,
        covariance=covariance,
        identifiable=identifiable,
        predictions=tuple(predictions),
        findings=tuple(findings),
    )


class _Fit:
    """Least squares over the simulation, with parameters in units of their scales."""

    def __init__(self, scene: Scene, law: FrictionLaw, settings: IdentifySettings):
        self.scene, self.law, self.settings = scene, law, settings
        self.parameters = [PARAMETERS[name] for name in settings.parameters]
        self.given = np.array([p.value(scene) for p in self.parameters])
        self.scale = np.array([p.scale(scene) for p in self.parameters])
        self.reach = np.array([p.reach(scene) for p in self.parameters])

    def values(self, runs: Sequence[MeasuredRun]) -> tuple[Array, Array]:
        """Fitted values (p,) and their covariance (p, p)."""
        whitening = [_whitening(run) for run in runs]

        def residual(u: Array) -> Array:
            values = self.given + u * self.scale
            parts = [self._residual(run, values, white) for run, white in zip(runs, whitening, strict=True)]
            return np.concatenate(parts)

        def jacobian(u: Array) -> Array:
            steps = _STEP * np.eye(len(u))
            return np.column_stack([(residual(u + step) - residual(u - step)) / (2 * _STEP) for step in steps])

        # The difference quotients look a step beyond the value: the bounds stay that far from the range's ends.
        bound = self.reach / self.scale - _STEP
        solution = least_squares(
            residual, np.zeros(len(self.given)), jacobian, (-bound, bound), xtol=1e-4, ftol=1e-6, gtol=1e-8
        )
        return self.given + solution.x * self.scale, self._covariance(solution.jac, solution.fun, len(runs))

    def _covariance(self, jacobian: Array, residual: Array, runs: int) -> Array:
        p = jacobian.shape[1]
        if np.linalg.matrix_rank(jacobian) < p:
            return np.full((p, p), np.nan)
        solver = np.linalg.pinv(jacobian)
        per_run = solver.reshape(p, runs, -1, 3).sum(axis=2).reshape(p, -1)
        chi2 = float(residual @ residual) / max(1, len(residual) - p)
        both = solver @ solver.T + per_run @ per_run.T
        return both * max(1.0, chi2) * np.outer(self.scale, self.scale)

    def _residual(self, run: MeasuredRun, values: Array, whitening: Array) -> Array:
        means = block_means(_error(run, self.simulated(run, values)))
        # A block in which the object was never seen says nothing.
        return np.einsum("kij,kj->ki", whitening, np.nan_to_num(means)).ravel()

    def simulated(self, run: MeasuredRun, values: Array) -> Array:
        """Poses (n, 3) of the object with the values (p,)."""
        scene, law = self.scene, self.law
        for parameter, value in zip(self.parameters, values, strict=True):
            scene, law = parameter.changed(scene, law, float(value))
        motion = simulate_rung(
            run.rung,
            towed_object(scene),
            law,
            scene.tether,
            hinge_path(run.rover, scene.hinge, run.time_s),
            run.towed.spline()(run.time_s[0]),
            run.time_s,
            accuracy=Accuracy(self.settings.tolerance_m),
        )
        if len(motion.time_s) < len(run.time_s):
            raise RefusedError(f"run {run.name} cannot be simulated while inputs are searched: {motion.outcome}")
        return motion.pose


def _error(run: MeasuredRun, pose: Array) -> Array:
    """Simulated minus measured (n, 3), NaN where the object was not seen."""
    rows = np.searchsorted(run.object_track.time_s, run.time_s - 1e-9)
    error = pose - np.where(run.object_track.seen[rows, None], run.object_track.pose[rows], np.nan)
    error[:, 2] = wrapped(error[:, 2])
    return error


def _path_rms(run: MeasuredRun, pose: Array) -> float:
    return float(np.sqrt(np.nanmean(np.sum(_error(run, pose)[:, :2] ** 2, axis=1))))


def _whitening(run: MeasuredRun) -> Array:
    """Matrices (24, 3, 3) that turn a block's mean error into units of the measurement's deviation."""
    covariance = block_means(run.measurement.reshape(-1, 9)).reshape(-1, 3, 3)
    return np.linalg.inv(np.linalg.cholesky(covariance + 1e-12 * np.eye(3)))


def _identifiability(names: Sequence[str], covariance: Array, reach: Array) -> tuple[tuple[bool, ...], list[Finding]]:
    """Which values the runs fix, and a finding for each that they do not."""
    if not np.isfinite(covariance).all():
        text = f"The runs do not tell {', '.join(names)} apart: the simulated paths do not change with all of them."
        return (False,) * len(names), [Finding(Severity.WARNING, "not_identifiable", text)]
    std = np.sqrt(np.diag(covariance))
    identifiable = std <= _VAGUE_SHARE * reach
    findings = [
        Finding(
            Severity.WARNING,
            "not_identifiable",
            f"{_titled(name)} is not identifiable: its deviation is {deviation:.3g}, the searched range ± {half:.3g}.",
        )
        for name, deviation, half, good in zip(names, std, reach, identifiable, strict=True)
        if not good
    ]
    correlation = covariance / np.outer(std, std)
    for i in range(len(names)):
        for j in range(i):
            if abs(correlation[i, j]) > _TIED:
                identifiable[[i, j]] = False
                text = (
                    f"{_titled(names[j])} and {_titled(names[i])} are not identifiable apart, only a combination of "
                    f"them (correlation {correlation[i, j]:+.3f}). Identify one of them."
                )
                findings.append(Finding(Severity.WARNING, "not_identifiable", text))
    return tuple(map(bool, identifiable)), findings


def _titled(name: str) -> str:
    unit = PARAMETERS[name].unit
    return name.replace("_", " ") + (f" [{unit}]" if unit else "")

"""Identification: inputs of the simulation fitted to measured runs, and each run predicted from the others.

Separate from the validation: the blind comparison uses the values of campaign.yaml and nothing from here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from scipy.stats import qmc

from towval.model import Array, DecimatedTrack, Finding, Identification, Prediction, Severity, TowingScene, Track
from towval.model.checks import within
from towval.model.errors import InputError, RefusedError, TowvalError
from towval.model.findings import finding
from towval.model.geometry import block_means, pose_difference
from towval.model.inputs import IDENTIFIABLE, Realisation, UncertainInput, titled
from towval.model.run_record import measured_poses
from towval.physics.ladder import DYNAMICS
from towval.validation.consequences import forbidding
from towval.validation.hinge_trajectory import hinge_trajectory
from towval.validation.scene_model import SceneModel
from towval.validation.seen_otherwise import SeenOtherwise

_STEP = 0.1
"""Step of the difference quotients, in units of a parameter's scale: below it the phase of stick-slip is noise."""

_PLACES, _SEED = 64, 1
"""Number of points at which the sum of squares is computed before a fit, and the seed of their sequence."""

_STARTS = 3
"""Number of the best of these points, from which fits are started."""

_AT_THE_END = 1e-3
"""A value counts as being at the end of the searched range within this share of half the range."""

_MISFIT = 2.0
"""Root mean square of a fit's residuals, in deviations of the measurement, above which it does not explain the runs by
itself, and of what other inputs leave of them, above which the model does not."""

_ANOTHER = "the model is not that of the runs, and the values belong to it"
_EXPLAINED = "they may explain the runs"

_VAGUE_SHARE = 0.25
"""A value with a deviation of more than this share of half the searched range is not identified."""

_TIED = 0.98
"""Correlation of two values above which only a combination of them is known."""


@dataclass(frozen=True)
class IdentifySettings:
    """Keys of ``config["identify"]``.

    ``parameters`` to fit, names of the components in :data:`towval.model.inputs.INPUTS`; none: nothing is identified.
    ``tolerance_m`` of integration [m].
    """

    parameters: tuple[str, ...] = ()
    tolerance_m: float = 1e-6

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", tuple(self.parameters))
        unknown = [name for name in self.parameters if name not in IDENTIFIABLE]
        if unknown or len(set(self.parameters)) < len(self.parameters):
            raise InputError(
                "identify.parameters is out of range", got=list(self.parameters), allowed=", ".join(IDENTIFIABLE)
            )
        within(self, "identify", "m", tolerance_m=(1e-12, 1e-3))


@dataclass(frozen=True)
class MeasuredRun:
    """What identification needs of a run.

    ``name``; the decimated tracks of both bodies and the object's track; ``time_s`` (n,) at which it was simulated and
    ``measurement`` (n, 3, 3) the covariance of the measured pose there; ``rung`` of the model that simulated it
    and whether it was ``sticking``; ``findings`` of all stages so far; ``otherwise``: its tracks with each unknown that
    all runs share one deviation off, in the same order in all runs.
    """

    name: str
    rover: DecimatedTrack
    towed: DecimatedTrack
    object_track: Track
    time_s: Array
    measurement: Array
    rung: str
    sticking: bool = False
    findings: tuple[Finding, ...] = ()
    otherwise: tuple[SeenOtherwise, ...] = ()


def identify(
    scene: TowingScene, deviations: Mapping[str, float], runs: Sequence[MeasuredRun], settings: IdentifySettings
) -> Identification:
    """Fit inputs to runs by least squares over the simulation, and predict each run from all others.

    The residual is the error's mean over 24 blocks of time, in which stick and slip average out, in units of the
    deviation u_D of the measurement there. The correlation in time of measurement errors is not known here, so they are
    counted twice: once as independent between blocks, once as one unknown for all blocks of a run (such as the camera's
    or the start's). The covariance of the residuals is ``V = 1 + Σ + B Bᵀ``, with Σ that of the second case and in the
    columns of B the changes of the residuals by one deviation to either side, over √2, of each input that is not
    fitted, as in campaign.yaml, and by one deviation of camera and heights, whose errors all runs share. The values
    make ``rᵀ V⁻¹ r`` least: an anchor that is a millimetre off turns the object by many deviations of the measurement,
    which are then not mistaken for effects of the values. Their covariance is ``(Jᵀ V⁻¹ J)⁻¹ max(1, χ²)`` with χ²
    reduced. B is taken at the values of campaign.yaml, then at those found.

    The sum of squares has many minima. It is computed at the values of campaign.yaml and at 64 points of a Sobol
    sequence over the searched range; fits start at the best three, and the best fit counts.

    Runs whose findings leave them without a verdict are left out, with a finding for each: poses at wrong times, say,
    would be fitted by wrong values.

    ``deviations`` are those of the inputs by name; those of fitted inputs are for comparison only. `InputError` where
    no parameter is named, or one of a load that is absent; `RefusedError` where all runs are left out, or where a
    simulation ends early within the searched range.
    """
    if not settings.parameters or not runs:
        raise InputError(
            "there is nothing to identify",
            allowed=f"one or more of {', '.join(IDENTIFIABLE)}, and a run",
            remedy=None if settings.parameters else 'name inputs: --set "identify.parameters=[rest_length,friction]"',
        )
    missing = [name for name in settings.parameters if not IDENTIFIABLE[name][0].present(scene)]
    if missing:
        raise InputError(
            "identify.parameters names what the campaign does not have (a load)",
            got=", ".join(missing),
            remedy="leave them out",
        )
    runs, left_out = _sound(runs)
    fit = _Fit(Realisation.nominal(scene), deviations, settings)
    found, by_others = fit.fitted(runs)
    covariance = fit.covariance(runs, found, by_others)
    identifiable, findings = _identifiability(settings.parameters, covariance, fit.reach)
    identifiable, further = _trust(found, by_others, fit, identifiable)
    findings += [*further, *left_out]
    predictions = _predictions(fit, found, by_others, runs) if len(runs) > 1 else []
    if len(runs) == 1:
        findings.append(finding("identify_one_run"))
    return Identification(
        parameters=tuple(titled(name) for name in settings.parameters),
        runs=tuple(run.name for run in runs),
        given=fit.given,
        given_std=np.array([deviations.get(IDENTIFIABLE[name][0].name, 0.0) for name in settings.parameters]),
        values=found.values,
        covariance=covariance,
        identifiable=identifiable,
        predictions=tuple(predictions),
        findings=tuple(findings),
    )


def _sound(runs: Sequence[MeasuredRun]) -> tuple[list[MeasuredRun], list[Finding]]:
    """The runs that can be judged, and a finding for each of the others."""
    reasons = {run.name: forbidding(run.findings) for run in runs}
    sound = [run for run in runs if not reasons[run.name]]
    if not sound:
        name, texts = next(iter(reasons.items()))
        raise RefusedError("no run can be judged, so none is fit to identify inputs from", got=f"{name}: {texts[0]}")
    return sound, [finding("identify_left_out", run=name, reason=texts[0]) for name, texts in reasons.items() if texts]


@dataclass(frozen=True)
class _Found:
    """Fitted values (p,), and there the residuals (m,) and derivatives (m, p), parameters in units of their scales.

    ``measured``: how many of the residuals are of blocks in which the object was seen; the others are zero.
    """

    values: Array
    residual: Array
    jacobian: Array
    measured: int

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals that were measured."""
        return self._rms(self.residual)

    def unexplained(self, by_others: Array) -> float:
        """The same of what neither other values nor other inputs within their deviations explain.

        In the columns of ``by_others`` (m, k): what one deviation of each of them changes.
        """
        count = by_others.shape[1]
        held = np.hstack([np.zeros((count, self.jacobian.shape[1])), np.eye(count)])
        changes = np.vstack([np.hstack([self.jacobian, by_others]), held])
        residual = np.append(self.residual, np.zeros(count))
        best = np.linalg.lstsq(changes, -residual, rcond=None)[0]
        return self._rms(residual + changes @ best)

    def _rms(self, residual: Array) -> float:
        return float(np.sqrt(residual @ residual / max(1, self.measured)))


class _Fit:
    """Least squares over the simulation, with parameters in units of their scales."""

    def __init__(self, nominal: Realisation, deviations: Mapping[str, float], settings: IdentifySettings):
        self.nominal, self.deviations, self.settings = nominal, deviations, settings
        scene = nominal.scene
        self.parameters = [IDENTIFIABLE[name] for name in settings.parameters]
        # Parameters act in the order of the table, whatever the settings' is: the friction scales the static one, too.
        place = list(IDENTIFIABLE).index
        self.in_turn = sorted(range(len(self.parameters)), key=lambda k: place(settings.parameters[k]))
        self.given = np.array([row.values(scene)[i] for row, i in self.parameters])
        self.scale = np.array([row.searched(scene, "step")[i] for row, i in self.parameters])
        self.reach = np.array([row.searched(scene, "reach")[i] for row, i in self.parameters])
        # Difference quotients go a step beyond a value, so the bounds stay that far from the ends of the range.
        self.bound = self.reach - _STEP * self.scale
        sequence = qmc.Sobol(len(self.given), scramble=True, rng=np.random.default_rng(_SEED)).random(_PLACES)
        self.places = np.vstack([self.given, self.given + (2 * sequence - 1) * self.bound])
        self._at_places: dict[str, Array] = {}
        self._whitening: dict[str, Array] = {}

    def fitted(self, runs: Sequence[MeasuredRun]) -> tuple[_Found, Array]:
        """The best fit to the runs, and what other inputs change there; see :meth:`by_others`."""
        by_others = self.by_others(runs, self.given)
        found = self.values(runs, self.starts(runs, by_others)[:_STARTS], by_others)
        by_others = self.by_others(runs, found.values)
        return self.values(runs, [found.values, *self.starts(runs, by_others)[:_STARTS]], by_others), by_others

    def starts(self, runs: Sequence[MeasuredRun], by_others: Array) -> Array:
        """Points (k, p) in the searched range to start from, the best for these runs first."""
        for run in runs:
            if run.name not in self._at_places:
                self._at_places[run.name] = np.array([self._residuals_if_any(run, values) for values in self.places])
        residuals = np.hstack([self._at_places[run.name] for run in runs])
        squares = np.sum((residuals @ _whitener(runs, by_others).T) ** 2, axis=1)
        return self.places[np.argsort(squares, kind="stable")]  # Those without residuals are last: NaN.

    def values(self, runs: Sequence[MeasuredRun], starts: ArrayLike, by_others: Array) -> _Found:
        """The best of the fits to these runs that begin at ``starts`` (k, p)."""
        whitener = _whitener(runs, by_others)

        def residual(u: Array) -> Array:
            return np.asarray(whitener @ self._residuals(runs, self.nominal, self.given + u * self.scale))

        def jacobian(u: Array) -> Array:
            steps = _STEP * np.eye(len(u))
            return np.column_stack([(residual(u + step) - residual(u - step)) / (2 * _STEP) for step in steps])

        bound = self.bound / self.scale
        fits = [
            least_squares(
                residual, (start - self.given) / self.scale, jacobian, (-bound, bound), xtol=1e-4, ftol=1e-6, gtol=1e-8
            )
            for start in np.asarray(starts)
        ]
        best = min(fits, key=lambda fit: fit.cost)
        values = self.given + best.x * self.scale
        rows, scene = [row for row, _ in self.parameters], self.nominal.scene
        # Of an input without a sign its size is reported.
        mirrored = [row.acts_by_size(scene, float(value)) for row, value in zip(rows, values, strict=True)]
        signs = np.where(mirrored, -1.0, 1.0)
        residual_there, slopes = np.linalg.solve(whitener, best.fun), np.linalg.solve(whitener, best.jac * signs)
        return _Found(signs * values, residual_there, slopes, sum(int(_there(run).sum()) for run in runs))

    def _residuals_if_any(self, run: MeasuredRun, values: Array) -> Array:
        try:
            return self._residuals([run], self.nominal, values)
        except TowvalError:
            # Not a start. Where no point is one, the fit meets the same error and raises it.
            return np.full(_there(run).size, np.nan)

    def by_others(self, runs: Sequence[MeasuredRun], values: Array) -> Array:
        """Changes of the residuals (m, k) by one deviation to either side of each input that is not fitted, over √2,
        and by one deviation of what all runs share in their measurement.

        The sum of their squares is the mean square change. It counts inputs that cannot be on one side, too: of a
        height of zero both sides are the same, and their difference is none.
        """
        unmoved = self._residuals(runs, self.nominal, values)
        columns = [np.empty((len(unmoved), 0))]
        for name, (row, i) in IDENTIFIABLE.items():
            std = self.deviations.get(row.name, 0.0)
            if name in self.settings.parameters or std == 0 or not row.present(self.nominal.scene):
                continue
            given = row.values(self.nominal.scene)[i]
            for off in (std, -std):
                moved = self._residuals(runs, _changed(self.nominal, row, i, given + off), values)
                columns.append((moved - unmoved)[:, None] / np.sqrt(2))
        for otherwise in zip(*(run.otherwise for run in runs), strict=True):
            seen = [replace(run, **vars(other)) for run, other in zip(runs, otherwise, strict=True)]
            columns.append((self._residuals(seen, self.nominal, values) - unmoved)[:, None])
        return np.hstack(columns)

    def covariance(self, runs: Sequence[MeasuredRun], found: _Found, by_others: Array) -> Array:
        """Covariance (p, p) of the values fitted to the runs; NaN where these do not determine all of them."""
        whitener = _whitener(runs, by_others)
        jacobian, residual = whitener @ found.jacobian, whitener @ found.residual
        p = jacobian.shape[1]
        if np.linalg.matrix_rank(jacobian) < p:
            return np.full((p, p), np.nan)
        solver = np.linalg.pinv(jacobian)
        chi2 = float(residual @ residual) / max(1, found.measured - p)
        return np.asarray(solver @ solver.T * max(1.0, chi2) * np.outer(self.scale, self.scale))

    def _residuals(self, runs: Sequence[MeasuredRun], base: Realisation, values: Array) -> Array:
        """Block means of simulated − measured in deviations of the measurement, all runs one after another."""
        parts = []
        for run in runs:
            if run.name not in self._whitening:
                self._whitening[run.name] = _whitening(run)
            means = block_means(_error(run, self._poses(run, base, values)))
            # A block in which the object was never seen counts as zero.
            parts.append(np.einsum("kij,kj->ki", self._whitening[run.name], np.nan_to_num(means)).ravel())
        return np.concatenate(parts)

    def simulated(self, run: MeasuredRun, values: Array) -> Array:
        """Poses (n, 3) of the object with the values (p,)."""
        return self._poses(run, self.nominal, values)

    def _poses(self, run: MeasuredRun, base: Realisation, values: Array) -> Array:
        real = base
        for k in self.in_turn:
            real = _changed(real, *self.parameters[k], float(values[k]))
        hinge, start = hinge_trajectory(run.rover, real.scene.hinge, run.time_s), run.towed.poses_at(run.time_s[0])
        model = SceneModel(real.scene, sticking=run.sticking)
        rung = run.rung if model.planar else DYNAMICS
        motion = model.motion(rung, hinge, start, run.time_s, self.settings.tolerance_m)
        if len(motion.time_s) < len(run.time_s):
            raise RefusedError(f"run {run.name} cannot be simulated while inputs are searched: {motion.outcome}")
        return motion.pose


def _predictions(fit: _Fit, found: _Found, by_others: Array, runs: Sequence[MeasuredRun]) -> list[Prediction]:
    """Each run simulated with values that were fitted to all others."""
    predictions = []
    changes = np.split(by_others, len(runs))
    for left_out in runs:
        rest = [run for run in runs if run is not left_out]
        of_rest = np.vstack([change for run, change in zip(runs, changes, strict=True) if run is not left_out])
        others = fit.values(rest, [found.values, fit.starts(rest, of_rest)[0]], of_rest).values
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
    return predictions


def _changed(real: Realisation, row: UncertainInput, component: int, value: float) -> Realisation:
    """A realisation with one component of an input at another value."""
    values = np.array(row.values(real.scene))
    values[component] = value
    return row.acts(real, values).checked()


def _measured(run: MeasuredRun) -> Array:
    """Measured poses (n, 3) at the simulated times, NaN where the object was not seen."""
    return measured_poses(run.object_track)[run.object_track.rows_at(run.time_s)]


def _there(run: MeasuredRun) -> NDArray[np.bool_]:
    """Which means over blocks of time there are of a run's error (24, 3)."""
    return np.isfinite(block_means(_measured(run)))


def _whitener(runs: Sequence[MeasuredRun], by_others: Array) -> Array:
    """Matrix (m, m) that makes the residuals of runs independent, of unit variance; see :func:`identify`."""
    covariance = np.eye(len(by_others)) + by_others @ by_others.T
    per_run = len(by_others) // len(runs)
    for k, run in enumerate(runs):
        own, there = slice(k * per_run, (k + 1) * per_run), _there(run)
        covariance[own, own] += np.outer(there, there) * np.tile(np.eye(there.shape[1]), (len(there),) * 2)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))


def _error(run: MeasuredRun, pose: Array) -> Array:
    """Simulated minus measured (n, 3), NaN where the object was not seen."""
    return pose_difference(pose, _measured(run))


def _path_rms(run: MeasuredRun, pose: Array) -> float:
    return float(np.sqrt(np.nanmean(np.sum(_error(run, pose)[:, :2] ** 2, axis=1))))


def _whitening(run: MeasuredRun) -> Array:
    """Matrices (24, 3, 3) that turn a block's mean error into units of the measurement's deviation."""
    # A run of fewer times than blocks leaves some without; their errors count as zero.
    covariance = np.nan_to_num(block_means(run.measurement.reshape(-1, 9))).reshape(-1, 3, 3)
    return np.linalg.inv(np.linalg.cholesky(covariance + 1e-12 * np.eye(3)))


def _identifiability(names: Sequence[str], covariance: Array, reach: Array) -> tuple[tuple[bool, ...], list[Finding]]:
    """Which values the runs determine, and a finding for each that they do not."""
    if not np.isfinite(covariance).all():
        reason = "the simulated paths do not change with all of them"
        return (False,) * len(names), [finding("not_identifiable", names=", ".join(names), reason=reason)]
    std = np.sqrt(np.diag(covariance))
    identifiable = std <= _VAGUE_SHARE * reach
    findings = [
        finding(
            "not_identifiable",
            names=titled(name),
            reason=f"its deviation is {deviation:.3g}, the searched range ± {half:.3g}",
        )
        for name, deviation, half, good in zip(names, std, reach, identifiable, strict=True)
        if not good
    ]
    correlation = covariance / np.outer(std, std)
    for i in range(len(names)):
        for j in range(i):
            if abs(correlation[i, j]) > _TIED:
                identifiable[[i, j]] = False
                pair = f"{titled(names[j])} and {titled(names[i])}"
                reason = f"only a combination of them is (correlation {correlation[i, j]:+.3f}); identify one of them"
                findings.append(finding("not_identifiable", names=pair, reason=reason))
    return tuple(map(bool, identifiable)), findings


def _trust(
    found: _Found, by_others: Array, fit: _Fit, identifiable: tuple[bool, ...]
) -> tuple[tuple[bool, ...], list[Finding]]:
    """``identifiable`` except for values at the end of their range, and findings on these and on the misfit."""
    names, findings = fit.settings.parameters, []
    inside = np.abs(found.values - fit.given) < fit.bound - _AT_THE_END * fit.reach
    for name, value, is_inside in zip(names, found.values, inside, strict=True):
        if not is_inside:
            reason = (
                f"the fit ends at {value:.4g}, the end of the searched range; check its value in campaign.yaml, or "
                "what else may be wrong"
            )
            findings.append(finding("not_identifiable", names=titled(name), reason=reason))
    if found.misfit > _MISFIT:
        left = found.unexplained(by_others)
        severity, meaning = (Severity.WARNING, _ANOTHER) if left > _MISFIT else (Severity.NOTE, _EXPLAINED)
        findings.append(finding("identify_misfit", severity, misfit=found.misfit, left=left, meaning=meaning))
    return tuple(bool(i and w) for i, w in zip(identifiable, inside, strict=True)), findings

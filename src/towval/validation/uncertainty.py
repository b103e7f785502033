"""Stage uncertainty: what the error of a run may be if the model is right, by sampling all that is not known exactly.

Camera, heights, registration in the first frame and tracking noise move the measured object *and* the rover that drives
the simulation; masses, tether and friction move the simulation alone. All are drawn together, the run is simulated for
each draw, and the spread of simulated − measured is the validation uncertainty (ASME V&V 20-2009, 5: shared errors are
counted once).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm, qmc

from towval.model import (
    Array,
    Body,
    Calibration,
    Choice,
    DecimatedTrack,
    Finding,
    RunUncertainty,
    SimulatedMotion,
    TowingScene,
    Track,
)
from towval.model.errors import InputError, RefusedError, TowvalError
from towval.model.findings import finding
from towval.model.geometry import compose, wrapped
from towval.model.inputs import INPUTS, Realisation
from towval.model.statement import Draws
from towval.optics.moved_view import pose_sensitivity
from towval.validation.consequences import WIDER, widened
from towval.validation.effects import effect_choices
from towval.validation.explain import Left, Moves, explain
from towval.validation.faults import visible_faults
from towval.validation.hinge_way import by_kept_poses, nodes_between
from towval.validation.path_frame import OnPath
from towval.validation.shares import REST, variance_shares
from towval.validation.simulate import STICKING
from towval.validation.simulate_many import Batch, Drawn
from towval.validation.statistics import RightModel, error_sizes

_RATE_STEP_S = 1e-4
_DROPPED_SHARE = 0.02
_KEPT_TIMES = 1000
"""Draws are kept at this many times at most: more than the path has features."""

_SMALLEST = 2.0**-31  # Half a step of the Sobol sequence, which may hold 0, whose normal quantile is infinite.


@dataclass(frozen=True)
class UncertaintySettings:
    """Keys of ``config["uncertainty"]``.

    ``samples`` drawn, a power of two; ``seed`` of the scrambled Sobol sequence; ``tolerance_m`` of integration [m];
    ``confidence`` of the limits that a right model keeps; ``processes``, threads in truth, that simulate at once.
    """

    samples: int = 512
    seed: int = 1
    tolerance_m: float = 3e-6
    confidence: float = 0.99
    processes: int = 1

    def __post_init__(self) -> None:
        if self.samples < 64 or self.samples & (self.samples - 1):
            raise InputError(
                "uncertainty.samples is out of range", got=self.samples, allowed="a power of two from 64 on"
            )
        if not 0.5 <= self.confidence < 1:
            raise InputError("uncertainty.confidence is out of range", got=self.confidence, allowed="0.5 up to below 1")
        if not 1e-12 <= self.tolerance_m <= 1e-3:
            raise InputError("uncertainty.tolerance_m is out of range", got=self.tolerance_m, allowed="1e-12 to 1e-3 m")
        if self.processes < 1:
            raise InputError("uncertainty.processes is out of range", got=self.processes, allowed="1 or more")


@dataclass(frozen=True)
class Case:
    """One run: what was stated and what was measured.

    ``deviations`` are those of :func:`towval.model.inputs.deviations`, what they do not name is exact; those of the
    heights are the bodies' own. ``run`` is its name: inputs that runs share are drawn alike in all of them, the others
    not. ``assumed`` are the inputs of which neither value nor deviation was stated.
    """

    scene: TowingScene
    deviations: Mapping[str, float]
    calibration: Calibration
    rover: Body
    towed: Body
    rover_track: Track
    rover_decimated: DecimatedTrack
    object_track: Track
    object_decimated: DecimatedTrack
    simulated: SimulatedMotion
    run: str = ""
    assumed: tuple[str, ...] = ()

    @property
    def upstream(self) -> tuple[Finding, ...]:
        """Findings of the stages before."""
        parts = (
            self.calibration, self.rover_track, self.object_track, self.rover_decimated, self.object_decimated,
            self.simulated,
        )  # fmt: skip
        return tuple(each for part in parts for each in part.findings)


@dataclass(frozen=True)
class _Motions:
    """How the poses of a body along its track move with the camera (n, 3, 18) and with the height of its top (n, 3)."""

    pose: Array
    by_camera: Array
    by_height: Array

    def shifted(self, camera: Array, height: float, first_frame: Array) -> Array:
        """Poses (n, 3) for a change of the camera's parameters, of the height and of the body frame's registration."""
        moved = self.pose + self.by_camera @ camera + self.by_height * height
        return compose(moved, first_frame)


def sample_uncertainty(
    case: Case, settings: UncertaintySettings | None = None, progress: Callable[[int], None] | None = None
) -> RunUncertainty:
    """Draw everything that is uncertain, simulate each draw, and describe the spread.

    Parameters
    ----------
    settings : UncertaintySettings, optional
        How many draws, from which seed, and how exactly each is simulated.
    progress : callable, optional
        Called with the number of draws done.

    Returns
    -------
    RunUncertainty
        Covariances over time, the draws, and the smallest faults that they leave visible.

    Raises
    ------
    RefusedError
        When more than 2 % of the draws cannot be simulated: the limits would be those of the easy ones.
    """
    settings = settings or UncertaintySettings()
    sampling = UncertaintySampling(case, settings, progress)
    return sampling.completed(sampling.describe(settings.samples))


class UncertaintySampling:
    """Draws of all that is uncertain in a run, and where each leads; asking for more keeps those that were made.

    ``case``, ``settings``, ``progress``: as in :func:`sample_uncertainty`; the number of draws is that of
    :meth:`describe`.
    """

    def __init__(self, case: Case, settings: UncertaintySettings, progress: Callable[[int], None] | None = None):
        self.case, self.settings, self.progress = case, settings, progress
        self._sampler = _Sampler(case, settings)
        self._sequence = qmc.Sobol(
            sum(self._sampler.widths.values()), scramble=True, rng=np.random.default_rng(settings.seed)
        )
        self._draws = np.empty((0, self._sequence.d))
        self._outcomes: list[tuple[Array, Array]] = []

    def describe(self, samples: int) -> RunUncertainty:
        """The spread of the first ``samples`` draws, a power of two; errors as in :func:`sample_uncertainty`."""
        self._extend(samples)
        draws = self._draws[:samples]
        simulated, measured = (np.array(part) for part in zip(*self._outcomes[:samples], strict=True))
        done = np.isfinite(simulated[:, -1, 0])
        if np.mean(~done) > _DROPPED_SHARE:
            raise RefusedError(
                "the uncertainty cannot be sampled",
                got=f"{np.count_nonzero(~done)} of {len(draws)} draws could not be simulated",
                allowed=f"at most {100 * _DROPPED_SHARE:.0f} %",
                remedy="check the deviations in campaign.yaml: a load may leave its footprint, a length be negative",
            )
        return self._described(draws[done], simulated[done], measured[done], int(np.count_nonzero(~done)))

    def _described(self, draws: Array, simulated: Array, measured: Array, dropped: int) -> RunUncertainty:
        # Deviations are taken from the nominal solution, which stands where the truth stands in the campaign, not from
        # the mean of the draws: where phases wander, both sides of S − D oscillate, and the mean of the draws does not.
        nominal, u_num_m = self.case.simulated.pose, self.case.simulated.statistics["u_num_m"]
        error = _difference(simulated, measured)
        shares = variance_shares(draws, error[..., :2].reshape(len(error), -1), self._sampler.widths)
        rng = np.random.default_rng([self.settings.seed, len(draws)])
        numerical = np.pad(rng.standard_normal((len(draws), 1, 2)) * u_num_m / np.sqrt(2), ((0, 0), (0, 0), (0, 1)))
        rows = np.arange(0, len(nominal), -(-len(nominal) // _KEPT_TIMES))
        off = _difference(measured, nominal)
        kept = Draws(rows, (error + numerical)[:, rows], off[:, rows], draws, self._sampler.names)
        return RunUncertainty(
            time_s=self._sampler.times,
            measurement=_mean_square(off),
            simulation=_mean_square(_difference(simulated, nominal)),
            validation=with_numerical(_mean_square(error), u_num_m),
            confidence=self.settings.confidence,
            shares=shares,
            samples=len(draws),
            seed=self.settings.seed,
            findings=(*_findings(dropped, shares), *self._widened()),
            upstream=self.case.upstream,
            draws=kept,
        )

    def completed(self, known: RunUncertainty) -> RunUncertainty:
        """The same with the smallest faults that show in nine of ten of its draws, and what explains the error."""
        return self.explained(self.with_faults(known))

    def with_faults(self, known: RunUncertainty) -> RunUncertainty:
        """The same with the smallest faults that show in nine of ten of its draws."""
        path, sampler, confidence = self.on_path(known), self._sampler, self.settings.confidence
        if path is None or known.draws is None:
            return known
        batch = replace(sampler.batch, times=known.time_s[known.draws.rows])
        tows = self.case.scene, batch, sampler.rover_moves, self.case.simulated
        faults = visible_faults(*tows, path.drawn, known.draws.inputs, confidence, path.frame)
        return replace(known, faults=faults)

    def explained(self, known: RunUncertainty) -> RunUncertainty:
        """The same with what explains an error that a right model leaves not, or that no draw of the measurement is."""
        path, draws = self.on_path(known), known.draws
        if path is None or draws is None:
            return known
        right = RightModel.of(path.drawn, draws.inputs, self.settings.confidence)
        if not right.rejects(path.error) and error_sizes(path.error)[1] <= error_sizes(path.off)[:, 1].max():
            return known
        left = self._left(replace(self._sampler.batch, times=known.time_s[draws.rows]), draws.rows, path)
        found = explain(path.error, path.off, right, draws.column_names, self.case.assumed, left, path.length)
        return replace(known, explanation=found)

    def on_path(self, known: RunUncertainty) -> OnPath | None:
        """Error and draws of the run along and across its path; None without draws or where it was hardly seen."""
        draws = known.draws
        return None if draws is None else OnPath.of(self.case.object_track, self.case.simulated, draws)

    def _left(self, batch: Batch, rows: NDArray[np.intp], path: OnPath) -> Left:
        """The error of the run with inputs moved and the run simulated again, as :func:`explain` asks for it."""

        def errors(moves: Sequence[Moves]) -> Array:
            draws = np.zeros((len(moves), self._sequence.d))
            for draw, each in zip(draws, moves, strict=True):
                draw[list(each)] = list(each.values())
            laid_out = [self._sampler.moved(draw) for draw in draws]
            measured = np.array([seen[rows] for _, seen in laid_out])
            simulated = np.array(list(batch.simulate(drawn for drawn, _ in laid_out)))
            return path.frame.along_across(_difference(simulated, measured))[:, path.frame.seen]

        nominal = errors([{}])
        return lambda moves: path.error + (errors(moves) - nominal)

    def effects(self, found: RunUncertainty) -> tuple[Choice, ...]:
        """Each effect of a lab on the path, taken or left out; see :func:`towval.validation.effects.effect_choices`."""
        sampler = self._sampler
        return effect_choices(self.case.scene, sampler.batch, sampler.rover_moves, sampler.start.pose[0], found)

    def _widened(self) -> Iterator[Finding]:
        for name, codes in widened(self.case.upstream).items():
            label = INPUTS[name].label if name in INPUTS else name
            yield finding("widened", input=label, factor=WIDER, codes=", ".join(codes))

    def _extend(self, samples: int) -> None:
        made = len(self._draws)
        if samples <= made:
            return
        uniform = self._sequence.random(samples - made)
        draws = norm.ppf(np.clip(uniform, _SMALLEST, 1 - _SMALLEST))
        # The sequence is that of all runs of a campaign: what each run has of its own is drawn apart.
        own = self._sampler.own
        for i in range(len(draws)):
            draws[i, own] = self._sampler.generator(made + i, 1).standard_normal(np.count_nonzero(own))
        self._draws = np.concatenate([self._draws, draws])
        measured: list[Array] = []

        def laid_out() -> Iterator[Drawn | None]:
            for i, draw in enumerate(draws):
                drawn, seen = self._sampler.lay_out(made + i, draw)
                measured.append(seen)
                yield drawn

        for i, pose in enumerate(self._sampler.batch.simulate(laid_out())):
            self._outcomes.append((pose, measured[i]))
            if self.progress is not None:
                self.progress(len(self._outcomes))


def with_numerical(covariance: Array, u_num_m: float) -> Array:
    """Covariances (..., 3, 3) of the error over the draws with the numerical uncertainty of the simulation added.

    This is where u_val² = u_num² + u_input² + u_D² is formed, for the table, the test and the plots alike; errors that
    simulation and measurement share are counted once, since the draws are of their difference. ``u_num_m`` [m] counts
    at every time, half its square in each direction.
    """
    return covariance + 0.5 * u_num_m**2 * np.diag([1.0, 1.0, 0.0])


class _Sampler:
    """Turns standard normal numbers into what is to be simulated and a measured motion of the object."""

    def __init__(self, case: Case, settings: UncertaintySettings):
        self.case, self.settings = case, settings
        self.times = case.simulated.time_s
        begin, end = self.times[[0, -1]]
        self.nodes = nodes_between(case.rover_decimated, begin, end)
        self.rover_moves = case.rover_decimated.poses_and_rates_at(self.nodes)
        # How a change of the camera moves the rover's rates is told from poses a little before and after each node.
        self.around = np.clip(self.nodes[:, None] + [0.0, -_RATE_STEP_S, _RATE_STEP_S], begin, end).T
        self.rover = _motions(case.calibration, case.rover, case.rover_decimated.poses_at(self.around.ravel()))
        rows = np.searchsorted(case.object_track.time_s, self.times - 1e-9)
        self.noise_std = np.nan_to_num(case.object_track.std[rows])
        self.object = _motions(case.calibration, case.towed, case.simulated.pose)
        self.start = _motions(case.calibration, case.towed, case.object_decimated.poses_at(self.times[:1]))
        self.nominal = Realisation.nominal(case.scene)
        self.batch = Batch(
            self.nodes, self.times, case.simulated.rung, bool(case.simulated.statistics.get(STICKING, 0.0)),
            settings.tolerance_m, settings.processes,
        )  # fmt: skip
        self.knot_std = np.sqrt(np.diagonal(case.rover_decimated.covariance, axis1=1, axis2=2))
        self.by_knots = by_kept_poses(case.rover_decimated, self.nodes)
        self.roots = _roots(case)
        if "tracking" in widened(case.upstream):
            self.noise_std, self.knot_std = WIDER * self.noise_std, WIDER * self.knot_std
        # Only what varies is drawn: each further column costs digits of the shares of all.
        self.drawn = [name for name in INPUTS if self.roots[name].any()] or ["camera"]
        self.stated = {name: INPUTS[name].values(case.scene) for name in self.drawn}
        self.widths = {INPUTS[name].label: len(INPUTS[name].components) for name in self.drawn}
        self.names = dict(zip(self.drawn, self.widths.values(), strict=True))
        self.own = np.repeat([INPUTS[name].shared == "run" for name in self.drawn], list(self.widths.values()))

    def generator(self, index: int, purpose: int) -> np.random.Generator:
        """One generator a draw, so that the result does not depend on how draws are shared among threads."""
        return np.random.default_rng([self.settings.seed, index, crc32(self.case.run.encode()), purpose])

    def lay_out(self, index: int, draw: Array) -> tuple[Drawn | None, Array]:
        """What is to be simulated of one draw, None where it cannot be, and measured poses (n, 3)."""
        rng = self.generator(index, 0)
        noise, knots = self.noise_std * rng.standard_normal(self.noise_std.shape), self._knot_noise(rng)
        drawn, measured = self.moved(draw)
        return drawn and drawn._replace(rover=drawn.rover + knots), measured + noise

    def moved(self, draw: Array) -> tuple[Drawn | None, Array]:
        """The same without noise: what inputs (d,) in standard normal numbers make of simulation and measurement."""
        towed, rover = self.case.towed.name, self.case.rover.name
        try:
            real = self._realisation(draw)
        except TowvalError:
            return None, np.full_like(self.noise_std, np.nan)
        moved = real.camera, real.height[towed], real.registration[towed]
        seen = self.rover.shifted(real.camera, real.height[rover], real.registration[rover])
        poses, before, after = seen.reshape(3, -1, 3)
        rates = (after - before) / (self.around[2] - self.around[1])[:, None]
        driven = np.concatenate([poses, rates], axis=1)
        return Drawn(real.scene, driven, self.start.shifted(*moved)[0]), self.object.shifted(*moved)

    def _realisation(self, draw: Array) -> Realisation:
        """All inputs at the values of a draw of standard normal numbers."""
        real = self.nominal
        parts = np.split(draw, np.cumsum(list(self.widths.values()))[:-1])
        for row, part in zip(map(INPUTS.__getitem__, self.drawn), parts, strict=True):
            real = row.acts(real, self.stated[row.name] + self.roots[row.name] @ part)
        return real

    def _knot_noise(self, rng: np.random.Generator) -> Array:
        """Noise of poses and rates (m, 6): cubics through independent noise of the kept poses of the rover's track."""
        noise = self.knot_std * rng.standard_normal(self.knot_std.shape)
        return np.concatenate(self.by_knots @ noise, axis=1)


def _motions(calibration: Calibration, body: Body, pose: Array) -> _Motions:
    return _Motions(pose, *pose_sensitivity(calibration.camera, calibration.floor, body, pose))


def _roots(case: Case) -> dict[str, Array]:
    """Square roots (k, k) of the covariances of the inputs, by name."""
    stated = dict(case.deviations)
    covariances = {"camera": case.calibration.covariance}
    for body, track in ((case.rover, case.rover_track), (case.towed, case.object_track)):
        stated[f"{body.name}_height"] = body.height_std_m
        covariances[f"{body.name}_registration"] = track.start_covariance
    roots = {name: _root(covariance) for name, covariance in covariances.items()}
    drawn = {row.name: 0.0 if row.within else stated.get(row.name, 0.0) for row in INPUTS.values() if row.stated}
    roots = {name: std * np.eye(len(INPUTS[name].components)) for name, std in drawn.items()} | roots
    return roots | {name: WIDER * roots[name] for name in widened(case.upstream) if name in roots}


def _root(covariance: ArrayLike) -> Array:
    """A square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(np.asarray(covariance, dtype=np.float64))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _difference(pose: Array, other: Array) -> Array:
    """Poses (..., 3) less others, the heading's difference in (−π, π]."""
    difference = pose - other
    difference[..., 2] = wrapped(difference[..., 2])
    return difference


def _mean_square(error: Array) -> Array:
    """Second moments (n, 3, 3) about zero over the first axis of errors (k, n, 3)."""
    return np.asarray(np.einsum("kni,knj->nij", error, error) / len(error))


def _findings(dropped: int, shares: dict[str, float]) -> tuple[Finding, ...]:
    findings = []
    named = {name: share for name, share in shares.items() if name != REST}
    if any(named.values()):
        first = max(named, key=lambda name: named[name])
        findings.append(finding("main_input", percent=100 * named[first], label=first))
    if dropped:
        findings.append(finding("draws_left_out", count=dropped))
    return tuple(findings)

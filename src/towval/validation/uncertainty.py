"""Stage uncertainty: what the error of a run may be if the model is right, by sampling all that is not known exactly.

Camera, heights, registration in the first frame and tracking noise move the measured object *and* the rover that drives
the simulation; masses, tether and friction move the simulation alone. All are drawn together, the run is simulated for
each draw, and the spread of simulated − measured is the validation uncertainty (ASME V&V 20-2009, 5: shared errors are
counted once).
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from towval.model import Array, Choice, Finding, RunUncertainty
from towval.model.errors import InputError, RefusedError, TowvalError
from towval.model.findings import finding
from towval.model.geometry import pose_difference
from towval.model.inputs import INPUTS
from towval.model.results import UNEXPLAINED
from towval.model.statement import Draws
from towval.physics.ladder import DYNAMICS
from towval.validation.consequences import WIDER, widened
from towval.validation.effects import effect_choices
from towval.validation.explain import Left, Moves, explain
from towval.validation.faults import Acts, Drawing, visible_faults
from towval.validation.path_frame import OnPath
from towval.validation.sampler import Case, Sampler, UncertaintySettings
from towval.validation.shares import variance_shares
from towval.validation.simulate_many import Batch, Drawn
from towval.validation.slips import slip_findings
from towval.validation.statistics import RightModel, error_sizes

DRAWS = (256, 512, 1024, 2048)
"""Numbers of draws that "auto" selects from; with 128 a right model exceeds its limits of 1 % in 2 % of runs."""

BOUND_ERROR = 0.05
"""Largest relative standard error of the bounds that the number of draws may cause."""

_BOUND_CONFIDENCE = 0.95  # of the bounds whose error is estimated

_DROPPED_SHARE = 0.02
"""Share of the draws that fail, above which the limits hold for those only that could be simulated."""

_COARSE_M = 1e-5
"""Tolerance of a step, that of preset draft, from which on draws miss break-aways: on filmed runs their paths are then
off by about a millimetre, twenty times as much as with the default (docs/selection.md)."""

_LEAST_SHARE = 0.5
"""Share of the draws above which a spread is stated at all."""

_KEPT_TIMES = 1000
"""Draws are kept at this many times at most: more than the path has features."""

_SMALLEST = 2.0**-31  # Half a step of the Sobol sequence, which may hold 0, whose normal quantile is infinite.


def sample_uncertainty(
    case: Case, settings: UncertaintySettings | None = None, progress: Callable[[int], None] | None = None
) -> RunUncertainty:
    """Draw everything that is uncertain, simulate each draw, and describe the spread.

    The result holds covariances over time, the draws, and the smallest faults that they leave visible; ``progress`` is
    called with the number of draws done. Where more than 2 % of the draws cannot be simulated, a finding leaves the run
    not judged: the limits hold for the others only. So does a tolerance as wide as a draft's. `RefusedError` where half
    of the draws cannot be simulated.
    """
    settings = settings or UncertaintySettings()
    sampling = UncertaintySampling(case, settings, progress)
    return sampling.completed(sampling.sampled()[0])


class UncertaintySampling:
    """Draws of all uncertain inputs of a run, and their results; a larger number adds to those that were made.

    ``case``, ``settings``, ``progress``: as in :func:`sample_uncertainty`.
    """

    def __init__(self, case: Case, settings: UncertaintySettings, progress: Callable[[int], None] | None = None):
        self.case, self.settings, self.progress = case, settings, progress
        self._sampler = Sampler(case, settings)
        self._sequence = qmc.Sobol(
            sum(self._sampler.widths.values()), scramble=True, rng=np.random.default_rng(settings.seed)
        )
        self._draws = np.empty((0, self._sequence.d))
        self._to_dynamics = self._shift_by_dynamics()
        self._made = _Made(case.simulated.pose)

    def sampled(self) -> tuple[RunUncertainty, float]:
        """The spread of as many draws as the settings say, and the relative error of the bounds that is left [1].

        Under "auto" draws are added until the standard error of both upper bounds of the largest error, the
        simulation's and the model's, is at most :data:`BOUND_ERROR` of them, or 2048 are made. It is 0 without bounds.
        """
        auto = self.settings.samples == "auto"
        count = DRAWS[0] if auto else int(self.settings.samples)
        found, error = self._with_error(count)
        while auto and error > BOUND_ERROR and count < DRAWS[-1]:
            # The error falls with the root of the number; the first estimate is rough, so a step is at most fourfold.
            needed = min(count * (error / BOUND_ERROR) ** 2, 4 * count)
            count = next((each for each in DRAWS if count < each >= needed), DRAWS[-1])
            found, error = self._with_error(count)
        return found, error

    def _with_error(self, count: int) -> tuple[RunUncertainty, float]:
        found = self.describe(count)
        path = self.on_path(found)
        return found, 0.0 if path is None else path.bound_error(_BOUND_CONFIDENCE)

    def describe(self, samples: int) -> RunUncertainty:
        """The spread of ``samples`` draws, a power of two; errors as in :func:`sample_uncertainty`.

        `InputError` where more were made: only their sums are kept.
        """
        if samples < len(self._draws):
            raise InputError("draws cannot be taken back", got=samples, allowed=f"{len(self._draws)} or more")
        self._extend(samples)
        done = self._made.done
        if np.mean(done) <= _LEAST_SHARE:
            raise RefusedError(
                "the uncertainty cannot be sampled",
                got=f"{np.count_nonzero(~done)} of {len(done)} draws could not be simulated",
                allowed=f"less than {100 * (1 - _LEAST_SHARE):.0f} %",
                remedy=f"check the deviations in campaign.yaml; of the first of these draws: {self._failure(done)}",
            )
        return self._described(done)

    def _failure(self, done: NDArray[np.bool_]) -> str:
        """Why the first of the draws that are not ``done`` (n,) could not be simulated."""
        first = int(np.argmin(done))
        text = self._sampler.batch.failure(self._sampler.lay_out(first, self._draws[first])[0])
        return " ".join(text.split())

    def _described(self, done: NDArray[np.bool_]) -> RunUncertainty:
        """The spread of the draws that are ``done`` (n,)."""
        # Deviations are taken from the nominal solution, which corresponds to the truth in a campaign, not from the
        # mean of the draws: where phases drift, both sides of S − D oscillate, and the mean of the draws does not.
        draws, made = self._draws[done], self._made
        simulated, measured = (np.array(paths)[done] for paths in (made.simulated, made.measured))
        u_tolerance_m, rows = self.case.simulated.statistic("u_tolerance_m"), made.rows
        error = pose_difference(simulated, measured)
        rng = np.random.default_rng([self.settings.seed, len(draws)])
        step = np.pad(rng.standard_normal((len(draws), 1, 2)) * u_tolerance_m / np.sqrt(2), ((0, 0), (0, 0), (0, 1)))
        numerical = step + rng.standard_normal((len(draws), 1, 1)) * self._to_dynamics[rows]
        error += numerical
        # Of all that u_val holds: else an input's share of the larger variance would count as a larger effect of it.
        shares = variance_shares(draws, error[..., :2].reshape(len(error), -1), self._sampler.widths)
        off = pose_difference(measured, made.nominal[rows])
        of_measurement, of_simulation, of_error = made.squares / len(draws)
        return RunUncertainty(
            time_s=self._sampler.times,
            measurement=of_measurement,
            simulation=of_simulation,
            validation=with_numerical(of_error, u_tolerance_m, self._to_dynamics),
            confidence=self.settings.confidence,
            shares=shares,
            samples=len(draws),
            seed=self.settings.seed,
            findings=(*_main_input(shares), *self._dropped(done), *self._coarse(), *self._widened()),
            upstream=self.case.upstream,
            draws=Draws(rows, error, off, draws, self._sampler.names),
        )

    def _shift_by_dynamics(self) -> Array:
        """By how much the full dynamics would move the path (n, 3) [m, m, rad]; a simpler rung is in error by as much.

        That has the shape of a turn into a curve or of a start. A constant shift as large, as a right model's error,
        would hide other errors, and show a right model to be wrong by the shape of its error.
        """
        batch, sampler = self._sampler.batch, self._sampler
        if batch.rung == DYNAMICS:
            return np.zeros((len(batch.times), 3))
        stated = [sampler.as_stated]
        (simpler,), (fullest,) = (each.simulate(stated) for each in (batch, replace(batch, rung=DYNAMICS)))
        if not np.isfinite(fullest).all():
            raise RefusedError(
                "how far the simulation is from the full dynamics is not known",
                got=f"rung {batch.rung}; the dynamics cannot be simulated to the end",
                remedy="set simulate.rung: dynamics, and read what the stage simulate says",
            )
        return pose_difference(fullest, simpler)

    def completed(self, known: RunUncertainty) -> RunUncertainty:
        """Add the smallest faults that show in nine of ten draws, and what explains the error."""
        return self.explained(self.with_faults(known))

    def with_faults(self, known: RunUncertainty) -> RunUncertainty:
        """Add the smallest faults that show in nine of ten draws."""
        path, draws = self.on_path(known), known.draws
        if path is None or draws is None:
            return known
        sampler, nominal = self._sampler, self.case.simulated
        batch = replace(sampler.batch, times=known.time_s[draws.rows])
        unchanged = sampler.as_stated
        (plain,) = batch.simulate([unchanged])
        done = np.flatnonzero(self._made.done)

        def shifts(acts: Sequence[Acts], rows: NDArray[np.intp] | None) -> Array:
            laid_out: list[Drawn | None]
            if rows is None:
                laid_out = [unchanged] * len(acts)
                poses = plain
            else:
                numbers = [done[row] for row in rows]
                laid_out = [sampler.lay_out(i, self._draws[i])[0] for i in numbers]
                poses = np.array([self._made.simulated[i] for i in numbers])
            moved = np.array(list(batch.simulate(map(_acted, acts, laid_out))))
            return path.frame.along_across(pose_difference(moved, poses))[:, path.frame.seen]

        drawing = Drawing(path.drawn, draws.inputs, self.settings.confidence, shifts)
        return replace(known, faults=visible_faults(nominal, drawing))

    def explained(self, known: RunUncertainty) -> RunUncertainty:
        """Add what explains an error that is rejected, or larger than in any draw of the measurement."""
        path, draws = self.on_path(known), known.draws
        if path is None or draws is None:
            return known
        right = RightModel.of(path.drawn, draws.inputs, self.settings.confidence)
        if not right.rejects(path.error) and error_sizes(path.error)[1] <= error_sizes(path.off)[:, 1].max():
            return known
        batch = replace(self._sampler.batch, times=known.time_s[draws.rows])
        left = self._left(batch, draws.rows, path)
        found = explain(path.error, path.off, right, draws.column_names, self.case.assumed, left, path.length)
        slips = self._slips(batch, path, right) if right.rejects(path.error) else []
        return replace(known, explanation=found, findings=(*known.findings, *slips))

    def on_path(self, known: RunUncertainty) -> OnPath | None:
        """Error and draws of the run along and across its path; None without draws or where it was hardly seen."""
        draws = known.draws
        return None if draws is None else OnPath.of(self.case.object_track, self.case.simulated, draws)

    def _left(self, batch: Batch, rows: NDArray[np.intp], path: OnPath) -> Left:
        """The error of the run with inputs moved and the run simulated again, as :func:`explain` needs it."""

        def errors(moves: Sequence[Moves]) -> Array:
            draws = np.zeros((len(moves), self._sequence.d))
            for draw, each in zip(draws, moves, strict=True):
                draw[list(each)] = list(each.values())
            laid_out = [self._sampler.moved(draw) for draw in draws]
            measured = np.array([seen[rows] for _, seen in laid_out])
            simulated = np.array(list(batch.simulate(drawn for drawn, _ in laid_out)))
            return path.frame.along_across(pose_difference(simulated, measured))[:, path.frame.seen]

        nominal = errors([{}])
        return lambda moves: path.error + (errors(moves) - nominal)

    def _slips(self, batch: Batch, path: OnPath, right: RightModel) -> list[Finding]:
        """A finding where a slip in campaign.yaml, undone, leaves the error of a right model."""
        # A simpler rung was chosen for the scene as stated.
        batch, stated = replace(batch, rung=DYNAMICS), self._sampler.as_stated
        (plain,) = batch.simulate([stated])

        def left(acts: Sequence[Acts]) -> Array:
            moved = np.array(list(batch.simulate(_acted(act, stated) for act in acts)))
            return path.error + path.frame.along_across(pose_difference(moved, plain))[:, path.frame.seen]

        return slip_findings(self.case.scene, path, right, left)

    def effects(self, found: RunUncertainty, limit_m: float = 0.0) -> tuple[Choice, ...]:
        """Each effect of a lab on the path, taken or left out; see :func:`towval.validation.effects.effect_choices`."""
        return effect_choices(self._sampler.batch, self._sampler.as_stated, found, self.case.simulated, limit_m)

    def _dropped(self, done: NDArray[np.bool_]) -> Iterator[Finding]:
        """A finding on draws that are not ``done`` (n,), which leaves the run not judged where they are many."""
        dropped, drawn = int(np.count_nonzero(~done)), len(done)
        if dropped > _DROPPED_SHARE * drawn:
            percent = 100 * _DROPPED_SHARE
            yield finding("draws_fail", count=dropped, drawn=drawn, percent=percent, reason=self._failure(done))
        elif dropped:
            yield finding("draws_left_out", count=dropped, reason=self._failure(done))

    def _coarse(self) -> Iterator[Finding]:
        """A finding that leaves the run not judged where draws are as coarse as a draft's."""
        if self.settings.tolerance_m >= _COARSE_M:
            yield finding("draft_settings", tolerance_mm=1e3 * self.settings.tolerance_m)

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
        # All runs of a campaign use the same sequence; inputs that each run has separately are drawn separately.
        own = self._sampler.own
        for i in range(len(draws)):
            draws[i, own] = self._sampler.generator(made + i, 1).standard_normal(np.count_nonzero(own))
        self._draws = np.concatenate([self._draws, draws])
        waiting = deque[Array]()

        def laid_out() -> Iterator[Drawn | None]:
            for i, draw in enumerate(draws):
                drawn, seen = self._sampler.lay_out(made + i, draw)
                waiting.append(seen)
                yield drawn

        for pose in self._sampler.batch.simulate(laid_out()):
            self._made.add(pose, waiting.popleft())
            if self.progress is not None:
                self.progress(len(self._made.simulated))


class _Made:
    """What is kept of the draws that were made: their paths at some times, and second moments at all times.

    ``nominal`` (n, 3) is the path of the simulation, from which the deviations count; ``squares`` (3, n, 3, 3) are the
    sums over the draws of the outer products of measured − nominal, simulated − nominal and simulated − measured.
    """

    def __init__(self, nominal: Array):
        self.nominal, self.rows = nominal, np.arange(0, len(nominal), -(-len(nominal) // _KEPT_TIMES))
        self.simulated, self.measured = list[Array](), list[Array]()
        self._done = list[bool]()
        self.squares = np.zeros((3, len(nominal), 3, 3))

    @property
    def done(self) -> NDArray[np.bool_]:
        """Which of the draws could be simulated."""
        return np.array(self._done)

    def add(self, simulated: Array, measured: Array) -> None:
        """Add a draw by its paths (n, 3), the simulated one NaN where it could not be simulated."""
        self._done.append(bool(np.isfinite(simulated[-1, 0])))
        self.simulated.append(simulated[self.rows])
        self.measured.append(measured[self.rows])
        if self._done[-1]:
            apart = ((measured, self.nominal), (simulated, self.nominal), (simulated, measured))
            for k, (path, other) in enumerate(apart):
                off = pose_difference(path, other)
                self.squares[k] += off[:, :, None] * off[:, None, :]


def with_numerical(covariance: Array, u_tolerance_m: float, to_dynamics: Array) -> Array:
    """Covariances (n, 3, 3) of the error over the draws with the numerical uncertainty of the simulation added.

    This is where u_val² = u_num² + u_input² + u_D² is formed, for the table, the test and the plots; errors that
    simulation and measurement share are counted once, since the draws are of their difference. ``u_tolerance_m`` [m]
    counts at every time, with half of its square in each direction; ``to_dynamics`` (n, 3) [m, m, rad], by which the
    full dynamics would move the path, as one deviation of it.
    """
    squares = covariance + 0.5 * u_tolerance_m**2 * np.diag([1.0, 1.0, 0.0])
    return np.asarray(squares + to_dynamics[:, :, None] * to_dynamics[:, None, :])


def _acted(act: Acts, drawn: Drawn | None) -> Drawn | None:
    """The simulation with a change of its scene; None where there is no such scene: a tether cannot lose its length."""
    try:
        return drawn and drawn._replace(scene=act(drawn.scene))
    except TowvalError:
        return None


def _main_input(shares: dict[str, float]) -> Iterator[Finding]:
    named = {name: share for name, share in shares.items() if name != UNEXPLAINED}
    if any(named.values()):
        first = max(named, key=lambda name: named[name])
        yield finding("main_input", percent=100 * named[first], label=first)

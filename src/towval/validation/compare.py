"""Stage compare: simulated against measured path of the object, unaligned."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Comparison, Finding, RunUncertainty, Severity, SimulatedMotion, Track, Verdict
from towval.model.errors import InputError, RefusedError
from towval.model.findings import finding
from towval.model.geometry import position_rms
from towval.model.results import START_OFF
from towval.model.statement import Bounds, Draws, VisibleFault
from towval.validation.consequences import excusing, forbidding
from towval.validation.metrics import aligned_rms, area_metric, error_ratio, frechet_distance
from towval.validation.out_of_sight import changes_unseen
from towval.validation.path_frame import OnPath, PathFrame
from towval.validation.statistics import SIZES, STATISTICS, RightModel, bounds, error_sizes, holding_levels, place
from towval.validation.verdict import Evidence, between, statement_findings, verdict_of

TOLERANCE_M = 0.02
"""Tolerance where none is stated."""

_START_SHARE = 0.25
"""Share of the tolerance by which the start of the simulation may lead it off."""

_MOVING_M_PER_S = 2e-3
"""Speed from which the simulated object counts as moving: above the creep of a regularised law."""


@dataclass(frozen=True)
class CompareSettings:
    """Keys of ``config["compare"]``.

    ``tolerance_m`` is the error of the path that matters for the intended use [m], by default :data:`TOLERANCE_M`;
    ``resolution_m`` its former name. ``bound_confidence`` is that of the bounds.
    """

    tolerance_m: float | None = None
    resolution_m: float | None = None
    bound_confidence: float = 0.95

    def __post_init__(self) -> None:
        for name in ("tolerance_m", "resolution_m"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise InputError(f"compare.{name} is out of range", got=value, allowed="above 0 m")
        if None not in (self.tolerance_m, self.resolution_m):
            raise InputError("compare.resolution_m is the former name of tolerance_m", remedy="state one of them")
        if not 0.5 <= self.bound_confidence < 1:
            raise InputError("compare.bound_confidence is out of range", got=self.bound_confidence, allowed="0.5 to 1")

    @property
    def stated_m(self) -> float | None:
        """The error that matters as stated [m], None where it is not."""
        return self.tolerance_m if self.tolerance_m is not None else self.resolution_m


def compare(
    run: str,
    simulated: SimulatedMotion,
    measured: Track,
    uncertainty: RunUncertainty,
    settings: CompareSettings | None = None,
) -> Comparison:
    """Compare a simulated motion with the measured one, frame by frame and without aligning them.

    Only frames in which the object was seen count; `RefusedError` where there is none. ``uncertainty`` describes the
    error of a right model at the simulated times. The verdict is in the terms of ASME V&V 20: E against u_val (see
    :func:`towval.validation.uncertainty.with_numerical` and docs/validation.md).
    """
    settings = settings or CompareSettings()
    frame = PathFrame(measured, simulated.time_s)
    pose, seen = frame.pose, frame.seen
    if not seen.any():
        raise RefusedError(
            f"run {run} cannot be compared",
            got="no simulated frame in which the object was seen",
            remedy="look at the findings of the stage track",
        )
    error = frame.error(simulated.pose)
    distance = np.linalg.norm(error[:, :2], axis=1)
    u_val = position_rms(uncertainty.validation)
    along_across = frame.along_across(error)[:, :2]
    path_std = np.sqrt(np.diagonal(frame.covariance(uncertainty.validation[:, :2, :2]), axis1=1, axis2=2))
    found = Comparison(
        run=run,
        time_s=simulated.time_s,
        error=error,
        along_across=along_across,
        ratio=error_ratio(error, uncertainty.validation),
        path_rms_m=_rms(distance),
        path_max_m=float(np.nanmax(distance)),
        final_error_m=float(distance[seen][-1]),
        heading_rms_rad=_rms(error[:, 2]),
        path_length_m=float(frame.length[-1]),
        u_num_m=simulated.statistic("u_num_m"),
        u_input_m=position_rms(uncertainty.simulation),
        u_measurement_m=position_rms(uncertainty.measurement),
        u_val_m=u_val,
        verdict=Verdict.NOT_JUDGED,
        tracked_frames=int(np.count_nonzero(seen)),
        lost_frames=int(np.count_nonzero(~seen)),
        frechet_m=frechet_distance(simulated.pose[seen, :2], pose[seen, :2]),
        area_along_m=area_metric(along_across[:, 0], path_std[:, 0]),
        area_across_m=area_metric(along_across[:, 1], path_std[:, 1]),
        aligned_rms_m=aligned_rms(simulated.pose[seen, :2], pose[seen, :2]),
    )
    return _judged(found, simulated, measured, uncertainty, settings)


def _judged(
    found: Comparison,
    simulated: SimulatedMotion,
    measured: Track,
    uncertainty: RunUncertainty,
    settings: CompareSettings,
) -> Comparison:
    """The comparison with bounds, statistics, verdict and findings added."""
    tolerance_m = settings.stated_m or TOLERANCE_M
    tested, drawn_tests, (begins_m, ends_m) = _tested(found, simulated, measured, uncertainty, settings)
    upstream = (*uncertainty.upstream, *measured.findings, *simulated.findings)
    draws = uncertainty.draws
    unseen: list[Finding] = []
    if draws is not None and tested["limits"]:
        unseen = changes_unseen(measured, simulated, draws, uncertainty.confidence)
    evidence = Evidence(
        tolerance_m=tolerance_m,
        detectable_m=_detectable_m(uncertainty.faults),
        seen_share=_seen_share(found.error, simulated),
        moved_m=found.path_length_m,
        forbidding=forbidding((*upstream, *uncertainty.findings)) or _start_off(simulated, tolerance_m),
        excusing=excusing((*upstream, *unseen)),
        shares=uncertainty.shares,
        explanation=uncertainty.explanation,
        largest_m=found.path_max_m,
        u_num_m=found.u_num_m,
        u_val_m=found.u_val_m,
        hidden=tuple(fault.kind for fault in uncertainty.faults if not fault.shift_rms_m <= tolerance_m),
        **tested,
    )
    verdict, reason = verdict_of(evidence)
    said = statement_findings(evidence, uncertainty.faults, settings.bound_confidence)
    # A change that no test sees needs no reason.
    findings = (reason, *said, *(unseen if evidence.rejected else ()), *_findings(measured, simulated))
    if settings.stated_m is None:
        findings = (*findings, finding("tolerance_default", tolerance_mm=1e3 * tolerance_m))
    every = (*upstream, *uncertainty.findings, *findings)
    codes = dict.fromkeys(each.code for each in every if each.severity is not Severity.NOTE)
    model = evidence.bounds.model.get("position_max", (float("nan"),) * 2)
    numbers: dict[str, Any] = {f"{name}_statistic": value for name, value in evidence.statistics.items()}
    numbers |= {f"{name}_limit": value for name, value in evidence.limits.items()}
    return replace(
        found,
        verdict=verdict,
        tolerance_m=tolerance_m,
        tolerance_stated=settings.stated_m is not None,
        error_upper_m=evidence.upper_m,
        model_error_lower_m=model[0],
        model_error_upper_m=model[1],
        detectable_m=evidence.detectable_m,
        seen_share=evidence.seen_share,
        begins_m=begins_m,
        ends_m=ends_m,
        warnings=" ".join(codes),
        drawn_tests=drawn_tests,
        bounds=evidence.bounds,
        faults=uncertainty.faults,
        explanation=evidence.explanation,
        findings=findings,
        **numbers,
    )


def _detectable_m(faults: Sequence[VisibleFault]) -> float:
    """Shift of the path, RMS, from which on half of the kinds of faults show [m]; NaN without faults."""
    visible = sorted(np.nan_to_num(fault.shift_rms_m, nan=np.inf) for fault in faults)
    return float(visible[(len(visible) - 1) // 2]) if visible else float("nan")


def _seen_share(error: Array, simulated: SimulatedMotion) -> float:
    """Share of the frames of the motion in which the object was seen; of all frames where it never moves."""
    moving = np.linalg.norm(simulated.twist[:, :2], axis=1) > _MOVING_M_PER_S
    seen = np.isfinite(error[:, 0])
    return float(np.mean(seen[moving] if moving.any() else seen))


def _tested(
    found: Comparison,
    simulated: SimulatedMotion,
    measured: Track,
    uncertainty: RunUncertainty,
    settings: CompareSettings,
) -> tuple[dict[str, Any], Array, tuple[float, float]]:
    """The tested part of the evidence, the draws of the test (k, 2), and between which lengths the error begins [m].

    Empty, and NaN, where there are no draws or too few times.
    """
    draws = uncertainty.draws
    path = None if draws is None else OnPath.of(measured, simulated, draws)
    if draws is None or path is None:
        nothing = {"bounds": Bounds(), "statistics": {}, "limits": {}, "where": ""}
        return nothing, np.empty((0, 2)), (np.nan, np.nan)
    error, drawn = path.error, path.drawn
    right = RightModel.of(drawn, draws.inputs, uncertainty.confidence)
    statistics = dict(zip(STATISTICS, map(float, right.statistics(error)), strict=True))
    limits = dict(zip(STATISTICS, map(float, right.limits), strict=True))
    confidence, both = settings.bound_confidence, 0.5 * (1 + settings.bound_confidence)
    # The draws do not represent a run that is rejected: there the plain quantile is used, exact for large errors.
    levels = None if right.rejects(error) else holding_levels(drawn, path.off, confidence)
    begins = place(error, right, path.length)
    upper = np.array([[0.0], [1.0]]) * _between(found, draws.rows)
    off, model = bounds(error, path.off, confidence, levels) + upper, bounds(error, drawn, both) + upper
    tested = {
        "bounds": Bounds(_named(off), _named(model)),
        "between_m": float(upper[1, SIZES.index("position_max")]),
        "statistics": statistics,
        "limits": limits,
        "where": _where(error, path.frame.pose[path.frame.seen], path.length, begins),
    }
    return tested, np.column_stack([_keys(draws), (right.drawn / right.limits).max(axis=1)]), begins


def _start_off(simulated: SimulatedMotion, tolerance_m: float) -> tuple[str, ...]:
    """Why a run is not judged whose start from rest leads it off by what matters at its tolerance [m]."""
    off_m = simulated.statistics.get(START_OFF, 0.0)
    if off_m <= _START_SHARE * tolerance_m:
        return ()
    return (
        f"the object moves in the first picture, and the simulation starts it from rest, which leads its path off by "
        f"up to {1e3 * off_m:.1f} mm, where {1e3 * tolerance_m:g} mm matter. Begin the video while all bodies rest",
    )


def _between(found: Comparison, rows: NDArray[np.intp]) -> Array:
    """By how much the error of a run is larger at all times than at those at which draws are kept, each of SIZES (6,).

    Of a long run they are kept at some times only, and what is between them is not tested.
    """
    error = np.column_stack([found.along_across, found.error[:, 2]])
    kept = np.zeros(len(error), dtype=bool)
    kept[rows] = True
    seen = np.isfinite(error[:, 0])
    return np.maximum(error_sizes(error[seen]) - error_sizes(error[seen & kept]), 0.0)


def _keys(draws: Draws) -> Array:
    """A key (k,) of each draw that is the same in all runs of a campaign: its first input, which they share."""
    return draws.inputs[:, 0] if draws.inputs.shape[1] else np.arange(len(draws.inputs), dtype=np.float64)


def _named(found: Array) -> dict[str, tuple[float, float]]:
    return {name: (float(low), float(high)) for name, low, high in zip(SIZES, *found, strict=True)}


def _where(error: Array, pose: Array, length: Array, begins: tuple[float, float]) -> str:
    """Where on the path the error begins, how large it becomes and in which direction."""
    begin = int(np.searchsorted(length, begins[0])) if np.isfinite(begins[0]) else 0
    rest = error[begin:]
    along, across, _ = 1e3 * rest[np.argmax(np.hypot(rest[:, 0], rest[:, 1]))]
    heading = float(np.degrees(rest[np.argmax(np.abs(rest[:, 2])), 2]))
    start = (
        f"it begins {between(*begins)}, near ({pose[begin, 0]:.2f}, {pose[begin, 1]:.2f}) m, and"
        if np.isfinite(begins[0]) else "it is there all along and"
    )  # fmt: skip
    return f"{start} reaches {along:+.1f} mm along, {across:+.1f} mm across and {heading:+.2f}°"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _findings(measured: Track, simulated: SimulatedMotion) -> Iterable[Finding]:
    lost = np.count_nonzero(~measured.seen)
    if lost:
        yield finding("compare_lost", count=lost)
    if len(simulated.time_s) < len(measured.time_s):
        yield finding("compare_cut", count=len(measured.time_s) - len(simulated.time_s))

"""Stage compare: simulated against measured path of the object, unaligned."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from towval.model import (
    Array,
    Comparison,
    Finding,
    RunUncertainty,
    Severity,
    SimulatedMotion,
    Track,
    TrackStatus,
    Verdict,
)
from towval.model.errors import InputError, RefusedError
from towval.model.findings import finding
from towval.model.geometry import (
    error_signature,
    normalised_signature,
    rotation,
    signature_blocks,
    signature_entries,
    wrapped,
)
from towval.validation.metrics import aligned_rms, area_metric, error_ratio, frechet_distance, position_rms

_STEP_M = 0.01
"""Way after which direction and length of the path are read again [m]: long against noise, short against bends."""


@dataclass(frozen=True)
class CompareSettings:
    """Keys of ``config["compare"]``.

    ``resolution_m`` is the smallest path error that matters to whoever asks [m]: where twice the validation uncertainty
    exceeds it, agreement says too little and the verdict is "too uncertain".
    """

    resolution_m: float = 0.02

    def __post_init__(self) -> None:
        if not self.resolution_m > 0:
            raise InputError("compare.resolution_m is out of range", got=self.resolution_m, allowed="above 0 m")


def compare(
    run: str,
    simulated: SimulatedMotion,
    measured: Track,
    uncertainty: RunUncertainty,
    settings: CompareSettings | None = None,
) -> Comparison:
    """Compare a simulated motion with the measured one, frame by frame and without aligning them.

    Parameters
    ----------
    measured : Track
        What the camera saw; only frames in which the object was seen count.
    uncertainty : RunUncertainty
        What the error may be if the model is right, at the simulated times.
    settings : CompareSettings, optional
        Which error matters.

    Returns
    -------
    Comparison
        Errors over time, their summary, and the verdict in the terms of ASME V&V 20: E against u_val (see
        :func:`towval.validation.uncertainty.with_numerical`).

    Raises
    ------
    RefusedError
        When no simulated frame was seen.
    """
    settings = settings or CompareSettings()
    rows = np.minimum(np.searchsorted(measured.time_s, simulated.time_s - 1e-9), len(measured.time_s) - 1)
    pose = np.where(measured.seen[rows, None], measured.pose[rows], np.nan)
    seen = np.isfinite(pose[:, 0])
    if not seen.any():
        raise RefusedError(
            f"run {run} cannot be compared",
            got="no simulated frame in which the object was seen",
            remedy="look at the findings of the stage track",
        )
    error = simulated.pose - pose
    error[:, 2] = wrapped(error[:, 2])
    distance = np.linalg.norm(error[:, :2], axis=1)
    u_val = position_rms(uncertainty.validation)
    turn = rotation(_directions(pose))
    along_across = np.einsum("nji,nj->ni", turn, error[:, :2])
    path_covariance = turn.transpose(0, 2, 1) @ uncertainty.validation[:, :2, :2] @ turn
    path_std = np.sqrt(np.diagonal(path_covariance, axis1=1, axis2=2))
    verdict, reason = _verdict(error, along_across, pose, uncertainty, u_val, settings)
    return Comparison(
        run=run,
        time_s=simulated.time_s,
        error=error,
        along_across=along_across,
        ratio=error_ratio(error, uncertainty.validation),
        path_rms_m=_rms(distance),
        path_max_m=float(np.nanmax(distance)),
        final_error_m=float(distance[seen][-1]),
        heading_rms_rad=_rms(error[:, 2]),
        path_length_m=float(_arc_length(pose)[-1]),
        u_num_m=simulated.statistics["u_num_m"],
        u_input_m=position_rms(uncertainty.simulation),
        u_measurement_m=position_rms(uncertainty.measurement),
        u_val_m=u_val,
        verdict=verdict,
        tracked_frames=int(np.count_nonzero(measured.status[rows] == TrackStatus.TRACKED)),
        lost_frames=int(np.count_nonzero(measured.status[rows] != TrackStatus.TRACKED)),
        frechet_m=frechet_distance(simulated.pose[seen, :2], pose[seen, :2]),
        area_along_m=area_metric(along_across[:, 0], path_std[:, 0]),
        area_across_m=area_metric(along_across[:, 1], path_std[:, 1]),
        aligned_rms_m=aligned_rms(simulated.pose[seen, :2], pose[seen, :2]),
        findings=(reason, *_findings(measured, simulated)),
    )


def _verdict(
    error: Array, along_across: Array, pose: Array, uncertainty: RunUncertainty, u_val: float, settings: CompareSettings
) -> tuple[Verdict, Finding]:
    """The verdict and the sentence that gives its reason.

    A fault of the model is detected when an entry of the error's signature, in units of its deviation, exceeds what
    the largest entry of a right model exceeds once in ``1 / (1 − confidence)`` runs.
    """
    normalised = normalised_signature(error_signature(error), uncertainty.signature).max(axis=1)
    peak, limit = float(np.nanmax(normalised)), uncertainty.signature_limit
    signature = f"the error's signature reaches {peak:.1f} of its deviations, a correct model's {limit:.1f}"
    if peak > limit:
        where = f"Model-form error: {_where(error, along_across, pose, normalised, limit)}"
        return Verdict.MODEL_ERROR, finding("verdict", Severity.WARNING, statement=where, signature=signature)
    if 2 * u_val > settings.resolution_m:
        hidden = (
            f"Too uncertain to tell: an error up to {2000 * u_val:.0f} mm could hide in the uncertainty, and errors "
            f"from {1000 * settings.resolution_m:.0f} mm on matter"
        )
        return Verdict.TOO_UNCERTAIN, finding("verdict", Severity.WARNING, statement=hidden, signature=signature)
    agrees = f"Agrees within the validation uncertainty of {1000 * u_val:.1f} mm (one deviation)"
    return Verdict.AGREES, finding("verdict", statement=agrees, signature=signature)


def _where(error: Array, along_across: Array, pose: Array, normalised: Array, limit: float) -> str:
    """Where on the path the error begins, how large it becomes and in which direction."""
    entries = signature_entries()
    blocks = signature_blocks(len(error))
    length = _arc_length(pose)
    # The entry that exceeds and ends first says when the error shows; a change also says since when it has grown.
    exceeding = [entry for entry, value in zip(entries, normalised, strict=True) if value > limit]
    first = min(exceeding, key=lambda entry: (entry.last, -entry.first))
    begin, end = int(blocks[first.first][-1]), int(blocks[first.last][-1])
    place = pose[begin] if np.isfinite(pose[begin, 0]) else pose[np.flatnonzero(np.isfinite(pose[:, 0]))[0]]
    rest = slice(begin, None)
    worst = begin + int(np.nanargmax(np.linalg.norm(error[rest, :2], axis=1)))
    along, across = 1000 * along_across[worst]
    turn = np.degrees(error[rest, 2])
    heading = float(turn[np.nanargmax(np.abs(turn))])
    return (
        f"it begins between {length[begin]:.2f} m and {length[end]:.2f} m of the path, near ({place[0]:.2f}, "
        f"{place[1]:.2f}) m, and reaches {along:+.1f} mm along, {across:+.1f} mm across and {heading:+.2f}°"
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _directions(pose: Array) -> Array:
    """Direction (n,) of the measured path [rad]; where the object rests, its last one; NaN where it never moves."""
    direction = np.full(len(pose), np.nan)
    seen = np.flatnonzero(np.isfinite(pose[:, 0]))
    anchor = pose[seen[0], :2]
    for i in seen:
        step = pose[i, :2] - anchor
        if step @ step > _STEP_M**2:
            direction[i], anchor = np.arctan2(step[1], step[0]), pose[i, :2]
    known = np.flatnonzero(np.isfinite(direction))
    if len(known) == 0:
        return direction
    return direction[known[np.clip(np.searchsorted(known, np.arange(len(pose))), 0, len(known) - 1)]]


def _arc_length(pose: Array) -> Array:
    """Arc length (n,) of the measured path [m], read at steps longer than the noise, so that a rest adds nothing."""
    length, total, corner = np.zeros(len(pose)), 0.0, None
    for i, position in enumerate(pose[:, :2]):
        if np.isfinite(position[0]):
            if corner is None:
                corner = position
            path = float(np.linalg.norm(position - corner))
            if path > _STEP_M:
                total, corner = total + path, position
        length[i] = total
    return length


def _findings(measured: Track, simulated: SimulatedMotion) -> Iterable[Finding]:
    lost = int(np.count_nonzero(measured.status != TrackStatus.TRACKED))
    if lost:
        yield finding("compare_lost", count=lost)
    if len(simulated.time_s) < len(measured.time_s):
        yield finding("compare_cut", count=len(measured.time_s) - len(simulated.time_s))

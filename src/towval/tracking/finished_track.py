"""What was recorded of one body, finished: registered to the edges of all pictures, noise estimated, rests held."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Finding, Track, TrackStatus
from towval.model.findings import finding
from towval.model.geometry import compose
from towval.tracking.blur import ahead_of_middle
from towval.tracking.camera_motion import ViewMotion
from towval.tracking.edges_alone import EdgesAlone
from towval.tracking.known_lengths import lift_findings
from towval.tracking.noise import as_when_moving, hold_rest, scatter_factors, steadied
from towval.tracking.outline import OutlineFit
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.record import Record
from towval.tracking.registration import registration
from towval.tracking.two_measurements import EdgeWatch, compared, edges


@dataclass(frozen=True)
class FinishConstants:
    """Tuned constants of finishing a track; lengths in pixels are measured on the planar target."""

    unsure_edges_px: float = 0.15  # [px] Deviation: sharp edges give up to 0.1, blurred ones 0.2 and more.
    low_texture_px: float = 0.12  # [px] Deviation of a pose from which on a target counts as too plain.
    moving_px: float = 0.1  # [px] A picture: a body that moves less shows compression's repeated error.
    most_scatter_px: float = 0.06  # [px] More is a motion that five pictures do not follow, not noise.
    most_turned: float = 2.0  # Times the predicted scatter of headings: that of a few marks is 1.2 to 2 times as large.
    most_rest_px: float = 0.1  # [px] Poses of a body at rest lie within this.
    named_blur_px: float = 1.0  # [px] A blur so wide is reported; readings are smoothed by 0.6 px anyway.


CONSTANTS = FinishConstants()


@dataclass(frozen=True)
class Followed:
    """What following one body through a film leaves behind.

    ``pixel_m``: width of a pixel on the target [m]; ``first_pose`` (3,) and ``start_covariance`` (3, 3): of the first
    picture; ``record``: poses picture by picture; ``edge_watch`` and ``edges_alone``: what its edges said beside the
    texture, and in its place; ``fits``: outlines fitted in the pictures ``fitted_in``; ``exposure_s`` [s] and
    ``widest_blur_px`` [px]: of the pictures; ``mistakable``: number of times at which something else looked like it;
    ``findings``: those of its start.
    """

    target: PlanarTarget
    pixel_m: float
    first_pose: Array
    start_covariance: Array
    record: Record
    edge_watch: EdgeWatch
    edges_alone: EdgesAlone
    fits: Sequence[OutlineFit]
    fitted_in: Sequence[int]
    exposure_s: float
    widest_blur_px: float
    mistakable: int
    findings: Sequence[Finding]


def finished(
    body: Followed, method: str, further_findings: Sequence[Finding] = (), view: ViewMotion | None = None
) -> Track:
    """The whole record of a body as a track.

    ``method``: name of the tracker; ``view``: how the camera moved, where it was watched.
    """
    time_s, raw, covariance, status, inliers, residual = body.record.columns()
    target, pixel_m = body.target, body.pixel_m
    if view is not None:
        shift, by_view = view.of_poses(target.body, raw)
        raw, covariance = raw + shift, covariance + by_view
        status[(status == TrackStatus.TRACKED) & ~view.known] = TrackStatus.COASTING
    tracked = status == TrackStatus.TRACKED
    raw = raw - ahead_of_middle(time_s, np.where(tracked[:, None], raw, np.nan), body.exposure_s)
    replace_first(covariance, tracked, body.start_covariance)
    raw, covariance, fit, of_edges = with_outline(body, time_s, raw, covariance)
    moving = moves_on(raw, tracked, pixel_m)
    covariance = honest_covariance(time_s, raw, covariance, tracked, moving, pixel_m)
    most = CONSTANTS.most_rest_px * pixel_m * np.array([1, 1, 1 / target.reach_m])
    pose = hold_rest(time_s, raw, covariance, tracked, most)
    covariance = as_when_moving(covariance, tracked & moving, tracked & ~moving)
    if fit is not None:
        pose = compose(pose, fit.correction)
    of_observations = judge_observations(body, time_s, covariance, status)
    return Track(
        body=target.body.name,
        time_s=time_s,
        pose=pose,
        covariance=covariance,
        status=status,
        inlier_fraction=inliers,
        residual=residual,
        start_covariance=body.start_covariance if fit is None else fit.covariance,
        features=body.record.features(raw, target.body.tracked_plane_height_m),
        findings=(*body.findings, *of_edges, *of_observations, *further_findings),
        method=method,
    )


def replace_first(covariance: Array, tracked: NDArray[np.bool_], start_covariance: Array) -> None:
    """The first picture made the template, so it fits itself: its noise is that of the others."""
    later = np.flatnonzero(tracked)[1:]
    if tracked[0]:
        covariance[0] = np.median(covariance[later], axis=0) if len(later) else start_covariance


def with_outline(
    body: Followed, time_s: Array, pose: Array, covariance: Array
) -> tuple[Array, Array, OutlineFit | None, list[Finding]]:
    """Poses (n, 3) and covariances with what the outline says of them, the registration, and findings about both."""
    looks = body.edge_watch.looks()
    if not len(looks.picture):
        return pose, covariance, None, judge_registration(body, None, np.zeros(2))
    seen = compared(time_s, pose, covariance, looks, edges(body.target, body.first_pose))
    findings = [*lift_findings(body.target, time_s[looks.picture], pose[looks.picture], looks.size)]
    excess, usual_m = (seen.excess + seen.hops)[list(body.fitted_in)], body.edge_watch.usual_size()
    fit = registration(body.fits, excess, usual_m, seen.strayed, body.pixel_m)
    findings += judge_registration(body, fit, usual_m)
    std_m = float(np.percentile(np.sqrt(np.linalg.eigvalsh(seen.excess[looks.picture, :2, :2])[:, -1]), 95))
    if std_m > CONSTANTS.unsure_edges_px * body.pixel_m:
        findings.append(finding("texture_unsure", name=body.target.body.name, std_mm=1000 * std_m))
    findings += body.edges_alone.findings(len(pose))
    alone, widened = body.edges_alone.pictures, seen.widened(pose, covariance)
    seen.steps[alone], widened[alone] = body.edges_alone.steps(fit), covariance[alone]
    return compose(pose, seen.steps), widened, fit, findings


def judge_registration(body: Followed, fit: OutlineFit | None, usual_m: Array) -> list[Finding]:
    """Findings about edges, whose length and width are usually ``usual_m`` (2,) more than those of the top."""
    name = body.target.body.name
    if fit is None:
        return [finding("edges_not_found", name=name, std_mm=1000 * np.sqrt(body.start_covariance[0, 0]))]
    if fit.largest_std_m <= CONSTANTS.unsure_edges_px * body.pixel_m:
        return []
    std_mm, length_mm, width_mm = 1000 * np.array([fit.largest_std_m, *usual_m])
    return [finding("edges_unsure", name=name, std_mm=std_mm, length_mm=length_mm, width_mm=width_mm)]


def moves_on(pose: Array, tracked: NDArray[np.bool_], pixel_m: float) -> NDArray[np.bool_]:
    """Pictures (n,) after which the body moves on, by more than a coded picture of a body at rest does."""
    masked = np.where(tracked[:, None], pose[:, :2], np.nan)
    step = np.linalg.norm(np.diff(masked, axis=0, append=np.nan), axis=1)
    return np.asarray(step > CONSTANTS.moving_px * pixel_m)


def honest_covariance(
    time_s: Array, pose: Array, covariance: Array, tracked: NDArray[np.bool_], moving: NDArray[np.bool_], pixel_m: float
) -> Array:
    """Covariances of the pictures' residuals, widened to those of pictures around and to the scatter in time."""
    covariance[tracked] = steadied(covariance[tracked])
    factors = scatter_factors(time_s, np.where(tracked[:, None], pose, np.nan), covariance, moving)
    if tracked.any():
        most = CONSTANTS.most_scatter_px * pixel_m / np.sqrt(np.median(covariance[tracked][:, 0, 0]))
        whole = min(factors[0], max(1.0, most))
        turn = min(factors[1], max(whole, CONSTANTS.most_turned))
        covariance[tracked] *= np.outer([whole, whole, turn], [whole, whole, turn])
    return covariance


def judge_observations(body: Followed, time_s: Array, covariance: Array, status: NDArray[np.uint8]) -> list[Finding]:
    """Findings about frames without an observation, and about a target too plain to be tracked well."""
    findings, name, tracked = [], body.target.body.name, status == TrackStatus.TRACKED
    missed, lost = time_s[~tracked], int((status == TrackStatus.LOST).sum())
    if len(missed):
        counts = {"count": len(missed), "frames": len(status), "lost": lost, "bridged": len(missed) - lost}
        findings.append(finding("not_seen", name=name, **counts, first_s=missed[0], last_s=missed[-1]))
    if body.widest_blur_px > CONSTANTS.named_blur_px:
        findings.append(finding("focus_changed", name=name, blur_px=body.widest_blur_px))
    if body.mistakable:
        findings.append(finding("lookalike", name=name, count=body.mistakable))
    std_m = float(np.sqrt(np.median(covariance[tracked][:, 0, 0]))) if tracked.any() else 0.0
    if std_m > CONSTANTS.low_texture_px * body.pixel_m:
        findings.append(finding("low_texture", name=name, std_mm=1000 * std_m))
    return findings

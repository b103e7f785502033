"""Whether a set of views is adequate: tilt, coverage and number of views, two halves compared, surveyed marks."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from towval.calibration.blocks import BOARD_DOUBTS, CAMERA_END, Estimate, residuals
from towval.calibration.bundle_adjustment import adjust, marginal_covariance
from towval.calibration.lens import LensTrial, active_parameters
from towval.calibration.observations import CalibrationObservations
from towval.calibration.single_marks import misfit_findings
from towval.model import Array, Calibration, Camera, Finding, Floor, Severity
from towval.model.findings import finding
from towval.optics.plane_uncertainty import (
    camera_position_covariance,
    pixel_grid,
    position_sensitivity,
    uncertainty_map,
)
from towval.optics.projection import to_plane


@dataclass(frozen=True)
class AdequacyConstants:
    """Tuned constants of the findings about a set of views."""

    enough_tilt_deg: float = 8.0  # [°] Median tilt of the held boards: below it focal length and distance trade off.
    enough_coverage: float = 0.4  # Of the picture, in the hull of all corners: outside it the lens is extrapolated.
    enough_views: int = 6  # Held boards.
    focal_std_share: float = 0.006  # Deviation over focal length that is warned about: 24 mm of camera height at 4 m.
    useless_focal_std_share: float = 0.02  # The same, refused.
    blurred_px: float = 4.5  # [px] Width of an edge: sharp pictures of five sets have 1.6 to 3.4, moved by 9 px 5 to 8.
    off_square: float = 0.005  # Of a pixel's sides: 0.0002 in one set of photographs, 0.0019 of an action camera.


CONSTANTS = AdequacyConstants()

_FILM_TILT = "film the board tilted by 20° to 40°, to all four sides in turn"
_FILM_ALL_OVER = "film the board all over the picture, also with its edge at the picture's edges and corners"


def tilts_deg(observed: CalibrationObservations, estimate: Estimate) -> list[float]:
    """Angle between each board and the image plane [°], in the order of the observations."""
    floor_normal = estimate.T_camera_floor[:3, 2]
    normals = [cv2.Rodrigues(place[:3])[0][:, 2] for place in estimate.places[: len(observed.boards)]]
    normals += [floor_normal] * len(observed.floor_boards)
    return [float(np.degrees(np.arccos(min(1.0, abs(normal[2]))))) for normal in normals]


def covered_share(corners_px: Sequence[Array], resolution_px: tuple[int, int]) -> float:
    """Share of the image within the convex hull of all corners."""
    if not len(corners_px):
        return 0.0
    hull = cv2.convexHull(np.concatenate(corners_px).astype(np.float32))
    return float(cv2.contourArea(hull) / (resolution_px[0] * resolution_px[1]))


@dataclass(frozen=True)
class ViewStatistics:
    """Held boards: number, tilts [°], share of the image covered, relative standard deviation of the focal length.

    That is infinite where the focal length found is not positive: no camera has one.
    """

    held: int
    tilt_deg: Array
    covered: float
    focal_std_share: float

    @property
    def median_tilt_deg(self) -> float:
        """Median tilt of the held boards [°], zero without any."""
        return float(np.median(self.tilt_deg)) if self.held else 0.0


def view_statistics(observed: CalibrationObservations, estimate: Estimate, covariance: Array) -> ViewStatistics:
    """Statistics of the held boards, from a fit and the covariance (18, 18) of its shared parameters."""
    held = len(observed.boards)
    tilt = np.array(tilts_deg(observed, estimate)[:held])
    covered = covered_share([s.corners_px for s in observed.boards], observed.resolution_px)
    focal, std = float(estimate.shared[0]), float(np.sqrt(covariance[0, 0]))
    return ViewStatistics(held, tilt, covered, std / focal if focal > 0 else np.inf)


def view_findings(statistics: ViewStatistics) -> list[Finding]:
    """Findings about degenerate sets of views, each with what to film instead."""
    findings = []
    focal = {"focal_percent": 100 * statistics.focal_std_share, "remedy": _FILM_TILT}
    useless = statistics.focal_std_share > CONSTANTS.useless_focal_std_share
    severity = Severity.REFUSAL if useless else Severity.WARNING
    if statistics.held and statistics.median_tilt_deg < CONSTANTS.enough_tilt_deg:
        tilt = {"held": statistics.held, "tilt_deg": statistics.median_tilt_deg}
        findings.append(finding("no-tilt", severity, **tilt, **focal))
    elif statistics.focal_std_share > CONSTANTS.focal_std_share:
        findings.append(finding("focal-length-uncertain", severity, **focal))
    if statistics.covered < CONSTANTS.enough_coverage:
        findings.append(finding("centre-only", covered_percent=100 * statistics.covered, remedy=_FILM_ALL_OVER))
    if statistics.held < CONSTANTS.enough_views:
        remedy = f"{_FILM_TILT}, and {_FILM_ALL_OVER}"
        findings.append(finding("few-views", held=statistics.held, least=CONSTANTS.enough_views, remedy=remedy))
    return findings


@dataclass(frozen=True)
class HalvesComparison:
    """RMS distance of positions on a plane from two halves of the views, found and expected from corner noise [m].

    A larger distance than expected is an error of the model: of the lens, of the board.
    """

    height_m: float
    found_m: float
    expected_m: float


def compare_halves(
    observed: CalibrationObservations, trial: LensTrial, heights_m: Sequence[float]
) -> list[HalvesComparison]:
    """Calibrate two halves of the views separately and compare them over the image on planes parallel to the floor.

    The first floor board and the marks are in both halves, so that both have the same floor frame. Empty where the
    halves would have fewer than three held boards each, or where there is no floor.
    """
    if observed.reference is None or len(observed.boards) < 6:
        return []
    active = active_parameters(trial.model, with_floor=True)
    fits = [_half(observed, trial, active, start) for start in (0, 1)]
    pixels = pixel_grid(observed.resolution_px, 24).reshape(-1, 2)
    comparisons = []
    for height in heights_m:
        on_plane = [to_plane(camera, floor, pixels, height) for camera, floor, _ in fits]
        apart = on_plane[0] - on_plane[1]
        expected = np.zeros(len(pixels))
        for camera, floor, covariance in fits:
            A = position_sensitivity(camera, floor, pixels, height)[0]
            expected += np.trace(A @ covariance @ A.transpose(0, 2, 1), axis1=1, axis2=2)
        comparisons.append(HalvesComparison(height, _rms(np.linalg.norm(apart, axis=1)), _rms(np.sqrt(expected))))
    return comparisons


def _half(
    observed: CalibrationObservations, trial: LensTrial, active: NDArray[np.intp], start: int
) -> tuple[Camera, Floor, Array]:
    boards = range(start, len(observed.boards), 2)
    flat = range(len(observed.boards), len(observed.observations))
    first = [] if observed.marks else [flat[0]]
    every = observed.blocks
    chosen = [*boards, *first, *flat[len(first) + start :: 2], *range(len(observed.observations), len(every))]
    blocks = [every[i] for i in chosen]
    fitted = adjust(blocks, trial.estimate.of(chosen), active)
    camera = Camera(observed.resolution_px, fitted.matrix, fitted.distortion, trial.model)
    return camera, Floor(fitted.T_camera_floor), marginal_covariance(blocks, fitted, active)[0]


def _rms(values: Array) -> float:
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else np.inf


def halves_findings(comparisons: Sequence[HalvesComparison]) -> list[Finding]:
    """A warning where the halves differ by much more than the corner noise explains."""
    apart = [plane for plane in comparisons if plane.found_m > max(3 * plane.expected_m, 1e-3)]
    return [
        finding("halves-disagree", found_mm=1e3 * p.found_m, height_m=p.height_m, expected_mm=1e3 * p.expected_m)
        for p in apart
    ]


def blur_findings(observed: CalibrationObservations) -> list[Finding]:
    """A warning about blurred pictures of the board."""
    width = {each.name: each.edge_px for each in observed.observations if each.edge_px > CONSTANTS.blurred_px}
    if not width:
        return []
    worst = max(width, key=lambda name: width[name])
    return [finding("views-blurred", names=", ".join(width), worst=worst, edge_px=width[worst])]


def squeeze_findings(calibration: Calibration, limit_m: float) -> list[Finding]:
    """A warning where the pictures are squeezed to one side, as by saving them at another aspect ratio.

    Focal lengths along and across the picture differ then, and boards fit as well as ever. Sensors have square pixels,
    or nearly. What differs by more than the views leave open (three deviations) is named where it moves places on the
    floor by more than ``limit_m`` (RMS over the picture).
    """
    (fx, fy), covariance = calibration.camera.matrix.diagonal()[:2], calibration.covariance
    squeeze = fx / fy
    slope = np.array([1.0, -squeeze]) / fy
    std = float(np.sqrt(max(slope @ covariance[:2, :2] @ slope, 0.0)))
    if abs(squeeze - 1) <= CONSTANTS.off_square + 3 * std:
        return []
    pixels, middle = pixel_grid(calibration.camera.resolution_px, 24).reshape(-1, 2), calibration.camera.matrix[:2, 2]
    square = middle + (pixels - middle) * [squeeze, 1.0]
    places = [to_plane(calibration.camera, calibration.floor, each, 0.0) for each in (pixels, square)]
    moved_m = _rms(np.linalg.norm(places[1] - places[0], axis=1))
    if moved_m <= limit_m:
        return []
    percent = {"percent": 100 * (squeeze - 1), "std_percent": 100 * std}
    return [finding("pictures-squeezed", **percent, moved_mm=1e3 * moved_m)]


def floor_quality(calibration: Calibration, heights_m: Sequence[float]) -> dict[str, float]:
    """Height of the camera with its deviation, and the deviation of positions on planes at some heights [m]."""
    return {
        "camera_height_m": float(calibration.floor.camera_position_m[2]),
        "camera_height_std_m": float(np.sqrt(camera_position_covariance(calibration)[2, 2])),
        **{f"position_std_mm at {z:.3f} m": 1e3 * uncertainty_map(calibration, z).rms_m for z in heights_m},
    }


def floor_findings(
    observed: CalibrationObservations, calibration: Calibration, heights_m: Sequence[float], limit_m: float
) -> list[Finding]:
    """A warning on the first plane where positions are more uncertain than ``limit_m`` (RMS over the image)."""
    references = [s.corners_px for s in observed.floor_boards]
    if observed.marks:
        references.append(observed.floor_reference.marks_px)
    covered_percent = 100 * covered_share(references, observed.resolution_px)
    for height in heights_m:
        plane = uncertainty_map(calibration, height)
        if plane.rms_m > limit_m:
            # Where the lens model ends, a pixel has no place at all.
            std = np.where(np.isfinite(plane.std_m), plane.std_m, 0.0)
            worst = np.unravel_index(np.argmax(std), std.shape)
            (u, v), size = plane.pixels[worst], {"rms_mm": 1e3 * plane.rms_m, "worst_mm": 1e3 * std[worst]}
            return [finding("floor-extrapolated", covered_percent=covered_percent, height_m=height, **size, u=u, v=v)]
    return []


def marks_std_px(observed: CalibrationObservations, estimate: Estimate) -> tuple[float, bool]:
    """Standard deviation of one coordinate of a mark, from the marks' own residuals [px].

    The six unknowns of the floor's place are counted against the marks, which overstates it where boards help. The
    second value: whether it exceeds the stated deviation significantly (0.1 % level).
    """
    residual = residuals(observed.blocks, estimate)[-1]
    freedom = max(residual.size - 6, 1)
    squares, stated = float(np.sum(residual**2)), observed.floor_reference.mark_std_px
    return np.sqrt(squares / freedom), bool(squares > stated**2 * chdtri(freedom, 0.001))


def marks_findings(observed: CalibrationObservations, trial: LensTrial, stated_std_px: float) -> list[Finding]:
    """Findings about surveyed marks that are worse than the campaign states [px], all of them or single ones."""
    if not observed.marks:
        return []
    reference, findings = observed.floor_reference, []
    if reference.mark_std_px > stated_std_px:
        findings.append(finding("marks-noisy", found_px=reference.mark_std_px, stated_px=stated_std_px))
    known = np.flatnonzero(trial.estimate.doubts_std[BOARD_DOUBTS - CAMERA_END] > 0)
    active = np.concatenate([active_parameters(trial.model, with_floor=True), BOARD_DOUBTS[known]])
    return [*findings, *misfit_findings(observed.blocks, trial.estimate, active, stated_std_px)]

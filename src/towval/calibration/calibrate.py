"""The stage ``calibrate``: pictures of a board, held up and lying on the floor, to a camera over a floor."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from towval.calibration.adequacy import (
    blur_findings,
    compare_halves,
    floor_findings,
    floor_quality,
    halves_findings,
    marks_findings,
    marks_std_px,
    squeeze_findings,
    tilts_deg,
    view_findings,
    view_statistics,
)
from towval.calibration.alike import without_repeats
from towval.calibration.behind_boards import as_floor_shows, some_of
from towval.calibration.blocks import Estimate, residuals
from towval.calibration.board_search import NamedImage, find_boards
from towval.calibration.corners import BoardObservation
from towval.calibration.doubts import doubts_std
from towval.calibration.floor import in_floor_axes
from towval.calibration.lens import LENS_MODELS, NESTED, LensTrial
from towval.calibration.marks_scale import check_scale
from towval.calibration.observations import MARKS_VIEW, CalibrationObservations
from towval.calibration.sound_views import Adjusted, adjust_sound_views
from towval.calibration.stray_marks import with_sound_marks
from towval.model import Board, Calibration, Camera, Finding, Floor, FloorReference, Severity, View
from towval.model.errors import InputError, RefusedError
from towval.model.findings import finding

_NONE_IS_HELD = (
    "every picture of camera.calibration_images is one of the floor's, too, and its board was taken to lie flat on the "
    "floor: narrow floor.more_images to those that do"
)
_MUST_BE_SEEN = "the board must be sharp, and no hand, glare or edge of the picture may hide a part of a chessboard"


@dataclass(frozen=True)
class CalibrateSettings:
    """How to calibrate: the keys of ``config["calibrate"]``.

    ``lens_models`` to choose from, names of :data:`towval.calibration.lens.LENS_MODELS`, smallest first; ``folds`` of
    the cross-validation; ``misfit_ratio``: a view with residuals this many times those of the median view is dropped;
    ``position_limit_m``: the position uncertainty that is warned about; ``accept_refused``: return a calibration from
    a degenerate set instead of refusing it; ``threads`` that search for boards.
    """

    lens_models: tuple[str, ...] = NESTED
    folds: int = 6
    misfit_ratio: float = 4.0
    position_limit_m: float = 0.003
    accept_refused: bool = False
    threads: int = 2

    def __post_init__(self) -> None:
        if not self.lens_models:
            raise InputError("calibrate.lens_models is empty", allowed=", ".join(LENS_MODELS))
        for name in self.lens_models:
            LENS_MODELS.require(name, "calibrate.lens_models")


def calibrate(
    images: Sequence[NamedImage],
    floor_images: Sequence[NamedImage],
    board: Board,
    floor: FloorReference,
    settings: CalibrateSettings,
    *,
    heights_m: Sequence[float] = (),
) -> Calibration:
    """Calibrate a camera and the floor under it.

    ``images`` are names and grey pictures (height, width) uint8 of the board held in many poses, ``floor_images`` of
    the board lying on the floor, of which the first fixes the floor frame unless ``floor`` has marks. They are read
    when they are searched and not kept, so a sequence that reads files needs memory for a few of them. ``heights_m``
    are those of the planar targets, for which the quality is stated besides the floor's [m]. The result holds every
    view with its residuals or the reason why it was dropped.

    `InputError` where no picture shows the board, the pictures differ in size, or the floor board is missing or not
    where ``floor`` says; `RefusedError` where too few views are left, or the set is degenerate and ``settings`` do not
    accept that.
    """
    everything, floor_names, resolution = _listed(images, floor_images)
    marked_px = {}
    if floor_names and floor.origin_corner_px is not None and not len(floor.marks_px):
        marked_px = {floor_names[0]: floor.origin_corner_px}
    observations, without_board = find_boards(everything, board, settings.threads, marked_px, len(floor_names))
    flat = _with_origin([s for s in observations if s.name in floor_names], floor_names, floor)
    held = tuple(s for s in observations if s.name not in floor_names)
    observed = CalibrationObservations(resolution, held, tuple(flat), floor, doubts_std(board, floor))
    observed, unsure, behind = as_floor_shows(observed, everything, settings.threads)
    calibration = calibrate_observations(observed, settings, without_board | unsure, heights_m=heights_m)
    calibration = replace(calibration, findings=(*calibration.findings, *behind, *_beside_another(observations)))
    refusals = [finding.text for finding in calibration.findings if finding.severity is Severity.REFUSAL]
    if refusals and not settings.accept_refused:
        remedy = None if len(everything) > len(floor_images) else _NONE_IS_HELD
        # A single mark that is metres off may leave all else uncertain.
        codes = "mark-left-out", "mark-misfit"
        marks = [finding.text for finding in calibration.findings if finding.code in codes][:1]
        unseen = [name for name in without_board if name not in floor_names]
        if len(unseen) > len(held):
            marks.append(f"{len(unseen)} of {len(unseen) + len(held)} held pictures: {without_board[unseen[0]]}.")
            remedy = f"look at {some_of(unseen)}: {_MUST_BE_SEEN}"
        raise RefusedError("the calibration views are degenerate", got=" ".join([*marks, *refusals]), remedy=remedy)
    return calibration


def _beside_another(observations: Sequence[BoardObservation]) -> list[Finding]:
    """A note on the pictures that show another board, which may be mistaken for the right one."""
    names = [one.name for one in observations if one.another_px is not None]
    return [finding("boards-alike", names=some_of(names), count=len(names))] if names else []


@dataclass(frozen=True)
class _Chosen(Sequence[NamedImage]):
    """Some pictures of some sequences, each read from its sequence when accessed and not kept."""

    places: tuple[tuple[Sequence[NamedImage], int], ...]

    def __len__(self) -> int:
        return len(self.places)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        if isinstance(index, slice):
            return _Chosen(self.places[index])
        images, place = self.places[index]
        return images[place]


def _listed(
    images: Sequence[NamedImage], floor_images: Sequence[NamedImage]
) -> tuple[_Chosen, list[str], tuple[int, int]]:
    """All pictures once, held boards first, the names of the floor pictures, and the common size."""
    # A pattern for held boards often matches the floor pictures, too.
    sizes: dict[tuple[int, ...], str] = {}
    on_floor: dict[str, int] = {}
    for i, (name, image) in enumerate(floor_images):
        _check_new(name, on_floor)
        on_floor[name] = i
        sizes.setdefault(image.shape, name)
    held, listed = [], set[str]()
    for i, (name, image) in enumerate(images):
        _check_new(name, listed)
        listed.add(name)
        sizes.setdefault(image.shape, name)
        if name not in on_floor:
            held.append((images, i))
        elif not np.array_equal(image, floor_images[on_floor[name]][1]):
            what = "a held board and a floor board have pictures of the same name"
            raise InputError(what, got=name, remedy="rename one")
    if len(sizes) != 1:
        got = ", ".join(f"{name}: {shape[1]} × {shape[0]}" for shape, name in sizes.items()) or "no picture"
        raise InputError("the calibration pictures are not of one size", got=got, allowed="the size of the videos")
    height, width = next(iter(sizes))
    flat = [(floor_images, i) for i in range(len(floor_images))]
    return _Chosen((*held, *flat)), list(on_floor), (width, height)


def _check_new(name: str, known: Container[str]) -> None:
    """Views are told apart by the names of their pictures: of two folders they may be the same."""
    if name in known:
        raise InputError("two calibration pictures have the same name", got=name, remedy="rename one")


def _with_origin(flat: list[BoardObservation], names: Sequence[str], floor: FloorReference) -> list[BoardObservation]:
    if len(floor.marks_px):
        return flat
    if not names or not flat or flat[0].name != names[0]:
        raise InputError(
            "the board is not found in the first floor picture",
            got=names[0] if names else "no floor picture",
            allowed="the whole board, lying flat on the floor",
            remedy="check floor.image, or give surveyed marks on the floor instead",
        )
    return [in_floor_axes(flat[0], floor), *flat[1:]]


def calibrate_observations(
    observed: CalibrationObservations,
    settings: CalibrateSettings,
    without_board: dict[str, str],
    *,
    heights_m: Sequence[float] = (),
) -> Calibration:
    """As :func:`calibrate`, from observed corners.

    ``without_board`` are names of pictures without a board and the reason, for the record. Without a floor
    (``observed.reference`` None) the camera alone is calibrated and the floor of the result is the camera frame itself.
    A degenerate set is in the findings, with the severity of a refusal where it is hopeless. `RefusedError` where too
    few views are left, the board that fixes the floor frame does not fit, or no camera does; `InputError` where
    surveyed marks contradict each other, or the scale of the boards on the floor.
    """
    try:
        if not observed.marks:
            return _calibrated(observed, settings, without_board, heights_m)
        check_scale(observed)
        return with_sound_marks(
            observed.floor_reference,
            observed.resolution_px,
            lambda sound: _calibrated(replace(observed, reference=sound), settings, without_board, heights_m),
        )
    except np.linalg.LinAlgError:
        marks = "the pixel and the coordinates of each of floor.surveyed_marks, and " if observed.marks else ""
        raise RefusedError(
            "no camera fits the calibration",
            got=f"{len(observed.observations)} pictures of the board and {observed.marks} surveyed marks",
            remedy=f"check {marks}that all pictures are of one camera and show the board that is stated",
        ) from None


def _calibrated(
    observed: CalibrationObservations,
    settings: CalibrateSettings,
    without_board: dict[str, str],
    heights_m: Sequence[float],
) -> Calibration:
    """As :func:`calibrate_observations`, with all of the marks."""
    distinct, repeats = without_repeats(observed)
    adjusted = adjust_sound_views(distinct, settings.lens_models, settings.folds, settings.misfit_ratio)
    kept, dropped, settled = adjusted.kept, adjusted.dropped, adjusted.settled
    chosen = settled.chosen
    estimate = chosen.estimate
    calibration = Calibration(
        camera=Camera(observed.resolution_px, estimate.matrix, estimate.distortion, chosen.model),
        floor=Floor(estimate.T_camera_floor),
        covariance=settled.covariance,
        corner_noise_px=estimate.noise_px,
        views=_views(observed, kept, estimate, repeats | dropped, without_board),
    )
    calibration = _judged(calibration, kept, settled.trials, chosen, (0.0, *heights_m), settings.position_limit_m)
    stated = observed.reference.mark_std_px if observed.reference is not None else np.nan
    further = (*settled.findings, *_fisheye_findings(adjusted), *marks_findings(kept, chosen, stated))
    quality = {**calibration.quality, **settled.quality}
    left_out = _dropped_findings(calibration, repeats)
    return replace(calibration, findings=(*left_out, *calibration.findings, *further), quality=quality)


def _views(
    observed: CalibrationObservations,
    kept: CalibrationObservations,
    estimate: Estimate,
    dropped: dict[str, str],
    without_board: dict[str, str],
) -> tuple[View, ...]:
    names = [s.name for s in kept.observations]
    fitted = dict(zip(names, residuals(kept.blocks, estimate), strict=False))
    tilts = dict(zip(names, tilts_deg(kept, estimate), strict=True))
    on_floor = {s.name for s in observed.floor_boards}
    views = [
        View(
            name=s.name,
            corners_px=s.corners_px,
            board_m=s.board_m,
            residuals_px=fitted.get(s.name, np.full_like(s.corners_px, np.nan)),
            tilt_deg=tilts.get(s.name, np.nan),
            on_floor=s.name in on_floor,
            dropped=dropped.get(s.name, ""),
        )
        for s in observed.observations
    ]
    if kept.marks:
        marks, residual = kept.floor_reference, residuals(kept.blocks, estimate)[-1]
        views.append(View(MARKS_VIEW, marks.marks_px, marks.marks_m, residual, np.nan, on_floor=True))
    empty = np.zeros((0, 2))
    return (
        *views,
        *(View(name, empty, empty, empty, np.nan, dropped=reason) for name, reason in without_board.items()),
    )


def _judged(
    calibration: Calibration,
    kept: CalibrationObservations,
    trials: Sequence[LensTrial],
    chosen: LensTrial,
    heights_m: Sequence[float],
    limit_m: float,
) -> Calibration:
    """The calibration with its findings and quality figures."""
    statistics = view_statistics(kept, chosen.estimate, calibration.covariance)
    quality = {
        "views_used": float(len(kept.observations)),
        "views_dropped": float(sum(bool(view.dropped) for view in calibration.views)),
        "median_tilt_deg": statistics.median_tilt_deg,
        "covered_share": statistics.covered,
        "reprojection_rms_px": _reprojection_rms_px(calibration),
        "held_out_rms_px": float(np.sqrt(chosen.score_px2)),
        "condition_number": chosen.condition,
        "focal_length_std_px": float(np.sqrt(calibration.covariance[0, 0])),
    }
    findings = [*view_findings(statistics), *_lens_findings(trials, chosen)]
    findings += blur_findings(kept)
    if kept.reference is not None:
        halves = compare_halves(kept, chosen, heights_m)
        findings += halves_findings(halves)
        findings += floor_findings(kept, calibration, heights_m, limit_m)
        findings += squeeze_findings(calibration, limit_m)
        if kept.marks:
            quality["marks_rms_px"], _ = marks_std_px(kept, chosen.estimate)
        quality |= floor_quality(calibration, heights_m)
        for plane in halves:
            quality[f"halves_difference_mm at {plane.height_m:.3f} m"] = 1e3 * plane.found_m
            quality[f"halves_expected_mm at {plane.height_m:.3f} m"] = 1e3 * plane.expected_m
    return replace(calibration, findings=tuple(findings), quality=quality)


def _reprojection_rms_px(calibration: Calibration) -> float:
    """Root mean square length of the residual vectors of all corners used, as OpenCV counts it [px]."""
    used = [view.residuals_px for view in calibration.views if not view.dropped and view.name != MARKS_VIEW]
    return float(np.sqrt(np.mean(np.sum(np.concatenate(used) ** 2, axis=1))))


def _dropped_findings(calibration: Calibration, repeats: Mapping[str, str]) -> list[Finding]:
    """Findings about views that are left out, those that repeat another one in a single one."""
    found = []
    for view in calibration.views:
        if view.dropped and view.name not in repeats:
            severity = Severity.WARNING if len(view.corners_px) else Severity.NOTE
            found.append(finding("view-dropped", severity, name=view.name, reason=view.dropped))
    if repeats:
        found.append(finding("views-repeated", names=some_of(list(repeats)), count=len(repeats)))
    return found


def _fisheye_findings(adjusted: Adjusted) -> list[Finding]:
    """A warning where a fisheye predicts better than the pinhole camera that is kept."""
    if adjusted.fisheye is None:
        return []
    own, other = adjusted.settled.chosen, adjusted.fisheye
    numbers = {"chosen_px": np.sqrt(own.score_px2), "fisheye_px": np.sqrt(other.score_px2)}
    return [finding("lens-fisheye", chosen=own.model, model=other.model, **numbers)]


def _lens_findings(trials: Sequence[LensTrial], chosen: LensTrial) -> list[Finding]:
    """A note where a larger lens model predicts better but its coefficients are not determined."""
    better = [t for t in trials if not t.determined and t.score_px2 < chosen.score_px2]
    own = {"chosen": chosen.model, "chosen_px": np.sqrt(chosen.score_px2)}
    return [
        finding("lens-undetermined", model=t.model, score_px=np.sqrt(t.score_px2), condition=t.condition, **own)
        for t in better
    ]

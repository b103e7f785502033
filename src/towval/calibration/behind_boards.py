"""What stands still behind the boards: it shows which pictures have another zoom or crop, or are turned over.

A camera at a ceiling sees the floor behind every board that is held under it, or lies there. Features of it (Lowe
2004) are matched with the first picture of the floor, the boards left out. The homography between the two (RANSAC)
tells another crop from a turn of the camera, which is no fault of a picture: to first order it is a zoom, a shift, and
a perspective that the turn alone brings. No lens enters but for the focal length, roughly.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.calibration.blocks import CAMERA_END, DOUBTS, HELD_DOUBTS
from towval.calibration.board_search import NamedImage
from towval.calibration.corners import BoardObservation
from towval.calibration.observations import CalibrationObservations, first_guess
from towval.model import Array, Finding
from towval.model.findings import finding


@dataclass(frozen=True)
class BehindConstants:
    """Tuned constants of the comparison of backgrounds."""

    width_px: int = 400  # [px] To which pictures are reduced; the deviation of a zoom is then
    zoom_std_percent: float = 0.005  # [%]
    features: int = 400  # Of a picture.
    distinct: float = 0.8  # Distance of a feature's match over that of the next: Lowe's.
    inlier_px: float = 1.0  # [px] Of the reduced picture, from the common motion.
    least: int = 25  # Matches that agree; of random ones up to 11 did.
    spread: float = 0.15  # Of the picture, in the hull of these: more than a person has of it.
    board_scale: float = 1.5  # Of a board's corners, left out with its margin.
    differs_px: float = 1.0  # [px] At a picture's corner: 0.1 % of 1920 × 1080, or 0.1 to 0.2 mm on a top.
    significant: float = 4.0  # Deviations of a shift.
    carried: float = 0.1  # [rad] Of a turn in the picture, and share of a picture by which views differ,
    most_views: int = 2  # of which a camera that stays has no more: one zoom and another.
    lens_share: float = 0.35  # Of a turn's shift, which a lens makes look like a crop: 0.3 with that of lab_a.


CONSTANTS = BehindConstants()

_FLIPS = {
    (False, False): "", (False, True): "upside down",
    (True, False): "mirrored", (True, True): "upside down and mirrored",
}  # fmt: skip


@dataclass(frozen=True)
class Crop:
    """A picture against another: how it is turned over, its zoom, the shift (2,) of its middle [px], and its noise.

    ``turn_rad`` is what is left of a turn in the picture, ``middle_px`` (2,) how far crop and turn together move its
    middle [px].
    """

    flip: str = ""
    zoom: float = 1.0
    shift_px: Array = field(default_factory=lambda: np.zeros(2))
    std_px: float = 0.0
    turn_rad: float = 0.0
    middle_px: Array = field(default_factory=lambda: np.zeros(2))

    def displaced_px(self, other: "Crop", resolution_px: tuple[int, int]) -> float:
        """By how much the two displace the corner of a picture otherwise."""
        apart = float(np.linalg.norm(self.shift_px - other.shift_px))
        return abs(self.zoom - other.zoom) * float(np.hypot(*resolution_px)) / 2 + apart

    def differs(self, other: "Crop", resolution_px: tuple[int, int]) -> bool:
        """Whether the two displace the corner of a picture otherwise."""
        noise_px = CONSTANTS.significant * float(np.hypot(self.std_px, other.std_px))
        return self.displaced_px(other, resolution_px) > max(CONSTANTS.differs_px, noise_px)

    def turned_px(self, resolution_px: tuple[int, int]) -> float:
        """By how much a turn of the camera displaces the corner of a picture, zero where it is not significant."""
        crop_px = self.shift_px if self.differs(Crop(), resolution_px) else np.zeros(2)
        turn = Crop(zoom=1 + self.turn_rad, shift_px=self.middle_px - crop_px, std_px=self.std_px)
        return turn.displaced_px(Crop(), resolution_px) if turn.differs(Crop(), resolution_px) else 0.0

    def undone(self, pixels: Array, resolution_px: tuple[int, int]) -> Array:
        """Where pixels (n, 2) of the picture are in the other."""
        middle = (np.array(resolution_px) - 1) / 2
        return np.asarray(middle + (pixels - middle - self.shift_px) / self.zoom)


@dataclass(frozen=True)
class _Features:
    """Places (n, 2) from the picture's middle [px], descriptors (n, 128), and by how much the picture was reduced."""

    places: Array
    descriptors: NDArray[np.float32]
    reduced: float


def as_floor_shows(
    observed: CalibrationObservations, pictures: Sequence[NamedImage], threads: int
) -> tuple[CalibrationObservations, dict[str, str], tuple[Finding, ...]]:
    """All boards as the camera of the floor's first picture sees them, by what stands still behind them.

    ``pictures`` are those of the ``observed`` boards, among others. Also returned are the boards that are left out,
    each with the reason, and the findings. Where the floor is seen behind most of the held boards, their zoom and crop
    are known and no longer fitted. If the boards were filmed before the camera was mounted, nothing follows from what
    is behind them. Boards on the floor that were seen after the camera was turned are left out.
    """
    size = observed.resolution_px
    if not observed.floor_boards or not observed.boards:
        return observed, {}, ()
    all_crops = _crops(observed, pictures, threads)
    observed, left_out, turned = _without_turned(observed, all_crops)
    all_crops = {name: crop for name, crop in all_crops.items() if name not in left_out}
    crops = {each.name: all_crops[each.name] for each in observed.boards}
    seen = {name: crop for name, crop in crops.items() if crop is not None}
    if _carried(list(seen.values()), size):
        return observed, left_out, turned
    flipped = [name for name, crop in seen.items() if crop.flip]
    if flipped:
        behind = "what stands still behind the boards is turned over"
        named = finding("held-flipped", names=some_of(flipped), flip=seen[flipped[0]].flip, by=behind)
        return _undoubted(observed), left_out, (*turned, named)
    known = {name: crop for name, crop in all_crops.items() if crop is not None and not crop.flip}
    known = {
        name: _mean([each for each in known.values() if not each.differs(crop, size)]) for name, crop in known.items()
    }
    # One that differs by chance does so no more in the mean of those that are like it.
    differ = [name for name, crop in known.items() if crop.differs(Crop(), size)]
    held_differ = [name for name in differ if name in seen]
    kept = _undoubted(observed) if held_differ or 2 * len(seen) >= len(crops) else observed
    if not differ:
        return kept, left_out, turned
    seen = {name: known[name] for name in seen}
    of_held = [Crop()] if not held_differ else list(seen.values())
    usual = None if any(each.differs(of_held[0], size) for each in of_held) else of_held[0]
    reason = "the floor behind it is not seen, and others have another zoom or crop"
    dropped = {name: reason for name, crop in crops.items() if crop is None and usual is None}
    kept = kept.without(set(dropped))
    boards = tuple(_seen_by(each, seen.get(each.name, usual), size) for each in kept.boards)
    flat = tuple(_seen_by(each, known.get(each.name), size) for each in kept.floor_boards)
    most = known[max(differ, key=lambda name: abs(known[name].zoom - 1))]
    numbers = {"percent": 100 * (most.zoom - 1), "std_percent": CONSTANTS.zoom_std_percent}
    named = finding("held-differ", names=some_of(differ), u=most.shift_px[0], v=most.shift_px[1], **numbers)
    return replace(kept, boards=boards, floor_boards=flat), left_out | dropped, (*turned, named)


def _without_turned(
    observed: CalibrationObservations, crops: Mapping[str, Crop | None]
) -> tuple[CalibrationObservations, dict[str, str], tuple[Finding, ...]]:
    """The observations less the boards on the floor that were seen after the camera was turned, and what to say of it.

    One plane is fitted to all of them, as the camera saw it in the first of these pictures: boards that it saw from
    another place tilt it, and fit as well as ever. A held board lies anywhere, and stays.
    """
    seen = {each.name: crops.get(each.name) for each in observed.floor_boards[1:]}
    size = observed.resolution_px
    by_px = {name: crop.turned_px(size) for name, crop in seen.items() if crop is not None and not crop.flip}
    by_px = {name: px for name, px in by_px.items() if px > 0}
    if not by_px:
        return observed, {}, ()
    named = finding("floor-turned", names=some_of(list(by_px)), by_px=max(by_px.values()))
    reason = "the camera was turned between the first picture of the floor and this one"
    return observed.without(set(by_px)), dict.fromkeys(by_px, reason), (named,)


def _carried(crops: Sequence[Crop], resolution_px: tuple[int, int]) -> bool:
    """Whether the camera was moved between the pictures: it turned, or saw the floor at more than two sizes."""
    views: list[Crop] = []
    for crop in crops:
        far_px = CONSTANTS.carried * float(np.hypot(*resolution_px)) / 2
        if all(crop.displaced_px(view, resolution_px) > far_px for view in views):
            views.append(crop)
    return len(views) > CONSTANTS.most_views or any(abs(crop.turn_rad) > CONSTANTS.carried for crop in crops)


def _mean(crops: Sequence[Crop]) -> Crop:
    """One crop for all that are alike."""
    zoom, shift = (np.median([getattr(c, name) for c in crops], axis=0) for name in ("zoom", "shift_px"))
    return Crop("", float(zoom), shift, float(np.median([c.std_px for c in crops])))


def some_of(names: Sequence[str]) -> str:
    """The first of some names, and how many more there are."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more


def _seen_by(board: BoardObservation, crop: Crop | None, resolution_px: tuple[int, int]) -> BoardObservation:
    if crop is None or not crop.differs(Crop(), resolution_px):
        return board
    return replace(board, corners_px=crop.undone(board.corners_px, resolution_px))


def _undoubted(observed: CalibrationObservations) -> CalibrationObservations:
    """The observations with zoom and crop of the held pictures taken as known."""
    held = np.isin(CAMERA_END + np.arange(len(DOUBTS)), HELD_DOUBTS)
    return replace(observed, doubts_std=np.where(held, 0.0, observed.doubts_std))


def _crops(observed: CalibrationObservations, pictures: Sequence[NamedImage], threads: int) -> dict[str, Crop | None]:
    """Crop of each other picture against the first of the floor; None where the floor is not seen in it."""
    boards = {each.name: each for each in observed.observations}
    focal_px = float(first_guess(observed).shared[0])

    def features(i: int) -> tuple[str, tuple[_Features, ...]]:
        name, picture = pictures[i]
        if name not in boards:
            return name, ()
        shown, first = boards[name], name == observed.floor_boards[0].name
        corners = [shown.corners_px] if shown.another_px is None else [shown.corners_px, shown.another_px]
        return name, tuple(_features(picture, corners, mirrored=m) for m in ((False, True) if first else (False,)))

    with ThreadPoolExecutor(threads) as pool:
        found = dict(pool.map(features, range(len(pictures))))
    floor = found[observed.floor_boards[0].name]
    others = (*observed.boards, *observed.floor_boards[1:])
    return {each.name: _crop(floor, found[each.name][0], focal_px) for each in others}


def _features(picture: NDArray[np.uint8], boards_px: Sequence[Array], *, mirrored: bool) -> _Features:
    """Features of a picture reduced in size, without its boards."""
    reduced = max(1.0, picture.shape[1] / CONSTANTS.width_px)
    small = cv2.resize(picture, None, fx=1 / reduced, fy=1 / reduced, interpolation=cv2.INTER_AREA)
    mask: NDArray[Any] = np.full(small.shape, 255, dtype=np.uint8)
    for corners_px in boards_px:
        hull = cv2.convexHull(corners_px.astype(np.float32)).reshape(-1, 2)
        grown = (hull.mean(axis=0) + CONSTANTS.board_scale * (hull - hull.mean(axis=0))) / reduced
        cv2.fillConvexPoly(mask, np.rint(grown).astype(np.int32), 0)
    if mirrored:
        small, mask = cv2.flip(small, 1), cv2.flip(mask, 1)
    keys, descriptors = cv2.SIFT.create(nfeatures=CONSTANTS.features).detectAndCompute(small, mask)
    places = np.array([key.pt for key in keys], dtype=np.float64).reshape(-1, 2)
    middle = (np.array([small.shape[1], small.shape[0]]) - 1) / 2
    found = np.zeros((0, 128)) if descriptors is None else descriptors
    return _Features((places - middle) * reduced, np.asarray(found, dtype=np.float32), reduced)


def _crop(floor: tuple[_Features, ...], held: _Features, focal_px: float) -> Crop | None:
    for mirrored, reference in zip((False, True), floor, strict=True):
        found = _common_motion(reference, held)
        if found is not None:
            return _crop_of(*found, focal_px, mirrored=mirrored)
    return None


def _common_motion(floor: _Features, held: _Features) -> tuple[Array, float] | None:
    """Homography (3, 3) from places of one picture to the other's, and the deviation of its perspective [1 / px]."""
    if min(len(floor.places), len(held.places)) < CONSTANTS.least:
        return None
    pairs = cv2.BFMatcher().knnMatch(floor.descriptors, held.descriptors, k=2)
    near = [one for one, next_ in pairs if one.distance < CONSTANTS.distinct * next_.distance]
    if len(near) < CONSTANTS.least:
        return None
    before = floor.places[[one.queryIdx for one in near]]
    after = held.places[[one.trainIdx for one in near]]
    H, inlier = cv2.findHomography(before, after, cv2.RANSAC, CONSTANTS.inlier_px * floor.reduced)
    if H is None or np.linalg.det(H[:2, :2]) <= 0:
        return None
    agree = np.asarray(inlier).ravel() > 0
    before, after = before[agree], after[agree]
    area = cv2.contourArea(cv2.convexHull(after.astype(np.float32))) if len(after) else 0.0
    picture = np.prod(np.ptp(held.places, axis=0))
    if len(after) < CONSTANTS.least or area < CONSTANTS.spread * picture:
        return None
    moved = cv2.perspectiveTransform(before[:, None], H)[:, 0]
    # Perspective displaces by the square of a place.
    bend_std = np.sqrt(np.mean((moved - after) ** 2) / len(after)) / np.mean(before**2)
    return np.asarray(H, dtype=np.float64), float(bend_std)


def _crop_of(H: Array, bend_std: float, focal_px: float, *, mirrored: bool) -> Crop:
    """Zoom and shift of a homography between centred pixels, less what a turn of the camera does."""
    A, turn_px = H[:2, :2], -(focal_px**2) * H[:2, :2] @ H[2, :2]
    shift = H[:2, 2] - turn_px
    # A crop and a turn that undo one another are the noise of the perspective, by which alone they are told apart.
    still = np.linalg.norm(H[:2, 2]) < CONSTANTS.differs_px
    if still or np.linalg.norm(shift) < CONSTANTS.lens_share * np.linalg.norm(turn_px):
        shift = np.zeros(2)
    turn = float(np.arctan2(A[1, 0] - A[0, 1], A[0, 0] + A[1, 1]))
    upside_down = abs(turn) > np.pi / 2
    return Crop(
        _FLIPS[mirrored, upside_down],
        float(np.sqrt(np.linalg.det(A))),
        shift,
        focal_px**2 * bend_std,
        turn - np.copysign(np.pi, turn) if upside_down else turn,
        H[:2, 2],
    )

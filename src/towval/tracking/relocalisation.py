"""Relocalisation: a lost body is found anywhere in the picture, and distinguished from lookalikes.

The picture is first rectified: resampled on the tracked plane with square cells. There the body keeps its size, so that
a match of features is a shift and a turn, and a similarity whose scale is not one is a false match. A pose found is
worth nothing if another fits as well (a body of the same kind, or this one turned half round): the target is
correlated, coarsely and at headings all around, with the whole rectified picture.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Camera, Floor
from towval.model.geometry import transform, wrapped
from towval.tracking.planar_target import PlanarTarget, usable_points
from towval.tracking.template import Floats, Luma, shrunk


@dataclass(frozen=True)
class RelocalisationConstants:
    """Tuned constants of the search by features and by appearance."""

    least_cell_px: float = 0.7  # [px] Finer cells show nothing more.
    cells_of_body: int = 160  # Cells along the longer side of the target, for features.
    most_cells: int = 1600  # Along the longer side of the rectified picture: bounds time and memory.
    tolerance_cells: float = 3.0  # Distance of a match from the similarity that it supports.
    least_matches: int = 6  # Three times what a similarity needs.
    scale_tolerance: float = 0.06  # A body keeps its size on its plane: any other scale is a false match.
    features: int = 3000  # The strongest of a picture.
    tile_cells: int = 400  # Side of the tiles in which features are sought: pyramids take 300 bytes a cell.
    overlap_cells: int = 48  # Of tiles on each side: what is beyond describes only features that are larger.
    coarse_cells_of_body: int = 24  # The same two, for the correlation.
    most_coarse_cells: int = 400
    turn: float = np.deg2rad(7.5)  # [rad] Between headings: a cell and a half at the rim,
    blur_cells: float = 0.8  # so that what lies between two headings or cells still correlates.
    near_as_good: float = 0.85  # Of the correlation at the place found.
    most_candidates: int = 12  # Of one heading, and rivals of one place.
    light_range: float = 1.6  # Brightness and contrast of bodies that look alike differ by less.


CONSTANTS = RelocalisationConstants()

_ROWS = 100
_RATIO = 0.8  # SOURCE: D. Lowe, IJCV 60 (2004): nearest over second nearest neighbour.


def _cell_m(target: PlanarTarget, pose: Array, cells_of_body: int) -> float:
    """Side of a cell of the rectified picture [m]."""
    length_m = float(np.ptp(target.body.top_corners_m, axis=0).max())
    return max(length_m / cells_of_body, CONSTANTS.least_cell_px * target.metres_per_pixel(pose))


class Relocaliser:
    """Finds a planar target, observed at ``pose`` (3,) in ``luma``, by its features."""

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array):
        self.target = target
        corners = target.body.top_corners_m
        self.cell_m = _cell_m(target, pose, CONSTANTS.cells_of_body)
        self.detector = cv2.SIFT.create(nfeatures=CONSTANTS.features, contrastThreshold=0.02)
        self.corner_m = corners.min(axis=0)
        self.own = _grid(self.corner_m, corners.max(axis=0), self.cell_m)
        self.view = _resampled(luma, target.picture_of(transform(pose, self.own)))
        self._kept: tuple[Floor, Array, Floats] | None = None

    @cached_property
    def _keyframe(self) -> tuple[Array, Floats | None]:
        """Features of the target: places in the body frame (m, 2) [m] and descriptors; made when first needed."""
        mask = usable_points(self.target.body, self.own.reshape(-1, 2), 2 * self.cell_m).reshape(self.own.shape[:2])
        points, descriptors = self.detector.detectAndCompute(self.view, mask.astype(np.uint8) * 255)
        places_m: Array = self.corner_m + self.cell_m * np.array([p.pt for p in points]).reshape(-1, 2)
        return places_m, None if descriptors is None else np.asarray(descriptors, dtype=np.float32)

    @property
    def _rectified(self) -> tuple[Array, Floats]:
        """Corner of the visible part of the plane [m], and the pixel of each of its cells; anew if the camera moved."""
        if self._kept is None or self._kept[0] is not self.target.floor:
            low, high = visible_part(self.target, CONSTANTS.most_cells * self.cell_m)
            x, y = _axes(low, high, self.cell_m)
            # Some rows at a time: all cells in float64 would be the largest thing in memory.
            rows = (np.stack(np.meshgrid(x, y[i : i + _ROWS]), axis=-1) for i in range(0, len(y), _ROWS))
            pixels = np.concatenate([self.target.picture_of(each).astype(np.float32) for each in rows])
            self._kept = self.target.floor, low, pixels
        return self._kept[1:]

    def _features(self, luma: Luma, pixels: Floats) -> tuple[Array, Floats]:
        """Cells (m, 2) of the strongest features of the rectified picture, and their descriptors; tile by tile."""
        side, overlap = CONSTANTS.tile_cells, CONSTANTS.overlap_cells
        found: list[tuple[float, Array, NDArray[np.uint8]]] = []
        for row in range(0, pixels.shape[0], side):
            for column in range(0, pixels.shape[1], side):
                above, left = max(row - overlap, 0), max(column - overlap, 0)
                part = pixels[above : row + side + overlap, left : column + side + overlap]
                points, descriptors = self.detector.detectAndCompute(_resampled(luma, part), None)
                for i, point in enumerate(points):
                    u, v = point.pt[0] + left, point.pt[1] + above
                    if column <= u < column + side and row <= v < row + side:
                        # SIFT gives whole numbers to 255.
                        found.append((point.response, np.array([u, v]), descriptors[i].astype(np.uint8)))
        found.sort(key=lambda one: -one[0])
        kept = found[: CONSTANTS.features]
        places = np.array([place for _, place, _ in kept]).reshape(-1, 2)
        return places, np.array([own for *_, own in kept], dtype=np.float32).reshape(-1, self.detector.descriptorSize())

    def find(self, luma: Luma) -> Array | None:
        """Pose (3,) of the body anywhere in a picture, to a few pixels; None where too few features agree."""
        points_m, own_descriptors = self._keyframe
        if own_descriptors is None or len(points_m) < CONSTANTS.least_matches:
            return None
        corner, pixels = self._rectified
        points, descriptors = self._features(luma, pixels)
        if len(points) < CONSTANTS.least_matches:
            return None
        pairs = cv2.BFMatcher().knnMatch(own_descriptors, descriptors, k=2)
        good = [p[0] for p in pairs if len(p) == 2 and p[0].distance < _RATIO * p[1].distance]
        if len(good) < CONSTANTS.least_matches:
            return None
        source = points_m[[match.queryIdx for match in good]]
        target = corner + self.cell_m * points[[match.trainIdx for match in good]]
        similarity, inliers = cv2.estimateAffinePartial2D(
            source, target, method=cv2.RANSAC, ransacReprojThreshold=CONSTANTS.tolerance_cells * self.cell_m
        )
        if similarity is None or int(inliers.sum()) < CONSTANTS.least_matches:
            return None
        cosine, sine = similarity[0, 0], similarity[1, 0]
        if abs(np.hypot(cosine, sine) - 1) > CONSTANTS.scale_tolerance:
            return None
        return np.array([similarity[0, 2], similarity[1, 2], np.arctan2(sine, cosine)])


@dataclass(frozen=True)
class Candidate:
    """A place that looks like a body.

    ``correlation`` with its target; ``pose`` (3,) [m, m, rad]; ``light`` (2,) mean and deviation of the grey values.
    """

    correlation: float
    pose: Array
    light: Array


class Lookalikes:
    """Finds what looks like a planar target, observed at ``pose`` (3,) in ``luma``."""

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array):
        self.cell_m = _cell_m(target, pose, CONSTANTS.coarse_cells_of_body)
        self.factor = max(1, int(self.cell_m / target.metres_per_pixel(pose)))
        self.seen, self.target = target, replace(target, camera=_shrunk_camera(target, self.factor))
        reach = target.reach_m * np.ones(2)
        self.own = _grid(-reach, reach, self.cell_m)
        self.pose, self.first = pose, shrunk(luma, self.factor)

    @cached_property
    def _templates(self) -> list[tuple[float, Floats, Floats]]:
        """The first picture's target at each heading: heading [rad], grey values, where it is (1 or 0)."""
        templates = []
        for heading in np.arange(0, 2 * np.pi, CONSTANTS.turn):
            own = transform([0.0, 0.0, -heading], self.own.reshape(-1, 2))
            usable = usable_points(self.target.body, own, 0.5 * self.cell_m).reshape(self.own.shape[:2])
            pixels = self.target.picture_of(transform(self.pose, own)).reshape(self.own.shape)
            templates.append((float(heading), _blurred(_resampled(self.first, pixels)), usable.astype(np.float32)))
        return templates

    @cached_property
    def _rectified(self) -> tuple[Array, Array]:
        low, grid = self._places
        return low, self.target.picture_of(grid)

    @cached_property
    def _places(self) -> tuple[Array, Array]:
        low, high = visible_part(self.target, CONSTANTS.most_coarse_cells * self.cell_m)
        return low, _grid(low - self.target.reach_m, high + self.target.reach_m, self.cell_m)

    @cached_property
    def twins(self) -> list[Array]:
        """Poses (3,) of what else looks like the body in the first picture."""
        rivals = self.rivals(self._candidates(self.first, *self._rectified), self.pose) or []
        return [r for r in rivals if np.linalg.norm(r[:2] - self.pose[:2]) > self.target.reach_m / 2]

    def candidates(self, luma: Luma) -> list[Candidate]:
        """Where in a picture something looks like the body, best first, to a cell and some degrees."""
        low, pixels = self._rectified
        if self.seen.floor is not self.target.floor:  # The camera moved.
            pixels = replace(self.seen, camera=_shrunk_camera(self.seen, self.factor)).picture_of(self._places[1])
        return self._candidates(shrunk(luma, self.factor), low, pixels)

    def _candidates(self, small: Luma, low: Array, pixels: Array) -> list[Candidate]:
        view = _blurred(_resampled(small, pixels))
        found = [candidate for template in self._templates for candidate in self._best(view, template, low)]
        return sorted(found, key=lambda candidate: -candidate.correlation)

    def rivals(self, candidates: list[Candidate], place: Array) -> list[Array] | None:
        """Poses (3,) among the ``candidates`` of a picture that look as much like the body as ``place`` (3,) does.

        A rival lies half a body away or more, or is turned by 45° or more. None where ``place`` is no candidate itself.
        """
        here = [candidate for candidate in candidates if not self._elsewhere(place, candidate.pose)]
        if not here:
            return None
        others: list[Array] = []
        for other in candidates:
            too_poor = other.correlation < CONSTANTS.near_as_good * here[0].correlation
            if too_poor or len(others) == CONSTANTS.most_candidates:
                break
            alike = np.abs(np.log(other.light / here[0].light)).max() < np.log(CONSTANTS.light_range)
            if alike and all(self._elsewhere(known, other.pose) for known in (place, *others)):
                others.append(other.pose)
        return others

    def _best(self, view: Floats, template: tuple[float, Floats, Floats], low: Array) -> list[Candidate]:
        """The best places of one heading."""
        heading, grey, usable = template
        fit = np.nan_to_num(cv2.matchTemplate(view, grey, cv2.TM_CCOEFF_NORMED, mask=usable), posinf=0.0, neginf=0.0)
        half = max(1, grey.shape[0] // 4)
        best = []
        for _ in range(CONSTANTS.most_candidates):
            row, column = np.unravel_index(np.argmax(fit), fit.shape)
            score = float(fit[row, column])
            if score <= 0:
                break
            fit[max(0, row - half) : row + half + 1, max(0, column - half) : column + half + 1] = 0.0
            inside = view[row : row + grey.shape[0], column : column + grey.shape[1]][usable > 0]
            light = np.array([inside.mean(), inside.std()]) + 1.0
            # The view begins one reach before ``low``, the template one reach before its middle.
            place = low + self.cell_m * np.array([column, row])
            best.append(Candidate(score, np.array([*place, heading]), light))
        return best

    def _elsewhere(self, place: Array, other: Array) -> bool:
        turn = abs(wrapped(other[2] - place[2]))
        return bool(np.linalg.norm(other[:2] - place[:2]) > self.target.reach_m / 2 or turn > np.pi / 4)


def visible_part(target: PlanarTarget, most_m: float = np.inf) -> tuple[Array, Array]:
    """Lower and upper corner (2,) of the part of the tracked plane in the picture, at most ``most_m`` wide [m]."""
    width, height = target.camera.resolution_px
    border = np.stack(np.meshgrid(np.linspace(0, width - 1, 9), np.linspace(0, height - 1, 9)), axis=-1)
    visible = target.floor_xy(border.reshape(-1, 2))
    # With the horizon in the picture the plane has no end: what is far from the middle is left out.
    visible = visible[np.isfinite(visible).all(axis=1)]
    middle = np.median(visible, axis=0)
    return np.maximum(visible.min(axis=0), middle - most_m / 2), np.minimum(visible.max(axis=0), middle + most_m / 2)


def _grid(low: Array, high: Array, cell_m: float) -> Array:
    """Points (rows, columns, 2) [m] from ``low`` to ``high``, ``cell_m`` apart, x along the columns."""
    return np.stack(np.meshgrid(*_axes(low, high, cell_m)), axis=-1)


def _axes(low: Array, high: Array, cell_m: float) -> list[Array]:
    return [lo + cell_m * np.arange(int(np.ceil((hi - lo) / cell_m)) + 1) for lo, hi in zip(low, high, strict=True)]


def _resampled(luma: Luma, pixels: Array | Floats) -> Luma:
    """Grey values of a picture at pixels (rows, columns, 2), zero outside it."""
    u, v = np.moveaxis(np.asarray(pixels, dtype=np.float32), -1, 0)
    grey = cv2.remap(luma, np.ascontiguousarray(u), np.ascontiguousarray(v), cv2.INTER_LINEAR)
    return np.asarray(grey, dtype=np.uint8)


def _blurred(grey: Luma) -> Floats:
    return np.asarray(cv2.GaussianBlur(grey.astype(np.float32), (0, 0), CONSTANTS.blur_cells), dtype=np.float32)


def _shrunk_camera(target: PlanarTarget, factor: int) -> Camera:
    """The camera that would have taken a picture ``factor`` times smaller; pixel centres are whole numbers in both."""
    matrix = target.camera.matrix.copy()
    matrix[:2, 2] += 0.5
    matrix[:2] /= factor
    matrix[:2, 2] -= 0.5
    width, height = target.camera.resolution_px
    return replace(target.camera, matrix=matrix, resolution_px=(width // factor, height // factor))

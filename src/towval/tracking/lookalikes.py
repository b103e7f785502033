"""Whether something else in a picture looks like a body: another body of its kind, or itself turned half round.

A relocalised pose is worth nothing if another one fits as well. The target is correlated, coarsely and at headings all
around, with the whole rectified picture; where else it correlates about as well as at the place found,
a body cannot be told from what is there.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Camera
from towval.model.geometry import transform
from towval.tracking.planar_target import PlanarTarget, usable_points
from towval.tracking.relocalisation import grid, resampled, visible_part

Luma = NDArray[np.uint8]


@dataclass(frozen=True)
class LookalikeConstants:
    """Tuned constants of the search by the whole look."""

    cells_of_body: int = 24  # Cells along the longer side of the target.
    most_cells: int = 400  # Along the longer side of the view from above: bounds the time.
    least_cell_px: float = 0.7  # [px] Finer cells show nothing more.
    turn: float = np.deg2rad(7.5)  # [rad] Between headings: a cell and a half at the rim,
    blur_cells: float = 0.8  # so that what lies between two headings or cells still correlates.
    near_as_good: float = 0.85  # Of the correlation at the place found.
    most_candidates: int = 12  # Of one heading, and rivals of one place.
    light_range: float = 1.6  # Brightness and contrast of bodies that look alike differ by less.


CONSTANTS = LookalikeConstants()


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
        corners = target.body.top_corners_m
        pixel_m = target.metres_per_pixel(pose)
        self.cell_m = max(np.ptp(corners, axis=0).max() / CONSTANTS.cells_of_body, CONSTANTS.least_cell_px * pixel_m)
        self.factor = max(1, int(self.cell_m / pixel_m))
        self.target = replace(target, camera=_shrunk_camera(target, self.factor))
        reach = target.reach_m * np.ones(2)
        self.own = grid(-reach, reach, self.cell_m)
        self.pose, self.first = pose, self._shrunk(luma)

    def _shrunk(self, luma: Luma) -> Luma:
        height, width = luma.shape
        size = width // self.factor, height // self.factor
        whole = luma[: size[1] * self.factor, : size[0] * self.factor]
        return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)

    @cached_property
    def _templates(self) -> list[tuple[float, NDArray[np.float32], NDArray[np.float32]]]:
        """The first picture's target at each heading: heading [rad], grey values, where it is (1 or 0)."""
        templates = []
        for heading in np.arange(0, 2 * np.pi, CONSTANTS.turn):
            own = transform([0.0, 0.0, -heading], self.own.reshape(-1, 2))
            usable = usable_points(self.target.body, own, 0.5 * self.cell_m).reshape(self.own.shape[:2])
            pixels = self.target.picture_of(transform(self.pose, own)).reshape(self.own.shape)
            templates.append((float(heading), _blurred(resampled(self.first, pixels)), usable.astype(np.float32)))
        return templates

    @cached_property
    def _view_from_above(self) -> tuple[Array, Array]:
        low, high = visible_part(self.target, CONSTANTS.most_cells * self.cell_m)
        return low, self.target.picture_of(grid(low - self.target.reach_m, high + self.target.reach_m, self.cell_m))

    @cached_property
    def has_twin(self) -> bool:
        """Whether the first picture shows something else that looks like the body."""
        rivals = self.rivals(self._candidates(self.first), self.pose) or []
        return any(np.linalg.norm(r[:2] - self.pose[:2]) > self.target.reach_m / 2 for r in rivals)

    def candidates(self, luma: Luma) -> list[Candidate]:
        """Where in a picture something looks like the body, best first, good to a cell and some degrees."""
        return self._candidates(self._shrunk(luma))

    def _candidates(self, small: Luma) -> list[Candidate]:
        low, pixels = self._view_from_above
        view = _blurred(resampled(small, pixels))
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
            if (
                other.correlation < CONSTANTS.near_as_good * here[0].correlation
                or len(others) == CONSTANTS.most_candidates
            ):
                break
            alike = np.abs(np.log(other.light / here[0].light)).max() < np.log(CONSTANTS.light_range)
            if alike and all(self._elsewhere(known, other.pose) for known in (place, *others)):
                others.append(other.pose)
        return others

    def _best(
        self, view: NDArray[np.float32], template: tuple[float, NDArray[np.float32], NDArray[np.float32]], low: Array
    ) -> list[Candidate]:
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
        turn = abs(np.arctan2(np.sin(other[2] - place[2]), np.cos(other[2] - place[2])))
        return bool(np.linalg.norm(other[:2] - place[:2]) > self.target.reach_m / 2 or turn > np.pi / 4)


def _blurred(grey: Luma) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(grey.astype(np.float32), (0, 0), CONSTANTS.blur_cells), dtype=np.float32)


def _shrunk_camera(target: PlanarTarget, factor: int) -> Camera:
    """The camera that would have taken a picture ``factor`` times smaller; pixel centres are whole numbers in both."""
    matrix = target.camera.matrix.copy()
    matrix[:2, 2] += 0.5
    matrix[:2] /= factor
    matrix[:2, 2] -= 0.5
    width, height = target.camera.resolution_px
    return replace(target.camera, matrix=matrix, resolution_px=(width // factor, height // factor))

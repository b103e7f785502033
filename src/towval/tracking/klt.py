"""The paper's tracker: KLT points on the planar target, matched to a keyframe, fitted with a planar pose.

Points are followed from a keyframe and not from the frame before, so their error does not add up over frames. A patch
of pixels matches only while it has not turned much; so keyframes are kept by heading, and a new one is made only at a
heading that none covers yet. Each point is checked by following it back.
"""

from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.geometry import inverse_transform, wrapped
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import Measurement, Tracker, robust_rigid_fit
from towval.tracking.template import Floats, Luma


@dataclass(frozen=True)
class KltConstants:
    """Tuned constants of the KLT tracker."""

    window_px: int = 21  # [px] OpenCV's default window.
    levels: int = 2  # Halvings of the picture: with them a point 40 px off is reached.
    iterations: int = 30  # Of one level: OpenCV's default.
    step_px: float = 0.005  # [px] At which they end: a tenth of the noise floor below.
    quality: float = 0.01  # Of the best corner's: OpenCV's samples' value.
    spacing_px: float = 6.0  # [px] Between points: nearer ones share most of a window.
    block_px: int = 5  # [px] Of the corner measure.
    refined_px: int = 3  # [px] Half-width of the window of the subpixel refinement.
    least_body_px: float = 130.0  # [px] Length to which a small body is magnified: a window must be a part of it.
    margin_px: int = 8  # [px] Kept from the edges, behind which the background moves differently.
    points: int = 120  # Of a keyframe: twice what the feature table holds.
    keyframe_turn: float = np.deg2rad(10.0)  # [rad] A 21 px patch turned by 10° moves 1.8 px at its rim.
    least_points: int = 8  # Fewer points leave a robust fit too little to compare.
    noise_floor_px: float = 0.05  # [px] Of a point, where all agree better by chance.


CONSTANTS = KltConstants()

_STOP = cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT
_REFINE = (_STOP, 20, 0.01)  # Iterations of the subpixel refinement and the step [px] at which they end.
_TABLE_POINTS = 60


@dataclass(frozen=True)
class _Keyframe:
    crop: Luma
    pixels: Array
    points_m: Array
    heading: float


class KltTracker(Tracker):
    """Follows a planar target, observed at ``pose`` (3,) in ``luma``, by KLT points.

    A point counts if it comes back to within ``forward_backward_px`` of where it started [px].
    """

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array, forward_backward_px: float = 0.5):
        self.target, self.forward_backward_px = target, forward_backward_px
        pixels = target.pixels(target.body.top_corners_m, pose)
        reach = np.linalg.norm(pixels - target.pixels(np.zeros((1, 2)), pose), axis=1).max()
        # The crop holds the body at any heading, elsewhere in the picture a little larger, and the search around it.
        self.zoom = max(1, round(CONSTANTS.least_body_px / (2 * float(reach))))
        side = int(2 * (1.2 * reach + 2 * CONSTANTS.window_px))
        self.crop_px = np.minimum(side, [luma.shape[1], luma.shape[0]])
        self.keyframes: list[_Keyframe] = []
        self._add_keyframe(luma, pose)

    def _crop(self, luma: Luma, pose: Array) -> tuple[Luma, Array]:
        """The part of a picture around the body, magnified, always of the same size, and its upper left corner [px]."""
        centre = self.target.pixels(np.zeros((1, 2)), pose)[0]
        room = np.array([luma.shape[1], luma.shape[0]]) - self.crop_px
        u, v = np.clip(np.round(np.nan_to_num(centre) - self.crop_px / 2), 0, room).astype(int)
        corner = np.array([u, v], dtype=np.float64)
        crop = luma[v : v + self.crop_px[1], u : u + self.crop_px[0]]
        if self.zoom == 1:
            return np.ascontiguousarray(crop), corner
        size = self.zoom * crop.shape[1], self.zoom * crop.shape[0]
        return np.asarray(cv2.resize(crop, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8), corner

    def _into_crop(self, pixels: Array, corner: Array) -> Array:
        """Places (n, 2) in a crop of pixels of its picture; pixel centres are whole numbers in both."""
        return (pixels - corner + 0.5) * self.zoom - 0.5

    def _out_of_crop(self, places: Array, corner: Array) -> Array:
        return (places + 0.5) / self.zoom - 0.5 + corner

    def _mask(self, corner: Array, pose: Array) -> Luma:
        """Where points may lie in a crop: on the target, off its edges and obstructions."""
        mask = np.zeros((self.zoom * self.crop_px[1], self.zoom * self.crop_px[0]), np.uint8)

        def draw(outline: Array, value: int) -> None:
            pixels = self._into_crop(self.target.pixels(outline, pose), corner)
            cv2.fillPoly(mask, [np.round(pixels).astype(np.int32)], value)

        draw(self.target.body.top_corners_m, 255)
        for obstruction in self.target.body.obstructions:
            draw(obstruction, 0)
        # The frame of zeros makes the picture's border an edge, too.
        eroded = cv2.erode(
            cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0),
            np.ones((2 * CONSTANTS.margin_px + 1, 2 * CONSTANTS.margin_px + 1), np.uint8),
        )
        return np.asarray(eroded[1:-1, 1:-1], dtype=np.uint8)

    def _add_keyframe(self, luma: Luma, pose: Array) -> None:
        crop, corner = self._crop(luma, pose)
        c, mask = CONSTANTS, self._mask(corner, pose)
        corners = cv2.goodFeaturesToTrack(crop, c.points, c.quality, c.spacing_px, mask=mask, blockSize=c.block_px)
        if corners is None or len(corners) < c.least_points:
            return
        corners = cv2.cornerSubPix(crop, corners, (c.refined_px, c.refined_px), (-1, -1), _REFINE)
        pixels = corners.reshape(-1, 2).astype(np.float64)
        on_plane = self.target.floor_xy(self._out_of_crop(pixels, corner))
        self.keyframes.append(_Keyframe(crop, pixels, inverse_transform(pose, on_plane), float(pose[2])))

    def measure(self, luma: Luma, predicted: Array, velocity: Array | None = None) -> Measurement | None:
        """Pose near ``predicted`` (3,), or None where too few points come back to where they started.

        The ``velocity`` is not used: blur takes points away, and those left are matched as they are.
        """
        if not self.keyframes:
            return None
        turns = [abs(wrapped(k.heading - predicted[2])) for k in self.keyframes]
        found = self._match(self.keyframes[int(np.argmin(turns))], luma, predicted)
        if found is None or min(turns) <= CONSTANTS.keyframe_turn:
            return found
        return replace(found, learn=partial(self._add_keyframe, luma, found.pose))

    def _match(self, key: _Keyframe, luma: Luma, predicted: Array) -> Measurement | None:
        crop, corner = self._crop(luma, predicted)
        guess = self._into_crop(self.target.pixels(key.points_m, predicted), corner)
        start, first = key.pixels.astype(np.float32)[:, None], guess.astype(np.float32)[:, None]
        forth, there = _flow(key.crop, crop, start, first)
        back, here = _flow(crop, key.crop, forth, start)
        astray = np.linalg.norm((back - start).reshape(-1, 2), axis=1)
        good = (there.ravel() == 1) & (here.ravel() == 1) & (astray < self.forward_backward_px)
        if good.sum() < CONSTANTS.least_points:
            return None
        pixel = self.target.metres_per_pixel(predicted)
        floor_xy = self.target.floor_xy(self._out_of_crop(forth.reshape(-1, 2)[good], corner))
        fit = robust_rigid_fit(key.points_m[good], floor_xy, CONSTANTS.noise_floor_px * pixel)
        weights = np.zeros(len(good))
        weights[good] = fit.weights
        return Measurement(
            pose=fit.pose,
            covariance=fit.covariance,
            inlier_fraction=float((weights > 0.1).mean()),
            residual=fit.rms / pixel,
            points_m=key.points_m[:_TABLE_POINTS],
            weights=weights[:_TABLE_POINTS],
        )


def _flow(source: Luma, target: Luma, points: Floats, guess: Floats) -> tuple[Floats, NDArray[np.uint8]]:
    """Where points (n, 1, 2) of one picture are in another, near a guess [px], and whether they were found."""
    window, stop = (CONSTANTS.window_px, CONSTANTS.window_px), (_STOP, CONSTANTS.iterations, CONSTANTS.step_px)
    follow = partial(cv2.calcOpticalFlowPyrLK, winSize=window, maxLevel=CONSTANTS.levels, criteria=stop)
    found, status, _ = follow(source, target, points, guess.copy(), flags=cv2.OPTFLOW_USE_INITIAL_FLOW)
    return np.asarray(found, dtype=np.float32), np.asarray(status, dtype=np.uint8)

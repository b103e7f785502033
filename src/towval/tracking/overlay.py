"""Finds what is drawn over a video (a banner, a time stamp) where it covers a body in the first picture.

It stands still while the body moves on, and must not become part of the body's template.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.geometry import inverse_transform
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.template import Floats, Luma


@dataclass(frozen=True)
class OverlayConstants:
    """Tuned constants of the search for overlays."""

    window_px: int = 9  # [px] Width of the compared windows: a letter of a time stamp.
    least_contrast: float = 6.0  # [grey levels] Deviation in a window: twice a camera's noise.
    same: float = 0.9  # Correlation of two pictures of the same thing,
    other: float = 0.5  # and at most of two pictures of different ones.
    kept: float = 0.5  # Share of an overlay that keeps its grey values: at its border the top beside it changes.
    gap_px: int = 15  # [px] Gaps between letters that are closed, so that digits that change are included.
    least_share: float = 0.02  # Of the top: a smaller overlay does not disturb a tracker.
    least_changed: float = 0.2  # Share of the top's texture that must change; else the body never left its place.


CONSTANTS = OverlayConstants()


def standing_still(first: Luma, last: Luma, target: PlanarTarget, pose: Array) -> list[Array]:
    """Outlines (n, 2) in the body frame [m] of what covers a body and is the same in the first and the last picture.

    ``pose`` (3,) is the body's in the first picture. Empty where the body has not moved, so that nothing can be told,
    or is outside the picture.
    """
    corners = np.round(target.pixels(target.body.top_corners_m, pose)).astype(np.int32)
    pad = CONSTANTS.window_px
    low = np.maximum(corners.min(axis=0) - pad, 0)
    high = np.minimum(corners.max(axis=0) + pad + 1, [first.shape[1], first.shape[0]])
    if (high <= low).any():
        return []
    box = slice(low[1], high[1]), slice(low[0], high[0])
    top = np.zeros(first[box].shape, np.uint8)
    cv2.fillPoly(top, [corners - low.astype(np.int32)], 1)
    likeness, kept, textured = _likeness(first[box].astype(np.float32), last[box].astype(np.float32))
    textured &= top > 0
    if (textured & (likeness < CONSTANTS.other)).sum() < CONSTANTS.least_changed * textured.sum():
        return []
    alike = textured & (likeness > CONSTANTS.same)
    still = cv2.morphologyEx(alike.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((CONSTANTS.gap_px,) * 2, np.uint8))
    outlines, _ = cv2.findContours(np.asarray(still), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    large = [each for each in outlines if cv2.contourArea(each) > CONSTANTS.least_share * top.sum()]
    large = [each for each in large if kept[_within(each, top.shape) & alike].mean() > CONSTANTS.kept]
    hulls = [cv2.convexHull(each).reshape(-1, 2) + low for each in large]
    return [inverse_transform(pose, target.floor_xy(hull.astype(np.float64))) for hull in hulls]


def _within(outline: cv2.typing.MatLike, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Pixels (height, width) within an outline."""
    filled = np.zeros(shape, np.uint8)
    cv2.drawContours(filled, [outline], 0, (1,), cv2.FILLED)
    return filled > 0


def _likeness(one: Floats, other: Floats) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Correlation of two pictures around each pixel, where grey values are the same, and where the first one shows any.

    Of a smooth top any window is a ramp, and ramps of two places that rise the same way correlate. What is drawn over a
    video keeps its grey values as well (concordance; Lin, Biometrics 45, 255, 1989).
    """

    def mean(values: Floats) -> Floats:
        return np.asarray(cv2.blur(values, (CONSTANTS.window_px,) * 2), dtype=np.float32)

    middle, beside = mean(one), mean(other)
    spread = np.sqrt(np.maximum(mean(one * one) - middle**2, 1e-3))
    beyond = np.sqrt(np.maximum(mean(other * other) - beside**2, 1e-3))
    common = mean(one * other) - middle * beside
    concordance = 2 * common / (spread**2 + beyond**2 + (middle - beside) ** 2)
    likeness = np.asarray(common / (spread * beyond), dtype=np.float32)
    return likeness, concordance > CONSTANTS.same, spread > CONSTANTS.least_contrast

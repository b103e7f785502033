"""Where a body of the first picture is in other pictures, and which part of the picture moves with it."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from towval.model import Array
from towval.model.errors import InputError
from towval.model.geometry import compose, inverse, transform
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.plane_tracker import PlaneTracker
from towval.tracking.rectified import MovingAlong, View
from towval.tracking.relocalisation import Lookalikes
from towval.tracking.template import Luma


@dataclass(frozen=True)
class CoMovingConstants:
    """Tuned constants; lengths in pixels are measured on the planar target."""

    least_px: float = 8.0  # [px] A body that has moved so far has other lines of the floor beside its edges.
    window_px: float = 2.0  # [px] Deviation of the window in which pictures are compared.
    least_difference: float = 3.0  # [grey levels] Difference of two pictures due to noise alone.
    most_views: int = 4  # Pictures that suffice: what agrees by chance falls with the root of their number.


CONSTANTS = CoMovingConstants()


def co_moving(target: PlanarTarget, pose: Array, pictures: Sequence[Luma]) -> list[View]:
    """The first picture, and those others in which the body at ``pose`` (3,) in the first is found at another place.

    Only the first where it stays in its place, or its top has too little texture to be recognised. The step of a view
    is in the floor frame: a body at ``pose`` in the first picture is at ``compose(step, pose)`` in that of the view.
    """
    views: list[View] = [(pictures[0], np.zeros(3))]
    try:
        tracker = PlaneTracker(target, pictures[0], pose)
    except InputError:
        return views
    lookalikes = Lookalikes(target, pictures[0], pose)
    last, least_m = pose, CONSTANTS.least_px * target.metres_per_pixel(pose)
    for luma in pictures[1:]:
        found = tracker.measure(luma, last)
        if found is None:
            best = lookalikes.candidates(luma)[:1]  # None in a picture without any contrast, such as a black one.
            found = tracker.measure(luma, best[0].pose) if best else None
        if found is None:
            continue
        found.learn()
        last = found.pose
        if target.apart_m(pose, last) > least_m:
            views.append((luma, compose(last, inverse(pose))))
        if len(views) > CONSTANTS.most_views:
            break
    return views


def moving_along(target: PlanarTarget, views: Sequence[View], low: Array, high: Array) -> MovingAlong:
    """Which part of the first picture, ``low`` to ``high`` (2,) [m] on a target's plane, moves with it to other views.

    A cell that moves along differs less from the cell at its new place than from the one at its old place.
    """
    cell_m = target.metres_per_pixel(np.array([*(low + high) / 2, 0.0]))
    axes = [np.arange(lo, hi, cell_m) for lo, hi in zip(low, high, strict=True)]
    places = np.stack(np.meshgrid(*axes), axis=-1)

    def read(luma: Luma, step: Array) -> Array:
        pixels = target.picture_of(transform(step, places)).astype(np.float32)
        return np.asarray(cv2.remap(luma, pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR), dtype=np.float64)

    first = read(*views[0])

    def differing(motions: Sequence[Array]) -> Array:
        each = [np.abs(read(luma, motion) - first) for (luma, _), motion in zip(views[1:], motions, strict=True)]
        return np.asarray(cv2.GaussianBlur(np.mean(each, axis=0), (0, 0), CONSTANTS.window_px))

    gone = differing([step for _, step in views[1:]])
    stayed = differing([np.zeros(3)] * (len(views) - 1))
    share = (stayed - gone) / (stayed + gone + CONSTANTS.least_difference)
    return MovingAlong(low, cell_m, share.astype(np.float32))

"""ArUco and AprilTag markers on a body in place of clicks on its corners."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Body, Camera, Floor, Tag
from towval.model.errors import InputError
from towval.model.geometry import lifted, rigid_fit, transform
from towval.optics.projection import project, to_plane


@dataclass(frozen=True)
class MarkerConstants:
    """Tuned constant of tags."""

    worst_misfit: float = 0.1  # Of a tag's side: more, and its size, place or number is not as stated.


CONSTANTS = MarkerConstants()


def clicks_from_tags(luma: NDArray[np.uint8], body: Body, tags: Sequence[Tag], camera: Camera, floor: Floor) -> Array:
    """Pixels (n, 2) of a body's corners from the tags on its planar target, to be given to ``track`` as clicks.

    All tags found in the first picture ``luma`` (height, width) are used together. `InputError` where no tag is found,
    a dictionary is unknown, or the tags do not fit their places.
    """
    own, on_floor = [], []
    for tag in tags:
        corners = _detect(luma, tag)
        if corners is not None:
            own.append(tag.corners_m())
            on_floor.append(to_plane(camera, floor, corners, body.tracked_plane_height_m))
    if not own:
        raise InputError(
            f"no tag of {body.name} is found in the first picture",
            got=", ".join(f"{tag.dictionary} {tag.number}" for tag in tags) or "no tags",
            remedy="start with its tags in view, unhidden and with a white border, or click its corners",
        )
    source, target = np.concatenate(own), np.concatenate(on_floor)
    pose = rigid_fit(source, target)
    misfit = float(np.linalg.norm(transform(pose, source) - target, axis=1).max())
    smallest = min(tag.size_m for tag in tags)
    if not misfit <= CONSTANTS.worst_misfit * smallest:
        raise InputError(
            f"the tags of {body.name} do not fit their places",
            got=f"{1000 * misfit:.1f} mm off",
            allowed=f"{1000 * CONSTANTS.worst_misfit * smallest:.1f} mm",
            remedy="check size, place and heading of each tag, and the height of the planar target",
        )
    return project(camera, floor, lifted(transform(pose, body.top_corners_m), body.tracked_plane_height_m))


def _detect(luma: NDArray[np.uint8], tag: Tag) -> Array | None:
    """Corners (4, 2) of a tag [px], None where it is not found."""
    constant = getattr(cv2.aruco, f"DICT_{tag.dictionary}", None)
    if constant is None:
        raise InputError("a tag's dictionary is unknown", got=tag.dictionary, allowed="4X4_50, APRILTAG_36h11, …")
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(constant), parameters)
    corners, numbers, _ = detector.detectMarkers(luma)
    if numbers is None:
        return None
    for quad, number in zip(corners, numbers.ravel(), strict=True):
        if number == tag.number:
            return quad.reshape(4, 2).astype(np.float64)
    return None

"""Pictures of fiducial markers on a body."""

import cv2
import numpy as np

from towval.model.geometry import transform
from towval.optics.projection import project


def picture_with(tags, pose, height, camera, floor):
    """A grey picture with tags drawn on the top of a body."""
    width, rows = camera.resolution_px
    image = np.full((rows, width), 150, np.uint8)
    for tag in tags:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{tag.dictionary}"))
        marker = np.full((400, 400), 255, np.uint8)
        marker[50:350, 50:350] = cv2.aruco.generateImageMarker(dictionary, tag.number, 300)
        corners = transform(pose, tag.corners_m())
        seen = project(camera, floor, np.column_stack([corners, np.full(4, height)])).astype(np.float32)
        # The black square runs from the outer border of pixel 50 to that of pixel 349.
        black = np.array([[49.5, 49.5], [349.5, 49.5], [349.5, 349.5], [49.5, 349.5]], np.float32)
        warp = cv2.getPerspectiveTransform(black, seen)
        drawn = cv2.warpPerspective(marker, warp, (width, rows), flags=cv2.INTER_AREA)
        mask = cv2.warpPerspective(np.full_like(marker, 255), warp, (width, rows)) > 127
        image[mask] = drawn[mask]
    return cv2.GaussianBlur(image, (0, 0), 0.6)

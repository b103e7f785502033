"""Bodies proposed from their motion, for the user to confirm where nothing was clicked."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.errors import InputError


@dataclass(frozen=True)
class ProposalConstants:
    """Tuned constants of the proposals."""

    least_pictures: int = 5  # For the median to be the background where a body passes.
    deviations: float = 6.0  # Of the noise: a difference that means motion.
    least_difference: float = 10.0  # [grey levels] As much, where a video holds no noise.
    least_area: float = 2e-4  # Of the picture: a body 20 px wide at 1080p.


CONSTANTS = ProposalConstants()

_COLOURS = ((60, 60, 230), (230, 160, 40), (60, 200, 60), (200, 60, 200))


@dataclass(frozen=True)
class Proposal:
    """Something that moved: the corners (4, 2) of the rectangle around it in the first picture [px], and its area."""

    corners_px: Array
    area_px: float


def propose_bodies(pictures: Sequence[NDArray[np.uint8]], most: int = 2) -> tuple[list[Proposal], NDArray[np.uint8]]:
    """Propose up to ``most`` bodies, largest first, from what moves against the background.

    The background is the median of ``pictures`` (height, width), five or more spread over the video; what differs from
    it in the first picture stood there and left. The rectangles include sides and shadow: they show where bodies are,
    and the user still clicks the corners of the planar targets. The second value is the first picture (height, width,
    3; blue, green, red) with the proposals drawn and their corners lettered, to be confirmed.
    """
    if len(pictures) < CONSTANTS.least_pictures:
        raise InputError(
            "too few pictures to separate bodies from the background", got=len(pictures), allowed="5 or more"
        )
    stack = np.stack(pictures)
    difference = cv2.absdiff(stack[0], np.median(stack, axis=0).astype(np.uint8))
    difference = cv2.GaussianBlur(difference, (0, 0), 1.5).astype(np.float32)
    noise = 1.4826 * float(np.median(difference))
    mask = (difference > max(CONSTANTS.deviations * noise, CONSTANTS.least_difference)).astype(np.uint8)
    size = max(3, round(0.008 * stack.shape[2]) | 1)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((2 * size + 1, 2 * size + 1), np.uint8))
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((size, size), np.uint8))
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    large = [outline for outline in outlines if cv2.contourArea(outline) > CONSTANTS.least_area * mask.size]
    large = sorted(large, key=cv2.contourArea, reverse=True)[:most]
    proposals = [
        Proposal(cv2.boxPoints(cv2.minAreaRect(outline)).astype(np.float64), float(cv2.contourArea(outline)))
        for outline in large
    ]
    return proposals, _drawn(stack[0], proposals)


def _drawn(luma: NDArray[np.uint8], proposals: Sequence[Proposal]) -> NDArray[np.uint8]:
    picture = np.asarray(cv2.cvtColor(luma, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    for i, proposal in enumerate(proposals):
        colour = _COLOURS[i % len(_COLOURS)]
        cv2.polylines(picture, [np.round(proposal.corners_px).astype(np.int32)], True, colour, 2, cv2.LINE_AA)
        place = np.round(proposal.corners_px.mean(axis=0)).astype(int)
        cv2.putText(picture, str(i + 1), (int(place[0]), int(place[1])), cv2.FONT_HERSHEY_SIMPLEX, 1.2, colour, 2)
        for letter, corner in zip("abcd", proposal.corners_px, strict=True):
            u, v = np.round(corner + 0.15 * (corner - place)).astype(int)
            cv2.putText(picture, letter, (int(u), int(v)), cv2.FONT_HERSHEY_SIMPLEX, 0.7, colour, 2)
    return picture

"""Warped tops: parts of a top that the picture displaces against each other, which no motion of a body does.

A drop on the lens, or a pane before it, bends what is seen through it. The floor there stays as it is in all pictures,
and texture and outline of a body that passes are displaced together. But a top that gets there looks otherwise than in
the first picture: its tiles are displaced against each other.
"""

from array import array
from dataclasses import dataclass

import numpy as np

from towval.model import Array, Finding
from towval.model.findings import finding
from towval.tracking.floor_kernels import sums_of_clusters
from towval.tracking.floor_registration import CONSTANTS as REGISTRATION
from towval.tracking.floor_registration import MEDIAN_NORMAL
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.template import Luma, Template


@dataclass(frozen=True)
class WarpedTopConstants:
    """Tuned constants of warped tops."""

    scattered_px: float = 0.3  # [px] Of tiles against each other: up to 0.2 on sound films of faint tops, 0.4 to 1.2
    # where a drop on the lens magnifies by 5 %.


CONSTANTS = WarpedTopConstants()

_LOOKS = 3
"""Looks in a row by whose median a top is warped: what hides half of it for a moment is in one or two."""
_FREE = 4
"""Numbers that are fitted to a tile: its displacement, gain and bias."""


class WarpedTop:
    """Collects by how much tiles of a top are displaced against each other.

    ``template`` of the first picture; None where too little of the body is in it. Pictures are those of the echoes.
    """

    def __init__(self, target: PlanarTarget, template: Template | None):
        self.target, self.template, self.rows = target, template, array("d")

    def look(self, time_s: float, luma: Luma, pose: Array) -> None:
        """Take in a picture of the body at ``pose`` (3,)."""
        template = self.template
        if template is None:
            return
        values = self.target.grey_values(luma, template.points, pose)
        known = np.isfinite(values)
        tile, count = template.tile[known], np.bincount(template.tile[known], minlength=template.tiles)
        enough = count >= max(REGISTRATION.least_of_cluster, _FREE + 1)
        if enough.sum() < REGISTRATION.least_clusters:
            return
        light = np.column_stack([np.ones(len(values)), template.values - template.values.mean()])
        columns = np.hstack([template.slopes[:, :2] * template.pixel_m, light])[known]
        misfit = (values - template.values)[known]
        information, right = sums_of_clusters(tile, template.tiles, columns, misfit)
        inverse = np.linalg.pinv(information[enough], hermitian=True)
        fitted = np.einsum("nij,nj->ni", inverse, right[enough])
        left = np.bincount(tile, misfit**2, template.tiles)[enough] - np.einsum("ni,ni->n", right[enough], fitted)
        variance = np.diagonal(inverse, axis1=1, axis2=2)[:, :2] * (left / (count[enough] - _FREE))[:, None]
        by_noise = np.median(variance, axis=0)
        apart = fitted[:, :2] - np.median(fitted[:, :2], axis=0)
        excess = np.median(apart**2, axis=0) / MEDIAN_NORMAL**2 - by_noise
        worst = int(np.argmax(excess))
        told = excess[worst] > REGISTRATION.beyond_noise**2 * by_noise[worst]
        self.rows.extend((time_s, np.sqrt(excess[worst]) if told else 0.0))

    def scattered_px(self, time_s: Array) -> Array:
        """Deviation (n,) of tiles against each other at times (n,) [px]; zero where it is that of sound pictures."""
        at_s, seen_px = np.array(self.rows).reshape(-1, 2).T
        if len(at_s) < _LOOKS:
            return np.zeros(len(time_s))
        padded = np.pad(seen_px, _LOOKS // 2, mode="edge")
        usual_px = np.median(np.lib.stride_tricks.sliding_window_view(padded, _LOOKS), axis=1)
        usual_px[usual_px < CONSTANTS.scattered_px] = 0.0
        return np.asarray(np.interp(time_s, at_s, usual_px, left=0.0))

    def findings(self, time_s: Array) -> tuple[Finding, ...]:
        """A warning where a top is warped at any of the times (n,)."""
        most_px = float(self.scattered_px(time_s).max(initial=0.0))
        place = f"of the top of {self.target.body.name}"
        return (finding("picture_warped", place=place, scattered_px=most_px),) if most_px else ()

    def widened(self, time_s: Array) -> tuple[Array, Array]:
        """Covariances (n, 3, 3) of poses at times (n,), and (3, 3) of the registration.

        The picture that is warped may also be the first one, from which the others differ.
        """
        pixel_m = 0.0 if self.template is None else self.template.pixel_m
        variance = (pixel_m * self.scattered_px(time_s)) ** 2
        unit = np.diag([1.0, 1.0, (1 / self.target.body.reach_m) ** 2])
        return variance[:, None, None] * unit, variance.mean() * unit

"""Fields: whether every second row of a picture was taken at another time, as interlaced video has it.

Rows of the two fields show a moving body displaced by what it moves between them. Read from the even rows alone and
from the odd rows alone, the body's texture then differs by its slope along the way; at rest, and in progressive video,
it does not. Some sensors expose every second row for a shorter time, which looks the same.
"""

from array import array
from dataclasses import dataclass

import cv2
import numpy as np

from towval.model import Array, Finding
from towval.model.findings import finding
from towval.tracking.blur import paths
from towval.tracking.echoes import CONSTANTS as ECHOES
from towval.tracking.echoes import ROBUST_ROUNDS, largest_of_parts
from towval.tracking.late import delayed
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import STD_OF_MEDIAN, tukey_weights
from towval.tracking.template import Luma, Template


@dataclass(frozen=True)
class FieldConstants:
    """Tuned constants of the fields; pictures and points are those of the echoes."""

    named: float = 0.1  # Of the time between two pictures: interlaced video has a half.
    deviations: float = 5.0  # By which it is beyond that.


CONSTANTS = FieldConstants()


class Fields:
    """Collects by how much the odd rows of pictures show a body ahead of the even ones.

    ``template`` of the first picture; None where too little of the body is in it.
    """

    def __init__(self, target: PlanarTarget, template: Template | None):
        self.target, self.template, self.rows = target, template, array("d")

    def look(self, luma: Luma, pose: Array, step: Array) -> None:
        """Take in a picture of the body at ``pose`` (3,), reached by ``step`` (3,) in its own frame [m, m, rad]."""
        template = self.template
        if template is None:
            return
        u, v = self.target.pixels(template.points, pose).astype(np.float32).T
        even, odd = (_read(luma[k::2], u, (v - k) / 2) for k in (0, 1))
        # Where the body is ahead, a place shows what was behind it.
        ahead = -np.sum(template.slopes[:, :2] * paths(template.points, step), axis=1)
        known = (even > 0) & (odd > 0) & np.isfinite(ahead)
        if known.sum() >= ECHOES.samples / 4:
            self.rows.extend(_normal(ahead[known], (odd - even)[known]))

    def apart(self) -> float:
        """Time from the even rows to the odd ones, as a share of that between pictures, by its size.

        Over the run, or in the part of it where it is largest; zero where the fields do not clearly differ.
        """
        return largest_of_parts(np.array(self.rows).reshape(-1, 2), _apart)


def _read(field: Luma, u: Array, v: Array) -> Array:
    """Grey values (n,) of a field at its own pixels, zero outside."""
    return np.asarray(cv2.remap(field, u[None], v[None].astype(np.float32), cv2.INTER_LINEAR)[0], dtype=np.float64)


def _normal(ahead: Array, apart: Array) -> tuple[float, float]:
    """Information on a share of ``ahead`` (n,) in ``apart`` (n,), and that times the share."""
    ahead, apart = ahead - ahead.mean(), apart - np.median(apart)
    weight = np.ones(len(ahead))
    for _ in range(ROBUST_ROUNDS):
        share = np.sum(weight * ahead * apart) / max(np.sum(weight * ahead**2), 1e-9)
        left = apart - share * ahead
        scale = STD_OF_MEDIAN * float(np.median(np.abs(left))) + 1e-6
        weight = tukey_weights(left, scale)
    information = float(np.sum(weight * ahead**2)) / scale**2
    return information, information * share


def _apart(rows: Array) -> float:
    """As :meth:`Fields.apart`, of some pictures (n, 2)."""
    information, vector = rows.T
    total = max(float(information.sum()), 1e-9)
    share = float(vector.sum()) / total
    # Pictures scatter by more than their residuals suggest: texture is not white noise.
    std = float(np.sqrt(np.sum((vector - information * share) ** 2))) / total
    return abs(share) if abs(share) > CONSTANTS.named + CONSTANTS.deviations * std else 0.0


def field_lateness(time_s: Array, pose: Array, apart: float) -> Array:
    """Covariance (n, 3, 3) of poses (n, 3) that may be those of either field, half of ``apart`` early or late."""
    return delayed(time_s, pose, 0.5 * apart * float(np.median(np.diff(time_s))) if apart else 0.0)


def field_findings(time_s: Array, apart: float) -> tuple[Finding, ...]:
    """A warning where the fields of pictures at times (n,) [s] are apart."""
    if not apart:
        return ()
    return (finding("fields_apart", apart_ms=1000 * apart * float(np.median(np.diff(time_s)))),)

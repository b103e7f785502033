"""Focus: the appearance of a planar target in pictures that are less sharp than the one its template was taken from.

A focus that hunts takes the fine texture away. Aligned with the sharp template, such a picture leaves residuals that
are no noise: what the sharp target has and this picture has not. Where they happen to agree with the slopes of the
template the pose is off, and small residuals that are left do not show it. So the target is aligned as it looks through
a Gaussian blur of the same width. Of a few widths that one is taken, for the next picture, too, which leaves least of
the present one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.tracking.alignment import Alignment
from towval.tracking.blur import SharpTarget
from towval.tracking.light import light_misfit
from towval.tracking.planar_target import usable_points
from towval.tracking.template import Luma, Template, by_motion, clearance_m, slopes_at


@dataclass(frozen=True)
class FocusConstants:
    """Tuned constants of the focus, set on run g of lab_c, its focus hunting by 3 and 6 px."""

    narrowest_px: float = 0.8  # [px] Standard deviation of the least blur: readings are smoothed by 0.6 px.
    wider: float = 1.5  # Times the width before.
    widths: int = 6  # Up to 6 px,
    widest: float = 1 / 12  # and to so much of the smaller side of a body: of less than twelve widths little is left.
    least_side_px: float = 24.0  # [px] Of a body: the pixels of a smaller one are too few to tell a blur from chance.
    clear: float = 1.5  # Widths that points keep from the outline: a fifteenth of what they show is from beyond it.
    least_kept: float = 0.4  # Of the points: where fewer are so clear, all are kept.
    learned_from: int = 400  # Points, the first of the template: an even choice.
    better: float = 0.8  # Of what the sharp target leaves: a blur that leaves more is not taken.
    compared_every: int = 10  # Pictures after which a blur is tried while the target looks sharp,
    grown: float = 1.5  # if less is left over than so many times as much as usual: a blur begins to show by that.
    memory: float = 0.05  # Rate of the usual misfit: that of 20 pictures.
    first_misfit: float = 0.5  # [squared grey levels] Usual misfit to begin with: rounding and an encoder leave it.


CONSTANTS = FocusConstants()

_READINGS_PX2 = 1 / 3  # Variance of the cubic B-spline by which readings of a picture are smoothed.


def width_px(level: int) -> float:
    """Standard deviation of the blur of a level [px]: zero for level zero, the sharp target."""
    return CONSTANTS.narrowest_px * CONSTANTS.wider ** (level - 1) if level else 0.0


def blurred(luma: Luma, level: int) -> Luma:
    """A picture (height, width) through the blur of a level."""
    return np.asarray(cv2.GaussianBlur(luma, (0, 0), width_px(level)), dtype=np.uint8)


class Focus:
    """A planar target at several levels of blur, and the level at which the present pictures show it.

    ``sharp`` is the target as the first picture shows it: level 0; ``last`` is the widest level.
    """

    def __init__(self, sharp: SharpTarget):
        self.levels: dict[int, SharpTarget] = {0: sharp}
        side_px = float(np.ptp(sharp.target.body.top_corners_m, axis=0).min()) / sharp.template.pixel_m
        widest_px = CONSTANTS.widest * side_px if side_px >= CONSTANTS.least_side_px else 0.0
        self.last = sum(width_px(level) <= widest_px for level in range(1, CONSTANTS.widths + 1))
        self.level, self.widest, self.observed, self.usual = 0, 0, 0, CONSTANTS.first_misfit

    def at(self, level: int) -> SharpTarget:
        """The target as it looks at a level, made when it is first asked for."""
        if level not in self.levels:
            self.levels[level] = _through_blur(self.levels[0], level)
        return self.levels[level]

    def is_due(self, scale: float) -> bool:
        """Whether other levels are to be tried in a picture whose residuals have this ``scale``.

        In every one while there is a blur, else now and then, and where more is left over than usual.
        """
        unusual = scale * scale > CONSTANTS.grown * self.usual
        return bool(self.level) or self.observed % CONSTANTS.compared_every == 0 or unusual

    def best(self, misfits: Mapping[int, float]) -> int:
        """The level that leaves least; the sharp one unless another leaves clearly less."""
        # A blurred target holds less noise than a sharp one, and would leave less for that alone.
        least = min(misfits, key=misfits.__getitem__)
        noise = misfits[least] / (1 + _noise_left(least))
        free = {level: misfit - noise * _noise_left(level) for level, misfit in misfits.items()}
        best = min(free, key=free.__getitem__)
        return 0 if 0 in free and free[best] > CONSTANTS.better * free[0] else best

    def allowed(self, floor_px: float) -> int:
        """The widest level beside a floor whose blur is ``floor_px`` wide: the focus is the same for both.

        An encoder takes the texture of what moves alone, and leaves it behind: that is no blur.
        """
        if not floor_px:
            return 0
        return sum(width_px(level) <= CONSTANTS.wider * floor_px * (1 + 1e-9) for level in range(1, self.last + 1))

    def settle(self, misfits: Mapping[int, float]) -> None:
        """Take the best of the levels that were tried in an observed picture, if any were, and what it leaves."""
        self.observed += 1
        if misfits:
            self.level = self.best(misfits)
            self.widest = max(self.widest, self.level)
            self.usual += CONSTANTS.memory * (misfits[self.level] - self.usual)


def misfit(values: Array, found: Alignment, template: Template) -> float:
    """Mean squared residual of a picture in which a template was ``found`` [squared grey levels of the picture].

    ``values`` (n,) are the picture's at the first points of the template.
    """
    n, known = len(values), np.isfinite(values)
    weight = np.where(known, found.weight[:n], 0.0)
    values, seen = np.where(known, values, 0.0), template.values[:n]
    total = light_misfit(values, seen, template.tile[:n], template.tiles, weight, found.scale)
    return total / max(float(weight.sum()), 1e-9)


def _noise_left(level: int) -> float:
    """Share of the variance of white noise that a level of blur leaves in readings."""
    return _READINGS_PX2 / (_READINGS_PX2 + width_px(level) ** 2)


def _through_blur(sharp: SharpTarget, level: int) -> SharpTarget:
    """A target through the blur of a level, by those points of its template that are clear of the surroundings."""
    template = sharp.template
    margin = clearance_m(sharp.target.body, template.pixel_m) + CONSTANTS.clear * width_px(level) * template.pixel_m
    clear = usable_points(sharp.target.body, template.points, margin)
    if clear.mean() < CONSTANTS.least_kept:
        clear[:] = True
    soft = replace(sharp, luma=blurred(sharp.luma, level))
    values = soft.read(template.points)
    slope = slopes_at(soft.luma, soft.target, soft.pose, template.points, template.pixel_m)
    kept: NDArray[np.bool_] = clear & np.isfinite(values) & np.isfinite(slope).all(axis=1)
    slopes = by_motion(template.points, slope)
    return replace(soft, template=replace(template.of(kept), values=values[kept], slopes=slopes[kept]))

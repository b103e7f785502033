"""The light on a planar target: gain and bias of each of its tiles between a template and a picture.

Beside it pictures of even light (:func:`evened`), and pictures without dead pixels (:func:`without_dead`).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.tracking.interpolation import RELAXED


@dataclass(frozen=True)
class LightConstants:
    """Tuned constants of the light; gains are picture over template."""

    gain_spread: float = 0.5  # ASSUME: prior deviation of a gain from one; lamps and shade change it by half.
    least_gain: float = 0.2  # A tile that follows the template at no more than this does not show it.
    most_gain: float = 5.0  # The inverse of the least.
    evened: float = 1 / 24  # Of a picture's width: light changes over more, the floor's texture over less.
    evened_levels: float = 40.0  # [grey levels] Deviation of the texture, of which the ends are then cut off at three.
    least_contrast: float = 0.5  # [grey levels] Of the texture: rounding alone gives 0.3.
    dead_levels: float = 20.0  # [grey levels] By which a dead pixel is beyond all around it,
    dead_share: float = 5e-5  # of the picture; fewer do not matter, and grain has up to 1e-5 that look like it.


CONSTANTS = LightConstants()

Tiles = NDArray[np.int64]

_AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=np.uint8)

OUTSIDE = 1e12
"""Residual of a point outside the picture: finite, so that compiled sums stay finite."""


@compiled(fastmath=RELAXED)
def fit_light(
    values: Array,
    template: Array,
    tile: Tiles,
    tiles: int,
    weight: Array,
    ridge: float,
    least_gain: float,
    most_gain: float,
) -> Array:
    """Gain, mean of the template, mean of the picture, weight and weighted variance of each tile: (tiles, 5)."""
    sums = np.zeros((tiles, 5))
    light = np.empty((tiles, 5))
    for i in range(values.shape[0]):
        w, a, t, row = weight[i], values[i], template[i], tile[i]
        sums[row, 0] += w
        sums[row, 1] += w * t
        sums[row, 2] += w * a
        sums[row, 3] += w * t * t
        sums[row, 4] += w * t * a
    for row in range(tiles):
        total = max(sums[row, 0], 1e-9)
        mean_t, mean_a = sums[row, 1] / total, sums[row, 2] / total
        variance = max(sums[row, 3] - total * mean_t * mean_t, 0.0)
        # The ridge is a prior: gain 1, give or take ``gain_spread``, against residuals of the present scale.
        gain = (sums[row, 4] - total * mean_t * mean_a + ridge) / (variance + ridge)
        light[row, 0] = min(max(gain, least_gain), most_gain)
        light[row, 1], light[row, 2], light[row, 3], light[row, 4] = mean_t, mean_a, total, variance
    return light


@compiled(fastmath=RELAXED)
def misfits(values: Array, template: Array, tile: Tiles, light: Array, residual: Array) -> None:
    """Write the residuals in grey levels of the template to ``residual`` (n,)."""
    for i in range(values.shape[0]):
        row = tile[i]
        misfit = (values[i] - light[row, 2]) / light[row, 0] - (template[i] - light[row, 1])
        residual[i] = misfit if values[i] >= 0 else OUTSIDE


def light_misfit(values: Array, template: Array, tile: Tiles, tiles: int, weight: Array, scale: float) -> float:
    """Weighted sum of squared residuals once the light is fitted [squared grey levels of the picture].

    ``values`` (n,) are grey values in the picture, none outside it, ``template`` (n,) those of the template; ``tile``
    and ``weight`` (n,) as in the alignment; ``scale`` the standard deviation of the residuals [template grey levels].
    """
    ridge = (scale / CONSTANTS.gain_spread) ** 2
    light = fit_light(values, template, tile, tiles, weight, ridge, CONSTANTS.least_gain, CONSTANTS.most_gain)
    return float(_weighed_misfit(values, template, tile, light, weight))


@compiled(fastmath=RELAXED)
def _weighed_misfit(values: Array, template: Array, tile: Tiles, light: Array, weight: Array) -> float:
    total = 0.0
    for i in range(values.shape[0]):
        row = tile[i]
        misfit = values[i] - light[row, 2] - light[row, 0] * (template[i] - light[row, 1])
        total += weight[i] * misfit * misfit
    return total


def without_dead(luma: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture (height, width) with each dead pixel replaced by the median around it; as it is where few are dead.

    Dead pixels stay at their places and are the steepest points of all: a floor that is recognised by them stands still
    however the camera moves. All other pixels are kept, since the floor is registered by its finest texture.
    """
    above = cv2.subtract(luma, cv2.dilate(luma, _AROUND)) > CONSTANTS.dead_levels
    below = cv2.subtract(cv2.erode(luma, _AROUND), luma) > CONSTANTS.dead_levels
    dead = above | below
    if np.count_nonzero(dead) <= CONSTANTS.dead_share * dead.size:
        return luma
    return np.where(dead, cv2.medianBlur(luma, 3), luma)


def evened(luma: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture (height, width) with the same brightness and contrast everywhere, through a median of 3 × 3 pixels.

    Two pictures of one place taken at different times differ in their light, also within a tile (bands of mains light).
    The contrast of weak texture is raised, and with it dead pixels and noise, which the median takes away before.
    """
    width = round(CONSTANTS.evened * luma.shape[1])
    alive = cv2.medianBlur(luma, 3).astype(np.float32)
    texture = alive - cv2.blur(alive, (width, width))
    # Sums that move over the picture round off: after a bright place, a plain one may be left with less than nothing.
    contrast = np.sqrt(np.maximum(cv2.blur(texture * texture, (width, width)), 0.0))
    levels = 128 + CONSTANTS.evened_levels * texture / np.maximum(contrast, CONSTANTS.least_contrast)
    return np.asarray(np.clip(np.rint(levels), 0, 255), dtype=np.uint8)

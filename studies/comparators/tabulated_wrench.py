"""A candidate for cheap friction: the wrench of a patch read from a table over the directions of the twist.

Under Coulomb's law the wrench does not depend on the length of the twist (vx, vy, r ω), only on its direction, two
angles. A table of it, read bilinearly, costs a few multiplications. It is wrong at speeds at which the law has not yet
saturated, which is why the package does not use it; the chart shows what it would buy.
"""

from __future__ import annotations

import math

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.wrench import SlidingPatch, wrench_at_origin

_FAST = 10.0  # m/s, far beyond any stiction velocity


def wrench_table(patch: SlidingPatch, parts: int) -> Array:
    """Wrenches (2 parts + 1, parts + 1, 3) about the patch's origin over azimuth and elevation of the twist."""
    azimuths = np.linspace(-np.pi, np.pi, 2 * parts + 1)
    elevations = np.linspace(-np.pi / 2, np.pi / 2, parts + 1)
    table = np.empty((len(azimuths), len(elevations), 3))
    for i, azimuth in enumerate(azimuths):
        for k, elevation in enumerate(elevations):
            across, turning = _FAST * math.cos(elevation), _FAST * math.sin(elevation)
            vx, vy = across * math.cos(azimuth), across * math.sin(azimuth)
            table[i, k] = wrench_at_origin(patch, vx, vy, turning / patch.radius)
    return table


@compiled()
def read_wrench(table: Array, radius: float, vx: float, vy: float, omega: float) -> tuple[float, float, float]:
    """Force [N] and moment [N m] from a table of :func:`wrench_table`, bilinear in the two angles."""
    u = (math.atan2(vy, vx) + math.pi) / (2 * math.pi) * (table.shape[0] - 1)
    v = (math.atan2(radius * omega, math.hypot(vx, vy)) / math.pi + 0.5) * (table.shape[1] - 1)
    i, k = min(int(u), table.shape[0] - 2), min(int(v), table.shape[1] - 2)
    a, b = u - i, v - k
    low, high = (1 - a) * (1 - b), a * b
    left, right = (1 - a) * b, a * (1 - b)
    return (
        low * table[i, k, 0] + right * table[i + 1, k, 0] + left * table[i, k + 1, 0] + high * table[i + 1, k + 1, 0],
        low * table[i, k, 1] + right * table[i + 1, k, 1] + left * table[i, k + 1, 1] + high * table[i + 1, k + 1, 1],
        low * table[i, k, 2] + right * table[i + 1, k, 2] + left * table[i, k + 1, 2] + high * table[i + 1, k + 1, 2],
    )

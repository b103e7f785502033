"""Footprints for the physics tests."""

import numpy as np

from towval.model import Patch


def rectangle(width, depth):
    x, y = width / 2, depth / 2
    return Patch([[-x, -y], [x, -y], [x, y], [-x, y]])


def random_star(rng, corners=(3, 16)):
    """A simple polygon, mostly not convex, anywhere and of any size."""
    while True:
        n = int(rng.integers(*corners))
        angle = np.sort(rng.uniform(0, 2 * np.pi, n))
        gaps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
        if gaps.max() < 3.0 and gaps.min() > 1e-3:
            break
    radius = rng.uniform(0.1, 1.0, n)
    outline = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return outline * np.exp(rng.normal()) + rng.normal(size=2)

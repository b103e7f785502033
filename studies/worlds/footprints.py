"""Random footprints, and places of a load on them."""

from __future__ import annotations

import numpy as np
import shapely

from towval.model import Array


def random_star(rng: np.random.Generator, corners: tuple[int, int] = (3, 16)) -> Array:
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


def random_load(rng: np.random.Generator, outline: Array) -> Array:
    """A place inside the hull of a polygon, down to 1e-3 of its size from the hull's edge."""
    hull = shapely.Polygon(outline).convex_hull
    size = np.linalg.norm(np.ptp(outline, axis=0))
    middle = shapely.get_coordinates(hull.centroid)[0]
    while True:
        edge = shapely.get_coordinates(hull.exterior.interpolate(rng.uniform(0, hull.exterior.length)))[0]
        place = edge + 10 ** rng.uniform(-3, 0) * (middle - edge)
        if hull.exterior.distance(shapely.Point(place)) >= 1e-3 * size:
            return place

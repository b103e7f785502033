"""Where the instantaneous centre of a rover can be, given the steering ranges of its wheels.

The axle line of a wheel sweeps a double cone while the wheel steers through its range. A centre is feasible if it lies
in the double cones of all wheels, so the region is a union of convex pieces, one for each combination of sides (left or
right) on which the wheels have the centre: at most 2⁴ intersections of eight half-planes, exact and possibly unbounded.
The two pieces on the same side of all wheels are the flanks, within which the centre moves without reversing a wheel;
the paper uses only those. SOURCE: section 2.4.2.
"""

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array
from towval.model.checks import locked
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.planning.kinematics import Rover, wheel_velocities

GUARD = 1e-9
"""Margin of the planner inside every steering range [rad], so that rounding never leaves the range."""

STEEPEST_TANGENT = 1e3
"""Limit of the tangents of the bicycle's steering angles where the wheels' ranges impose none."""


@dataclass(frozen=True)
class Piece:
    """A convex piece of the feasible region: ``normals`` (m, 2) and ``offsets`` (m,) with ``n · Ω ≥ offset`` [m].

    ``sides`` (4,) is +1 for the wheels that have the centre on their left when rolling forward, −1 for the others.
    """

    sides: tuple[int, ...]
    normals: Array
    offsets: Array

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points (..., 2) [m] lie in the piece or on its boundary, (...,) bool."""
        heights = np.asarray(points, dtype=np.float64) @ self.normals.T
        inside: NDArray[np.bool_] = np.logical_and.reduce(heights >= self.offsets, axis=-1)
        return inside

    def polygon(self, extent: float) -> Array:
        """Corners (k, 2) [m] of the piece within a square of half width ``extent`` [m] about the rover; may be none."""
        corners = extent * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return clipped(corners, self.normals, self.offsets)

    def vertices(self) -> Array:
        """Corners of the unbounded piece (k, 2) [m]."""
        found = []
        for i, j in itertools.combinations(range(len(self.normals)), 2):
            pair = self.normals[[i, j]]
            if abs(np.linalg.det(pair)) < 1e-12:
                continue
            corner = np.linalg.solve(pair, self.offsets[[i, j]])
            if (self.normals @ corner >= self.offsets - 1e-9 * (1 + np.abs(corner).max())).all():
                found.append(corner)
        return np.array(found).reshape(-1, 2)


def clipped(polygon: Array, normals: Array, offsets: Array) -> Array:
    """The part of a convex polygon (n, 2) in which ``normal · p ≥ offset`` holds for every row: corners (k, 2)."""
    for normal, offset in zip(normals, offsets, strict=True):
        if not len(polygon):
            break
        height = polygon @ normal - offset
        kept = []
        for k, (point, h) in enumerate(zip(polygon, height, strict=True)):
            before, h_before = polygon[k - 1], height[k - 1]
            if (h > 0) != (h_before > 0):
                kept.append(before + (point - before) * (h_before / (h_before - h)))
            if h > 0:
                kept.append(point)
        polygon = np.array(kept).reshape(-1, 2)
    return polygon


def feasible_piece(rover: Rover, sides: tuple[int, ...], guard: float = 0.0) -> Piece:
    """The feasible centres on given sides of the wheels.

    A wheel at p rolling forward with the centre on its left has ``Ω − p = r (−sin ρ, cos ρ)``, r > 0: the range
    ρ ∈ [ρ_min, ρ_max] is ``(Ω − p) · e(ρ_min) ≤ 0`` and ``(Ω − p) · e(ρ_max) ≥ 0``, e the unit vector of an angle.
    ``sides`` (4,) is +1 left, −1 right of each wheel; ``guard`` [rad] narrows each range at both ends.
    """
    side = locked(sides, "sides of the wheels", (4,))[:, None]
    if not np.isin(side, (-1.0, 1.0)).all():
        raise InputError("the centre is on no side of a wheel", got=sides, allowed="+1 (left) or −1 (right) of each")
    least, greatest = rover.steering_ranges.T + np.array([[guard], [-guard]])
    if not (least < greatest).all():
        raise InputError("the guard leaves nothing of a steering range", got=f"{guard} rad", allowed="less than half")
    lower = -side * np.stack([np.cos(least), np.sin(least)], axis=1)
    upper = side * np.stack([np.cos(greatest), np.sin(greatest)], axis=1)
    normals = np.concatenate([lower, upper])
    positions = np.concatenate([rover.wheel_positions, rover.wheel_positions])
    return Piece(tuple(sides), normals, np.sum(normals * positions, axis=1))


class Flanks(NamedTuple):
    """The part of the feasible region that the planner uses: left and right flank.

    ``normals`` (2, 8, 2), ``offsets`` (2, 8) half-planes of the left and right flank; ``corners`` (2, k, 2) [m] their
    vertices, padded with repetitions; ``tips`` (2, 2) [m] the vertex of each flank nearest to the rover: the tightest
    turns. ``steering_corners`` (m, 2) is the same region in the tangents of the bicycle's front and rear steering
    angle, a convex polygon, counter-clockwise.
    """

    normals: Array
    offsets: Array
    corners: Array
    tips: Array
    steering_corners: Array

    @property
    def tightest_radius(self) -> float:
        """Radius of the tightest turn of the rover's reference point to either side [m]."""
        return float(np.linalg.norm(self.tips, axis=1).max())


def flanks(rover: Rover) -> Flanks:
    """The flanks of a rover's feasible region, :data:`GUARD` inside its steering ranges.

    Every range holds straight ahead and is narrower than half a turn, so each flank exists and has a vertex.
    """
    pieces = [feasible_piece(rover, (side,) * 4, GUARD) for side in (1, -1)]
    corners = [piece.vertices() for piece in pieces]
    most = max(len(found) for found in corners)
    padded = np.stack([np.concatenate([found, np.repeat(found[:1], most - len(found), axis=0)]) for found in corners])
    tips = np.stack([found[np.argmin(np.linalg.norm(found, axis=1))] for found in corners])
    return Flanks(
        np.stack([piece.normals for piece in pieces]),
        np.stack([piece.offsets for piece in pieces]),
        padded,
        tips,
        _steering_polygon(rover),
    )


def _steering_polygon(rover: Rover) -> Array:
    """Feasible tangents of the bicycle's steering angles (m, 2).

    With v_x = 1 the wheels' velocities are linear in the tangents t: front and rear axle give
    ``ω = (t_f − t_r)/(x_f − x_r)``, ``v_y = t_f − ω x_f``; so each steering limit is a half-plane.
    """
    front, rear = rover.axles[:, 0]
    rates = np.array([1.0, -1.0]) / (front - rear)
    sideways = np.array([1.0, 0.0]) - rates * front
    twists = np.array([[1.0, 0.0, 0.0], [0.0, sideways[0], rates[0]], [0.0, sideways[1], rates[1]]])
    constant, by_front, by_rear = wheel_velocities(rover.wheel_positions, twists)
    normals, offsets = [], []
    for sign, limit in ((1.0, rover.steering_ranges[:, 0] + GUARD), (-1.0, rover.steering_ranges[:, 1] - GUARD)):
        across = sign * np.stack([-np.sin(limit), np.cos(limit)], axis=1)
        gradient = np.stack([np.sum(v * across, axis=1) for v in (by_front, by_rear)], axis=1)
        size = np.linalg.norm(gradient, axis=1)
        normals.append(gradient / size[:, None])
        offsets.append(-np.sum(constant * across, axis=1) / size)
    square = STEEPEST_TANGENT * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return clipped(square, np.concatenate(normals), np.concatenate(offsets))


@compiled()
def nearest_centre(normals: Array, offsets: Array, corners: Array, x: float, y: float) -> tuple[float, float, float]:
    """Point of a convex flank nearest to (x, y) [m], the point itself if it lies inside, and its distance [m].

    ``normals`` (m, 2), ``offsets`` (m,), ``corners`` (k, 2) as in :class:`Flanks`. The nearest point is the
    perpendicular foot on a boundary line, if that lies in the flank, or a corner.
    """
    m = len(offsets)
    inside = True
    best_x, best_y, best = 0.0, 0.0, np.inf
    for i in range(m):
        gap = offsets[i] - (normals[i, 0] * x + normals[i, 1] * y)
        if gap <= 0.0:
            continue
        inside = False
        foot_x, foot_y = x + gap * normals[i, 0], y + gap * normals[i, 1]
        slack = 1e-12 * (1.0 + abs(foot_x) + abs(foot_y))
        feasible = gap < best
        for j in range(m):
            if normals[j, 0] * foot_x + normals[j, 1] * foot_y < offsets[j] - slack:
                feasible = False
        if feasible:
            best_x, best_y, best = foot_x, foot_y, gap
    if inside:
        return x, y, 0.0
    for k in range(len(corners)):
        distance = np.hypot(corners[k, 0] - x, corners[k, 1] - y)
        if distance < best:
            best_x, best_y, best = corners[k, 0], corners[k, 1], distance
    return best_x, best_y, best


@compiled()
def nearest_in_polygon(corners: Array, x: float, y: float) -> tuple[float, float]:
    """Point nearest to (x, y) of a convex polygon (m, 2), counter-clockwise; the point itself if it lies inside."""
    inside = True
    best_x, best_y, best = 0.0, 0.0, np.inf
    m = len(corners)
    for k in range(m):
        ax, ay = corners[k, 0], corners[k, 1]
        bx, by = corners[(k + 1) % m, 0] - ax, corners[(k + 1) % m, 1] - ay
        if bx * (y - ay) - by * (x - ax) >= 0.0:
            continue
        inside = False
        share = min(max(((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by), 0.0), 1.0)
        foot_x, foot_y = ax + share * bx, ay + share * by
        distance = (foot_x - x) ** 2 + (foot_y - y) ** 2
        if distance < best:
            best_x, best_y, best = foot_x, foot_y, distance
    if inside:
        return x, y
    return best_x, best_y

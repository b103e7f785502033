"""Where a path of the tow rests: in which direction, and at what speed, the tether pulls there."""

import math

from towval.model.compiling import compiled
from towval.physics.splines import Spline, spline_at

CREEP = 1e-9  # m/s; where the path rests, directions are those of a creep this slow


@compiled(allocates=False)
def next_rest(spline: Spline, piece: int) -> float:
    """When a path next comes to rest or, where it rests, moves on. No panel goes beyond: forces jump there."""
    limits, end = spline.speed_limits, piece + 1
    while end < len(limits) and (limits[end] <= CREEP) == (limits[piece] <= CREEP):
        end += 1
    return float(spline.knots[end])


@compiled(allocates=False)
def moving_velocity(spline: Spline, time: float, piece: int) -> tuple[float, float]:
    """Velocity of the path at a time within a piece; where it rests, a creep in the direction of its motion.

    That is the direction in which it will move, or at its end has moved; throughout a pause that of the motion before,
    at whose end the tether stays, or of the motion after a pause at the start.
    """
    knots = spline.knots
    moving = _moving_piece(spline, piece)
    if moving != piece:
        time, piece = knots[moving + 1] if moving < piece else knots[moving], moving
    _, _, vx, vy, ax, ay = spline_at(knots, spline.coefficients, time, piece)
    speed = math.sqrt(vx * vx + vy * vy)
    if speed > CREEP:
        return vx, vy
    push = math.hypot(ax, ay)
    if push > 0:
        sign = 1.0 if time < knots[piece + 1] else -1.0
        return sign * CREEP * ax / push, sign * CREEP * ay / push
    if speed > 0:
        return CREEP * vx / speed, CREEP * vy / speed
    return CREEP, 0.0


@compiled(allocates=False)
def _moving_piece(spline: Spline, piece: int) -> int:
    """The piece of a path itself; where it rests, the last that moved or, at the start, the first that does."""
    limits, moving = spline.speed_limits, piece
    while moving > 0 and limits[moving] <= CREEP:
        moving -= 1
    while moving < len(limits) - 1 and limits[moving] <= CREEP:
        moving += 1
    return moving if limits[moving] > CREEP else piece


@compiled(allocates=False)
def slowest_tow(spline: Spline, time: float, piece: int) -> float:
    """Speed at which the tether of an object at rest pulls as it did while the path moved [m/s]; 0 where it moves.

    A tether that holds still keeps its pull and direction. At a creep there would be neither: friction that rises with
    speed is next to none there, and is spread over the footprint in another way. It is the speed that the path may
    reach in the piece before a pause.
    """
    _, _, vx, vy, _, _ = spline_at(spline.knots, spline.coefficients, time, piece)
    if spline.speed_limits[piece] > CREEP and vx * vx + vy * vy > CREEP * CREEP:
        return 0.0
    return max(CREEP, float(spline.speed_limits[_moving_piece(spline, piece)]))

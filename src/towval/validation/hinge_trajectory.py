"""The trajectory of the tether's hinge with the rover: cubics between the kept poses of its decimated track.

Nodes are those of the track, so that the acceleration of the hinge jumps only where that of the track does, and times
between them where the rover turns: a cubic through positions and velocities misses the arc of a lever l by l Δϑ⁴/384.
"""

import numpy as np

from towval.model import Array, DecimatedTrack
from towval.model.geometry import rotation, velocity_at
from towval.physics.splines import Spline, hermite_spline

_TURN = 0.05  # rad between two nodes; for a lever of 0.4 m the arc is then missed by 10 nm, hard braking by 1 µm


def nodes_between(track: DecimatedTrack, begin: float, end: float, parts: int = 1) -> Array:
    """Times (m,) of the nodes from ``begin`` to ``end`` [s], both included; in each piece at least ``parts``."""
    inside = track.time_s[(track.time_s > begin) & (track.time_s < end)]
    ends = np.concatenate([[begin], inside, [end]])
    moving = track.poses_and_rates_at(ends)
    length = np.diff(ends)
    fastest = np.maximum(np.abs(moving[:-1, 5]), np.abs(moving[1:, 5])) * length
    counts = np.maximum(parts, np.ceil(np.maximum(fastest, np.abs(np.diff(moving[:, 2]))) / _TURN)).astype(int)
    first = np.repeat(ends[:-1], counts)
    within = np.concatenate([np.arange(count) / count for count in counts])
    return np.append(first + within * np.repeat(length, counts), end)


def trajectory_of(hinge: Array, times: Array, rover: Array) -> Spline:
    """Trajectory of a point (2,) of the rover [m] with poses and rates (m, 6) of the rover at times (m,) [s]."""
    lever = rotation(rover[:, 2]) @ hinge
    return hermite_spline(times, rover[:, :2] + lever, velocity_at(rover[:, 3:], lever))


def hinge_trajectory(rover: DecimatedTrack, hinge: Array, times: Array) -> Spline:
    """Trajectory of the tether's hinge (2,) [m] along the rover's smoothed track, over ``times`` (n,) [s]."""
    nodes = nodes_between(rover, times[0], times[-1])
    return trajectory_of(hinge, nodes, rover.poses_and_rates_at(nodes))

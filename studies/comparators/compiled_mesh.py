"""The paper's mesh in well compiled code, against which the boundary integral is timed.

Finite volumes: a loop over cells that evaluates Makkar's law, three tanh, in each. No allocation, no indirection, the
arithmetic free to be reordered; tanh comes from one exponential, which is faster than the C library's own. The
quasi-static model takes one Newton step at each time from the extrapolated rate, with the slope summed in the same
loop. The package solves the balance at the nodes of panels and interpolates: its gain in time is both.
"""

from __future__ import annotations

import math

import numpy as np

from towval.model import Array, TimedPath, TowedObject
from towval.model.compiling import compiled
from towval.physics.wrench import SlidingPatch

_SETTLED = 1e-6
_AB3 = (23 / 12, -16 / 12, 5 / 12)

loop = compiled(allocates=False, fastmath=True)


@loop
def _tanh(x: float) -> float:
    decay = math.exp(-2 * x)
    return (1 - decay) / (1 + decay)


@loop
def mesh_wrench(
    cells: Array, gamma: tuple[float, ...], vx: float, vy: float, omega: float
) -> tuple[float, float, float]:
    """Force and moment about the origin of the cells (n, 3): place (x, y) and force p dS."""
    g1, g2, g3, g4, g5, g6 = gamma
    fx = fy = moment = 0.0
    for i in range(cells.shape[0]):
        x, y = cells[i, 0], cells[i, 1]
        ux, uy = vx - omega * y, vy + omega * x
        speed = math.sqrt(ux * ux + uy * uy) + 1e-300
        mu = g1 * (_tanh(g2 * speed) - _tanh(g3 * speed)) + g4 * _tanh(g5 * speed) + g6 * speed
        friction = cells[i, 2] * mu / speed
        fx -= friction * ux
        fy -= friction * uy
        moment -= friction * (x * uy - y * ux)
    return fx, fy, moment


@loop
def many_mesh_wrenches(cells: Array, gamma: tuple[float, ...], twists: Array, repeats: int) -> float:
    """Sum over many evaluations of the mesh's wrench, for timing."""
    total = 0.0
    for k in range(repeats):
        for i in range(len(twists)):
            fx, fy, moment = mesh_wrench(cells, gamma, twists[i, 0] + 1e-12 * k, twists[i, 1], twists[i, 2])
            total += fx + fy + moment
    return total


@loop
def _balance(
    cells: Array, gamma: tuple[float, ...], ax: float, ay: float, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float]:
    """Moment about the anchor, force, and the slopes of the three by ω, for the velocity of the cells' origin."""
    g1, g2, g3, g4, g5, g6 = gamma
    fx = fy = moment = fx_rate = fy_rate = moment_rate = 0.0
    for i in range(cells.shape[0]):
        x, y, load = cells[i, 0], cells[i, 1], cells[i, 2]
        ux, uy = vx - omega * y, vy + omega * x
        inverse = 1 / (math.sqrt(ux * ux + uy * uy) + 1e-300)
        speed = 1 / inverse
        t2, t3, t5 = _tanh(g2 * speed), _tanh(g3 * speed), _tanh(g5 * speed)
        ratio = load * (g1 * (t2 - t3) + g4 * t5 + g6 * speed) * inverse
        slope = load * (g1 * (g2 * (1 - t2 * t2) - g3 * (1 - t3 * t3)) + g4 * g5 * (1 - t5 * t5) + g6)
        speed_rate = (x * uy - y * ux) * inverse
        turn = (slope - ratio) * speed_rate * inverse
        lx, ly = x - ax, y - ay
        fx -= ratio * ux
        fy -= ratio * uy
        moment -= ratio * (lx * uy - ly * ux)
        fx_rate -= turn * ux - ratio * y
        fy_rate -= turn * uy + ratio * x
        moment_rate -= turn * (lx * uy - ly * ux) + ratio * (lx * x + ly * y)
    return moment, fx, fy, fx_rate, fy_rate, moment_rate


@loop
def _follow(cells: Array, gamma: tuple[float, ...], geometry: Array, velocity: Array, step: float, out: Array) -> int:
    """Fill ``out`` (n, 4): heading, rate, force in body axes; row 0 holds both to start with. Returns the solves."""
    ax, ay, radius = geometry
    solves = 0
    for i in range(len(velocity)):
        omega, theta = out[0, 1], out[0, 0]
        if i > 0:
            known = min(i, 3)
            mean = out[i - 1, 1]
            if known == 3:
                mean = _AB3[0] * out[i - 1, 1] + _AB3[1] * out[i - 2, 1] + _AB3[2] * out[i - 3, 1]
            theta = out[i - 1, 0] + step * mean
            omega = 2 * out[i - 1, 1] - out[i - 2, 1] if known > 1 else out[i - 1, 1]
        cos, sin = math.cos(theta), math.sin(theta)
        ux = cos * velocity[i, 0] + sin * velocity[i, 1]
        uy = cos * velocity[i, 1] - sin * velocity[i, 0]
        unit = math.sqrt(ux * ux + uy * uy) / radius
        fx = fy = 0.0
        for _ in range(30):
            solves += 1
            moment, fx, fy, fx_rate, fy_rate, moment_rate = _balance(cells, gamma, ax, ay, ux, uy, omega)
            change = -moment / moment_rate
            omega += change
            fx += change * fx_rate
            fy += change * fy_rate
            if abs(change) < _SETTLED * unit:
                break
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = theta, omega, fx, fy
    return solves


def plan_on_mesh(
    towed: TowedObject, patch: SlidingPatch, gamma: tuple[float, ...], path: TimedPath, start: tuple[float, float]
) -> Array:
    """Heading, rate and friction force (2, body axes) of the quasi-static model (n, 4) by a mesh, on a path's times.

    The tracked point is the body frame's origin; ``start`` holds heading and rate to begin with. The time steps of the
    path are even.
    """
    step = float(path.time_s[1] - path.time_s[0])
    velocity = np.gradient(path.position, step, axis=0, edge_order=2)
    cells = patch.area_nodes.copy()
    cells[:, :2] += patch.origin
    out = np.empty((len(path.time_s), 4))
    out[0, :2] = start
    radius = float(np.linalg.norm(cells[:, :2], axis=1).max())
    _follow(cells, gamma, np.array([*towed.anchor, radius]), velocity, step, out)
    return out

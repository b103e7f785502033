"""The LuGre model of a towed patch: bristles with damping on a grid of cells, as published for points and tyres.

SOURCE: Canudas de Wit, Olsson, Åström and Lischinsky (1995), in two dimensions and spread over a patch as by Velenis,
Tsiotras, Canudas de Wit and Sorine (2005), without their viscous term: per cell of normal force N_i and velocity v

    ż = v − σ0 |v|/g(v) z,   F_i = −N_i (σ0 z + σ1 ż),   g(v) = μ_k + (μ_s − μ_k) exp(−(v/v_S)²).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studies.comparators.tow_scenes import TowScene
from towval.model import Array
from towval.model.compiling import compiled
from towval.model.conventions import GRAVITY_M_PER_S2


@dataclass(frozen=True)
class LuGre:
    """Coefficients: static and kinetic friction [1], Stribeck velocity [m/s], bristles' stiffness σ0 [1/m] over μN.

    σ1 is chosen so that a bristle is damped critically under the object's mass.
    """

    static: float
    kinetic: float
    stribeck_velocity: float
    stiffness: float = 1e4


def lugre_places(scene: TowScene, law: LuGre, cells: int, step_s: float) -> Array:
    """Places (n, 2) of the centre of mass of a square object at the scene's times [m].

    Parameters
    ----------
    scene : TowScene
        The object's footprint is a square about its centre of mass; its own law of friction is not used.
    law : LuGre
    cells : int
        Along a side, of equal load.
    step_s : float
        Of semi-implicit Euler.
    """
    towed, half = scene.towed, float(scene.towed.patch.outline.max())
    along = (np.arange(cells) + 0.5) / cells * 2 * half - half
    places = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    count = round((scene.times[-1] - scene.times[0]) / step_s)
    moments = scene.times[0] + np.arange(count + 1) * step_s
    hinge = np.column_stack([np.interp(moments, scene.hinge.time_s, scene.hinge.position[:, k]) for k in (0, 1)])
    body = np.array([towed.mass, towed.inertia, *towed.anchor, scene.tether.rest_length, scene.tether.stiffness])
    damping = 2 * np.sqrt(law.stiffness / GRAVITY_M_PER_S2)
    friction = np.array([law.static, law.kinetic, law.stribeck_velocity, law.stiffness, damping])
    path = _march(places, body, friction, hinge, np.array(scene.start_pose), step_s)
    return path[np.round((scene.times - scene.times[0]) / step_s).astype(int)]


@compiled()
def _march(places: Array, body: Array, friction: Array, hinge: Array, start: Array, step: float) -> Array:
    mass, inertia, anchor_x, anchor_y, length, stiffness = body
    static, kinetic, stribeck, bristle, damping = friction
    load = mass * 9.81 / len(places)
    bent = np.zeros((len(places), 2))  # body axes
    x, y, heading = start
    vx, vy, spin = 0.0, 0.0, 0.0
    path = np.empty((len(hinge), 2))
    for k in range(len(hinge)):
        path[k, 0], path[k, 1] = x, y
        c, s = np.cos(heading), np.sin(heading)
        ux, uy = c * vx + s * vy, c * vy - s * vx
        fx, fy, moment = 0.0, 0.0, 0.0
        for i in range(len(places)):
            px, py = places[i]
            wx, wy = ux - spin * py, uy + spin * px
            speed = np.sqrt(wx * wx + wy * wy)
            rate = bristle * speed / (kinetic + (static - kinetic) * np.exp(-((speed / stribeck) ** 2)))
            # The bristle's equation is linear in z: implicit in it, so that no step is too long for its rate.
            old_x, old_y = bent[i, 0], bent[i, 1]
            bent[i, 0] = (old_x + step * wx) / (1 + step * rate)
            bent[i, 1] = (old_y + step * wy) / (1 + step * rate)
            gx = -load * (bristle * bent[i, 0] + damping * (bent[i, 0] - old_x) / step)
            gy = -load * (bristle * bent[i, 1] + damping * (bent[i, 1] - old_y) / step)
            fx, fy, moment = fx + gx, fy + gy, moment + px * gy - py * gx
        span_x = hinge[k, 0] - x - c * anchor_x + s * anchor_y
        span_y = hinge[k, 1] - y - s * anchor_x - c * anchor_y
        reach = np.sqrt(span_x * span_x + span_y * span_y)
        pull = max(0.0, stiffness * (reach - length)) / reach
        tx, ty = c * pull * span_x + s * pull * span_y, c * pull * span_y - s * pull * span_x
        moment += anchor_x * ty - anchor_y * tx
        vx += step * (c * (fx + tx) - s * (fy + ty)) / mass
        vy += step * (s * (fx + tx) + c * (fy + ty)) / mass
        spin += step * moment / inertia
        x, y, heading = x + step * vx, y + step * vy, heading + step * spin
    return path

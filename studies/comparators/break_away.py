"""When a towed object at rest breaks away, by the limits of friction on cells: no integrator, no law of velocity.

At rest friction balances the tether, so statics give the pressure, a plane that only pushes. The object holds as long
as no motion yields more power of the tether than the cells' friction takes (the kinematic theorem of limit analysis).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq, minimize

from studies.worlds.bristles import BristledObject, cells_of
from studies.worlds.lab_tows import LabTow
from towval.model import Array
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.errors import RefusedError

_CELLS = 12
"""Along each side of a part of the footprint."""

_TRIALS = 30

_ARM_M = 0.2
"""By which turning is compared with moving, near the object's radius."""


def break_away_s(tow: LabTow, before_s: float) -> float:
    """Time [s] at which a tow on a level, isotropic floor first breaks away, if it does before another."""
    places, areas = cells_of(tow.rings, _CELLS)
    towed = replace(tow.towed, places=places, areas=areas)
    found: float = brentq(lambda time: _surplus(tow, towed, time), 0.0, before_s, xtol=1e-6)
    return found


def _surplus(tow: LabTow, towed: BristledObject, time: float) -> float:
    """By how much the tether may be stronger than it is before the object breaks away [1]; without a pull 1e3."""
    pull = _pull(tow, time)
    if not pull.any():
        return 1e3
    lever = np.array(towed.anchor) - np.array(towed.centre)
    wrench = np.array([*pull[:2], (lever[0] * pull[1] - lever[1] * pull[0]) / _ARM_M])
    arms = towed.places - np.array(towed.centre)
    limits = towed.static * _pressure(tow, towed, pull) * towed.areas
    along = wrench / np.linalg.norm(wrench)
    aside = np.linalg.svd(along[None])[2][1:]

    def taken(x: Array) -> float:
        vx, vy, turn = along + x @ aside
        turn /= _ARM_M
        return float(limits @ np.hypot(vx - turn * arms[:, 1], vy + turn * arms[:, 0]))

    least = minimize(taken, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12})
    return float(least.fun / np.linalg.norm(wrench)) - 1


def _pull(tow: LabTow, time: float) -> Array:
    """Force (3,) of the tether on the object at rest in its first pose [N], up positive."""
    tether, x, y, heading = tow.tether, *tow.start_pose
    (place,), (velocity,) = tow.hinge(np.array([time]))
    c, s = np.cos(heading), np.sin(heading)
    anchor = np.array([x, y]) + np.array([[c, -s], [s, c]]) @ tow.towed.anchor
    span = np.array([*(place - anchor), tether.hinge_height - tether.anchor_height])
    length = float(np.linalg.norm(span))
    stretch = length - tether.rest_length
    if stretch < 0:
        return np.zeros(3)
    loaded = tether.stiffness * stretch / tether.full_load
    stiffness = tether.stiffness * (1 - tether.stiffening + tether.stiffening * loaded)
    force = max(0.0, stiffness * stretch + tether.damping * float(span[:2] @ velocity) / length)
    turned: Array = force / length * np.array([c * span[0] + s * span[1], -s * span[0] + c * span[1], span[2]])
    return turned


def _pressure(tow: LabTow, towed: BristledObject, pull: Array) -> Array:
    """Pressure (n,) on the cells [N/m²]: a plane on those that it presses, found anew until these stay the same."""
    lever = np.array(towed.anchor) - np.array(towed.centre)
    lift = towed.mass * GRAVITY_M_PER_S2 - pull[2]
    # Moments about the floor below the centre of mass: friction has none.
    loads = np.array([lift, *(tow.tether.anchor_height * pull[:2] - pull[2] * lever)])
    at = np.column_stack([np.ones(len(towed.places)), towed.places - np.array(towed.centre)])
    presses = np.ones(len(at), dtype=bool)
    for _ in range(_TRIALS):
        plane = np.linalg.solve((at[presses] * towed.areas[presses, None]).T @ at[presses], loads)
        pressure = at @ plane
        if ((pressure > 0) == presses).all():
            return np.asarray(pressure.clip(0))
        presses = pressure > 0
    raise RefusedError("the object tips", got=f"a pull of {np.linalg.norm(pull):.3g} N")

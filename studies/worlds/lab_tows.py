"""Tows as labs have them, with their truth on bristles: the paper's cube, a level tow, and four feet towed at height.

Numbers are about those of a campaign each; the hinge goes, rests and goes on, so that the object rests in between.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from studies.worlds.bristles import BristledObject, TetherAtHeight, bristle_tow, cells_of
from towval.model import Array

_RAMP_S = 0.6


@dataclass(frozen=True)
class StopAndGo:
    """A hinge that goes along a wave, with rests.

    ``start`` (2,) [m]; ``speed`` along x [m/s]; ``going_s`` and ``resting_s`` [s] in turn, after a tenth of a rest;
    ``wave`` amplitude [m] and ``length`` [m] of the path ``y = wave (1 − cos(2π x / length)) / 2``.
    """

    start: tuple[float, float]
    speed: float = 0.06
    going_s: float = 5.0
    resting_s: float = 2.0
    wave: float = 0.15
    length: float = 0.7

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Places and velocities (n, 2) [m, m/s] at times (n,) [s]."""
        period, first = self.going_s + self.resting_s, self.resting_s / 10
        count, since = np.divmod(np.maximum(times - first, 0.0), period)
        rise, rise_moved = _smooth(since / _RAMP_S)
        fall, fall_moved = _smooth((since - self.going_s + _RAMP_S) / _RAMP_S)
        along = self.speed * (rise - fall)
        moved = self.speed * (count * (self.going_s - _RAMP_S) + _RAMP_S * (rise_moved - fall_moved))
        wave = 2 * np.pi / self.length
        aside = self.wave / 2 * (1 - np.cos(wave * moved))
        places = np.array(self.start) + np.column_stack([moved, aside])
        return places, np.column_stack([along, self.wave / 2 * wave * np.sin(wave * moved) * along])


def _smooth(x: Array) -> tuple[Array, Array]:
    """A step from 0 to 1 over 0 ≤ x ≤ 1 with three continuous derivatives, and its integral from 0."""
    c = np.clip(x, 0.0, 1.0)
    step = c**4 * (35 - 84 * c + 70 * c**2 - 20 * c**3)
    return step, c**5 * (7 - 14 * c + 10 * c**2 - 2.5 * c**3) + np.maximum(x - 1, 0.0)


@dataclass(frozen=True)
class LabTow:
    """A tow and its floor: ``rings`` of the footprint (4, 2) each [m], rectangles; the rest as in ``bristle_tow``."""

    rings: tuple[Array, ...]
    towed: BristledObject
    tether: TetherAtHeight
    hinge: StopAndGo
    start_pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    duration: float = 21.0
    slope: tuple[float, float] = (0.0, 0.0)
    report_s: float = field(default=0.05)

    def truth(self, step_s: float = 1e-4) -> tuple[Array, Array]:
        """Times (n,) [s] and poses (n, 3) on bristles."""
        times, poses, _ = bristle_tow(
            self.towed,
            self.tether,
            self.hinge,
            self.start_pose,
            self.duration,
            slope=self.slope,
            report_s=self.report_s,
            step_s=step_s,
        )
        return times, poses


def rectangle(length: float, width: float, x: float = 0.0, y: float = 0.0) -> Array:
    """Corners (4, 2) of a rectangle about (x, y) [m]."""
    corners: Array = np.array([x, y]) + 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (length, width)
    return corners


def _straight_ahead(anchor: tuple[float, float], tether: TetherAtHeight, slack: float) -> tuple[float, float]:
    """Where the hinge starts, ahead of the anchor, with the tether short of taut by ``slack`` [m]."""
    rise = tether.hinge_height - tether.anchor_height
    return anchor[0] + float(np.sqrt((tether.rest_length - slack) ** 2 - rise**2)), anchor[1]


def started_anew(tow: LabTow, slack: float = 0.01) -> LabTow:
    """A tow whose tether has changed, with the hinge where its tether is short of taut by ``slack`` [m]."""
    return replace(tow, hinge=replace(tow.hinge, start=_straight_ahead(tow.towed.anchor, tow.tether, slack)))


def paper_tow(cells: int = 12) -> LabTow:
    """The paper's cube: tether and anchor on the floor, one coefficient of friction."""
    rings = (rectangle(0.4, 0.4),)
    places, areas = cells_of(rings, cells)
    towed = BristledObject(places, areas, 5.0, (0.0, 0.0), 0.0, 0.4 / 3, (0.2, 0.0), 0.35, 0.35, 0.01)
    tether = TetherAtHeight(0.6, 1000.0)
    return LabTow(rings, towed, tether, StopAndGo(_straight_ahead(towed.anchor, tether, 0.01)))


def level_tow(cells: int = 12) -> LabTow:
    """A box of 0.5 × 0.35 m with an eccentric load, the tether on the floor and without damping (campaign lab_a)."""
    rings = (rectangle(0.5, 0.35),)
    places, areas = cells_of(rings, cells)
    centre, inertia = (-0.0559, 0.0341), 0.19
    towed = BristledObject(places, areas, 5.8, centre, 0.0, inertia, (0.25, 0.0), 0.396, 0.35, 0.07)
    tether = TetherAtHeight(0.6, 800.0)
    return LabTow(rings, towed, tether, StopAndGo(_straight_ahead(towed.anchor, tether, 0.01)))


def four_feet(cells: int = 4) -> LabTow:
    """A box on four feet, towed at height on a slope, anisotropic, by a tether that stiffens (campaign lab_c)."""
    rings = tuple(rectangle(0.04, 0.04, x, y) for x in (-0.2151, 0.2151) for y in (-0.1395, 0.1395))
    places, areas = cells_of(rings, cells)
    towed = BristledObject(
        places,
        areas,
        5.962,
        (-0.0325, 0.0258),
        0.175,
        0.22,
        (0.2492, -0.0298),
        0.396,
        0.346,
        0.0112,
        across_over_along=1.04,
    )
    tether = TetherAtHeight(0.5993, 925.0, 12.5, 0.3, 25.0, 0.2201, 0.09)
    start = _straight_ahead(towed.anchor, tether, 0.01)
    return LabTow(rings, towed, tether, StopAndGo(start), slope=(-0.00058, 0.00267))


TOWS = {"paper": paper_tow, "level tow": level_tow, "four feet": four_feet}
"""By the name that charts show."""

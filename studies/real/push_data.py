"""Measured quasi-static pushes of a block: what is read from a folder, and the angles they are judged by.

SOURCE: Zhou, Paolini, Bagnell, Mason, "A convex polynomial force-motion model for planar sliding", ICRA 2016 (arXiv
1602.06056), logs of robinzhoucmu/MLab_EXP, Apache-2.0. The wrench is what the tip does to the block, in body axes about
the centre of mass; friction on the block is its opposite.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from towval.model import Array, locked
from towval.model.errors import InputError

LENGTH_M = 0.05
"""Moments are divided and heading rates multiplied by it, so that wrenches and twists have angles."""

MASS_KG = 1.518
PROGRAMMED_HEIGHT_M = 0.0125
TIP_HEIGHT_M = 0.015
"""Height of the tip above the board [m]: this one was chosen on the data, the robot was programmed to the other."""

STATED_FRICTION = 0.282
"""μ that the authors' scripts use for this board (4.2 N); only the load transfer of a predicted force needs it."""

LEAST_FORCE_N = 0.1
"""Ten times the sensor's noise; a push at a long arm takes 0.6 N, a straight one 4 N."""

OUTLINE = np.array([[-0.05, -0.05], [0.10, -0.05], [-0.05, 0.10]])


@dataclass(frozen=True)
class PushLog:
    """The usable pushes of one log.

    Attributes
    ----------
    name : str
    feet : ndarray (k, 2)
        Feet in body axes [m]; none where the whole face is the support.
    twist, wrench : ndarray (n, 3)
        Body twist over the push [m, m, rad] (in unit time) and mean body wrench of the tip [N, N, N m].
    courses : tuple of ndarray (m, 4)
        A push's samples while the tip advances: body wrench (3,) and the tip's work on the block since the last [J].
    """

    name: str
    feet: Array
    twist: Array
    wrench: Array
    courses: tuple[Array, ...] = ()

    def __post_init__(self) -> None:
        for name, shape in (("feet", (None, 2)), ("twist", (None, 3)), ("wrench", (None, 3))):
            object.__setattr__(self, name, locked(getattr(self, name), f"PushLog.{name}", shape))


def read_logs(folder: Path) -> list[PushLog]:
    """The logs of ``supports.csv`` with the pushes of ``pushes.csv`` that are marked usable."""
    supports, pushes = pd.read_csv(folder / "supports.csv"), pd.read_csv(folder / "pushes.csv")
    logs = []
    for row in supports.itertuples():
        own = pushes[(pushes.log == row.log) & (pushes.ok == 1)]
        feet = np.array([[row.p1x, row.p1y], [row.p2x, row.p2y], [row.p3x, row.p3y]])
        samples = dict(tuple(pd.read_csv(folder / f"{row.log}.csv").groupby("push")))
        logs.append(
            PushLog(
                str(row.log),
                np.empty((0, 2)) if np.isnan(feet).any() else feet,
                own[["vbx", "vby", "wb"]].to_numpy(float),
                own[["fbx", "fby", "mb"]].to_numpy(float),
                tuple(_course(samples[push]) for push in own.push),
            )
        )
    return logs


def _course(samples: pd.DataFrame) -> Array:
    """Body wrench and work between the samples of a push where its progress grows and the tip works."""
    heading = samples.th.to_numpy()[1:]
    force, moment = (_means(samples[names].to_numpy(float)) for names in (["fx", "fy"], ["mz"]))
    work = (force * np.diff(samples[["tip_x", "tip_y"]].to_numpy(float), axis=0)).sum(axis=1)
    cos, sin = np.cos(heading), np.sin(heading)
    along, across = cos * force[:, 0] + sin * force[:, 1], cos * force[:, 1] - sin * force[:, 0]
    kept = (np.diff(samples.s.to_numpy(float)) > 0) & (work > 0) & (np.linalg.norm(force, axis=1) > LEAST_FORCE_N)
    if not kept.any():
        number = samples["push"].iloc[0]
        raise InputError("a push has no samples in contact", got=f"push {number}", remedy="set its ok to 0")
    course: Array = np.column_stack([along, across, moment[:, 0], work])[kept]
    return course


def _means(values: Array) -> Array:
    middle: Array = (values[1:] + values[:-1]) / 2
    return middle


def scaled_wrench(wrench: ArrayLike) -> Array:
    """(fx, fy, m / 0.05 m) [N] of wrenches (..., 3)."""
    return np.asarray(wrench, dtype=np.float64) / (1.0, 1.0, LENGTH_M)


def scaled_twist(twist: ArrayLike) -> Array:
    """(vx, vy, 0.05 m · ω) [m/s] of twists (..., 3)."""
    return np.asarray(twist, dtype=np.float64) * (1.0, 1.0, LENGTH_M)


def angle_deg(a: ArrayLike, b: ArrayLike) -> Array:
    """Angles [deg] between vectors (..., 3), by atan2 so that small ones are exact."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    cross = np.linalg.norm(np.cross(a, b), axis=-1)
    angles: Array = np.degrees(np.arctan2(cross, (a * b).sum(axis=-1)))
    return angles

"""Check of the world of bristles against closed forms, the other reference, and itself with a finer step."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced
from studies.worlds.bristles import BristledObject, TetherAtHeight, bristle_tow, cells_of
from studies.worlds.reference import Box, towed_box
from towval.model import Array

_HERE = sys.modules[__name__]

_SQUARE = 0.2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_WEIGHT, _STATIC, _KINETIC = 5.0 * 9.81, 0.4, 0.35
_BEND_M = 1e-5
Hinge = Callable[[Array], tuple[Array, Array]]


def _block(count: int = 6, **keys: Any) -> BristledObject:
    given: dict[str, Any] = {"centre": (0.0, 0.0), "centre_height": 0.15, "inertia": 0.4 / 3, "anchor": (0.2, 0.0)}
    given |= {"mass": 5.0, "static": _STATIC, "kinetic": _KINETIC, "friction_velocity": 0.01}
    return BristledObject(*cells_of([_SQUARE], count), **(given | keys))


def _straight(speed: float, reach: float) -> Hinge:
    """A hinge that starts at rest a given reach ahead, and ends up at a speed within a second."""

    def hinge(t: Array) -> tuple[Array, Array]:
        ramp = np.minimum(t, 1.0)
        moved = speed * (ramp**3 - ramp**4 / 2 + np.maximum(t - 1, 0))
        velocity = speed * (3 * ramp**2 - 2 * ramp**3)
        return np.column_stack([reach + moved, 0 * t]), np.column_stack([velocity, 0 * t])

    return hinge


def _pulls() -> Values:
    """Pull of an inclined tether, T cos = μ (m g − T sin), sliding and at break-away, from the closed form [%]."""
    tether, reach = TetherAtHeight(0.6, 1000.0, 50.0, 0.0, 1.0, 0.3, 0.1), 0.2 + float(np.sqrt(0.6**2 - 0.2**2))

    def closed_form(friction: float, place: float) -> float:
        rise = float(np.arctan2(0.2, place - 0.2))
        return friction * _WEIGHT / (np.cos(rise) + friction * np.sin(rise))

    fast, slow = _straight(0.05, reach), _straight(0.01, reach)
    times, poses, pull = bristle_tow(_block(), tether, fast, (0, 0, 0), 6.0, report_s=0.01)
    sliding = pull[-1] / closed_form(_KINETIC, fast(times[-1:])[0][0, 0] - poses[-1, 0])
    times, poses, pull = bristle_tow(_block(), tether, slow, (0, 0, 0), 5.0, report_s=0.01)
    bent = int(np.argmax(poses[:, 0] > 0.995 * _BEND_M))
    breaking = pull[bent] / closed_form(_STATIC, slow(times)[0][bent, 0])
    return {
        "pull of an inclined tether, sliding": 100 * float(sliding - 1),
        "pull of an inclined tether, breaking away": 100 * float(breaking - 1),
    }


def _rests() -> Values:
    """What half of the limit of friction moves at once [µm], and in ten seconds more [nm]."""
    hinge = _straight(0.0, 0.8 + 0.5 * _STATIC * _WEIGHT / 1000.0)
    _, poses, _ = bristle_tow(_block(), TetherAtHeight(0.6, 1000.0), hinge, (0, 0, 0), 20.0, slope=(0.003, 0.001))
    more = np.abs(poses[-1] - poses[len(poses) // 2]).max()
    return {
        "half the limit moves it at once": 1e6 * float(np.abs(poses[-1, :2]).max()),
        "half the limit moves it in 10 s more": 1e9 * float(more),
    }


def _slides() -> Values:
    """A curved tow that slides all along, from quadrature and Radau, whose friction is rounded off over 0.02 mm/s."""

    def hinge(t: Any) -> tuple[Array, Array]:
        t = np.atleast_1d(t)
        return np.column_stack([0.805 + 0.08 * t, 0.03 * t**2]), np.column_stack([np.full(len(t), 0.08), 0.06 * t])

    flat = _block(24, static=_KINETIC, centre=(0.03, 0.02), inertia=0.15, centre_height=0.0)
    times, poses, _ = bristle_tow(flat, TetherAtHeight(0.6, 1000.0), hinge, (0, 0, 0), 3.0, report_s=0.1, step_s=2.5e-5)
    box = Box((0.4, 0.4), 5.0, (0.03, 0.02), 0.15, (0.2, 0.0), _KINETIC, 2e-5)
    truth = towed_box(
        box, lambda t: hinge(t)[0][0], (0.6, 1000.0), (0, 0, 0), times, panels=(8, 8), order=4, tolerance=1e-6
    )
    apart = np.abs(poses - truth)
    return {
        "sliding, from quadrature and Radau": 1e6 * float(apart[:, :2].max()),
        "sliding, from quadrature and Radau, heading": 1e3 * float(apart[:, 2].max()),
    }


def _finer() -> float:
    """What half the step and half the deflection move a tow of four feet at height [mm]."""

    def hinge(t: Array) -> tuple[Array, Array]:
        turn = 0.1 * (1 - np.cos(t))
        return np.column_stack([0.8 + 0.03 * t, turn]), np.column_stack([np.full(len(t), 0.03), 0.1 * np.sin(t)])

    tether = TetherAtHeight(0.6, 1000.0, 10.0, hinge_height=0.15, anchor_height=0.1)
    places, areas = cells_of([0.16 * sign + 0.2 * _SQUARE for sign in np.sign(_SQUARE)], 4)
    towed = replace(_block(), places=places, areas=areas, across_over_along=1.04)
    _, poses, _ = bristle_tow(towed, tether, hinge, (0, 0, 0), 6.0)
    half = replace(towed, deflection=_BEND_M / 2)
    _, finer, _ = bristle_tow(half, tether, hinge, (0, 0, 0), 6.0, step_s=5e-5)
    return 1e3 * float(np.linalg.norm((poses - finer)[:, :2], axis=1).max())


def _bristles() -> Values:
    return {**_pulls(), **_rests(), **_slides(), "half the step and deflection": _finer()}


def _lighter(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda body, *args, **kwargs: original(replace(body, mass=0.99 * body.mass), *args, **kwargs)


def _softer(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda body, *args, **kwargs: original(replace(body, deflection=20 * body.deflection), *args, **kwargs)


BRISTLES = Check(
    _bristles,
    {
        "the object is 1 % too light": replaced(_HERE, "bristle_tow", _lighter),
        "bristles bend twenty times as far": replaced(_HERE, "bristle_tow", _softer),
        "the hinge drifts by 1 µm/s": replaced(
            _HERE, "_straight", lambda original: lambda speed, reach: original(speed + 1e-6, reach)
        ),
    },
)

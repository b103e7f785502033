"""What the simulation is told and identification can fit: value, deviation and change of each input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from towval.model import FrictionLaw, InputDeviations, TowingScene

Changed = tuple[TowingScene, FrictionLaw]


@dataclass(frozen=True)
class Parameter:
    """An input that can be identified.

    ``unit`` of its value; ``value`` of a scene; ``given_std`` of campaign.yaml; ``changed`` the scene and law with
    another value; ``scale`` of a noticeable change and ``reach`` of the search to both sides, in the value's unit.
    """

    unit: str
    value: Callable[[TowingScene], float]
    given_std: Callable[[InputDeviations], float]
    changed: Callable[[TowingScene, FrictionLaw, float], Changed]
    scale: Callable[[TowingScene], float]
    reach: Callable[[TowingScene], float]


def _place(of: Literal["anchor", "hinge"], axis: int) -> Parameter:
    """A coordinate of the tether's end on the object or on the rover."""

    def changed(scene: TowingScene, law: FrictionLaw, value: float) -> Changed:
        return replace(scene, **{of: _with(getattr(scene, of), axis, value)}), law

    return Parameter(
        unit="m",
        value=lambda scene: float(getattr(scene, of)[axis]),
        given_std=lambda std: getattr(std, of),
        changed=changed,
        scale=lambda _: 2e-3,
        reach=lambda _: 0.05,
    )


def _load_at(axis: int) -> Parameter:
    def changed(scene: TowingScene, law: FrictionLaw, value: float) -> Changed:
        return replace(scene, load=replace(scene.load, at=_with(scene.load.at, axis, value))), law

    return Parameter(
        unit="m",
        value=lambda scene: float(scene.load.at[axis]),
        given_std=lambda std: std.load_at,
        changed=changed,
        scale=lambda _: 5e-3,
        reach=lambda scene: float(0.25 * np.ptp(scene.patch.outline[:, axis])),
    )


def _with(point: Any, axis: int, value: float) -> Any:
    changed = point.copy()
    changed[axis] = value
    return changed


def _friction(scene: TowingScene, law: FrictionLaw, value: float) -> Changed:
    return scene, law.scaled(value / scene.friction.kinetic)


def _tether(name: Literal["rest_length", "stiffness"], unit: str, scale: float, reach: float) -> Parameter:
    """An input of the tether, whose scale and reach are shares of its value."""
    return Parameter(
        unit=unit,
        value=lambda scene: getattr(scene.tether, name),
        given_std=lambda std: getattr(std, name),
        changed=lambda scene, law, value: (replace(scene, tether=replace(scene.tether, **{name: value})), law),
        scale=lambda scene: scale * getattr(scene.tether, name),
        reach=lambda scene: reach * getattr(scene.tether, name),
    )


PARAMETERS = {
    "friction": Parameter(
        unit="",
        value=lambda scene: scene.friction.kinetic,
        given_std=lambda std: std.friction,
        changed=_friction,
        scale=lambda scene: 0.02 * scene.friction.kinetic,
        reach=lambda scene: 0.5 * scene.friction.kinetic,
    ),
    "body_mass": Parameter(
        unit="kg",
        value=lambda scene: scene.body_mass,
        given_std=lambda std: std.body_mass,
        changed=lambda scene, law, value: (replace(scene, body_mass=value), law),
        scale=lambda scene: 0.02 * scene.body_mass,
        reach=lambda scene: 0.5 * scene.body_mass,
    ),
    "load_mass": Parameter(
        unit="kg",
        value=lambda scene: scene.load.mass,
        given_std=lambda std: std.load_mass,
        changed=lambda scene, law, value: (replace(scene, load=replace(scene.load, mass=value)), law),
        scale=lambda scene: 0.02 * scene.load.mass,
        reach=lambda scene: 0.5 * scene.load.mass,
    ),
    "load_x": _load_at(0),
    "load_y": _load_at(1),
    "rest_length": _tether("rest_length", "m", 0.004, 0.3),
    "stiffness": _tether("stiffness", "N/m", 0.02, 0.5),
    "anchor_x": _place("anchor", 0),
    "anchor_y": _place("anchor", 1),
    "hinge_x": _place("hinge", 0),
    "hinge_y": _place("hinge", 1),
}
"""What can be identified, by the names of ``config["identify"]["parameters"]``."""


def has_a_load(scene: TowingScene) -> bool:
    """Whether mass and place of the load are inputs of this scene."""
    return scene.load.mass > 0


def titled(name: str) -> str:
    """A parameter's name with its unit, for people."""
    unit = PARAMETERS[name].unit
    return name.replace("_", " ") + (f" [{unit}]" if unit else "")

"""Uncertain inputs: one table, a row an input.

From it the schema and the reader of campaign.yaml take key and default of each stated deviation, the uncertainty
analysis what to draw and how it acts, the identification what can be fitted, and the report what to list. A new input
is an :class:`UncertainInput` handed to :func:`register`. docs/inputs.md is this table in print.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from towval.model.camera import CALIBRATION_PARAMETERS
from towval.model.checks import Array
from towval.model.friction import FrictionLaw
from towval.model.plugins import Registry
from towval.model.towing import TowingScene


@dataclass(frozen=True)
class Realisation:
    """One set of values of all inputs, from which a run is simulated and measured.

    ``scene`` and ``law`` go to the simulation; ``camera`` (18,) is a change of the calibration's parameters, ``height``
    a change of the height of a body's planar target [m] and ``registration`` (3,) a pose of a body's frame in its
    registered frame [m, m, rad], both by the body's name.
    """

    scene: TowingScene
    law: FrictionLaw
    camera: Array
    height: Mapping[str, float]
    registration: Mapping[str, Array]

    @classmethod
    def nominal(cls, scene: TowingScene, law: FrictionLaw) -> "Realisation":
        """All inputs as stated."""
        bodies = ("rover", "object")
        camera = np.zeros(len(CALIBRATION_PARAMETERS))
        return cls(scene, law, camera, dict.fromkeys(bodies, 0.0), {body: np.zeros(3) for body in bodies})


@dataclass(frozen=True)
class StatedDeviation:
    """A standard deviation that campaign.yaml may state.

    ``key`` there, with dots; ``of`` what it is the deviation of; ``maximum`` that is accepted; ``default`` where it is
    missing, a share of the value where ``relative``, and ``why`` that much.
    """

    key: str
    of: str
    maximum: float
    default: float
    why: str
    relative: bool = False

    @property
    def default_text(self) -> str:
        """The default for people."""
        return f"{100 * self.default:g} % of the value" if self.relative else f"{self.default:g}"


@dataclass(frozen=True)
class SearchRange:
    """How identification searches an input: ``step`` of a noticeable change and ``reach`` to both sides, (k,) each."""

    step: Callable[[TowingScene], ArrayLike]
    reach: Callable[[TowingScene], ArrayLike]


def _zero(_: TowingScene) -> float:
    return 0.0


@dataclass(frozen=True)
class UncertainInput:
    """A row of the table.

    Parameters
    ----------
    name, label, unit : str
        In code and files; for people; of the value.
    shared : {"campaign", "run"}
        Whether all runs of a campaign have the same unknown error, or each its own.
    acts : callable
        ``(realisation, value (k,)) -> realisation`` with the input set to the value.
    value : callable
        The stated value of a scene, (k,) or a number; zero for inputs whose values are changes.
    components : tuple of str, optional
        Names of the k components; identification knows inputs by them. By default one, the input's name.
    stated : StatedDeviation, optional
        Of each component; None where a stage gives the covariance of all k (camera, registration).
    search : SearchRange, optional
        None for what cannot be identified.
    present : callable
        Whether a scene has this input at all.
    """

    name: str
    label: str
    unit: str
    shared: Literal["campaign", "run"]
    acts: Callable[[Realisation, Array], Realisation]
    value: Callable[[TowingScene], ArrayLike] = _zero
    components: tuple[str, ...] = ()
    stated: StatedDeviation | None = None
    search: SearchRange | None = None
    present: Callable[[TowingScene], bool] = lambda _: True

    def __post_init__(self) -> None:
        if not self.components:
            object.__setattr__(self, "components", (self.name,))

    def values(self, scene: TowingScene) -> Array:
        """The stated value of a scene (k,)."""
        return np.broadcast_to(np.asarray(self.value(scene), dtype=np.float64), len(self.components))

    def searched(self, scene: TowingScene, which: Literal["step", "reach"]) -> Array:
        """Step or reach of the search (k,)."""
        found = getattr(self.search, which)(scene)
        return np.broadcast_to(np.asarray(found, dtype=np.float64), len(self.components))


INPUTS: Registry[UncertainInput] = Registry("uncertain input")
"""The table, by name; its order is that of the draws."""

IDENTIFIABLE: Registry[tuple[UncertainInput, int]] = Registry("identifiable input")
"""What can be identified, by the name of the component: its row, and its place in the row's value."""


def register(*rows: UncertainInput) -> None:
    """Add rows to the table; `InputError` where a name is taken."""
    for row in rows:
        INPUTS.register(row.name, row)
        for i, component in enumerate(row.components if row.search else ()):
            IDENTIFIABLE.register(component, (row, i))


def titled(component: str) -> str:
    """An identifiable component with its unit, for people."""
    unit = IDENTIFIABLE[component][0].unit
    return component.replace("_", " ") + (f" [{unit}]" if unit else "")


def deviations(scene: TowingScene, document: Mapping[str, Any] | None = None) -> dict[str, float]:
    """Standard deviations of the inputs, in their units and by name.

    Parameters
    ----------
    scene : TowingScene
        The values that relative defaults refer to.
    document : mapping, optional
        campaign.yaml as read; what it does not state is at its default, and zero where the scene has no such input.
    """
    return {row.name: _deviation(row, row.stated, scene, document or {}) for row in INPUTS.values() if row.stated}


def stated_in(document: Mapping[str, Any], key: str) -> float | None:
    """The value of a dotted key of campaign.yaml, None where it is missing."""
    section: Any = document
    for part in key.split("."):
        section = section.get(part) if isinstance(section, Mapping) else None
    return None if section is None else float(section)


def _deviation(row: UncertainInput, stated: StatedDeviation, scene: TowingScene, document: Mapping[str, Any]) -> float:
    given = stated_in(document, stated.key)
    if given is not None:
        return given
    if not row.present(scene):
        return 0.0
    return stated.default * (float(row.values(scene)[0]) if stated.relative else 1.0)


def _in_scene(field: str) -> Callable[[Realisation, Array], Realisation]:
    """Sets a field of the scene, a number or a point."""

    def acts(real: Realisation, value: Array) -> Realisation:
        changed: dict[str, Any] = {field: value if len(value) > 1 else float(value[0])}
        return replace(real, scene=replace(real.scene, **changed))

    return acts


def _in_part(part: str, field: str) -> Callable[[Realisation, Array], Realisation]:
    """Sets a field of the scene's load or tether."""

    def acts(real: Realisation, value: Array) -> Realisation:
        changed: Any = replace(getattr(real.scene, part), **{field: value if len(value) > 1 else float(value[0])})
        scene: dict[str, Any] = {part: changed}
        return replace(real, scene=replace(real.scene, **scene))

    return acts


def _friction(real: Realisation, value: Array) -> Realisation:
    return replace(real, law=real.law.scaled(value[0] / real.scene.friction.kinetic))


def _share(step: float, reach: float, value: Callable[[TowingScene], float]) -> SearchRange:
    """Step and reach as shares of the value."""
    return SearchRange(lambda scene: step * value(scene), lambda scene: reach * value(scene))


def _has_load(scene: TowingScene) -> bool:
    return scene.load.mass > 0


_SCALE, _TAPE = "kitchen or parcel scale", "tape measure to a drawn mark"
_END = SearchRange(lambda _: 2e-3, lambda _: 0.05)

register(
    UncertainInput(
        "friction", "friction", "", "campaign", _friction, lambda scene: scene.friction.kinetic,
        stated=StatedDeviation(
            "friction.kinetic_std", "the kinetic friction coefficient, the static one going with it in proportion",
            1, 0.005, "inclined plane or spring balance, ten pulls",
        ),
        search=_share(0.02, 0.5, lambda scene: scene.friction.kinetic),
    ),
    UncertainInput(
        "body_mass", "mass of the object", "kg", "campaign", _in_scene("body_mass"), lambda scene: scene.body_mass,
        stated=StatedDeviation("object.mass_std_kg", "that mass", 1000, 0.01, _SCALE, relative=True),
        search=_share(0.02, 0.5, lambda scene: scene.body_mass),
    ),
    UncertainInput(
        "load_mass", "mass of the load", "kg", "campaign",
        lambda real, value: _in_part("load", "mass")(real, np.maximum(value, 0.0)), lambda scene: scene.load.mass,
        stated=StatedDeviation("object.load.mass_std_kg", "that mass", 1000, 0.01, _SCALE, relative=True),
        search=_share(0.02, 0.5, lambda scene: scene.load.mass), present=_has_load,
    ),
    UncertainInput(
        "load_at", "place of the load", "m", "campaign", _in_part("load", "at"), lambda scene: scene.load.at,
        ("load_x", "load_y"),
        StatedDeviation("object.load.at_std_m", "each coordinate of that centre", 0.5, 0.001, _TAPE),
        SearchRange(lambda _: 5e-3, lambda scene: 0.25 * np.ptp(scene.patch.corners, axis=0)), _has_load,
    ),
    UncertainInput(
        "anchor", "anchor", "m", "campaign", _in_scene("anchor"), lambda scene: scene.anchor,
        ("anchor_x", "anchor_y"),
        StatedDeviation("object.tether_anchor_std_m", "each coordinate of that place", 0.5, 0.001, _TAPE), _END,
    ),
    UncertainInput(
        "hinge", "hinge", "m", "campaign", _in_scene("hinge"), lambda scene: scene.hinge, ("hinge_x", "hinge_y"),
        StatedDeviation("rover.tether_hinge_std_m", "each coordinate of that place", 0.5, 0.001, _TAPE), _END,
    ),
    UncertainInput(
        "rest_length", "rest length", "m", "campaign", _in_part("tether", "rest_length"),
        lambda scene: scene.tether.rest_length,
        stated=StatedDeviation("tether.rest_length_std_m", "that length", 1, 0.001, "tape measure, no load"),
        search=_share(0.004, 0.3, lambda scene: scene.tether.rest_length),
    ),
    UncertainInput(
        "stiffness", "stiffness", "N/m", "campaign", _in_part("tether", "stiffness"),
        lambda scene: scene.tether.stiffness,
        stated=StatedDeviation("tether.stiffness_std_N_per_m", "the stiffness", 1e7, 0.02,
            "stretched by 30 mm or more under a mass known to 1 %, read to 0.5 mm", relative=True,
        ),
        search=_share(0.02, 0.5, lambda scene: scene.tether.stiffness),
    ),
    UncertainInput(
        "camera", "camera", "", "campaign", lambda real, value: replace(real, camera=value),
        components=CALIBRATION_PARAMETERS,
    ),
)  # fmt: skip


def _height(body: str) -> UncertainInput:
    return UncertainInput(
        f"{body}_height",
        f"height of the {body}",
        "m",
        "campaign",
        lambda real, value: replace(real, height={**real.height, body: float(value[0])}),
        stated=StatedDeviation(f"{body}.tracked_plane_height_std_m", "that height", 0.1, 0.001, "tape measure"),
    )


def _registration(body: str) -> UncertainInput:
    return UncertainInput(
        f"{body}_registration",
        f"{body}'s first frame",
        "",
        "run",
        lambda real, value: replace(real, registration={**real.registration, body: value}),
        components=tuple(f"{body}_registration_{axis}" for axis in ("x", "y", "heading")),
    )


register(_height("rover"), _height("object"), _registration("rover"), _registration("object"))

"""Type of a row of the table of uncertain inputs, and its deviation; the rows are in ``towval.model.inputs``."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from towval.model.camera import CALIBRATION_PARAMETERS
from towval.model.checks import Array
from towval.model.plugins import Registry
from towval.model.towing import TowingScene


@dataclass(frozen=True)
class Realisation:
    """One set of values of all inputs, from which a run is simulated and measured.

    ``scene`` goes to the simulation; ``camera`` (18,) is a change of the calibration's parameters, ``height``
    a change of the height of a body's planar target [m] and ``registration`` (3,) a pose of a body's frame in its
    registered frame [m, m, rad], both by the body's name; ``readout`` a change of the camera's readout [s].
    """

    scene: TowingScene
    camera: Array
    height: Mapping[str, float]
    registration: Mapping[str, Array]
    readout: float = 0.0

    @classmethod
    def nominal(cls, scene: TowingScene) -> "Realisation":
        """All inputs as stated."""
        bodies = ("rover", "object")
        camera = np.zeros(len(CALIBRATION_PARAMETERS))
        return cls(scene, camera, dict.fromkeys(bodies, 0.0), {body: np.zeros(3) for body in bodies})

    def checked(self) -> "Realisation":
        """The same with its scene validated; raises `InputError` for values that no scene may have."""
        parts = {name: getattr(self.scene, name) for name in ("load", "tether", "friction", "spread", "ground")}
        made: dict[str, Any] = {name: replace(part) for name, part in parts.items() if part is not None}
        return replace(self, scene=replace(self.scene, **made))


@dataclass(frozen=True)
class LeftOut:
    """Value and deviation assumed for an input that campaign.yaml may leave out.

    ``key`` of the value; ``value`` that is taken, as text; ``std`` its standard deviation, times ``scale`` of the scene
    where there is one, which ``scale_text`` names; ``why`` that much.
    """

    key: str
    value: str
    std: float
    why: str
    scale: Callable[[TowingScene], float] | None = None
    scale_text: str = ""

    @property
    def std_text(self) -> str:
        """The deviation for people."""
        return f"{100 * self.std:g} % of {self.scale_text}" if self.scale else f"{self.std:g}"


@dataclass(frozen=True)
class StatedDeviation:
    """A standard deviation that campaign.yaml may state.

    ``key`` there, with dots; ``of`` what it is the deviation of; ``maximum`` that is accepted; ``default`` where it is
    missing, a share of the value where ``relative``, and ``why`` that much; ``unit`` and ``unit_in_si`` of the key
    where they are not those of the input; ``left_out`` what holds where the value itself is missing.
    """

    key: str
    of: str
    maximum: float
    default: float
    why: str
    relative: bool = False
    unit: str = ""
    unit_in_si: float = 1.0
    left_out: LeftOut | None = None

    @property
    def default_text(self) -> str:
        """The default for people."""
        return f"{100 * self.default:g} % of the value" if self.relative else f"{self.default:g}"


@dataclass(frozen=True)
class SearchRange:
    """How identification searches an input: ``step`` of a noticeable change and ``reach`` to both sides, (k,) each."""

    step: Callable[[TowingScene], ArrayLike]
    reach: Callable[[TowingScene], ArrayLike]


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
        ``(realisation, value (k,)) -> realisation`` with the input set to the value; the whole is checked after.
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
    within : str, optional
        The input whose covariance, given by a stage, includes the effect of this one, which is then not drawn.
    """

    name: str
    label: str
    unit: str
    shared: Literal["campaign", "run"]
    acts: Callable[[Realisation, Array], Realisation]
    value: Callable[[TowingScene], ArrayLike] = lambda _: 0.0
    components: tuple[str, ...] = ()
    stated: StatedDeviation | None = None
    search: SearchRange | None = None
    present: Callable[[TowingScene], bool] = lambda _: True
    within: str = ""

    def __post_init__(self) -> None:
        if not self.components:
            object.__setattr__(self, "components", (self.name,))

    def values(self, scene: TowingScene) -> Array:
        """The stated value of a scene (k,)."""
        return np.broadcast_to(np.asarray(self.value(scene), dtype=np.float64), len(self.components))

    def acts_by_size(self, scene: TowingScene, value: float) -> bool:
        """Whether a value below zero makes the scene of the one above: a height cannot be negative."""
        if len(self.components) > 1 or value >= 0:
            return False
        acted = self.acts(Realisation.nominal(scene), np.array([value])).scene
        return float(self.values(acted)[0]) == -value

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

    Relative defaults refer to the values of ``scene``. What ``document``, campaign.yaml as read, does not state is at
    its default, and zero where the scene has no such input. Without it, all values count as stated and all deviations
    as not.
    """
    return {row.name: _deviation(row, row.stated, scene, document) for row in INPUTS.values() if row.stated}


def stated_in(document: Mapping[str, Any], key: str) -> float | None:
    """The value of a dotted key of campaign.yaml, None where it is missing or no number."""
    value = value_of(document, key)
    return None if value is None or isinstance(value, list) else float(value)


def value_of(document: Mapping[str, Any], key: str) -> Any:
    """What stands at a dotted key of campaign.yaml, a value or a section; None where nothing does."""
    found: Any = document
    for part in key.split("."):
        found = found.get(part) if isinstance(found, Mapping) else None
    return found


def is_left_out(row: UncertainInput, document: Mapping[str, Any]) -> bool:
    """Whether a document states neither the value of an input nor its deviation, so that both are defaults."""
    stated = row.stated
    return (
        stated is not None
        and stated.left_out is not None
        and value_of(document, stated.left_out.key) is None
        and stated_in(document, stated.key) is None
    )


def _deviation(
    row: UncertainInput, stated: StatedDeviation, scene: TowingScene, document: Mapping[str, Any] | None
) -> float:
    given = stated_in(document or {}, stated.key)
    if given is not None:
        return given * stated.unit_in_si
    if not row.present(scene):
        return 0.0
    value = float(row.values(scene)[0])
    # A relative deviation of zero would be zero: a stated zero is known no better than a missing value.
    if document is not None and stated.left_out and (is_left_out(row, document) or (stated.relative and value == 0)):
        scale = stated.left_out.scale
        return stated.left_out.std * stated.unit_in_si * (scale(scene) if scale else 1.0)
    return stated.default * (value if stated.relative else stated.unit_in_si)

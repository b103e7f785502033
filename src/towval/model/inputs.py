"""Uncertain inputs: one table, one row per input.

From it the schema and the reader of campaign.yaml take key and default of each stated deviation, the uncertainty
analysis what to draw and how it acts, the identification what can be fitted, and the report what to list. A new input
is an :class:`UncertainInput` handed to :func:`register`. docs/inputs.md is this table in print.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from towval.model.camera import CALIBRATION_PARAMETERS, Board, FloorReference
from towval.model.checks import Array
from towval.model.input_types import (
    IDENTIFIABLE,
    INPUTS,
    LeftOut,
    Realisation,
    SearchRange,
    StatedDeviation,
    UncertainInput,
    deviations,
    is_left_out,
    register,
    stated_in,
    titled,
)
from towval.model.towing import MassSpread, TowingScene

__all__ = [
    "IDENTIFIABLE", "INPUTS", "LeftOut", "Realisation", "SearchRange", "StatedDeviation", "UncertainInput",
    "deviations", "is_left_out", "register", "stated_in", "titled",
]  # fmt: skip

_LEAST, _MOST = 0.05, 0.9
"""Least ratio, and least share of a stated value that must be positive, that is drawn; and most stiffening."""

_APART = 6.0
"""v_k is drawn no lower than this many times v_s, or their stated ratio if less: closer, Makkar's form ends."""


Whole = TypeVar("Whole")


def _with(whole: Whole, **changed: Any) -> Whole:
    """A copy with other fields, not validated: a draw sets thirty, and `Realisation.checked` validates the result."""
    copy = object.__new__(type(whole))
    vars(copy).update(vars(whole), **changed)
    return copy


def _with_part(real: Realisation, part: str, **changed: Any) -> Realisation:
    """A copy in which a part of the scene has other fields."""
    return _with(real, scene=_with(real.scene, **{part: _with(getattr(real.scene, part), **changed)}))


def _in_scene(field: str) -> Callable[[Realisation, Array], Realisation]:
    """Sets a field of the scene, a number or a point."""

    def acts(real: Realisation, value: Array) -> Realisation:
        changed: dict[str, Any] = {field: value if len(value) > 1 else float(value[0])}
        return _with(real, scene=_with(real.scene, **changed))

    return acts


def _in_part(part: str, field: str, at_least: float = -np.inf) -> Callable[[Realisation, Array], Realisation]:
    """Sets a field of the scene's load, tether, friction, spread or ground, no lower than a bound."""

    def acts(real: Realisation, value: Array) -> Realisation:
        bounded = np.maximum(value, at_least)
        return _with_part(real, part, **{field: bounded if len(bounded) > 1 else float(bounded[0])})

    return acts


def _positive(
    acts: Callable[[Realisation, Array], Realisation], stated: Callable[[TowingScene], float]
) -> Callable[[Realisation, Array], Realisation]:
    """Keep a positive input above a small share of the value it has: a wide deviation reaches below zero."""
    return lambda real, value: acts(real, np.maximum(value, _LEAST * stated(real.scene)))


def _size(acts: Callable[[Realisation, Array], Realisation]) -> Callable[[Realisation, Array], Realisation]:
    """Absolute value, for inputs that cannot be negative: around zero the draws scatter to one side."""
    return lambda real, value: acts(real, np.abs(value))


def _friction(real: Realisation, value: Array) -> Realisation:
    """Scales kinetic and static coefficient together; the row of the static one comes later and sets it separately."""
    friction, kinetic = real.scene.friction, float(value[0])
    # By their ratio: where both are the same they stay so, to the last bit.
    return _with_part(real, "friction", kinetic=kinetic, static=kinetic * (friction.static / friction.kinetic))


def _static(real: Realisation, value: Array) -> Realisation:
    """Set the static coefficient, no lower than the kinetic one: at that value the law has no peak."""
    return _with_part(real, "friction", static=max(float(value[0]), real.scene.friction.kinetic))


def _stiction_velocity(real: Realisation, value: Array) -> Realisation:
    friction = real.scene.friction
    speed = max(float(value[0]), _LEAST * friction.stiction_velocity)
    settled = max(
        friction.friction_velocity, min(_APART, friction.friction_velocity / friction.stiction_velocity) * speed
    )
    return _with_part(real, "friction", stiction_velocity=speed, friction_velocity=settled)


def _friction_velocity(real: Realisation, value: Array) -> Realisation:
    friction = real.scene.friction
    least = min(_APART * friction.stiction_velocity, friction.friction_velocity)
    return _with_part(real, "friction", friction_velocity=max(float(value[0]), least))


def _regions(real: Realisation, value: Array) -> Realisation:
    """Add one change to the factors of all regions."""
    added, regions = float(value[0]), real.scene.ground.regions
    raised = tuple(replace(region, factor=max(0.01, region.factor + added)) for region in regions)
    return _with_part(real, "ground", regions=raised)


def _inertia(real: Realisation, value: Array) -> Realisation:
    gyration = np.sqrt(np.maximum(value, 0.0) / real.scene.body_mass)
    return _in_part("spread", "gyration", _LEAST * _spread(real.scene).gyration)(real, gyration)


def _spread(scene: TowingScene) -> MassSpread:
    return scene.spread or MassSpread(np.zeros(2), 1.0)


def _has_spread(scene: TowingScene) -> bool:
    return scene.spread is not None


def _in_camera(real: Realisation, _: Array) -> Realisation:
    """Change nothing: the covariance of the camera includes this input."""
    return real


def _share(step: float, reach: float, value: Callable[[TowingScene], float]) -> SearchRange:
    """Step and reach as shares of the value."""
    return SearchRange(lambda scene: step * value(scene), lambda scene: reach * value(scene))


_TIED = "assumed, not measured: a tow within 0.06 m of the floor; state the height of any other"
_SCALE, _TAPE = "kitchen or parcel scale", "tape measure to a drawn mark"
_END = SearchRange(lambda _: 2e-3, lambda _: 0.05)

register(
    UncertainInput(
        "friction", "friction", "", "campaign", _positive(_friction, lambda scene: scene.friction.kinetic),
        lambda scene: scene.friction.kinetic,
        stated=StatedDeviation(
            "friction.kinetic_std", "the kinetic friction coefficient", 1, 0.005,
            "inclined plane or spring balance, ten pulls",
        ),
        search=_share(0.02, 0.5, lambda scene: scene.friction.kinetic),
    ),
    UncertainInput(
        "static_friction", "static friction", "", "campaign", _static, lambda scene: scene.friction.static,
        stated=StatedDeviation(
            "friction.static_std", "the static friction coefficient", 1, 0.01,
            "break-away of ten pulls, which scatters",
        ),
        search=_share(0.02, 0.5, lambda scene: scene.friction.static),
    ),
    UncertainInput(
        "stiction_velocity", "stiction velocity", "m/s", "campaign", _stiction_velocity,
        lambda scene: scene.friction.stiction_velocity,
        stated=StatedDeviation(
            "friction.stiction_velocity_std_m_per_s", "that speed", 1, 0.3, "seldom measured", relative=True
        ),
        search=_share(0.1, 0.9, lambda scene: scene.friction.stiction_velocity),
    ),
    UncertainInput(
        "friction_velocity", "friction velocity", "m/s", "campaign", _friction_velocity,
        lambda scene: scene.friction.friction_velocity,
        stated=StatedDeviation(
            "friction.friction_velocity_std_m_per_s", "that speed", 10, 0.3, "seldom measured", relative=True
        ),
        search=_share(0.1, 0.9, lambda scene: scene.friction.friction_velocity),
    ),
    UncertainInput(
        "body_mass", "mass of the object", "kg", "campaign",
        _positive(_in_scene("body_mass"), lambda scene: scene.body_mass), lambda scene: scene.body_mass,
        stated=StatedDeviation("object.mass_std_kg", "that mass", 1000, 0.01, _SCALE, relative=True),
        search=_share(0.02, 0.5, lambda scene: scene.body_mass),
    ),
    UncertainInput(
        "load_mass", "mass of the load", "kg", "campaign",
        _in_part("load", "mass", 0.0), lambda scene: scene.load.mass,
        stated=StatedDeviation("object.load.mass_std_kg", "that mass", 1000, 0.01, _SCALE, relative=True),
        search=_share(0.02, 0.5, lambda scene: scene.load.mass), present=lambda scene: scene.load.mass > 0,
    ),
    UncertainInput(
        "load_at", "place of the load", "m", "campaign", _in_part("load", "at"), lambda scene: scene.load.at,
        ("load_x", "load_y"),
        StatedDeviation("object.load.at_std_m", "each coordinate of that centre", 0.5, 0.001, _TAPE),
        SearchRange(lambda _: 5e-3, lambda scene: 0.25 * np.ptp(scene.patch.corners, axis=0)),
        lambda scene: scene.load.mass > 0,
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
        "rest_length", "rest length", "m", "campaign",
        _positive(_in_part("tether", "rest_length"), lambda scene: scene.tether.rest_length),
        lambda scene: scene.tether.rest_length,
        stated=StatedDeviation("tether.rest_length_std_m", "that length", 1, 0.001, "tape measure, no load"),
        search=_share(0.004, 0.3, lambda scene: scene.tether.rest_length),
    ),
    UncertainInput(
        "stiffness", "stiffness", "N/m", "campaign",
        _positive(_in_part("tether", "stiffness"), lambda scene: scene.tether.stiffness),
        lambda scene: scene.tether.stiffness,
        stated=StatedDeviation("tether.stiffness_std_N_per_m", "the stiffness", 1e7, 0.02,
            "stretched by 30 mm or more under a mass known to 1 %, read to 0.5 mm", relative=True,
        ),
        search=_share(0.02, 0.5, lambda scene: scene.tether.stiffness),
    ),
    UncertainInput(
        "damping", "damping of the tether", "N s/m", "campaign", _size(_in_part("tether", "damping")),
        lambda scene: scene.tether.damping,
        stated=StatedDeviation(
            "tether.damping_std_Ns_per_m", "that damping", 1e5, 0.2, "from the decay of a mass hung on it",
            relative=True,
            left_out=LeftOut(
                "tether.damping_Ns_per_m", "0", 0.05, "cords of rubber and plastics lose 3 to 10 %",
                lambda scene: scene.critical_damping,
                "the critical damping of the object on the tether",
            ),
        ),
        search=_share(0.01, 0.3, lambda scene: scene.critical_damping),
    ),
    UncertainInput(
        "hinge_height", "height of the hinge", "m", "campaign", _size(_in_scene("hinge_height")),
        lambda scene: scene.hinge_height,
        stated=StatedDeviation(
            "rover.tether_hinge_height_std_m", "that height", 1, 0.002, "tape measure",
            left_out=LeftOut("rover.tether_hinge_height_m", "0", 0.03, _TIED),
        ),
        search=SearchRange(lambda _: 0.01, lambda _: 0.3),
    ),
    UncertainInput(
        "anchor_height", "height of the anchor", "m", "campaign", _size(_in_scene("anchor_height")),
        lambda scene: scene.anchor_height,
        stated=StatedDeviation(
            "object.tether_anchor_height_std_m", "that height", 1, 0.002, "tape measure",
            left_out=LeftOut("object.tether_anchor_height_m", "0", 0.03, _TIED),
        ),
        search=SearchRange(lambda _: 0.01, lambda _: 0.3),
    ),
    UncertainInput(
        "centre_of_mass_height", "height of the centre of mass", "m", "campaign",
        _size(_in_scene("centre_of_mass_height")), lambda scene: scene.centre_of_mass_height,
        stated=StatedDeviation(
            "object.centre_of_mass_height_std_m", "that height", 1, 0.01, "computed from the parts",
            left_out=LeftOut(
                "object.centre_of_mass_height_m", "0, or with another height or a slope half the top's", 0.05,
                "somewhere in the lower half of the object and its load",
            ),
        ),
        search=SearchRange(lambda _: 0.02, lambda _: 0.3),
    ),
    UncertainInput(
        "slope", "slope of the floor", "m/m", "campaign", _in_part("ground", "slope"), lambda scene: scene.ground.slope,
        ("slope_x", "slope_y"),
        StatedDeviation(
            "floor.slope_std_mm_per_m", "each component of that slope", 20, 0.3, "spirit level of 1 m, turned round",
            unit="mm/m", unit_in_si=1e-3,
            left_out=LeftOut("floor.slope_mm_per_m", "0", 1.0, "assumed, not measured: up to 2 mm a metre"),
        ),
        SearchRange(lambda _: 5e-4, lambda _: 1e-2),
    ),
    UncertainInput(
        "across_over_along", "ratio of friction across to along", "", "campaign",
        _in_part("friction", "across_over_along", _LEAST), lambda scene: scene.friction.across_over_along,
        stated=StatedDeviation(
            "friction.across_over_along_std", "that ratio", 1, 0.02, "ten pulls each way",
            left_out=LeftOut("friction.across_over_along", "1", 0.03, "assumed, not measured: up to 6 %"),
        ),
        search=SearchRange(lambda _: 0.01, lambda _: 0.3),
    ),
    UncertainInput(
        "radius_over_planar", "friction radius over that of a planar pressure", "", "campaign",
        _in_part("friction", "radius_over_planar", _LEAST), lambda scene: scene.friction.radius_over_planar,
        stated=StatedDeviation(
            "friction.radius_over_planar_std", "that ratio", 1, 0.05, "moment to turn the object on the spot",
            left_out=LeftOut("friction.radius_over_planar", "1", 0.1, "no sole and no floor is flat"),
        ),
        search=SearchRange(lambda _: 0.02, lambda _: 0.5),
    ),
    UncertainInput(
        "regions", "friction of the floor's regions", "", "campaign", _regions,
        stated=StatedDeviation("friction.regions_std", "all their factors together", 1, 0.02, "ten pulls each"),
        search=SearchRange(lambda _: 0.01, lambda _: 0.3), present=lambda scene: bool(scene.ground.regions),
    ),
    UncertainInput(
        "stiffening", "stiffening of the tether", "", "campaign",
        lambda real, value: _in_part("tether", "stiffening")(real, np.minimum(np.abs(value), _MOST)),
        lambda scene: scene.tether.stiffening,
        stated=StatedDeviation(
            "tether.stiffening_std", "that share", 1, 0.05, "stretch read at half and at full load",
            left_out=LeftOut("tether.stiffening", "0", 0.1, "cords and springs stiffen by 0 to 20 % of their chord"),
        ),
        search=SearchRange(lambda _: 0.05, lambda _: 0.8), present=lambda scene: scene.tether.full_load > 0,
    ),
    UncertainInput(
        "tether_mass", "mass of the tether", "kg/m", "campaign", _size(_in_part("tether", "mass_per_length")),
        lambda scene: scene.tether.mass_per_length,
        stated=StatedDeviation(
            "tether.mass_std_kg_per_m", "that mass", 1, 0.03, "weighed, and measured with a tape", relative=True,
            left_out=LeftOut("tether.mass_kg_per_m", "0", 0.0, "a cord of 10 g a metre moves a tow by under 0.1 mm"),
        ),
        search=_share(0.1, 0.9, lambda scene: scene.tether.mass_per_length),
        present=lambda scene: scene.tether.mass_per_length > 0,
    ),
    UncertainInput(
        "body_centre", "centre of mass of the object", "m", "campaign", _in_part("spread", "centre"),
        lambda scene: _spread(scene).centre, ("body_centre_x", "body_centre_y"),
        StatedDeviation(
            "object.centre_of_mass_std_m", "each coordinate of the object's own centre of mass", 0.5, 0.002,
            "balanced on an edge",
            left_out=LeftOut(
                "object.centre_of_mass_m", "that of mass_over", 0.002, "bodies are a little heavier on one side"
            ),
        ),
        SearchRange(lambda _: 5e-3, lambda scene: 0.25 * np.ptp(scene.patch.corners, axis=0)), _has_spread,
    ),
    UncertainInput(
        "inertia", "moment of inertia of the object", "kg m²", "campaign", _inertia,
        lambda scene: scene.body_mass * _spread(scene).gyration**2,
        stated=StatedDeviation(
            "object.moment_of_inertia_std_kg_m2", "that moment, without load", 1e4, 0.05, "computed or swung",
            relative=True,
            left_out=LeftOut(
                "object.moment_of_inertia_kg_m2", "that of mass_over", 0.1, "bodies are not even",
                lambda scene: scene.body_mass * _spread(scene).gyration**2, "the value",
            ),
        ),
        search=_share(0.1, 0.5, lambda scene: scene.body_mass * _spread(scene).gyration**2), present=_has_spread,
    ),
    UncertainInput(
        "camera", "camera", "", "campaign", lambda real, value: _with(real, camera=value),
        components=CALIBRATION_PARAMETERS,
    ),
    UncertainInput(
        "board_size", "size of the board over the stated one", "", "campaign", _in_camera, lambda _: 1.0,
        stated=StatedDeviation(
            "camera.board.size_std", "the whole board's size, relative", 0.1, Board.size_std,
            "steel rule along the whole board: 0.15 mm in 300 mm; unmeasured prints are up to 1 % off",
        ),
        within="camera",
    ),
    UncertainInput(
        "board_bow", "bow of the board", "m", "campaign", _in_camera,
        stated=StatedDeviation(
            "camera.board.bow_std_m", "how far the board's middle stands off its ends", 0.05, Board.bow_std_m,
            "cardboard and foam board of 0.4 m; the views tell it to 0.05 mm",
        ),
        within="camera",
    ),
    UncertainInput(
        "board_thickness", "thickness of the board", "m", "campaign", _in_camera,
        stated=StatedDeviation(
            "floor.board_thickness_std_m", "that thickness, and how flat the board lies", 0.05,
            FloorReference.board_thickness_std_m, "rule at its edge",
            left_out=LeftOut("floor.board_thickness_m", "0", 0.0033, "paper to foam board of 10 mm"),
        ),
        within="camera",
    ),
    UncertainInput(
        "readout", "readout of the camera's rows", "s", "campaign",
        lambda real, value: _with(real, readout=float(value[0])),
        stated=StatedDeviation(
            "camera.readout_std_s", "that time", 0.1, 0.0005, "data sheet, or a flickering light",
            left_out=LeftOut("camera.readout_s", "0", 0.01, "phones read a picture in 5 to 30 ms"),
        ),
    ),
)  # fmt: skip


def _height(body: str) -> UncertainInput:
    return UncertainInput(
        f"{body}_height", f"height of the {body}", "m", "campaign",
        lambda real, value: _with(real, height={**real.height, body: float(value[0])}),
        stated=StatedDeviation(f"{body}.tracked_plane_height_std_m", "that height", 0.1, 0.001, "tape measure"),
    )  # fmt: skip


def _registration(body: str) -> UncertainInput:
    return UncertainInput(
        f"{body}_registration", f"{body}'s first frame", "", "run",
        lambda real, value: _with(real, registration={**real.registration, body: value}),
        components=tuple(f"{body}_registration_{axis}" for axis in ("x", "y", "heading")),
    )  # fmt: skip


register(_height("rover"), _height("object"), _registration("rover"), _registration("object"))

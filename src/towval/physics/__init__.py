"""The physics of a towed object: contact, friction, tether, quasi-static motion, dynamics. Numbers in, numbers out.

The names that a notebook needs are imported from here; each loads its module when it is first used.

Examples
--------
>>> from towval.physics import Coulomb, Patch, friction_wrench, pressure_plane, sliding_patch
>>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
>>> patch = sliding_patch(pressure_plane(square, [(50.0, (0.03, 0.0))]), Coulomb(0.35, 1e-3))
>>> friction_wrench(patch, (0.1, 0.0, 0.0)).round(6) + 0.0
array([-17.5,   0. ,   0. ])
"""

from importlib import import_module
from typing import Any

_MODULES = {
    "towval.model": (
        "FloorRegion", "FrictionLaw", "FrictionSpecification", "Ground", "Patch", "Sliding", "Tether", "TimedPath",
        "TowedObject", "TowingScene",
    ),
    "towval.physics.contact": ("PressurePlane", "pressure_plane", "resting_pressure"),
    "towval.physics.creep": ("creep_length",),
    "towval.physics.dynamics": ("Accuracy", "Outcome", "feedback", "feedforward"),
    "towval.physics.friction_laws": ("LAWS", "Coulomb", "Makkar", "fit_makkar", "fitted_law", "risen_law"),
    "towval.physics.ladder": ("RUNGS", "choose_rung", "rung_names", "simulate_rung"),
    "towval.physics.mass": ("towed_object",),
    "towval.physics.quasistatic": ("QuasistaticMotion", "quasistatic_plan"),
    "towval.physics.spatial.tow": ("Sticking",),
    "towval.physics.tether": ("tether_force",),
    "towval.physics.trailing": ("trail",),
    "towval.physics.wrench": ("SlidingPatch", "friction_wrench", "sliding_patch"),
}  # fmt: skip
_HOME = {name: module for module, names in _MODULES.items() for name in names}

__all__ = sorted(_HOME)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__

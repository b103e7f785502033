"""Slips of the pen in campaign.yaml: a sign, two numbers exchanged, another unit.

Inputs are moved by twenty of their deviations at most, and a slip is often a hundred off. So each of the usual ones is
undone and the run simulated again. Where that leaves the error of a right model, it is named.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from towval.model import Array, Finding, TowingScene
from towval.model.findings import finding
from towval.model.geometry import rms_length
from towval.validation.faults import Acts
from towval.validation.path_frame import OnPath
from towval.validation.statistics import SIZES, RightModel, error_sizes

_POUND_KG = 0.45359237
_KILOGRAM_FORCE_N = 9.80665

_FAR = 4.0
"""An error so many times as large as in any draw of the measurement is no matter of a few millimetres."""


@dataclass(frozen=True)
class Slip:
    """A slip in words, and the change of a scene that undoes it."""

    name: str
    undone: Acts


def slips_of(scene: TowingScene) -> list[Slip]:
    """The slips that the numbers of a scene may hold; none that would change nothing."""
    return [*_of_points(scene), *_of_slope(scene), *_of_heights(scene), *_of_units(scene)]


def slip_findings(
    scene: TowingScene, path: OnPath, right: RightModel, left: Callable[[Sequence[Acts]], Array]
) -> list[Finding]:
    """A finding on the slips of a scene, each undone, that leave the error of a right model.

    The draws are of the scene as it is stated, and where that hardly moves, as on a spring in the wrong unit, they say
    nothing of a right model. So a slip also counts where it leaves no more than a draw of the measurement, of an error
    far beyond that. An error that is no larger than in a draw of the measurement needs no slip, and one that a slip
    would only enlarge is not explained by it.

    ``path`` is the run with its error and draws; ``left`` simulates it with k changes of the scene: errors (k, n, 3)
    along and across the path, NaN where that fails.
    """
    slips, largest = slips_of(scene), SIZES.index("position_max")
    most_m = float(error_sizes(path.off)[:, largest].max())
    off_m = float(error_sizes(path.error)[largest])
    if off_m <= most_m:
        return []

    def explains(error: Array) -> bool:
        if not np.isfinite(error).all() or rms_length(error) >= rms_length(path.error):
            return False
        return not right.rejects(error) or bool(off_m > _FAR * most_m and error_sizes(error)[largest] <= most_m)

    errors = left([slip.undone for slip in slips])
    found = [(1e3 * rms_length(error), slip.name) for slip, error in zip(slips, errors, strict=True) if explains(error)]
    names = "; ".join(f"{name} ({remaining:.1f} mm)" for remaining, name in sorted(found))
    return [finding("slip", error_mm=1e3 * rms_length(path.error), slips=names)] if found else []


def _of_points(scene: TowingScene) -> Iterator[Slip]:
    def moved_load(at: Array) -> Acts:
        return lambda s: replace(s, load=replace(s.load, at=at))

    def moved_anchor(at: Array) -> Acts:
        return lambda s: replace(s, anchor=at)

    def moved_hinge(at: Array) -> Acts:
        return lambda s: replace(s, hinge=at)

    if scene.load.mass > 0:
        yield from _of_pair("object.load.at_m", scene.load.at, moved_load)
    yield from _of_pair("object.tether_anchor_m", scene.anchor, moved_anchor)
    yield from _of_pair("rover.tether_hinge_m", scene.hinge, moved_hinge)


def _of_slope(scene: TowingScene) -> Iterator[Slip]:
    def sloping(slope: Array) -> Acts:
        return lambda s: replace(s, ground=replace(s.ground, slope=slope))

    return _of_pair("floor.slope_mm_per_m", scene.ground.slope, sloping)


def _of_pair(key: str, stated: Array, put: Callable[[Array], Acts]) -> Iterator[Slip]:
    """Signs of the two numbers of a key, alone and together, and their exchange."""
    x, y = np.asarray(stated)
    signs = {"x": (-1.0, 1.0), "y": (1.0, -1.0), "both numbers": (-1.0, -1.0)}
    for name, sign in signs.items():
        turned = np.array([x, y]) * sign
        # Of a number that is zero there is no sign, and of two, one of which is zero, no third change.
        if not np.array_equal(turned, stated) and (name != "both numbers" or (x and y)):
            yield Slip(f"the sign of {name} of {key}", put(turned))
    if x != y:
        yield Slip(f"x and y of {key} exchanged", put(np.array([y, x])))


def _of_heights(scene: TowingScene) -> Iterator[Slip]:
    hinge, anchor = scene.hinge_height, scene.anchor_height
    if hinge != anchor:
        yield Slip(
            "rover.tether_hinge_height_m and object.tether_anchor_height_m exchanged",
            lambda s: replace(s, hinge_height=anchor, anchor_height=hinge),
        )


def _of_units(scene: TowingScene) -> Iterator[Slip]:
    def heavier(body: float, load: float) -> Acts:
        return lambda s: replace(s, body_mass=body * s.body_mass, load=replace(s.load, mass=load * s.load.mass))

    def stiffer(factor: float) -> Acts:
        return lambda s: replace(s, tether=replace(s.tether, stiffness=factor * s.tether.stiffness))

    yield Slip("object.mass_kg in pounds", heavier(_POUND_KG, 1.0))
    if scene.load.mass > 0:
        yield Slip("object.load.mass_kg in pounds", heavier(1.0, _POUND_KG))
        yield Slip("both masses in pounds", heavier(_POUND_KG, _POUND_KG))
        if scene.body_mass > scene.load.mass:
            without = 1 - scene.load.mass / scene.body_mass
            yield Slip("the load weighed with the object in object.mass_kg", heavier(without, 1.0))
    for unit, factor in (("cm", 1e2), ("mm", 1e3)):
        yield Slip(f"tether.stiffness_N_per_m in newtons per {unit}", stiffer(factor))
    yield Slip("tether.stiffness_N_per_m in kilograms per metre", stiffer(_KILOGRAM_FORCE_N))

"""What moved the object while its tether was slack: nothing that the simulation knows of."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, DecimatedTrack, Finding, TowingScene
from towval.model.findings import finding
from towval.model.geometry import transform, velocity_at
from towval.model.tracks import stretches
from towval.physics.mass import towed_object
from towval.validation.bridges import GAP

_SLACK_SHARE = 0.95
"""Share of the rest length below which a tether is surely slack: no tape is that wrong (`taut_start`)."""

_MOVED_M = 0.005
"""Motion that counts: above what a decimated track swings by, and a quarter of the default tolerance."""

_COASTING = 3.0
"""Factor on the distance that friction lets an object coast: a wrong friction is for the verdict to find."""

_BEFORE_S = 0.1
"""Time before the tether is surely slack in which the object's fastest motion counts."""


def moved_while_slack(scene: TowingScene, rover: DecimatedTrack, towed: DecimatedTrack, times: Array) -> list[Finding]:
    """A finding where the measured object moves farther behind a slack tether than friction lets it coast.

    A body of mass m under friction of at least μ m g comes to rest within (v² + k² ω²) / (2 μ g): by Jensen's
    inequality the mean slip under a sole is at least the speed of its centre of pressure, taken as that of its mass,
    which it is near where no tether pulls. ``times`` (n,) [s] are those at which the object was seen. What moves it
    beyond that is the rover that touches it, a hand or a cable, none of which the simulation has. Nothing is said of a
    tether so heavy that its sag pulls the object, and of motion that was not seen: meanwhile the tether may have been
    taut.
    """
    if len(times) < 2:
        return []
    hinge = transform(rover.poses_at(times), scene.hinge)
    anchor = transform(towed.poses_at(times), scene.anchor)
    span = np.hypot(np.linalg.norm(hinge - anchor, axis=1), scene.hinge_height - scene.anchor_height)
    slack = span < _SLACK_SHARE * scene.tether.rest_length
    friction = _least_friction(scene)
    tether_weight = scene.tether.mass_per_length * scene.tether.rest_length * scene.ground.gravity
    if not slack.any() or tether_weight >= friction * scene.weight:
        return []
    moving = towed.poses_and_rates_at(times)
    body = towed_object(scene)
    centre = transform(moving[:, :3], body.centre_of_mass)
    lever = centre - moving[:, :2]
    velocity = velocity_at(moving[:, 3:], lever)
    square = np.sum(velocity**2, axis=1) + body.inertia / body.mass * moving[:, 5] ** 2
    worst_m, begins, ends = 0.0, 0, 0
    for first, last in _unbroken(stretches(slack), _hidden_before(times, centre)):
        before = np.searchsorted(times, times[first] - _BEFORE_S)
        coasting = square[before : first + 1].max() / (2 * friction * scene.ground.gravity)
        gone = np.linalg.norm(centre[first : last + 1] - centre[first], axis=1) - _COASTING * coasting
        if gone.max() > worst_m:
            worst_m, begins, ends = float(gone.max()), first, first + int(np.argmax(gone))
    if worst_m <= _MOVED_M:
        return []
    moved_m = float(np.linalg.norm(centre[ends] - centre[begins]))
    length_m = float(span[begins : ends + 1].max())
    return [
        finding(
            "moved_while_slack", moved_mm=1000 * moved_m, first_s=times[begins], last_s=times[ends],
            length_m=length_m, rest_m=scene.tether.rest_length,
        )
    ]  # fmt: skip


def _hidden_before(times: Array, centre: Array) -> NDArray[np.bool_]:
    """Frames (n,) before which the object, at places (n, 2) [m], moved while it was not seen for a while."""
    steps, gone = np.diff(times), np.linalg.norm(np.diff(centre, axis=0), axis=1)
    return np.append(False, (steps > GAP * np.median(steps)) & (gone > _MOVED_M))


def _unbroken(found: NDArray[np.int64], breaks: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last index of each of the stretches (k, 2), in parts that begin where there is a break (n,)."""
    for first, last in found:
        begins = [first, *(first + 1 + np.flatnonzero(breaks[first + 1 : last + 1]))]
        yield from zip(begins, [*(each - 1 for each in begins[1:]), last], strict=True)


def _least_friction(scene: TowingScene) -> float:
    """The least coefficient of friction, anywhere and in any direction, that slows the object down [1]."""
    friction = scene.friction
    weakest = min([1.0, friction.across_over_along, *(region.factor for region in scene.ground.regions)])
    return float(min(friction.kinetic, friction.static) * weakest - np.hypot(*scene.ground.slope))

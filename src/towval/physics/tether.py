"""The elastic tether that can only pull.

SOURCE: eq. (12), ``T = κ (|l| − l0) l/|l|`` when |l| ≥ l0, else 0, with l from the anchor to the hinge. ASSUME: with
damping, ``c d|l|/dt`` is added while the tether is stretched, and the sum never pushes. For a tether that stiffens see
:class:`towval.model.Tether`.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, FrictionSpecification, Ground, Tether, TowedObject
from towval.model.checks import instance_of, locked, matching, numbers_of, positive
from towval.model.compiling import compiled
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.errors import InputError
from towval.model.geometry import transform
from towval.physics.spatial.hanging import hanging_forces
from towval.physics.spatial.problem import tether_numbers

_LEAST_DISTANCE = 1e-9  # of the rest length

_HELD = 1.25
"""Pull that an object at rest may bear, as a multiple of the static friction of its weight on level ground: slopes, a
pull downward and a longer rest add some; and where friction does hold, the start stays as it was measured."""


def tether_force(tether: Tether, span: ArrayLike, span_rate: ArrayLike | None = None) -> Array:
    """Force on the object at its anchor, of a tether without mass.

    Parameters
    ----------
    span : array_like (..., 2)
        Vector l from anchor to hinge [m].
    span_rate : array_like (..., 2), optional
        dl/dt [m/s], for the damping; by default the ends are at rest.

    Returns
    -------
    ndarray (..., 2)
        Force [N] along l, zero where the tether is slack.

    Raises
    ------
    InputError
        When the tether has mass, and so is no straight line; or spans and rates are no vectors that match.

    Examples
    --------
    >>> tether_force(Tether(0.6, 1000.0), [[0.61, 0.0], [0.5, 0.0]]).round(6)
    array([[10.,  0.],
           [ 0.,  0.]])
    """
    instance_of(tether, "tether", Tether)
    if tether.mass_per_length > 0:
        what = "the force of a tether with mass does not follow from its span"
        raise InputError(what, got=f"{tether.mass_per_length:g} kg/m", allowed="a tether without mass")
    span = numbers_of(span, "span", 2)
    length = np.linalg.norm(span, axis=-1, keepdims=True)
    direction = span / np.where(length > 0, length, 1.0)
    stretch = length - tether.rest_length
    rate: Array | float = 0.0
    if span_rate is not None:
        moving = numbers_of(span_rate, "span rate", 2)
        matching((span, "span"), (moving, "span rate"))
        rate = (direction * moving).sum(axis=-1, keepdims=True)
    spring = tether.stiffness * stretch
    if tether.stiffening > 0:
        spring = spring * (1 - tether.stiffening + tether.stiffening * spring / tether.full_load)
    pull = np.maximum(0.0, spring + tether.damping * rate)
    return np.where(stretch >= 0, pull, 0.0) * direction


def lowest_point(tether: Tether, distance: float, rise: float, gravity: float = GRAVITY_M_PER_S2) -> float:
    """How far the lowest point of a tether with mass is below its anchor [m]; zero where it rises all along.

    ``distance`` along the floor and ``rise`` from anchor to hinge [m]. The stretch counts as that of a tether that does
    not stiffen. Raises `InputError` where the tether has no mass: what is slack hangs anywhere.

    Examples
    --------
    A chain of 1 kg/m and 0.6 m whose ends are drawn apart by 20 N: about w l²/(8 T).

    >>> round(lowest_point(Tether(0.6, 1e7, mass_per_length=1.0), 0.597843, 0.0), 4)
    0.022
    """
    instance_of(tether, "tether", Tether)
    positive(tether, "mass_per_length")
    distance, rise, gravity = (
        float(locked(value, name, ())) for value, name in ((distance, "distance"), (rise, "rise"), (gravity, "gravity"))
    )
    if gravity <= 0:
        raise InputError("gravity is out of range", got=gravity, allowed="above zero")
    numbers = tether_numbers(tether, rise, gravity)
    # Straight below the hinge nothing pulls sideways, and two parts hang side by side: the limit of a short distance.
    pull, lift, *_ = hanging_forces(numbers, max(abs(distance), _LEAST_DISTANCE * tether.rest_length))
    if lift >= 0:
        return max(0.0, -rise)
    weight = tether.mass_per_length * gravity
    if lift + weight * tether.rest_length <= 0:
        return -rise
    # From the anchor, where it leaves downward at −lift/pull, to where it is level: (√(pull² + lift²) − pull) / weight.
    slack = lift**2 / (weight * (math.hypot(pull, lift) + pull))
    return slack + lift**2 / (2 * weight * tether.stiffness * tether.rest_length)


def nearest_rest(
    towed: TowedObject,
    friction: FrictionSpecification,
    tether: Tether,
    ground: Ground,
    hinge_height: float,
    hinge: Array,
    pose: ArrayLike,
) -> Array:
    """A pose (3,) [m, m, rad], moved towards the hinge (2,) [m] until friction can hold against the tether.

    Lengths and places are known to a millimetre or so, by which a stiff tether would pull with more than friction
    holds. But the object was seen at rest: it is a wrong length, and no force that throws it.
    """
    start = np.array(pose, dtype=np.float64)
    most = max([friction.across_over_along, 1.0]) * max([1.0, *(region.factor for region in ground.regions)])
    weight, rise = towed.mass * ground.gravity, hinge_height - towed.anchor_height
    length = tether.rest_length + _HELD * friction.static * most * weight / tether.stiffness
    span = hinge - transform(start, towed.anchor)
    distance, longest = float(np.hypot(*span)), float(np.sqrt(max(length**2 - rise**2, 0.0)))
    if distance > longest:
        start[:2] += (1 - longest / distance) * span
    return start


def refuse_beyond_plane(model: str, towed: TowedObject, tether: Tether) -> None:
    """Raise InputError where a tow leaves the plane of the floor, or its tether the straight linear spring.

    The models of :mod:`towval.physics.trailing` support neither; the height of the centre of mass has no effect there.
    """
    stated = {
        "anchor height [m]": towed.anchor_height,
        "stiffening": tether.stiffening,
        "mass of the tether [kg/m]": tether.mass_per_length,
    }
    beyond = [f"{name} {value:g}" for name, value in stated.items() if value]
    if beyond:
        raise InputError(
            f"{model} is a model in the plane of the floor",
            got=", ".join(beyond),
            allowed="zero",
            remedy="towval.physics.feedback has heights and stiffening",
        )


@compiled(allocates=False, forceinline=True)
def stretch_and_pull(
    span_x: float, span_y: float, rate_x: float, rate_y: float, tether: Array
) -> tuple[float, float, float]:
    """Length, stretch |l| − l0 [m] and the pull [N] that would act if the tether could also push.

    ``tether`` holds κ, l0, c.
    """
    length = math.sqrt(span_x * span_x + span_y * span_y)
    stretch = length - tether[1]
    return length, stretch, tether[0] * stretch + tether[2] * (span_x * rate_x + span_y * rate_y) / length

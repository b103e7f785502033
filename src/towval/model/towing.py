"""Input of the simulation: footprint, load, friction and tether."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from towval.model.checks import Array, instance_of, items_of, lock, locked, positive
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.errors import InputError
from towval.model.friction import FrictionLaw


@dataclass(frozen=True)
class Patch:
    """The footprint of an object in the body frame: a simple polygon, with holes or without, or several apart.

    ``outline`` (n, 2), each of ``holes`` (m, 2) and of ``further`` (k, 2), the other feet or runners, in metres, in
    either sense of rotation.

    Raises `InputError` when a ring is no array (n, 2) of three or more finite corners.

    Examples
    --------
    >>> runners = Patch.of([[(-0.2, y), (0.2, y), (0.2, y + 0.02), (-0.2, y + 0.02)] for y in (-0.1, 0.08)])
    >>> len(runners.outlines), runners.corners.shape
    (2, (8, 2))
    """

    outline: Array
    holes: tuple[Array, ...] = ()
    further: tuple[Array, ...] = ()

    def __post_init__(self) -> None:
        lock(self, outline=(None, 2))
        for name in ("holes", "further"):
            rings = tuple(
                locked(ring, f"Patch.{name}", (None, 2)) for ring in items_of(getattr(self, name), f"Patch.{name}")
            )
            object.__setattr__(self, name, rings)
        if min(len(ring) for ring in (*self.outlines, *self.holes)) < 3:
            raise InputError("a ring of the footprint is no polygon", allowed="three corners or more")

    @classmethod
    def of(cls, outlines: Sequence[ArrayLike], holes: Sequence[ArrayLike] = ()) -> "Patch":
        """The footprint of these outlines (n, 2) each, one or more, and holes [m]."""
        outlines, holes = items_of(outlines, "Patch.outlines"), items_of(holes, "Patch.holes")
        if not outlines:
            raise InputError("the footprint has no outline", allowed="one ring or more")
        first, *further = (locked(ring, "Patch.outlines", (None, 2)) for ring in outlines)
        return cls(first, tuple(locked(hole, "Patch.holes", (None, 2)) for hole in holes), tuple(further))

    @property
    def outlines(self) -> tuple[Array, ...]:
        """The outlines of all parts (n, 2) each [m]."""
        return (self.outline, *self.further)

    @property
    def corners(self) -> Array:
        """The corners of all outlines (n, 2) [m]."""
        return np.concatenate(self.outlines)


@dataclass(frozen=True)
class Tether:
    """An elastic tether that can only pull, eq. (12) of the paper.

    ``rest_length`` [m], ``stiffness`` κ [N/m], ``damping`` [N s/m] (zero in the paper); ``stiffening`` σ [1], from 0 up
    to below 1, the share by which the stiffness of a slack tether is below κ:
    ``T = κ e ((1 − σ) + σ κ e / full_load)`` for a stretch e, so that κ is the chord up to ``full_load`` [N];
    ``mass_per_length`` [kg/m], which makes it sag (zero: a straight line).
    """

    rest_length: float
    stiffness: float
    damping: float = 0.0
    stiffening: float = 0.0
    mass_per_length: float = 0.0
    full_load: float = 0.0

    def __post_init__(self) -> None:
        positive(self, "rest_length", "stiffness")
        positive(self, "damping", "stiffening", "mass_per_length", "full_load", zero=True)
        if self.stiffening >= 1 or (self.stiffening > 0 and self.full_load == 0):
            raise InputError(
                "Tether.stiffening is out of range",
                got=f"{self.stiffening} with a full load of {self.full_load} N",
                allowed="zero, or below 1 with a full load above zero",
            )


@dataclass(frozen=True)
class FloorRegion:
    """A region of the floor with other friction: ``outline`` (n, 2) in the floor frame [m] and ``factor`` [1] on μ."""

    outline: Array
    factor: float

    def __post_init__(self) -> None:
        lock(self, outline=(None, 2))
        positive(self, "factor")
        if len(self.outline) < 3:
            raise InputError(
                "a region of the floor is no polygon", got=len(self.outline), allowed="three corners or more"
            )


@dataclass(frozen=True)
class Ground:
    """What the object stands on: a plane floor under gravity, in the floor frame.

    ``gravity`` [m/s²]; ``slope`` (2,) rise per metre towards x and y of the floor frame [1]; ``regions`` with other
    friction, where several overlap their factors less one add up.
    """

    gravity: float = GRAVITY_M_PER_S2
    slope: Array = field(default_factory=lambda: np.zeros(2))
    regions: tuple[FloorRegion, ...] = ()

    def __post_init__(self) -> None:
        lock(self, slope=(2,))
        positive(self, "gravity")
        object.__setattr__(self, "regions", items_of(self.regions, "Ground.regions"))
        for region in self.regions:
            instance_of(region, "Ground.regions", FloorRegion)
        if not np.hypot(*self.slope) < 1:
            raise InputError("Ground.slope is out of range", got=self.slope.tolist(), allowed="below 1 m per m (45°)")


@dataclass(frozen=True)
class Sliding:
    """Friction of a footprint: a law and how it departs from the same μ in all directions under a planar pressure.

    ``law``; ``across_over_along`` [1], semi-axes of the friction ellipse in body axes: the force of sliding along y
    over that along x, along the ellipse's normal; ``radius_over_planar`` [1], lever arm of the friction's moment about
    the centre of pressure over that under a planar pressure: above 1 for soles pressed at their rim, below 1 at the
    middle.
    """

    law: FrictionLaw
    across_over_along: float = 1.0
    radius_over_planar: float = 1.0

    def __post_init__(self) -> None:
        instance_of(self.law, "Sliding.law", FrictionLaw)
        positive(self, "across_over_along", "radius_over_planar")


@dataclass(frozen=True)
class TowedObject:
    """The towed object as dynamics sees it, in its body frame.

    ``patch`` the footprint; ``mass`` [kg] all in all; ``centre_of_mass`` (2,) [m]; ``inertia`` [kg m²] about the
    vertical through the centre of mass; ``anchor`` (2,) [m] where the tether holds it; ``anchor_height`` and
    ``centre_of_mass_height`` above the floor [m].
    """

    patch: Patch
    mass: float
    centre_of_mass: Array
    inertia: float
    anchor: Array
    anchor_height: float = 0.0
    centre_of_mass_height: float = 0.0

    def __post_init__(self) -> None:
        lock(self, centre_of_mass=(2,), anchor=(2,))
        positive(self, "mass", "inertia")
        positive(self, "anchor_height", "centre_of_mass_height", zero=True)


@dataclass(frozen=True)
class Load:
    """A box standing on the object, its sides along the object's axes.

    ``mass`` [kg]; ``at`` (2,) its centre in the object's frame [m]; ``size`` (3,) length, width and height [m].
    """

    mass: float
    at: Array
    size: Array

    def __post_init__(self) -> None:
        lock(self, at=(2,), size=(3,))
        positive(self, "mass", zero=True)

    @property
    def outline(self) -> Array:
        """Corners of its bottom (4, 2) in the object's frame [m]."""
        half = 0.5 * self.size[:2]
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return np.asarray(self.at + half * signs)


@dataclass(frozen=True)
class FrictionSpecification:
    """What a lab knows of the friction: the numbers to which a friction law is fitted, and which law.

    ``static`` and ``kinetic`` coefficients [1]; ``stiction_velocity`` v_s, where the law peaks,
    and ``friction_velocity`` v_k, where it has come down to the kinetic coefficient [m/s]; ``law`` its name in
    :data:`towval.physics.friction_laws.LAWS`; ``across_over_along`` and ``radius_over_planar`` [1] as in
    :class:`Sliding`.
    """

    static: float
    kinetic: float
    stiction_velocity: float
    friction_velocity: float
    law: str = "makkar"
    across_over_along: float = 1.0
    radius_over_planar: float = 1.0

    def __post_init__(self) -> None:
        positive(self, "static", "kinetic", "stiction_velocity", "friction_velocity")
        positive(self, "across_over_along", "radius_over_planar")


@dataclass(frozen=True)
class MassSpread:
    """Where the mass of a body is: ``centre`` (2,) of mass [m], ``gyration`` radius about the vertical through it [m].

    The moment of inertia is the mass times the square of ``gyration``.
    """

    centre: Array
    gyration: float

    def __post_init__(self) -> None:
        lock(self, centre=(2,))
        positive(self, "gyration")


@dataclass(frozen=True)
class TowingScene:
    """Everything the simulation needs in addition to the rover's track.

    ``patch``, ``load`` and ``anchor`` (2,) in the object's frame, ``hinge`` (2,) in the rover's [m]; ``body_mass`` [kg]
    of the object without its load, ``spread`` of that mass, evenly over the footprint if None; ``anchor_height``,
    ``hinge_height`` and ``centre_of_mass_height`` (of the object with its load) above the floor [m]; ``ground``.
    """

    patch: Patch
    body_mass: float
    load: Load
    anchor: Array
    hinge: Array
    tether: Tether
    friction: FrictionSpecification
    spread: MassSpread | None = None
    anchor_height: float = 0.0
    hinge_height: float = 0.0
    centre_of_mass_height: float = 0.0
    ground: Ground = field(default_factory=Ground)

    def __post_init__(self) -> None:
        lock(self, anchor=(2,), hinge=(2,))
        positive(self, "body_mass")
        positive(self, "anchor_height", "hinge_height", "centre_of_mass_height", zero=True)

    @property
    def mass(self) -> float:
        """Of the object with its load [kg]."""
        return self.body_mass + self.load.mass

    @property
    def weight(self) -> float:
        """Of the object with its load [N]."""
        return self.mass * self.ground.gravity

    @property
    def critical_damping(self) -> float:
        """Of the object on its tether, 2 √(κ m) [N s/m]."""
        return float(2 * np.sqrt(self.tether.stiffness * self.mass))

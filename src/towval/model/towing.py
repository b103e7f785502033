"""Input of the simulation: footprint, load, friction and tether."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from towval.model.checks import Array, lock, locked, positive
from towval.model.errors import InputError


@dataclass(frozen=True)
class Patch:
    """The footprint of an object: a simple polygon, with holes or without, in the body frame.

    ``outline`` (n, 2) and each of ``holes`` (m, 2) in metres, in either sense of rotation.
    """

    outline: Array
    holes: tuple[Array, ...] = ()

    def __post_init__(self) -> None:
        lock(self, outline=(None, 2))
        holes = tuple(locked(h, "Patch.holes", (None, 2)) for h in self.holes)
        object.__setattr__(self, "holes", holes)
        if min(len(ring) for ring in (self.outline, *holes)) < 3:
            raise InputError("a ring of the footprint is no polygon", allowed="three corners or more")


@dataclass(frozen=True)
class Tether:
    """An elastic tether that can only pull, eq. (12) of the paper.

    ``rest_length`` [m], ``stiffness`` [N/m], ``damping`` [N s/m] (zero in the paper).
    """

    rest_length: float
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        positive(self, "rest_length", "stiffness")
        positive(self, "damping", zero=True)


@dataclass(frozen=True)
class TowedObject:
    """The towed object as dynamics sees it, in its body frame.

    ``patch`` the footprint; ``mass`` [kg] all in all; ``centre_of_mass`` (2,) [m]; ``inertia`` [kg m²] about the
    vertical through the centre of mass; ``anchor`` (2,) [m] where the tether holds it.
    """

    patch: Patch
    mass: float
    centre_of_mass: Array
    inertia: float
    anchor: Array

    def __post_init__(self) -> None:
        lock(self, centre_of_mass=(2,), anchor=(2,))
        positive(self, "mass", "inertia")


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
    :data:`towval.physics.friction_laws.LAWS`.
    """

    static: float
    kinetic: float
    stiction_velocity: float
    friction_velocity: float
    law: str = "makkar"

    def __post_init__(self) -> None:
        positive(self, "static", "kinetic", "stiction_velocity", "friction_velocity")


@dataclass(frozen=True)
class TowingScene:
    """All that the simulation is told besides the rover's track.

    ``patch``, ``load`` and ``anchor`` (2,) in the object's frame, ``hinge`` (2,) in the rover's [m]; ``body_mass`` [kg]
    of the object without its load, spread evenly over the footprint.
    """

    patch: Patch
    body_mass: float
    load: Load
    anchor: Array
    hinge: Array
    tether: Tether
    friction: FrictionSpecification

    def __post_init__(self) -> None:
        lock(self, anchor=(2,), hinge=(2,))
        positive(self, "body_mass")

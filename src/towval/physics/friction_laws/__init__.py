"""Friction laws, and the table by which a specification chooses one.

A new law is a subclass of :class:`towval.model.FrictionLaw` with a function that makes it from a
:class:`towval.model.FrictionSpecification`, in a file of its own, and one line,
``LAWS.register(name, function)``; from outside the package as well (:mod:`towval.model.plugins`).
"""

from collections.abc import Callable

from towval.model import FrictionSpecification
from towval.model.checks import instance_of
from towval.model.plugins import Registry
from towval.physics.friction_laws.coulomb import Coulomb, fit_coulomb
from towval.physics.friction_laws.fitted import FittedLaw
from towval.physics.friction_laws.makkar import Makkar, fit_makkar, fit_specification, risen_law

LAWS: Registry[Callable[[FrictionSpecification], FittedLaw]] = Registry("friction law")
"""How each friction law is made from the numbers that a lab states, by name."""

LAWS.register(Makkar.name, fit_specification)
LAWS.register(Coulomb.name, fit_coulomb)

__all__ = ["LAWS", "Coulomb", "FittedLaw", "Makkar", "fit_makkar", "fitted_law", "risen_law"]


def fitted_law(specification: FrictionSpecification) -> FittedLaw:
    """The friction law that a specification names, fitted to its numbers.

    Raises `InputError` when no law of that name is registered.

    Examples
    --------
    >>> from towval.model import FrictionSpecification
    >>> stated = FrictionSpecification(0.35, 0.35, stiction_velocity=1e-3, friction_velocity=1e-2, law="coulomb")
    >>> fitted_law(stated).law.coefficient(0.1)
    np.float64(0.35)
    """
    instance_of(specification, "specification", FrictionSpecification)
    return LAWS.require(specification.law, "friction.law")(specification)

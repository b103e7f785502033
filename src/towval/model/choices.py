"""What a stage chose, and the alternative next to it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Choice:
    """A model or setting that a stage chose, and what its neighbour would have changed.

    ``what`` was chosen between ("lens model"); ``chosen``; ``next`` the one it would have taken next: the fuller or
    finer one, or, for the fullest, the simpler; ``change_m`` how far that moves positions [m], root mean square or the
    greatest as ``measure`` says; NaN where it could not be computed.
    """

    what: str
    chosen: str
    next: str
    change_m: float
    measure: str

"""Registration: the body frame by the outlines of all pictures, as sure as they allow."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from towval.model import Array
from towval.tracking.noise import beyond
from towval.tracking.outline import OutlineFit, combine_fits
from towval.tracking.two_measurements import by_size


@dataclass(frozen=True)
class RegistrationConstants:
    """Tuned constant of the registration; its length in pixels is measured on the planar target."""

    farthest_correction_px: float = 3.0  # [px] By all edges: clicks are that good.


CONSTANTS = RegistrationConstants()


def registration(
    fits: Sequence[OutlineFit], excess: Array, usual_m: Array, strayed: Array, pixel_m: float
) -> OutlineFit | None:
    """The body frame by the ``fits`` of a run's outlines; None where they show none.

    Of two opposite sides, one may be something else's: then the middle is off by half of what they are too far apart. A
    picture in which they are counts less. What they usually are, ``usual_m`` (2,) in length and width, counts once. An
    edge that is not sharp, though, stands inside by as much on all sides, and moves no middle: what length and width
    have in common is left out, unless they are larger than stated.

    ``excess`` (n, 3, 3): covariances of the poses at which the outlines were fitted, of each picture; ``strayed``
    (3, 3): covariance of outlines that may be others'; ``pixel_m``: width of a pixel on the target [m].
    """
    if not fits:
        return None
    common = min(0.0, float(np.mean(usual_m)))
    fit = combine_fits(fits, excess + by_size(np.array([one.size for one in fits]) - common))
    if np.linalg.norm(fit.correction[:2]) >= CONSTANTS.farthest_correction_px * pixel_m:
        return None
    # Of two that stand off their mean, each is off by more than that, in the mean square twice.
    of_all = by_size(np.sqrt(2) * (usual_m - common))
    # The noise of edges makes sides longer, too, and is in the covariance already.
    return replace(fit, covariance=fit.covariance + strayed + beyond(of_all[None], fit.covariance[None], 1.0)[0])

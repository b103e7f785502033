"""Registration: the body frame by the outlines of all pictures, as sure as they allow."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from towval.model import Array
from towval.tracking.noise import beyond
from towval.tracking.outline import CONSTANTS as OUTLINE
from towval.tracking.outline import OutlineFit, astray, combine_fits
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

    A picture counts less in which length and width are not what they usually are: by ``usual_m`` (2,) more than stated.
    Where that is more than edges stand off, even that above a thin strip of the side, one of two opposite sides may
    usually be something else's, and the middle off by half of it: then stated lengths take the place of usual ones, and
    what these are off counts once for all pictures. An edge that is not sharp, though, stands inside by as much on all
    sides, and moves no middle: what length and width have in common is left out, unless they are larger than stated.

    ``excess`` (n, 3, 3): covariances of the poses at which the outlines were fitted, of each picture; ``strayed``
    (3, 3): covariance of outlines that may be others'; ``pixel_m``: width of a pixel on the target [m].
    """
    if not fits:
        return None
    common = min(0.0, float(np.mean(usual_m)))
    apart = bool(np.abs(usual_m - common).max() > OUTLINE.other_size_px * pixel_m)
    expected = np.full(2, common) if apart else usual_m
    excess = excess + by_size(np.array([one.size for one in fits]) - expected)
    fit = combine_fits(fits, excess)
    if np.linalg.norm(fit.correction[:2]) >= CONSTANTS.farthest_correction_px * pixel_m:
        return None
    # Of two that stand off their mean, each is off by more than that, in the mean square twice.
    of_sides = by_size(np.sqrt(2) * (usual_m - expected))
    # The noise of edges makes sides longer, too, and is in the covariance already.
    doubts = beyond(of_sides[None], fit.covariance[None], 1.0)[0] + astray(fits, excess, fit)
    return replace(fit, covariance=fit.covariance + strayed + doubts)

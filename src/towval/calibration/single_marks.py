"""Surveyed marks that are not where everything else puts them: a slip of the tape, two coordinates exchanged.

A fit gives way to each mark, most to those at the ends: what a mark is off by shows in its residual only in part. Where
the other marks and the boards put it follows without another fit: with ``H`` the part of a mark's errors that the fit
follows, a residual ``r`` stands for ``(I - H)⁻¹ r``, of the covariance ``(I - H)⁻¹`` in units of a mark's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from towval.calibration.blocks import CAMERA_END, Block, Estimate
from towval.calibration.bundle_adjustment import marginal_covariance, whitened
from towval.model import Finding
from towval.model.errors import InputError
from towval.model.findings import finding


@dataclass(frozen=True)
class SingleMarksConstants:
    """Tuned constant of the search for marks that are off."""

    misfit: float = 4.0  # Deviations from where the others put a mark: one sound mark in 3,000 is farther off.
    slip: float = 50.0  # The same, of a slip of the tape or of the decimal point: none is rough by so much.


CONSTANTS = SingleMarksConstants()

FEWEST_TO_TELL = 9
"""Marks, as many as the unknowns of a plane seen by a camera: eight of its homography, one of the lens."""

_ROUNDING = 1e-6  # Share of a mark's errors that its residual must keep: below it nothing else tells where it is.


def misfit_findings(
    blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp], stated_px: float
) -> list[Finding]:
    """Findings about single marks that are farther than stated from where the others put them, the worst first.

    The last of ``blocks`` are the marks, ``stated_px`` is their stated deviation, maybe less than that of the fit of
    the ``active`` parameters. The worst is left out, and those named with it that would explain the misfit nearly as
    well, until the others agree. `InputError` for a slip among too few marks to tell which of them it is.
    """
    marks = blocks[-1]
    ((residual, by_shared, _),) = whitened(blocks[-1:], estimate.of([len(blocks) - 1]), np.arange(CAMERA_END))
    r, A = residual.reshape(-1, 2), by_shared.reshape(len(marks.pixels), 2, -1)
    P, left, off_px = marginal_covariance(blocks, estimate, active)[0], set(range(len(r))), dict[int, float]()
    while True:
        own = {i: np.eye(2) - A[i] @ P @ A[i].T for i in left}
        off = {i: np.linalg.solve(own[i], r[i]) for i in left if np.linalg.eigvalsh(own[i])[0] > _ROUNDING}
        squares = {i: (marks.std_px / stated_px) ** 2 * float(r[i] @ off[i]) for i in off}
        worst = max(squares, key=lambda i: squares[i], default=-1)
        if worst < 0 or squares[worst] <= CONSTANTS.misfit**2:
            break
        for i, square in squares.items():
            if square > max(CONSTANTS.misfit**2, squares[worst] - CONSTANTS.misfit**2):
                off_px.setdefault(i, marks.std_px * float(np.linalg.norm(off[i])))
        moved = P @ A[worst].T
        r, P = r + A @ moved @ off[worst], P + moved @ np.linalg.solve(own[worst], moved.T)
        left.remove(worst)
    if len(r) < FEWEST_TO_TELL and max(off_px.values(), default=0.0) > CONSTANTS.slip * stated_px:
        named = "; ".join(f"{marks.points_m[i, :2].tolist()} m by {off_px[i]:.0f} px" for i in off_px)
        raise InputError(
            "the surveyed marks contradict each other, or the boards",
            got=f"far from where the others put them: {named}",
            allowed=f"places on one floor [m] and their pixels in one picture of the camera; of fewer than "
            f"{FEWEST_TO_TELL} marks none can be left out",
            remedy="check the pixels and the coordinates of these marks in floor.surveyed_marks",
        )
    return [
        finding("mark-misfit", at_m=marks.points_m[i, :2].tolist(), distance_px=off_px[i], stated_px=stated_px)
        for i in sorted(off_px, key=lambda i: -off_px[i])
    ]

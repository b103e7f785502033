"""Stated deviations of a camera beside the jackknife over its pictures, and beside known errors of synthetic sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from studies.worlds.boards import calibration_set
from towval.calibration import view_covariance
from towval.calibration.blocks import Estimate
from towval.calibration.board_search import find_boards
from towval.calibration.bundle_adjustment import adjust, marginal_covariance
from towval.calibration.corners import BoardObservation
from towval.calibration.lens import active_parameters
from towval.calibration.observations import CalibrationObservations, first_guess
from towval.model import Array, Board
from towval.optics.plane_uncertainty import shared_parameters

SETS = {
    "opencv_left": ("left*.jpg", (9, 6), "k1 k2 p1 p2"),
    "gopro_wide_calib": ("GOPR*.jpg", (8, 6), "k1 k2 p1 p2 k3"),
}
"""Photographs by their folder: pattern, inner corners of the board, lens model."""

JUDGED = ("fx", "fy", "cx", "cy", "k1")
"""The parameters that are compared, the first five of every fit."""


def fitted(seen: CalibrationObservations, models: Sequence[str]) -> tuple[Estimate, NDArray[np.intp]]:
    """The fit with the last of some lens models, each started where the one before ended, and its free parameters."""
    estimate, active = first_guess(seen), np.zeros(0, dtype=np.intp)
    for model in models:
        active = active_parameters(model, with_floor=seen.reference is not None)
        estimate = adjust(seen.blocks, estimate, active)
    return estimate, active


def leave_one_out_std(seen: CalibrationObservations, estimate: Estimate, active: NDArray[np.intp]) -> Array:
    """Deviations of the free parameters from fits to all views but one."""
    found = []
    for out in range(len(seen.blocks)):
        kept = [i for i in range(len(seen.blocks)) if i != out]
        start = replace(estimate, places=tuple(estimate.places[i] for i in kept))
        found.append(adjust([seen.blocks[i] for i in kept], start, active).shared[active])
    views = len(found)
    spread: Array = np.sqrt((views - 1) / views * np.sum((np.array(found) - estimate.shared[active]) ** 2, axis=0))
    return spread


def photographs(folder: Path) -> CalibrationObservations:
    """What is seen in one of the :data:`SETS`."""
    pattern, corners, _ = SETS[folder.name]
    named = [(path.name, _gray(path)) for path in sorted(folder.glob(pattern))]
    observations, _ = find_boards(named, Board("chessboard", corners, 1.0), 2)
    height, width = named[0][1].shape
    return CalibrationObservations((width, height), tuple(observations))


def over_jackknife(folder: Path) -> tuple[Array, Array]:
    """Stated deviations (5,) of :data:`JUDGED` over the jackknife's, and those of independent corners over it."""
    seen = photographs(folder)
    estimate, active = fitted(seen, ("none", "k1", "k1 k2", SETS[folder.name][2]))
    truth = leave_one_out_std(seen, estimate, active)[:5]
    stated = np.sqrt(np.diag(view_covariance.view_covariance(seen.blocks, estimate, active)))[:5]
    alone = np.sqrt(np.diag(marginal_covariance(seen.blocks, estimate, active)[0])[active])[:5]
    return stated / truth, alone / truth


def _gray(path: Path) -> NDArray[np.uint8]:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def bent_fields(seen: CalibrationObservations, rng: np.random.Generator, size_px: float) -> CalibrationObservations:
    """Each view with a smooth error of its own over the board, as print, blur and a lens not of the model leave."""

    def bent(observation: BoardObservation) -> BoardObservation:
        x, y = (observation.board_m / 0.16).T
        field = np.column_stack([x**2, x * y, y**2, x**3, x**2 * y])
        return replace(observation, corners_px=observation.corners_px + field @ rng.normal(0, size_px, (5, 2)))

    return replace(seen, boards=tuple(map(bent, seen.boards)), floor_boards=tuple(map(bent, seen.floor_boards)))


def normalised_errors(seeds: Sequence[int], size_px: float, floor: str = "marks") -> tuple[float, float]:
    """Errors of :data:`JUDGED` over their stated deviations, RMS over sets; then over those of independent corners.

    The sets are :func:`studies.worlds.boards.calibration_set`, with :func:`bent_fields` of ``size_px`` [px].
    """
    by_view, by_corner = [], []
    for seed in seeds:
        scene = calibration_set(seed, floor=floor)
        seen = bent_fields(scene.seen, np.random.default_rng(seed), size_px) if size_px else scene.seen
        estimate, active = fitted(seen, ("none", "k1", "k1 k2"))
        error = (estimate.shared - shared_parameters(scene.camera, scene.floor))[active][:5]
        by_view.append(error / np.sqrt(np.diag(view_covariance.view_covariance(seen.blocks, estimate, active)))[:5])
        alone = marginal_covariance(seen.blocks, estimate, active)[0][np.ix_(active, active)]
        by_corner.append(error / np.sqrt(np.diag(alone))[:5])
    return float(np.sqrt(np.mean(np.square(by_view)))), float(np.sqrt(np.mean(np.square(by_corner))))

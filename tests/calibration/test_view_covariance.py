"""The covariance from views: against the jackknife on photographs, and against known errors of synthetic sets."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from studies.worlds.boards import calibration_set
from towval.calibration.board_search import find_boards
from towval.calibration.bundle_adjustment import Estimate, adjust, marginal_covariance
from towval.calibration.lens import active_parameters
from towval.calibration.observations import CalibrationObservations, first_guess
from towval.calibration.view_covariance import view_covariance
from towval.model import Board
from towval.optics.plane_uncertainty import shared_parameters


def fitted(seen: CalibrationObservations, models: tuple[str, ...]) -> tuple[Estimate, np.ndarray]:
    estimate = first_guess(seen)
    for model in models:
        active = active_parameters(model, with_floor=seen.reference is not None)
        estimate = adjust(seen.blocks, estimate, active)
    return estimate, active


def jackknife(seen: CalibrationObservations, estimate: Estimate, active: np.ndarray) -> np.ndarray:
    """Deviations from fits to all views but one."""
    found = []
    for out in range(len(seen.blocks)):
        kept = [i for i in range(len(seen.blocks)) if i != out]
        start = replace(estimate, places=tuple(estimate.places[i] for i in kept))
        found.append(adjust([seen.blocks[i] for i in kept], start, active).shared[active])
    views = len(found)
    return np.sqrt((views - 1) / views * np.sum((np.array(found) - estimate.shared[active]) ** 2, axis=0))


@pytest.mark.shared
@pytest.mark.parametrize(
    ("folder", "pattern", "corners", "lens"),
    [("opencv_left", "left*.jpg", (9, 6), "k1 k2 p1 p2"), ("gopro_wide_calib", "GOPR*.jpg", (8, 6), "k1 k2 p1 p2 k3")],
)
def test_stated_deviations_are_those_of_the_jackknife(shared_dir: Path, folder, pattern, corners, lens):
    paths = sorted((shared_dir / "real" / folder).glob(pattern))
    named = [(path.name, cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) for path in paths]
    observations, _ = find_boards(named, Board("chessboard", corners, 1.0), 2)
    height, width = named[0][1].shape
    seen = CalibrationObservations((width, height), tuple(observations))
    estimate, active = fitted(seen, ("none", "k1", "k1 k2", lens))
    stated = np.sqrt(np.diag(view_covariance(seen.blocks, estimate, active)))
    alone = np.sqrt(np.diag(marginal_covariance(seen.blocks, estimate, active)[0])[active])
    truth = jackknife(seen, estimate, active)
    ratio = (stated / truth)[:5]  # fx, fy, cx, cy, k1
    assert (ratio > 0.8).all()
    assert (ratio < 1.25).all()
    assert ((alone / truth)[:5] < 0.7).all()


def bent_fields(seen: CalibrationObservations, rng: np.random.Generator, size_px: float) -> CalibrationObservations:
    """Each view with a smooth error of its own over the board, as print, blur and a lens not of the model leave."""

    def bent(observation):
        x, y = (observation.board_m / 0.16).T
        field = np.column_stack([x**2, x * y, y**2, x**3, x**2 * y])
        return replace(observation, corners_px=observation.corners_px + field @ rng.normal(0, size_px, (5, 2)))

    return replace(seen, boards=tuple(map(bent, seen.boards)), floor_boards=tuple(map(bent, seen.floor_boards)))


@pytest.mark.parametrize("floor", ["marks", "boards"])
@pytest.mark.parametrize(("size_px", "fewest"), [(0.0, 0.7), (0.3, 2.0)])
def test_normalised_errors_are_about_one(floor, size_px, fewest):
    """Of fx, fy, cx, cy and k1; corners taken for independent understate them where they are not."""
    by_view, by_corner = [], []
    for seed in range(9200, 9240):
        scene = calibration_set(seed, floor=floor)
        seen = bent_fields(scene.seen, np.random.default_rng(seed), size_px) if size_px else scene.seen
        estimate, active = fitted(seen, ("none", "k1", "k1 k2"))
        error = (estimate.shared - shared_parameters(scene.camera, scene.floor))[active][:5]
        by_view.append(error / np.sqrt(np.diag(view_covariance(seen.blocks, estimate, active)))[:5])
        alone = marginal_covariance(seen.blocks, estimate, active)[0][np.ix_(active, active)]
        by_corner.append(error / np.sqrt(np.diag(alone))[:5])
    assert 0.8 < np.sqrt(np.mean(np.square(by_view))) < 1.3
    assert np.sqrt(np.mean(np.square(by_corner))) > fewest


def test_marks_alone_enter_with_their_stated_deviation():
    scene = calibration_set(9120)
    seen = replace(scene.seen, boards=())
    truth = Estimate(shared_parameters(scene.camera, scene.floor), (np.zeros(0),), noise_px=1.0)
    floor = np.arange(12, 18)
    np.testing.assert_allclose(
        view_covariance(seen.blocks, truth, floor),
        marginal_covariance(seen.blocks, truth, floor)[0][np.ix_(floor, floor)],
        rtol=1e-6,
    )

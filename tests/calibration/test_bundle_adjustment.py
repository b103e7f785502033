"""Bundle adjustment against finite differences, exact data, dense linear algebra and Monte-Carlo scatter."""

from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.boards import calibration_set
from towval.calibration.blocks import Block, Estimate, Placement, Stack, residuals
from towval.calibration.bundle_adjustment import adjust, marginal_covariance
from towval.calibration.lens import active_parameters
from towval.calibration.observations import first_guess
from towval.model import Calibration, Camera, Floor
from towval.optics.plane_uncertainty import position_covariance, shared_parameters
from towval.optics.projection import to_plane

ACTIVE = active_parameters("k1 k2", with_floor=True)


def exact(seed: int, **keys):
    """A set without noise, its blocks and its true shared parameters."""
    scene = calibration_set(seed, noise_px=0.0, **keys)
    return scene, scene.seen.blocks, shared_parameters(scene.camera, scene.floor)


def linearise(block, shared, place, doubts):
    """Residuals (2n,) of a block and their derivatives by shared parameters and doubts (2n, 28), and by its place."""
    one = Stack([block]).linearise(Estimate(shared, (place,), doubts=doubts))
    r, A, B = (each[0].reshape(2 * len(block.pixels), -1) for each in one)
    return r.ravel(), A, B[:, : len(place)]


def fitted(blocks, scene) -> Estimate:
    start = first_guess(scene.seen)
    for model in ("none", "k1"):
        start = adjust(blocks, start, active_parameters(model, with_floor=True))
    return adjust(blocks, start, ACTIVE)


@pytest.mark.parametrize("placement", list(Placement))
def test_derivatives_are_those_of_the_projection(placement):
    rng = np.random.default_rng(3)
    shared = np.array(
        [1500, 1490, 950, 530, -0.1, 0.02, 1e-3, -2e-3, 3e-3, 0.01, 0.02, 0.01, 3.0, 0.1, 0.2, 0.1, -0.1, 4]
    )
    place = {6: np.array([3.0, 0.2, -0.1, 0.1, 0.2, 1.5]), 3: np.array([0.4, -0.3, 0.7]), 0: np.zeros(0)}[
        placement.value
    ]
    doubts = np.array([0.01, 2e-3, -3e-3, 1e-3, 5e-4, 0.01, -0.02, 0.02, 3.0, -2.0])
    on_board = rng.uniform(-1, 1, (5, 2))
    block = Block(rng.uniform(-0.3, 0.3, (5, 3)), rng.uniform(0, 1000, (5, 2)), placement, on_board=on_board)
    _, J_shared, J_place = linearise(block, shared, place, doubts)
    step = 1e-6

    def change(k: int, is_shared: bool) -> np.ndarray:
        by = [np.zeros(28), np.zeros(len(place))]
        by[0 if is_shared else 1][k] = step
        ahead = linearise(block, shared + by[0][:18], place + by[1], doubts + by[0][18:])[0]
        behind = linearise(block, shared - by[0][:18], place - by[1], doubts - by[0][18:])[0]
        return (behind - ahead) / (2 * step)

    for k in range(28):
        np.testing.assert_allclose(J_shared[:, k], change(k, True), rtol=1e-5, atol=1e-3)
    for k in range(len(place)):
        np.testing.assert_allclose(J_place[:, k], change(k, False), rtol=1e-5, atol=1e-3)


def test_each_block_is_fitted_as_it_is_alone_however_many_points_the_others_have():
    scene = calibration_set(11, floor="both", views=6)
    start = first_guess(scene.seen)
    kept = [
        slice(len(block.pixels) - 3 * (i % 2) * (len(block.pixels) > 9)) for i, block in enumerate(scene.seen.blocks)
    ]
    blocks = [
        replace(b, points_m=b.points_m[k], pixels=b.pixels[k], on_board=None if b.on_board is None else b.on_board[k])
        for b, k in zip(scene.seen.blocks, kept, strict=True)
    ]
    assert len({len(block.pixels) for block in blocks}) > 2
    doubts = np.array([0.01, 2e-3, -3e-3, 1e-3, 5e-4, 0.01, -0.02, 0.02, 3.0, -2.0])
    stack, together = Stack(blocks), Stack(blocks).linearise(replace(start, doubts=doubts))
    medians = stack.medians(stack.lengths(together.residual))
    for i, (block, place) in enumerate(zip(blocks, start.places, strict=True)):
        n, alone = len(block.pixels), linearise(block, start.shared, place, doubts)
        np.testing.assert_allclose(together.residual[i, :n].ravel(), alone[0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(together.by_shared[i, :n].reshape(2 * n, -1), alone[1], rtol=1e-9, atol=1e-9)
        by_place = together.by_place[i, :n].reshape(2 * n, -1)
        np.testing.assert_allclose(by_place[:, : len(place)], alone[2], rtol=1e-9, atol=1e-9)
        assert not by_place[:, len(place) :].any()
        assert medians[i] == pytest.approx(np.median(np.linalg.norm(alone[0].reshape(-1, 2), axis=1)), rel=1e-12)


@pytest.mark.parametrize("floor", ["marks", "boards"])
def test_exact_corners_give_the_camera_back(floor):
    scene, blocks, truth = exact(11, floor=floor)
    estimate = fitted(blocks, scene)
    assert max(np.abs(r).max() for r in residuals(blocks, estimate)) < 1e-3
    np.testing.assert_allclose(estimate.shared[:4], truth[:4], atol=0.01)
    np.testing.assert_allclose(estimate.T_camera_floor, scene.floor.T_camera_floor, atol=2e-5)


def test_one_wild_corner_changes_little():
    scene = calibration_set(12)
    blocks = scene.seen.blocks
    clean = fitted(blocks, scene)
    wild = blocks[3].pixels.copy()
    wild[7] += [40.0, -25.0]
    spoilt = fitted([*blocks[:3], replace(blocks[3], pixels=wild), *blocks[4:]], scene)
    deviation = np.sqrt(np.diag(marginal_covariance(blocks, clean, ACTIVE)[0]))[ACTIVE]
    assert (np.abs(spoilt.shared - clean.shared)[ACTIVE] < deviation).all()


def test_marginal_covariance_is_a_block_of_the_full_inverse():
    scene = calibration_set(13, views=5)
    blocks = scene.seen.blocks
    estimate = fitted(blocks, scene)
    columns = len(ACTIVE) + sum(b.placement.value for b in blocks)
    rows, at = [], len(ACTIVE)
    for block, place in zip(blocks, estimate.places, strict=True):
        _, A, B = linearise(block, estimate.shared, place, estimate.doubts)
        row = np.zeros((len(A), columns))
        row[:, : len(ACTIVE)], row[:, at : at + B.shape[1]] = A[:, ACTIVE], B
        rows.append(row / (estimate.noise_px if np.isnan(block.std_px) else block.std_px))
        at += B.shape[1]
    J = np.concatenate(rows)
    scale = 1 / np.linalg.norm(J, axis=0)
    dense = scale[:, None] * np.linalg.inv((J * scale).T @ (J * scale)) * scale
    covariance, _ = marginal_covariance(blocks, estimate, ACTIVE)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance))[ACTIVE], np.sqrt(np.diag(dense))[: len(ACTIVE)], rtol=1e-4)
    unused = np.setdiff1d(np.arange(18), ACTIVE)
    assert not covariance[unused].any()


def test_predicted_covariance_is_that_of_the_scatter():
    scene, blocks, truth = exact(14, floor="boards")
    start, rng, noise = fitted(blocks, scene), np.random.default_rng(1), 0.2
    squares = []
    for _ in range(24):
        noisy = [replace(b, pixels=b.pixels + rng.normal(0, noise, b.pixels.shape)) for b in blocks]
        estimate = adjust(noisy, replace(start, noise_px=np.nan), ACTIVE)
        covariance = marginal_covariance(noisy, estimate, ACTIVE)[0][np.ix_(ACTIVE, ACTIVE)]
        apart = (estimate.shared - truth)[ACTIVE]
        squares.append(apart @ np.linalg.solve(covariance, apart) / len(ACTIVE))
        assert estimate.noise_px == pytest.approx(noise, rel=0.06)
    # 24 × 12 squared standard deviations of mean 1: their mean scatters by √(2/288) = 0.083; three of those.
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)


def test_covariance_is_of_the_rotation_vector_that_the_floor_gives_back():
    """A ceiling camera is turned by nearly half a turn; in this set the fit passes it."""
    scene = calibration_set(326)
    estimate = fitted(scene.seen.blocks, scene)
    covariance, _ = marginal_covariance(scene.seen.blocks, estimate, ACTIVE)

    def view(parameters: np.ndarray) -> tuple[Camera, Floor]:
        moved = Estimate(parameters, ())
        return Camera((1920, 1080), moved.matrix, moved.distortion, "k1 k2"), Floor(moved.T_camera_floor)

    np.testing.assert_allclose(shared_parameters(*view(estimate.shared))[12:15], estimate.shared[12:15], atol=1e-9)
    pixels, step = np.array([[100.0, 100.0], [1800.0, 900.0], [960.0, 540.0]]), 1e-6
    by_parameter = [
        (to_plane(*view(estimate.shared + e), pixels, 0.35) - to_plane(*view(estimate.shared - e), pixels, 0.35)) / 2
        for e in step * np.eye(18)
    ]
    slopes = np.stack(by_parameter, axis=-1) / step
    numerical = slopes @ covariance @ slopes.transpose(0, 2, 1)
    stated = position_covariance(Calibration(*view(estimate.shared), covariance, estimate.noise_px), pixels, 0.35)
    np.testing.assert_allclose(stated, numerical, rtol=1e-4, atol=1e-12)


def test_condition_number_sees_the_missing_tilt():
    conditions = []
    for tilt in ((20.0, 40.0), (0.0, 0.5)):
        scene = calibration_set(15, tilt_deg=tilt)
        conditions.append(marginal_covariance(scene.seen.blocks, fitted(scene.seen.blocks, scene), ACTIVE)[1])
    assert conditions[1] > 100 * conditions[0]

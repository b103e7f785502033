"""Pictures on a target's plane: how far edges show, and where what goes with a body ends, beside plain numpy."""

import cv2
import numpy as np
import pytest
from painted import POSE, picture, target
from scipy.ndimage import map_coordinates

from towval.model.geometry import compose, inverse_transform, rotation, transform
from towval.tracking.outline_search import OutlineSearch
from towval.tracking.rectified import CONSTANTS, MovingAlong, Rectified, edges_limit, edges_shown

BOX = target()
CORNERS = BOX.body.top_corners_m
CELL_M = BOX.metres_per_pixel(POSE)
LUMA = picture(BOX, grey=lambda xy: np.full(len(xy), 160.0))


def read(image, low, cell_m, points):
    """Values of an image (rows, columns) between its cells at points (..., 2), zero outside."""
    x, y = np.moveaxis((points - low) / cell_m, -1, 0)
    return map_coordinates(image.astype(float), [y, x], order=1, mode="constant")


def edge_points(pose):
    """The points (edges, n, 2) at which edges are read, and their normals (edges, 2) to the outside."""
    share = ((np.arange(CONSTANTS.points_of_edge) + 0.5) / CONSTANTS.points_of_edge)[:, None]
    edges = np.roll(CORNERS, -1, axis=0) - CORNERS
    points = np.stack([corner + share * edge for corner, edge in zip(CORNERS, edges, strict=True)])
    along = edges / np.linalg.norm(edges, axis=1, keepdims=True) @ rotation(pose[2]).T
    return transform(pose, points), np.column_stack([along[:, 1], -along[:, 0]])


def poses_about(count):
    return POSE + np.random.default_rng(5).normal(size=(count, 3)) * [5 * CELL_M, 5 * CELL_M, 0.1]


def test_edges_show_as_computed_with_numpy():
    rng = np.random.default_rng(3)
    low = POSE[:2] - 1.0
    views = [Rectified(low, 0.01, rng.normal(size=(200, 200, 2)).astype(np.float32), usual) for usual in (0.5, 2.0)]
    poses = poses_about(7)
    expected = np.zeros((7, 4))
    for n, pose in enumerate(poses):
        points, normals = edge_points(pose)
        for view in views:
            across = np.abs(sum(read(view.slopes[..., i], low, 0.01, points) * normals[:, None, i] for i in range(2)))
            expected[n] += (across / (across + CONSTANTS.steep * view.usual)).mean(axis=1) / 2
    np.testing.assert_allclose(edges_shown(BOX, views, poses), expected, rtol=1e-5)


def test_what_goes_ends_at_edges_as_computed_with_numpy():
    rng = np.random.default_rng(4)
    going = MovingAlong(POSE[:2] - 1.0, 0.01, rng.uniform(-1, 1, (200, 200)).astype(np.float32))
    poses = poses_about(7)
    limits, known = edges_limit(BOX, going, poses, CELL_M)
    for n, pose in enumerate(poses):
        points, normals = edge_points(pose)
        beside = CONSTANTS.beside_px * CELL_M * normals[:, None]
        inner, outer = (read(going.share, going.low, 0.01, points + sign * beside).mean(axis=1) for sign in (-1, 1))
        np.testing.assert_allclose(limits[n], np.clip((inner - outer) / 2, 0, 1), atol=1e-6)
        to_camera = BOX.floor.camera_position_m[:2] - points.mean(axis=1)
        np.testing.assert_array_equal(known[n], (to_camera * normals).sum(axis=1) <= 0)


@pytest.mark.parametrize(("wider_px", "limit"), [(1.8, 1.0), (3.6, 0.0)])
def test_what_goes_may_end_two_pixels_beside_an_edge(wider_px, limit):
    """What moves along is a little larger than the top in all directions."""
    cell_m = CELL_M / 8
    low, half = POSE[:2] - 1.0, np.ptp(CORNERS, axis=0) / 2 + wider_px * CELL_M
    axis = np.arange(0.0, 2.0, cell_m)
    places = inverse_transform(POSE, low + np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2))
    share = np.where((np.abs(places) < half).all(axis=1), 1.0, -1.0).reshape(len(axis), -1).astype(np.float32)
    limits, _ = edges_limit(BOX, MovingAlong(low, cell_m, share), POSE[None], CELL_M)
    assert limits[0] == pytest.approx(limit, abs=0.1)


def test_the_edges_of_a_painted_top_show():
    low, size = POSE[:2] - 1.0, np.full(2, round(2 / CELL_M), np.int64)
    view = Rectified.of(BOX, (LUMA, np.zeros(3)), low, size, CELL_M)
    elsewhere = POSE + np.array([8 * CELL_M, 8 * CELL_M, 0.0])
    here, beside = edges_shown(BOX, [view], np.array([POSE, elsewhere]))
    assert here.min() > 0.8
    assert beside.max() < 0.4


def test_nothing_shows_outside_the_picture():
    low, size = POSE[:2] - 1.0, np.full(2, round(2 / CELL_M), np.int64)
    view = Rectified.of(BOX, (LUMA, np.zeros(3)), low, size, CELL_M)
    assert not edges_shown(BOX, [view], POSE + np.array([[5.0, 0.0, 0.0]])).any()
    assert not Rectified.of(BOX, (LUMA, np.array([50.0, 0.0, 0.0])), low, size, CELL_M).slopes.any()


@pytest.mark.parametrize("reach_px", [20.0, 400.0])
def test_a_search_finds_the_outline_to_a_pixel(reach_px):
    reach_m = reach_px * CELL_M
    search = OutlineSearch(BOX, [(LUMA, np.zeros(3))], POSE[:2] - reach_m, POSE[:2] + reach_m)
    score, pose = search.found(POSE[2] + 0.03, 0.1)[0]
    assert score > 0.8
    assert BOX.apart_m(pose, POSE) < 1.5 * CELL_M


def best_score(share):
    """The best score near the top where a share of its inside moved; none where no place counts."""
    low, high = POSE[:2] - 10 * CELL_M, POSE[:2] + 10 * CELL_M
    inside = BOX.pixels(CORNERS * [1.0, share], POSE)
    moved = cv2.fillPoly(np.zeros_like(LUMA), [np.round(inside).astype(np.int32)], 1) > 0
    search = OutlineSearch(BOX, [(LUMA, np.zeros(3))], low, high, moved)
    return max((score for score, _ in search.levels[0].places(POSE[2:])), default=None)


def test_a_place_where_nothing_moved_counts_a_third_of_one_where_all_did():
    """So one where three tenths moved counts 8 fifteenths."""
    assert 0.47 < best_score(0.3) / best_score(1.0) < 0.6


def test_an_edge_twice_as_steep_as_usual_shows_by_half_and_a_faint_one_hardly():
    for steepness, shown in ((0.5, 0.2), (2.0, 0.5), (18.0, 0.9)):
        slopes = np.zeros((200, 200, 2), np.float32)
        slopes[..., 0] = 3.0 * steepness
        view = Rectified(POSE[:2] - 1.0, 0.01, slopes, usual=3.0)
        edges = edges_shown(BOX, [view], np.array([[*POSE[:2], 0.0]]))[0]
        assert edges == pytest.approx([0.0, shown, 0.0, shown], abs=0.05)
        assert view.shown(np.float32(0.0), np.float32(1.0)) == pytest.approx(shown, abs=0.05)


def test_a_gap_of_a_twentieth_of_an_edge_is_seen_wherever_it_is():
    low, pose = POSE[:2] - 1.0, np.array([[*POSE[:2], 0.0]])
    for at in np.linspace(-0.55, 0.55, 45):
        slopes = np.zeros((400, 400, 2), np.float32)
        slopes[..., 1] = np.where(np.abs(low[0] + 0.005 * np.arange(400) - POSE[0] - at) < 0.03, 0.0, 1e3)
        assert edges_shown(BOX, [Rectified(low, 0.005, slopes, 1.0)], pose)[0, 0] < 0.98


@pytest.mark.parametrize("cell_px", [1, 2, 4])
@pytest.mark.parametrize(("beside_cells", "shows"), [(1.0, True), (2.0, True), (3.0, False), (4.0, False)])
def test_a_sharp_edge_shows_two_cells_beside_it_and_not_at_three(cell_px, beside_cells, shows):
    """So headings and places may be tried two cells apart."""
    cell_m = cell_px * CELL_M
    low, size = POSE[:2] - 1.0, np.full(2, round(2 / cell_m), np.int64)
    view = Rectified.of(BOX, (LUMA, np.zeros(3)), low, size, cell_m, usual=1.0)
    aside = compose(POSE, np.array([beside_cells * cell_m, 0.0, 0.0]))
    left_and_right = edges_shown(BOX, [view], aside[None])[0, [1, 3]]
    assert (left_and_right.mean() > 0.45) == shows


def test_an_outline_of_which_a_long_edge_is_hidden_scores_half():
    """As if something of the body's grey lay over that edge."""
    beside = np.array([[-0.6, -0.35], [0.6, -0.35], [0.6, -0.65], [-0.6, -0.65]])
    middle = tuple(np.round(BOX.pixels(np.zeros((1, 2)), POSE)[0]).astype(int)[::-1])
    hidden = cv2.fillPoly(LUMA.copy(), [np.round(BOX.pixels(beside, POSE)).astype(np.int32)], int(LUMA[middle]))
    scores = []
    for luma in (hidden, LUMA):
        search = OutlineSearch(BOX, [(luma, np.zeros(3))], POSE[:2] - 0.1, POSE[:2] + 0.1)
        scores.append(float(search._scores(search._rectified(POSE, CELL_M), POSE[None])[0]))
    assert 0.465 < scores[0] / scores[1] < 0.515


@pytest.mark.parametrize(("share", "counts"), [(0.11, False), (0.22, True)])
def test_a_place_counts_where_a_sixth_of_a_top_moved(share, counts):
    assert (best_score(share) is not None) == counts


def test_an_outline_is_searched_in_cells_of_a_fortieth_of_it_and_coarser_ones_where_spots_blur_away():
    search = OutlineSearch(BOX, [(LUMA, np.zeros(3))], POSE[:2] - 0.1, POSE[:2] + 0.1)
    fine, coarse = (1.2 / level.cell_m for level in search.levels)
    assert 30 < fine < 55
    assert 12 < coarse < 22


def test_a_wide_floor_is_searched_in_some_five_hundred_cells():
    small = target(0.05, 0.04)
    search = OutlineSearch(small, [(LUMA, np.zeros(3))], POSE[:2] - 8.0, POSE[:2] + 8.0)
    assert 350 < search.levels[0].size.max() < 700


def test_no_place_that_is_tried_leaves_the_picture_around_it(monkeypatch):
    """The body goes as far as it can along x, to which it turns a corner."""
    search = OutlineSearch(BOX, [(LUMA, np.zeros(3))], POSE[:2] - 0.1, POSE[:2] + 0.1)
    left_m = []

    def scores(views, poses):
        view, corners = views[0], np.concatenate([transform(pose, CORNERS) for pose in poses])
        high = view.low + view.cell_m * (np.array(view.slopes.shape[1::-1]) - 1)
        left_m.append(min((corners - view.low).min(), (high - corners).min()) / view.cell_m)
        return poses[:, 0]

    monkeypatch.setattr(search, "_scores", scores)
    search.sharpened(np.array([*POSE[:2], -np.arctan2(CORNERS[1, 1], CORNERS[1, 0])]), 0.03)
    assert min(left_m) > 1.0

"""Planar geometry: closed forms, inverses, and invariance under motions of the frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from towval.model import geometry
from towval.model.errors import InputError

finite = st.floats(-10, 10)
poses = st.tuples(finite, finite, st.floats(-20, 20)).map(np.array)

L_SHAPE = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [0, 2]], dtype=float)


@given(st.floats(-100, 100))
def test_wrapped_is_the_same_direction_in_half_open_turn(angle):
    wrapped = float(geometry.wrapped(angle))
    assert -np.pi < wrapped <= np.pi
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-9)
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-9)


@given(poses, poses)
def test_composing_with_the_inverse_gives_the_other_pose_back(first, second):
    np.testing.assert_allclose(
        geometry.compose(geometry.inverse(first), geometry.compose(first, second)), second, atol=1e-9
    )


@given(poses, poses)
def test_transforming_twice_is_transforming_by_the_composition(first, second):
    points = np.array([[0.3, -0.2], [1.0, 2.0]])
    twice = geometry.transform(first, geometry.transform(second, points))
    np.testing.assert_allclose(geometry.transform(geometry.compose(first, second), points), twice, atol=1e-9)
    np.testing.assert_allclose(geometry.inverse_transform(first, geometry.transform(first, points)), points, atol=1e-9)


@given(poses)
def test_rigid_fit_recovers_the_motion(pose):
    source = np.array([[0, 0], [1, 0], [0.3, 0.8], [-0.4, 0.2]])
    fitted = geometry.rigid_fit(source, geometry.transform(pose, source), weights=[1, 2, 0.5, 1])
    np.testing.assert_allclose(fitted[:2], pose[:2], atol=1e-9)
    assert float(geometry.wrapped(fitted[2] - pose[2])) == pytest.approx(0, abs=1e-9)


def test_rigid_fit_gives_outliers_their_weight():
    source = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    target = source + np.array([2.0, 3.0])
    target[3] += 50
    np.testing.assert_allclose(geometry.rigid_fit(source, target, weights=[1, 1, 1, 0]), [2, 3, 0], atol=1e-12)


@pytest.mark.parametrize("weights", [[-1, 1, 1, 1], [0, 0, 0, 0], [1, 1, 1]])
def test_rigid_fit_refuses_weights_of_which_nothing_or_less_is_left(weights):
    with pytest.raises(InputError, match=r"the weights do not match(.|\n)*4 of zero or more, one above"):
        geometry.rigid_fit(np.eye(4)[:, :2], np.eye(4)[:, 2:], weights)


def test_a_path_of_no_points_has_no_lengths():
    assert [len(geometry.arc_lengths(np.zeros((n, 2)))) for n in (0, 1, 2)] == [0, 1, 2]


@pytest.mark.parametrize("sense", [1, -1])
def test_moments_of_an_l_shape(sense):
    """Two rectangles: 3 × 1 with its centre at (1.5, 0.5), 1 × 1 at (0.5, 1.5)."""
    polygon = L_SHAPE[::sense]
    assert geometry.polygon_area(polygon) == pytest.approx(4.0 * sense)
    centroid = (3 * np.array([1.5, 0.5]) + np.array([0.5, 1.5])) / 4
    np.testing.assert_allclose(geometry.polygon_centroid(polygon), centroid)
    polar = (
        3 * (9 + 1) / 12
        + 3 * np.sum((centroid - [1.5, 0.5]) ** 2)
        + (1 + 1) / 12
        + np.sum((centroid - [0.5, 1.5]) ** 2)
    )
    assert geometry.polygon_second_moment(polygon, centroid) == pytest.approx(polar * sense)


def test_inside_follows_the_even_odd_rule():
    points = np.array([[0.5, 1.5], [2.0, 1.5], [2.9, 0.5], [-0.1, 0.5]])
    np.testing.assert_array_equal(geometry.inside_polygon(L_SHAPE, points), [True, False, True, False])


def test_velocity_at_is_the_rate_of_a_point_of_a_moving_body():
    pose, twist, point, step = np.array([0.3, -0.2, 0.7]), np.array([0.1, 0.2, -0.5]), np.array([0.4, 0.1]), 1e-6
    moved = [geometry.transform(pose + sign * step * twist, point) for sign in (1, -1)]
    lever = geometry.transform(pose, point) - pose[:2]
    np.testing.assert_allclose(geometry.velocity_at(twist, lever), (moved[0] - moved[1]) / (2 * step), atol=1e-9)


def test_arc_lengths_begin_at_zero_and_add_up_to_the_length_of_the_path():
    path = np.array([[0, 0], [3, 4], [3, 4], [3, 5]], dtype=float)
    np.testing.assert_allclose(geometry.arc_lengths(path), [0, 5, 5, 6], rtol=1e-15)
    assert geometry.arc_lengths(path)[-1] == geometry.path_length(path)
    assert geometry.arc_lengths([[0, 0, 0], [1, 2, 2]]).tolist() == [0, 3]


def test_path_length_leaves_missing_points_out():
    path = np.array([[0, 0], [3, 4], [np.nan, np.nan], [3, 4], [3, 5]], dtype=float)
    assert geometry.path_length(path) == pytest.approx(6.0)


def ramp(n=240):
    return np.linspace(0, 1, n)[:, None] * np.array([0.02, -0.01, 0.05])


def test_a_constant_error_has_no_changes():
    signature = geometry.error_signature(np.tile([0.01, 0.02, 0.03], (240, 1)))
    entries = geometry.signature_entries()
    assert len(signature) == len(entries)
    for entry, value in zip(entries, signature, strict=True):
        expected = [0.01, 0.02, 0.03] if entry.first == entry.last else [0, 0, 0]
        np.testing.assert_allclose(value, expected, atol=1e-15)


def test_changes_of_a_ramp_grow_with_their_lag():
    entries, signature = geometry.signature_entries(), geometry.error_signature(ramp())
    for entry, value in zip(entries, signature, strict=True):
        if entry.first != entry.last:
            np.testing.assert_allclose(value[0], 0.02 * 10 * (entry.last - entry.first) / 239, rtol=1e-9)


def test_missing_errors_leave_their_block_out_and_nothing_else():
    error = ramp()
    error[30:70] = np.nan
    signature = geometry.error_signature(error)
    missing = {i for i, rows in enumerate(geometry.signature_blocks(240)) if np.isnan(error[rows]).all()}
    for entry, value in zip(geometry.signature_entries(), signature, strict=True):
        assert np.isnan(value[0]) == bool(missing & {entry.first, entry.last})


def test_a_normalised_signature_does_not_depend_on_the_floor_frame():
    rng = np.random.default_rng(3)
    samples = rng.normal(size=(400, 240, 3)).cumsum(axis=1) * [1e-3, 3e-4, 1e-3]
    turn = np.eye(3)
    turn[:2, :2] = geometry.rotation(0.8)

    def peak(errors):
        signature = geometry.error_signature(errors)
        covariance = np.einsum("kmi,kmj->mij", signature, signature) / len(signature)
        return geometry.normalised_signature(signature, covariance).max(axis=(1, 2))

    np.testing.assert_allclose(peak(samples @ turn.T), peak(samples), rtol=1e-9)


@pytest.mark.parametrize("turns", range(-1, 5))
def test_pixels_of_a_turned_picture_are_where_numpy_turns_them(turns):
    picture = np.arange(12).reshape(3, 4)
    turned = np.rot90(picture, turns)
    for v, u in np.ndindex(picture.shape):
        x, y = geometry.turned_pixels([u, v], (4, 3), turns)
        assert turned[int(y), int(x)] == picture[v, u]

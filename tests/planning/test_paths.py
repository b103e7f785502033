"""Curves: closed forms of length and shape, arc-length parametrisation, moving average, refusals."""

import numpy as np
import pytest

from towval.model.errors import InputError
from towval.model.geometry import path_length
from towval.planning import paths
from towval.planning.planner import heading_over_hinge, tightest_radius

CURVES = [
    paths.line(1.4),
    paths.circle(1.0),
    paths.lemniscate(2.0),
    paths.rounded_square(4.0, 0.5),
    paths.through_points([[0, 0], [1, 0.2], [2, -0.3], [2.5, 1.0]]),
]


def on(curve, s):
    return curve.position_at(np.asarray(s, dtype=float))


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_every_curve_is_parametrised_by_its_arc_length(curve):
    s = np.linspace(0, curve.length, 20_001)
    chords = np.linalg.norm(np.diff(on(curve, s), axis=0), axis=1)
    # A chord falls short of its arc by (step/radius)²/24: 3e-7 at the tightest place here.
    assert chords == pytest.approx(curve.length / 20_000, rel=1e-6)


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_closed_curves_end_where_they_begin(curve):
    gap = np.linalg.norm(np.subtract(*on(curve, [0.0, curve.length])))
    assert (gap < 1e-12) == (curve.name in ("circle", "lemniscate", "rounded_square"))


def test_lengths_are_those_of_the_closed_forms():
    assert paths.circle(1.0).length == pytest.approx(2 * np.pi)
    assert paths.rounded_square(4.0, 0.5).length == pytest.approx(12 + np.pi)
    # Bernoulli's lemniscate: a Γ(1/4)² / √(2π), five digits from any table.
    assert paths.lemniscate(2.0).length == pytest.approx(5.24411510858424, rel=1e-14)


def test_lemniscate_satisfies_its_own_equation():
    x, y = on(paths.lemniscate(2.0), np.linspace(0, 5.2, 501)).T
    np.testing.assert_allclose((x**2 + y**2) ** 2, x**2 - y**2, atol=1e-14)


def test_rounded_square_stays_in_its_square_and_touches_each_side():
    points = on(paths.rounded_square(4.0, 0.5), np.linspace(0, 12 + np.pi, 40_001))
    np.testing.assert_allclose(points.min(axis=0), [-2, -2], atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), [2, 2], atol=1e-12)


def test_the_curve_through_two_points_is_the_line_between_them():
    """A file of two points was refused, and the refusal of one with a single point said that two are enough."""
    curve = paths.through_points([[0.0, 1.0], [3.0, 5.0]])
    assert curve.length == pytest.approx(5.0, abs=1e-12)
    np.testing.assert_allclose(curve.position_at(np.array([0.0, 2.5, 5.0])), [[0, 1], [1.5, 3], [3, 5]], atol=1e-12)


def test_spline_through_points_of_a_circle_is_that_circle():
    angle = np.linspace(0, 2 * np.pi, 201)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points[-1] = points[0]
    curve = paths.through_points(points)
    assert curve.length == pytest.approx(2 * np.pi, rel=1e-7)
    assert np.linalg.norm(on(curve, np.linspace(0, curve.length, 999)), axis=1) == pytest.approx(1.0, rel=1e-7)


def test_timed_path_moves_at_the_speed_asked_for():
    path = paths.timed(paths.circle(1.0), 0.1, mean_speed=0.01)
    assert path.time_s[-1] == pytest.approx(2 * np.pi / 0.01, abs=0.05)
    assert path_length(path.position) / path.time_s[-1] == pytest.approx(0.01, rel=1e-4)


def test_the_papers_path_has_60000_steps():
    assert len(paths.timed(paths.lemniscate(2.0), 0.01, duration=600.0).time_s) == 60_001


def test_moving_average_keeps_a_straight_line_and_the_ends():
    ramp = np.linspace(1.0, 5.0, 101)
    np.testing.assert_allclose(paths.moving_average(ramp, 20), ramp, atol=1e-13)
    step = np.where(np.arange(101) < 50, 0.0, 1.0)
    smooth = paths.moving_average(step, 10)
    assert smooth[0] == 0.0
    assert smooth[-1] == 1.0
    np.testing.assert_allclose(np.diff(smooth[40:60]), 1 / 21, atol=1e-14)


def test_deviation_of_a_shifted_circle_is_known():
    angle = np.linspace(0, 2 * np.pi, 5001)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # A circle 1.1 times as large is 0.1 away everywhere; timing and direction do not matter.
    assert paths.deviation_rms(1.1 * unit[::-1], unit) == pytest.approx(0.1, rel=1e-5)


def test_deviation_counts_what_was_left_out():
    nominal = np.stack([np.linspace(0, 1, 1001), np.zeros(1001)], axis=1)
    assert paths.deviation_rms(nominal[:501], nominal) == pytest.approx(np.sqrt(0.5**3 / 3), rel=1e-2)
    assert paths.deviation_rms(nominal, nominal[:501]) == pytest.approx(np.sqrt(0.5**3 / 3), rel=1e-2)


def test_distance_is_from_the_segments_and_not_from_the_corners():
    polyline = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    np.testing.assert_allclose(
        paths.distance_to_polyline([[0.4, 0.2], [1.3, 0.6], [2.0, -1.0]], polyline), [0.2, 0.3, np.sqrt(2)]
    )


def test_a_pause_keeps_the_heading_and_bends_nothing():
    along = np.concatenate([np.zeros(5), np.linspace(0, 1, 21), np.ones(5), np.linspace(1, 2, 21)])
    rounding = 1e-15 * np.random.default_rng(1).standard_normal((len(along), 2))
    for turn in (0.0, 0.7, 3.0):
        position = np.outer(along, [np.cos(turn), np.sin(turn)]) + rounding
        assert paths.path_heading(position) == pytest.approx(turn, abs=1e-9)
        assert tightest_radius(position) > 1e6


@pytest.mark.parametrize(
    "build",
    [
        lambda: paths.line(0.0),
        lambda: paths.circle(-1.0),
        lambda: paths.rounded_square(4.0, 2.5),
        lambda: paths.through_points([[1, 1]]),
        lambda: paths.through_points([[0, 0], [0, 0], [1, 1]]),
        lambda: paths.through_points([[0, 0], [0.6, 0.8], [0, 0]]),
        lambda: paths.through_points([[0, 0], [0, 1], [0, 0.1], [0, -1]]),
        lambda: paths.timed(paths.circle(1.0), 0.1),
        lambda: paths.timed(paths.circle(1.0), 0.1, mean_speed=1.0, duration=1.0),
        lambda: paths.timed(paths.circle(1.0), 0.0, duration=1.0),
        lambda: paths.moving_average([1.0, 2.0], -1),
        lambda: paths.moving_average([1.0, 2.0], 0.5),
        lambda: paths.moving_average([[1.0, 2.0], [3.0, 4.0]], 1),
        lambda: paths.line("1.4"),
        lambda: paths.line(1.4, np.nan),
        lambda: paths.rounded_square(4.0, "1"),
        lambda: paths.path_heading([[0.0, 0.0]]),
        lambda: paths.path_heading([[0.0, 0.0], [np.nan, 0.0]]),
        lambda: paths.path_heading(np.zeros((3, 3))),
        lambda: paths.distance_to_polyline([0.0, 1.0], [[0.0, 0.0], [1.0, 0.0]]),
        lambda: paths.distance_to_polyline([[0.0, 1.0]], np.empty((0, 2))),
        lambda: paths.deviation_rms([[0.0, np.nan]], [[0.0, 0.0], [1.0, 0.0]]),
        lambda: paths.deviation_rms(np.empty((0, 2)), [[0.0, 0.0], [1.0, 0.0]]),
        lambda: tightest_radius([[0.0, 0.0], [1.0, np.nan], [2.0, 0.0]]),
        lambda: heading_over_hinge([[0.0, 0.0], [1.0, 0.0]], np.nan),
    ],
)
def test_impossible_wishes_are_refused(build):
    with pytest.raises(InputError):
        build()

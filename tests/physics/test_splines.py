import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from towval.model import TimedPath
from towval.model.errors import InputError
from towval.physics.splines import hermite_spline, spline_through, spline_values

AT_REST = (1, np.zeros(2))


def wavy(t):
    return np.column_stack([0.05 * t, 0.1 * np.sin(t)])


@pytest.mark.parametrize("n", [3, 4, 5, 9, 40])
def test_a_path_without_a_pause_is_scipys_spline(n):
    rng = np.random.default_rng(n)
    time = np.cumsum(rng.uniform(0.7, 1.3, n))
    path = wavy(time)
    expected = CubicSpline(time, path, bc_type="not-a-knot" if n > 3 else "natural")
    dense = np.linspace(time[0], time[-1], 301)
    value, rate = spline_values(spline_through(TimedPath(time, path)), dense)
    assert value == pytest.approx(expected(dense), abs=1e-14)
    assert rate == pytest.approx(expected(dense, 1), abs=1e-13)


@pytest.mark.parametrize("before", [2, 3, 4, 7])
@pytest.mark.parametrize("after", [2, 3, 4, 7])
def test_a_path_with_a_pause_is_two_splines_clamped_to_rest(before, after):
    driven = np.arange(before + after - 1.0)
    time = np.r_[driven[:before], driven[before - 1 :] + 20]
    path = np.vstack([wavy(driven[:before]), wavy(driven[before - 1 :])])
    spline = spline_through(TimedPath(time, path))

    def clamped(part, at_rest):
        free = "not-a-knot" if len(time[part]) > 3 else (2, np.zeros(2))
        return CubicSpline(time[part], path[part], bc_type=tuple(AT_REST if rest else free for rest in at_rest))

    for part, at_rest in ((slice(before), (False, True)), (slice(before, None), (True, False))):
        dense = np.linspace(*time[part][[0, -1]], 99)
        assert spline_values(spline, dense)[0] == pytest.approx(clamped(part, at_rest)(dense), abs=1e-14)
    place, speed = spline_values(spline, np.linspace(before - 1, before + 19, 50)[1:-1])
    assert place == pytest.approx(np.tile(path[before], (48, 1)), abs=1e-15)
    assert (speed == 0).all()


def test_a_pause_whose_ends_do_not_quite_coincide_does_not_swing():
    time = np.r_[np.arange(5.0), np.arange(5.0) + 64]
    along = 0.05 * np.r_[np.arange(5.0), np.arange(5.0) + 4]
    along[5:] += 0.0005  # the noise of a measured place
    dense = np.linspace(4, 64, 200)
    place, _ = spline_values(spline_through(TimedPath(time, np.column_stack([along, 0 * along]))), dense)
    assert (place[:, 0] >= along[4]).all()
    assert (place[:, 0] <= along[5] + 1e-15).all()


def test_a_turning_point_is_no_pause():
    """Samples may lie evenly about it; its error is that of a smooth curve, of fourth order."""
    errors = []
    for n in (20, 40):
        time = np.linspace(0, 2 * np.pi, n + 2)  # two samples beside π coincide
        path = np.column_stack([np.cos(time), 0 * time])
        dense = np.linspace(2, 4, 300)
        value, _ = spline_values(spline_through(TimedPath(time, path)), dense)
        errors.append(np.abs(value[:, 0] - np.cos(dense)).max())
    assert errors[0] / errors[1] > 10


def test_a_path_that_would_swing_between_its_points_is_refused():
    # For 100 s at a seventh of the speed before and after: neither a pause nor enough to tell how it slows down.
    time = np.array([0.0, 1.0, 2.0, 102.0, 103.0, 104.0])
    along = np.array([0.0, 1.0, 2.0, 17.0, 18.0, 19.0])
    path = np.column_stack([along, 0 * along])
    with pytest.raises(InputError, match="too few points"):
        spline_through(TimedPath(time, path))


def test_a_path_that_is_no_number_is_refused():
    position = np.array([[0.0, 0.0], [1.0, 0.0], [np.nan, 0.0]])
    with pytest.raises(InputError, match="not finite from 1 s on"):
        hermite_spline(np.arange(3.0), position, np.zeros((3, 2)))


def test_a_path_at_rest_stays():
    spline = spline_through(TimedPath([0.0, 1.0, 2.0], np.tile([0.3, -0.1], (3, 1))))
    assert spline_values(spline, np.linspace(0, 2, 9))[0] == pytest.approx(np.tile([0.3, -0.1], (9, 1)))


def test_noise_about_one_place_is_a_pause_and_does_not_swing():
    """Two measured points shortly after one another fix a velocity of noise, which a long rest must not carry on."""
    rng = np.random.default_rng(3)
    rest = np.array([0.0, 2.9, 3.0, 3.04])
    moving = 3.04 + np.arange(1, 8) * 0.4
    position = np.zeros((len(rest) + len(moving), 2))
    position[len(rest) :, 0] = 0.03 * np.arange(1, 8)
    position += rng.normal(size=position.shape) * 1e-4
    path = TimedPath(np.concatenate([rest, moving]), position)
    at_rest = spline_values(spline_through(path), np.linspace(0, 3.0, 200))[0]
    assert np.abs(at_rest).max() < 1e-3


@pytest.mark.parametrize("apart", [0.2, 0.1, 0.02])
def test_a_pause_in_a_bend_turns_the_direction_by_as_much_as_documented(apart):
    """A cubic of time that comes to rest cannot bend there (docs/planning.md)."""
    radius, way = 2.0, np.arange(round(1.0 / apart) + 1) * apart
    angle, time_s = np.r_[way, way + way[-1]] / radius, np.r_[way, way + way[-1] + 0.5] / 0.05
    path = TimedPath(time_s, radius * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=1))
    _, velocity = spline_values(spline_through(path), np.array([time_s[len(way) - 1] - 1e-4, time_s[len(way)] + 1e-4]))
    off = np.arctan2(velocity[:, 1], velocity[:, 0]) - way[-1] / radius
    np.testing.assert_allclose(off, np.array([-1, 1]) * apart / radius / math.sqrt(12), rtol=0.01)

"""Invented pictures: of two bodies on smooth paths only every so-many-th picture is real, the others lie between."""

from dataclasses import replace

import numpy as np
import pytest

from tests.tracking.test_stamps import EVEN, filmed
from towval.tracking.invented import check_invented


def _true_and_shown(every, seed, noise_m=1e-4):
    """Tracks of an oscillating tow as it was, and with straight lines between every so-many-th picture."""
    true = filmed(EVEN, EVEN, bumps=0.05, seed=seed, noise_m=noise_m)
    index = np.arange(len(EVEN))
    last = index[-1] // every * every
    real = np.minimum(index // every * every, last - every)
    share = ((index - real) / every)[:, None]
    shown = {
        name: replace(one, pose=(1 - share) * one.pose[real] + share * one.pose[real + every])
        for name, one in true.items()
    }
    return true, shown


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("every", [3, 4, 8])
def test_invented_pictures_are_named_and_as_uncertain_as_they_are_off(every, seed):
    true, shown = _true_and_shown(every, seed)
    tracks, (found,) = check_invented(shown)
    assert found.code == "pictures_invented"
    assert f"over {every} pictures at a time" in found.text
    for name, track in tracks.items():
        std = np.sqrt(np.linalg.eigvalsh(track.covariance[:, :2, :2])[:, -1])
        off = np.linalg.norm((track.pose - true[name].pose)[:, :2], axis=1)
        inner = slice(every, -every)
        assert (off[inner] < 3 * std[inner] + 5e-4).all()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("noise_m", [2e-5, 1e-4, 4e-4])
def test_pictures_that_are_all_real_are_not_named(noise_m, seed):
    tracks, findings = check_invented(_true_and_shown(4, seed, noise_m)[0])
    assert findings == ()
    assert all(np.allclose(one.covariance, one.covariance[0]) for one in tracks.values())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("left_out", ["every fourth", "at random"])
def test_pictures_that_the_stamps_leave_out_are_no_rhythm(left_out, seed):
    """Steps over two intervals of time are twice as long, and no bend."""
    index = np.arange(len(EVEN))
    kept = index % 4 < 3 if left_out == "every fourth" else np.random.default_rng(seed).random(len(EVEN)) < 0.7
    filmed_at = EVEN[kept]
    assert check_invented(filmed(filmed_at, filmed_at, bumps=0.05, seed=seed))[1] == ()


def test_one_body_that_bends_in_a_rhythm_is_not_enough():
    true, shown = _true_and_shown(4, 0)
    assert check_invented({"rover": shown["rover"], "object": true["object"]})[1] == ()


@pytest.mark.parametrize("name", ["shown", "true"])
def test_a_body_that_goes_straight_has_no_say(name):
    """Its bends are noise, invented or real; the other body tells alone."""
    given = dict(zip(("true", "shown"), _true_and_shown(4, 0, 2e-5), strict=True))[name]
    rng, rover = np.random.default_rng(3), given["rover"]
    straight = np.linspace(rover.pose[0], rover.pose[-1], len(rover.pose)) + 2e-5 * rng.standard_normal((len(EVEN), 3))
    _, findings = check_invented(given | {"rover": replace(rover, pose=straight)})
    assert [one.code for one in findings] == (["pictures_invented"] if name == "shown" else [])


@pytest.mark.parametrize(("rhythm", "named"), [(2.0, False), (3.5, True)])
def test_a_rhythm_tells_where_more_noise_is_stated_than_shows(rhythm, named):
    """Stated deviations hold what wanders slowly, too."""
    rover = _bending(rhythm)
    assert bool(check_invented({"rover": replace(rover, covariance=1e6 * rover.covariance)})[1]) == named


@pytest.mark.parametrize("name", ["true", "shown"])
def test_a_body_that_moves_in_few_pictures_objects_where_it_bends_between(name):
    """The object starts late, and moves in seven pictures of each of twelve kinds, as it did or as shown."""
    true, shown = _true_and_shown(12, 0, 2e-5)
    towed = {"true": true, "shown": shown}[name]["object"]
    pose = towed.pose.copy()
    pose[:-85] = pose[-85] + 2e-5 * np.random.default_rng(4).standard_normal((len(EVEN) - 85, 3))
    tracks, findings = check_invented(shown | {"object": replace(towed, pose=pose)})
    assert [one.code for one in findings] == (["pictures_invented"] if name == "shown" else [])
    assert (tracks["object"].covariance[-10, 0, 0] > 1e-6) == (name == "shown")


@pytest.mark.parametrize(("rhythm", "named"), [(2.0, False), (4.5, True)])
def test_bends_that_are_three_times_those_between_make_a_rhythm(rhythm, named):
    assert bool(check_invented({"rover": _bending(rhythm)})[1]) == named


def _bending(rhythm):
    """A rover on a path whose every fourth bend is so many times as large as the others."""
    rover, n = _true_and_shown(4, 0)[0]["rover"], len(EVEN)
    sizes = 2e-3 * np.where(np.arange(n) % 4, 1.0, rhythm)
    pose = np.linspace([0.0, 0.0, 0.0], [0.02 * n, 0.0, 0.0], n)
    pose[:, 1] = np.cumsum(np.cumsum(sizes * np.tile([1.0, -1.0, -1.0, 1.0, 1.0], n)[:n]))
    return replace(rover, pose=pose)


def test_a_body_that_bends_at_other_pictures_objects():
    """The rover shows a rhythm; the object bends at the pictures between, where nothing was invented."""
    _, shown = _true_and_shown(4, 0, 2e-5)
    other = replace(shown["object"], pose=np.roll(shown["object"].pose, 2, axis=0))
    assert check_invented(shown | {"object": other})[1] == ()


@pytest.mark.parametrize(("turns", "named"), [(6, False), (12, True)])
def test_a_rhythm_is_told_from_eight_real_pictures_on(turns, named):
    """A zigzag with a turn at every fourth picture."""
    n = 4 * turns + 2
    steps = np.where(np.arange(n) // 4 % 2, 1e-3, -1e-3)
    pose = np.column_stack([5e-3 * np.arange(n), np.cumsum(steps), np.zeros(n)])
    rover = filmed(EVEN[:n], EVEN[:n])["rover"]
    assert bool(check_invented({"rover": replace(rover, pose=pose)})[1]) == named


@pytest.mark.parametrize(("speed", "named"), [(0.2, True), (0.45, False)])
def test_a_body_that_creeps_at_less_than_a_third_of_its_speed_has_no_say(speed, named):
    """It turns at real pictures only where it is fast, and shakes in all of them where it creeps, most of the time."""
    rover, n = _true_and_shown(4, 0)[0]["rover"], len(EVEN)
    creeps = np.arange(n) < 0.6 * n
    along = np.where(creeps, 5e-3 * speed, 5e-3)
    turns = np.where(np.arange(n) // 4 % 2, 5e-4, -5e-4)
    shakes = 5e-4 * np.where(np.arange(n) % 2, 1.0, -1.0)
    pose = np.column_stack([np.cumsum(along), np.cumsum(np.where(creeps, shakes, turns)), np.zeros(n)])
    assert bool(check_invented({"rover": replace(rover, pose=pose)})[1]) == named

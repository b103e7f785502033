"""Repeated runs: closed forms of mean and scatter over the path, coverage of the common error, what is refused."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import t

from report_scenes import towed_run
from towval.model import Severity, Track, TrackStatus
from towval.model.errors import InputError
from towval.validation.repeats import corridor, corridor_finding


def run(name, error, speed=0.1, rest_s=0.0, seen=True):
    """A straight drive of two metres along x with errors along and across as a function of the length (2,)."""
    time_s = np.linspace(0.0, 2.0 / speed + rest_s, 1001)
    length = np.clip(speed * np.where(time_s < 5, time_s, np.maximum(time_s - rest_s, 5)), 0.0, 2.0)
    n, status = len(length), TrackStatus.TRACKED if seen else TrackStatus.LOST
    covariance = np.tile(1e-8 * np.eye(3), (n, 1, 1)) if seen else np.full((n, 3, 3), np.nan)
    pose = np.column_stack([length, np.zeros((n, 2))]) if seen else np.full((n, 3), np.nan)
    ones = np.ones(n) if seen else np.full(n, np.nan)
    track = Track("object", time_s, pose, covariance, np.full(n, status, np.uint8), ones, ones, 1e-8 * np.eye(3))
    off = np.array([error(each) for each in length])
    comparison = towed_run().comparison
    return track, dataclasses.replace(
        comparison, run=name, time_s=time_s, error=np.column_stack([off, 0 * length]), along_across=off,
        ratio=np.zeros(len(time_s)), u_val_m=0.001,
    )  # fmt: skip


def test_mean_scatter_and_interval_are_those_of_student():
    by = {"a": 0.001, "b": 0.002, "c": 0.006}
    found = corridor([run(name, lambda s, off=off: (off, np.sin(s) * 1e-3)) for name, off in by.items()])
    assert found.runs == ("a", "b", "c")
    assert found.length_m[-1] == pytest.approx(2.0, abs=0.02)
    np.testing.assert_allclose(found.mean[:, 0], 0.003, atol=1e-12)
    np.testing.assert_allclose(found.std[:, 0], np.std([0.001, 0.002, 0.006], ddof=1), atol=1e-12)
    half = t.ppf(0.975, 2) * np.std([0.001, 0.002, 0.006], ddof=1) / np.sqrt(3)
    np.testing.assert_allclose(found.half_width[:, 0], half, atol=1e-12)
    # What all runs have in common does not scatter; the path is read in steps of a centimetre.
    np.testing.assert_allclose(found.mean[:, 1], 1e-3 * np.sin(found.length_m), atol=1.1e-5)
    assert found.std[:, 1].max() < 1e-12
    assert found.scatter_m == pytest.approx(np.std([0.001, 0.002, 0.006], ddof=1))


def test_runs_are_compared_at_places_not_at_times():
    def error(s):
        return 0.001 * s, -0.002 * s

    found = corridor([run("a", error), run("b", error, speed=0.16), run("c", error, rest_s=4.0)])
    assert found.scatter_m < 3e-5  # steps of a centimetre times 2 mm a metre
    np.testing.assert_allclose(found.mean[:, 1], -0.002 * found.length_m, atol=3e-5)
    assert found.apart_m < 0.02


def test_the_interval_holds_the_common_error_as_often_as_it_says():
    rng, held = np.random.default_rng(5), []
    for _ in range(150):
        drawn = rng.normal(0.002, 0.001, (3, 2))
        group = [run(str(i), lambda _, off=off: off) for i, off in enumerate(drawn)]
        found = corridor(group)
        held += [*(np.abs(found.mean[200] - 0.002) <= found.half_width[200])]
    assert np.mean(held) == pytest.approx(0.95, abs=0.04)  # three deviations of 300 trials


def test_scatter_is_no_error_in_common():
    """The mean of two runs that only scatter is off by 0.7 of that, which was called common to both."""
    rng, squares = np.random.default_rng(6), []
    for _ in range(150):
        drawn = rng.normal([0.003, 0.0], 0.001, (2, 2))
        squares.append(corridor([run(str(i), lambda _, off=off: off) for i, off in enumerate(drawn)]).common_m ** 2)
    assert np.mean(squares) == pytest.approx(0.003**2, rel=0.1)  # 1.11 with what the scatter leaves in the mean


@pytest.mark.parametrize(("scatter", "code"), [(0.001, "repeats"), (0.004, "repeats_scatter")])
def test_more_scatter_than_the_deviations_allow_is_a_warning(scatter, code):
    found = corridor([run("a", lambda _: (scatter, 0.0)), run("b", lambda _: (-scatter, 0.0))])
    said = corridor_finding(found)
    assert said.code == code
    assert (said.severity is Severity.WARNING) == (code == "repeats_scatter")
    assert f"{1e3 * np.sqrt(2) * scatter:.1f} mm" in said.text
    assert "u_val" not in said.text


def test_drives_that_differ_are_no_repeats():
    track, comparison = run("b", lambda _: (0.0, 0.0))
    turned = dataclasses.replace(track, pose=track.pose[:, [1, 0, 2]])
    found = corridor([run("a", lambda _: (0.0, 0.0)), (turned, comparison)])
    assert found.apart_m == pytest.approx(2 * np.sqrt(2), abs=0.03)
    assert corridor_finding(found).code == "repeats_apart"


def test_too_few_runs_and_unseen_ones_are_refused():
    with pytest.raises(InputError, match="repeated runs"):
        corridor([run("a", lambda _: (0.0, 0.0))])
    with pytest.raises(InputError, match="not seen in run b"):
        corridor([run("a", lambda _: (0.0, 0.0)), run("b", lambda _: (0.0, 0.0), seen=False)])

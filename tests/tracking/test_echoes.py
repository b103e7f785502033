"""What pictures keep of those before them."""

import re

import cv2
import numpy as np
import pytest
from driven import MOTION, PICTURES, STEP_S, filmed, tracked
from painted import POSE, texture
from painted import picture as painted_picture
from painted import target as painted_target

from towval.model.geometry import compose
from towval.tracking.echoes import Echoes, _kept, echo_findings, lateness


def sharp(pictures):
    return pictures[::5]


def denoised(kept):
    """Each picture keeps a share of the one before: a recursive filter."""

    def change(pictures):
        seen = [pictures[0]]
        for picture in pictures[5::5]:
            seen.append((1 - kept) * picture + kept * seen[-1])
        return seen

    return change


def through_a_shutter(pictures):
    """The shutter is open from one picture to the next: the longest exposure there is."""
    return [pictures[0], *(np.mean(pictures[i - 2 : i + 3], axis=0) for i in range(5, len(pictures), 5))]


def out_of_focus(pictures):
    return [pictures[0], *(cv2.GaussianBlur(each, (0, 0), 1.5) for each in pictures[5::5])]


@pytest.mark.parametrize("change", [sharp, through_a_shutter, out_of_focus, denoised(0.1)])
def test_what_blurs_in_another_way_is_no_echo(change):
    _, pictures = filmed()
    findings = tracked(change(pictures))["rover"].findings
    assert "pictures_mixed" not in {each.code for each in findings}


def test_a_run_through_noise_reduction_is_named_and_as_uncertain_as_it_is_late():
    _, pictures = filmed()
    found = tracked(denoised(0.5)(pictures))
    (named,) = [each for each in found["rover"].findings if each.code == "pictures_mixed"]
    # The object rests: it is the rover that shows what the camera does.
    assert named in found["object"].findings
    assert 30 < float(re.search(r"keeps (\d+) %", named.text)[1]) < 55
    late_m = 0.25 * STEP_S  # a picture's way
    truth = [MOTION(i * STEP_S)[:2] for i in range(5, PICTURES)]
    error = np.linalg.norm(found["rover"].pose[5:, :2] - truth, axis=1)
    assert 0.1 * late_m < error.max() < late_m
    std = np.sqrt(np.linalg.eigvalsh(found["rover"].covariance[5:, :2, :2])[:, -1])
    assert np.all(error < 3 * std)


def test_lateness_goes_with_the_speed():
    time_s = np.arange(10) * STEP_S
    pose = np.column_stack([0.3 * time_s, np.zeros(10), np.zeros(10)])
    pose[4] = np.nan
    covariance = lateness(time_s, pose, 0.5)
    assert np.sqrt(covariance[[0, 3, 5], 0, 0]) == pytest.approx(0.3 * STEP_S)
    assert not covariance[4].any()
    assert not lateness(time_s, pose, 0.0).any()
    (found,) = echo_findings(time_s, 0.5)
    assert "lag by up to 40 ms" in found.text
    assert echo_findings(time_s, 0.0) == ()


def test_after_ten_pictures_one_in_ten_is_compared():
    own = painted_target()
    luma, along = painted_picture(own), np.array([own.metres_per_pixel(POSE), 0.0, 0.0])
    echoes = Echoes(own, luma, POSE)
    looked = []
    for i in range(1, 51):
        looked += [i] if echoes.is_due(along) else []
    assert looked == [*range(1, 11), 20, 30, 40, 50]


def shown(own, path_px, pictures=1, kept=0.0, **painted):
    """Echoes in pictures of a painted body that moves by so much in each, all of which keep a share of those before."""
    step = np.array([path_px * own.metres_per_pixel(POSE), 0.0, 0.0])
    seen = painted_picture(own, **painted)
    echoes = Echoes(own, seen, POSE)
    for i in range(-3 if kept else 0, pictures):
        pose = compose(POSE, i * step)
        seen = (1 - kept) * painted_picture(own, pose, seed=4 + i, **painted) + kept * seen
        if i >= 0 and echoes.is_due(step):
            echoes.look(np.rint(seen).astype(np.uint8), pose, step)
    return echoes


@pytest.mark.parametrize(("path_px", "compared"), [(0.35, False), (0.8, True)])
def test_a_picture_is_compared_where_the_body_moved_by_half_a_pixel(path_px, compared):
    assert bool(shown(painted_target(), path_px).rows) == compared


@pytest.mark.parametrize(("pictures", "found"), [(6, 0.0), (9, 0.5)])
def test_echoes_are_told_from_eight_pictures_on(pictures, found):
    assert shown(painted_target(), 2.0, pictures, kept=0.5).kept() == pytest.approx(found, abs=0.05)


@pytest.mark.parametrize(("side_px", "compared"), [(14, False), (17, True)])
def test_a_body_that_shows_a_hundred_pixels_off_its_edges_is_compared(side_px, compared):
    pixel_m = painted_target().metres_per_pixel(POSE)
    small = painted_target(side_px * pixel_m, side_px * pixel_m)
    assert bool(shown(small, 0.6).rows) == compared


@pytest.mark.parametrize(("echo", "told"), [(0.14, False), (0.2, True)])
def test_what_a_codec_leaves_of_faint_texture_is_no_echo(echo, told):
    """Pictures that are off by more than half of what their texture shows."""
    information, points = np.array([[400.0, 0.0], [0.0, 1000.0]]), 400.0
    row = [*information.ravel(), *(information @ [0.2, echo]), points]
    assert bool(_kept(np.tile(row, (20, 1)))) == told


@pytest.mark.parametrize(("std", "told"), [(0.0133, True), (0.02, False)])
def test_an_echo_is_beyond_what_is_usual_by_three_deviations_of_its_scatter(std, told):
    """One of 0.12, where 0.07 are usual; twenty pictures that differ as much as leaves that deviation."""
    information = 1000 * np.eye(2)
    vector = information @ [0.2, 0.12]
    rows = [[*information.ravel(), vector[0], vector[1] + sign * 1000 * std * 20**0.5, 0.0] for sign in (-1, 1)]
    assert bool(_kept(np.tile(rows, (10, 1)))) == told


@pytest.mark.parametrize(("kept", "found"), [(0.0, 0.0), (0.6, 0.5)])
@pytest.mark.parametrize("seed", range(3))
def test_noise_is_no_echo_where_it_exceeds_the_fine_texture(seed, kept, found):
    """The first picture's own noise looks like the body's places around: echoes of 0.16 of the picture."""
    faint = {"grey": texture(seed, contrast=5.0, finest_m=0.4), "noise": 2.5}
    assert shown(painted_target(), 2.0, 40, kept, **faint).kept() == pytest.approx(found, abs=0.1)


@pytest.mark.parametrize(("widest_blur_px", "found"), [(0.0, 0.6), (0.9, 0.6), (1.1, 0.0)])
def test_noise_reduction_that_begins_in_mid_run_is_told(widest_blur_px, found):
    """In low light a camera amplifies more, and averages more; a focus that hunts looks like that."""
    own = painted_target()
    run, later = shown(own, 2.0, 60), shown(own, 2.0, 20, kept=0.6)
    run.rows.extend(later.rows)
    assert run.kept(widest_blur_px) == pytest.approx(found, abs=0.08)

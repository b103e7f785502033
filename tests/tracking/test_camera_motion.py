"""The camera's motion: the floor painted from where a moved camera sees it, and pictures warped by OpenCV."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from studies.worlds import challenges
from studies.worlds.scenes import CeilingCamera, ceiling
from tests.tracking.painted import out_of_focus, texture
from tests.tracking.painted_floor import (
    BODY,
    CAMERA,
    FIRST,
    FLOOR,
    POSE,
    floor_picture,
    moved_by,
    noisy_floor,
    seen_through,
    warped,
)
from towval.model.geometry import inverse_transform, transform
from towval.optics.moved_view import parameters_by_motion, pose_sensitivity
from towval.optics.plane_uncertainty import shared_parameters
from towval.optics.projection import project, to_plane
from towval.optics.view_motion import moved_view
from towval.tracking import camera_motion, floor_registration
from towval.tracking.camera_motion import CameraMotion, _separated
from towval.tracking.floor_registration import FloorRegistration, Registered
from towval.tracking.focus import width_px
from towval.tracking.watched_floor import WatchedFloor


@pytest.mark.parametrize(
    "motion",
    [
        [0, 0, 0, 0, 0, 0, 0, 0.4, -0.3],
        [0.004, -0.003, 0.01, 0, 0, 0, 0.0, 0, 0],
        [0, 0, 0, 0.01, -0.01, 0, 0.01, 0, 0],
        [0.02, -0.04, 0.02, 0, 0, 0, 0.01, 0, 0],
    ],
)
def test_a_moved_view_is_found_to_a_twentieth_of_a_pixel(motion):
    true = moved_view(CAMERA, FLOOR, np.array(motion))
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    found = registration.register(floor_picture(*true, seed=1), np.zeros(9), [])
    gap = seen_through(moved_view(CAMERA, FLOOR, found.motion)) - seen_through(true)
    assert np.abs(gap).max() < 0.05
    assert np.abs(gap).max() < 4 * registration.std_px(found.covariance)


@pytest.mark.parametrize(
    ("noise", "contrast", "light"),
    [(2.0, 1.0, 1.0), (2.0, 0.3, 1.0), (3.0, 0.2, 1.0), (2.0, 1.0, 0.3), (2.0, 0.3, 0.5), (2.0, 0.7, 1.3)],
)
def test_a_still_view_scatters_by_what_is_stated_in_any_light_and_on_weak_texture(noise, contrast, light):
    """Two pictures of one floor, each pair with noise of its own; of a weak texture most slopes are noise."""
    plain = 128 + contrast * (floor_picture(noise=0.0).astype(float) - 128)
    pairs = np.array([plain, light * plain]) + noise * np.random.default_rng(7).standard_normal((12, 2, *plain.shape))
    sizes = []
    for first, other in np.clip(np.round(pairs), 0, 255).astype(np.uint8):
        found = FloorRegistration(CAMERA, FLOOR, first, ()).register(other, np.zeros(9), [])
        sizes.append(np.linalg.solve(np.linalg.cholesky(found.covariance), found.motion))
    assert 0.6 < np.sqrt(np.mean(np.square(sizes))) < 1.2


@pytest.mark.parametrize(("finest_m", "radius_px"), [(0.02, 3.0), (0.03, 5.0)])
def test_a_floor_out_of_focus_is_registered_as_well_as_is_stated(finest_m, radius_px):
    """Against the sharp floor the view is four times as far off in the first case, and not found in the second."""
    grey = texture(3, finest_m=finest_m)
    watch, sizes = WatchedFloor(CAMERA, FLOOR, floor_picture(grey=grey), ()), []
    for seed in range(1, 13):
        motion = np.array([0, 0, 0, 0, 0, 0, 0, 0.4 * np.cos(seed), 0.4 * np.sin(seed)])
        sharp = floor_picture(*moved_view(CAMERA, FLOOR, motion), noise=0.0, grey=grey)
        found = watch.register(out_of_focus(sharp, radius_px, np.random.default_rng(seed)), np.zeros(9), [])
        assert found.std_px < 0.12
        sizes.append(np.linalg.solve(np.linalg.cholesky(found.covariance), found.motion - motion))
    # A disc of radius r has a variance of r² / 4 along each axis.
    assert 0.7 < width_px(watch.level) / (radius_px / 2) < 1.8
    assert 0.6 < np.sqrt(np.mean(np.square(sizes))) < 1.3
    assert watch.register(floor_picture(seed=20, grey=grey), np.zeros(9), []).std_px < 0.06
    assert watch.level == 0


@pytest.mark.parametrize(("radius_px", "blur_px"), [(0.0, (0.0, 0.0)), (1.6, (0.7, 1.3))])
def test_a_sharp_floor_is_told_from_one_that_is_slightly_out_of_focus(radius_px, blur_px):
    grey = texture(3, finest_m=0.02)
    watch = WatchedFloor(CAMERA, FLOOR, floor_picture(grey=grey), ())
    for seed in range(1, 4):
        found = watch.register(
            out_of_focus(floor_picture(noise=0.0, grey=grey), radius_px, np.random.default_rng(seed)), np.zeros(9), []
        )
        # Its place is known well enough all the same.
        assert found.std_px < 0.06
        assert watch.level == 0
        assert blur_px[0] <= watch.blur_px() <= blur_px[1]


@pytest.mark.parametrize(("left", "seen_px"), [(0.8, 0.8), (0.95, 0.0)])
def test_a_blur_shows_by_a_tenth_of_the_deviation(monkeypatch, left, seen_px):
    watch, deviations = WatchedFloor(CAMERA, FLOOR, FIRST, ()), iter([0.04 * left, 1.0])
    own = Registered(np.zeros(9), 1e-9 * np.eye(9), 0.04)
    monkeypatch.setattr(watch.as_it_is, "register", lambda *_: own)
    soft = SimpleNamespace(template=FIRST, near=lambda *_: replace(own, std_px=next(deviations)))
    watch.levels |= dict.fromkeys(range(1, 7), soft)
    watch.register(FIRST, np.zeros(9), [])
    assert watch.blur_px() == seen_px


def test_a_floor_that_is_hidden_shows_no_blur_and_one_that_was_never_found_may_have_any():
    watch = WatchedFloor(CAMERA, FLOOR, FIRST, ())
    assert watch.register(np.full_like(FIRST, 90), np.zeros(9), []) is None
    assert watch.blur_px() == np.inf
    assert watch.register(floor_picture(seed=1), np.zeros(9), []) is not None
    assert watch.register(np.full_like(FIRST, 90), np.zeros(9), []) is None
    assert watch.blur_px() == 0.0


@pytest.mark.parametrize(("std_px", "sure"), [(0.05, True), (0.08, False)])
def test_a_floor_that_is_surely_registered_is_not_tried_through_a_blur(monkeypatch, std_px, sure):
    watch, asked = WatchedFloor(CAMERA, FLOOR, FIRST, ()), []
    seen = Registered(np.zeros(9), 1e-9 * np.eye(9), std_px)
    monkeypatch.setattr(watch.as_it_is, "register", lambda *_: seen)
    watch.levels |= dict.fromkeys(range(1, 7), SimpleNamespace(template=FIRST, near=lambda *_: asked.append(0) or seen))
    watch.in_even_light = SimpleNamespace(template=None)
    watch.register(FIRST, np.zeros(9), [])
    assert (asked == []) == sure


@pytest.mark.parametrize(("left", "taken"), [(0.6, True), (1.0, False)])
def test_a_blur_that_does_not_help_is_not_taken(monkeypatch, left, taken):
    watch, asked = WatchedFloor(CAMERA, FLOOR, FIRST, ()), []
    monkeypatch.setattr(watch.as_it_is, "register", lambda *_: Registered(np.zeros(9), 1e-9 * np.eye(9), 0.1))
    seen = Registered(np.zeros(9), 1e-9 * np.eye(9), 0.1 * left)
    soft = SimpleNamespace(template=FIRST, near=lambda *_: asked.append(0) or seen, register=lambda *_: seen)
    watch.levels |= dict.fromkeys(range(1, 7), soft)
    watch.in_even_light = SimpleNamespace(template=None)
    found = watch.register(FIRST, np.zeros(9), [])
    assert found.std_px == (0.1 * left if taken else 0.1)
    count = len(asked)
    # Where it did not help it is not tried again, until the floor is known still worse.
    watch.register(FIRST, np.zeros(9), [])
    assert (len(asked) > count) == taken


def test_a_blur_that_did_not_help_is_tried_again_after_the_floor_was_surely_known(monkeypatch):
    watch, asked, deviations = WatchedFloor(CAMERA, FLOOR, FIRST, ()), [], iter([0.3, 0.2, 0.03, 0.2])
    own = Registered(np.zeros(9), 1e-9 * np.eye(9), 0.3)
    monkeypatch.setattr(watch.as_it_is, "register", lambda *_: replace(own, std_px=next(deviations)))
    watch.levels |= dict.fromkeys(range(1, 7), SimpleNamespace(template=FIRST, near=lambda *_: asked.append(0) or own))
    watch.in_even_light, counts = SimpleNamespace(template=None), []
    for _ in range(4):
        watch.register(FIRST, np.zeros(9), [])
        counts.append(len(asked))
    assert counts == [6, 6, 6, 12]


@pytest.mark.parametrize(
    ("shift", "turn", "zoom"), [((5, -3), 0, 1), ((0, 0), 0, 1.01), ((-40, 45), 1.5, 1), ((0, 0), 3, 1)]
)
def test_a_warped_picture_is_found(shift, turn, zoom):
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    found = registration.register(warped(floor_picture(seed=1), shift, turn, zoom), np.zeros(9), [])
    matrix = cv2.getRotationMatrix2D(((480 - 1) / 2, (360 - 1) / 2), turn, zoom)
    expected = seen_through((CAMERA, FLOOR)) @ matrix[:, :2].T + matrix[:, 2] + shift
    assert np.abs(seen_through(moved_view(CAMERA, FLOOR, found.motion)) - expected).max() < 0.1


@pytest.mark.parametrize(("shift_px", "found"), [(9.0, 6), (12.0, 0)])
def test_a_floor_of_strong_contrast_is_registered_from_about_ten_pixels_off(shift_px, found):
    """Residuals so far off reach the largest scale; blocks are searched only where this registration fails."""
    plain = floor_picture(noise=0.0).astype(float)
    strong = np.clip(np.round(128 + 4 * (plain - plain.mean())), 0, 255).astype(np.uint8)
    registration = FloorRegistration(CAMERA, FLOOR, strong, ())
    shifts = [(shift_px * np.cos(turn), shift_px * np.sin(turn)) for turn in range(6)]
    views = [registration.near(warped(strong, shift), np.zeros(9), []) for shift in shifts]
    assert sum(view is not None for view in views) == found


@pytest.mark.parametrize(("hidden", "known"), [(0.4, True), (0.9, False)])
def test_part_of_the_floor_may_be_hidden(hidden, known):
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    found = registration.register(warped(floor_picture(seed=1, hidden=hidden), (1.0, 0.0)), np.zeros(9), [])
    assert (found is not None) == known


def with_bars(luma):
    """Black bars above and below, as an editor leaves them."""
    luma = luma.copy()
    luma[:36], luma[-36:] = 16, 16
    return luma


def with_text(luma):
    """A time stamp and a name, as a surveillance camera writes them."""
    luma = luma.copy()
    for grey, width in ((0, 4), (255, 1)):
        for text, place in (("2026-11-27 10:14:03", (24, 36)), ("Camera 01", (370, 335))):
            cv2.putText(luma, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.6, grey, width, cv2.LINE_AA)
    return luma


@pytest.mark.parametrize("drawn", [with_bars, with_text])
@pytest.mark.parametrize("shift", [(0.15, -0.05), (-0.3, 0.3), (0.9, 0.6)])
def test_what_is_written_into_all_pictures_does_not_hold_the_floor(drawn, shift):
    """Its edges are ten times as steep as the floor and stand still while the camera moves."""
    registration = FloorRegistration(CAMERA, FLOOR, drawn(FIRST), ())
    found = registration.register(drawn(warped(floor_picture(seed=1), shift)), np.zeros(9), [])
    moved = seen_through(moved_view(CAMERA, FLOOR, found.motion)) - seen_through((CAMERA, FLOOR))
    assert np.abs(moved - shift).max() < 0.08


@pytest.mark.parametrize("share", [0.0, 0.02])
def test_pixels_that_are_always_bright_do_not_hold_the_floor(share):
    """They are the steepest points of the picture, and stay where they are when the camera moves."""
    hot = np.random.default_rng(4).random(FIRST.shape) < share
    first, moved = np.where(hot, 250, FIRST), np.where(hot, 250, warped(FIRST, (1.5, -1.0)))
    registration = FloorRegistration(CAMERA, FLOOR, first.astype(np.uint8), ())
    found = registration.register(moved.astype(np.uint8), np.zeros(9), [])
    gap = seen_through(moved_view(CAMERA, FLOOR, found.motion)) - seen_through((CAMERA, FLOOR)) - [1.5, -1.0]
    assert np.abs(gap).max() < 0.15


@pytest.mark.parametrize("noise", [2.0, 6.0])
def test_marks_on_a_plain_floor_keep_their_weight(noise):
    """Strips of tape are all that shows where the floor is; the noise beside them shows nothing."""
    plain = np.full((360, 480), 180, dtype=np.uint8)
    for u, v in np.ndindex(6, 4):
        cv2.rectangle(plain, (35 + 72 * u + 7 * v, 40 + 75 * v + 5 * u), (59 + 72 * u, 52 + 75 * v + 3 * u), 60, -1)
    pictures = [plain + noise * np.random.default_rng(i).standard_normal(plain.shape) for i in range(9)]
    first, *others = (np.clip(np.round(picture), 0, 255).astype(np.uint8) for picture in pictures)
    registration = FloorRegistration(CAMERA, FLOOR, first, ())
    motions = [registration.register(warped(luma, (0.4, -0.3)), np.zeros(9), []).motion for luma in others]
    moved = [seen_through(moved_view(CAMERA, FLOOR, motion)) - seen_through((CAMERA, FLOOR)) for motion in motions]
    assert np.sqrt(np.mean(np.square(np.array(moved) - [0.4, -0.3]))) < 0.06


def test_rows_that_shake_do_not_carry_a_camera_off():
    """Each picture shakes by 0.7 px while its rows are read, as no motion of the view explains."""
    rows, columns = np.mgrid[:360, :480].astype(np.float32)
    registration, places = FloorRegistration(CAMERA, FLOOR, FIRST, ()), []
    for i in range(12):
        shaken = columns + 0.7 * np.sin(2 * np.pi * (1.5 * rows / 360 + 0.21 * i)).astype(np.float32)
        luma = cv2.remap(floor_picture(seed=i), shaken, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        found = registration.register(luma, np.zeros(9), [])
        places.append(found.motion[3:6] / np.sqrt(np.diag(found.covariance)[3:6]))
    assert np.sqrt(np.mean(np.square(places))) < 1.0


def test_another_floor_is_not_found():
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    other = np.random.default_rng(0).integers(60, 180, FIRST.shape).astype(np.uint8)
    assert registration.register(cv2.GaussianBlur(other, (0, 0), 2), np.zeros(9), []) is None


def watched(shifts):
    camera = CameraMotion(CAMERA, FLOOR, FIRST, [BODY], [POSE])
    for i, shift in enumerate(shifts):
        camera.register(i / 25, warped(floor_picture(seed=i), shift), [POSE])
    return camera


@pytest.mark.parametrize("share", [0.15, 0.3])
def test_bands_of_mains_light_hide_no_motion(share):
    """Bands that roll through the picture, finer than the tiles within which the light is taken for even."""
    bands = 2 * np.pi * 3.3 * np.arange(360) / 360
    lit = [1 + share * np.sin(bands + 2 * np.pi * 0.37 * i)[:, None] for i in range(8)]
    pictures = [
        np.clip(warped(floor_picture(seed=i), (0.5 * i, 0)) * lit[i], 0, 255).astype(np.uint8) for i in range(8)
    ]
    camera = CameraMotion(CAMERA, FLOOR, pictures[0], [BODY], [POSE])
    for i, luma in enumerate(pictures):
        camera.register(i / 25, luma, [POSE])
    found = camera.estimate()
    assert found.known.all()
    for i, motion in enumerate(found.motion):
        moved = seen_through(moved_view(CAMERA, FLOOR, motion)) - seen_through((CAMERA, FLOOR))
        assert np.abs(moved - [0.5 * i, 0]).max() < 0.2


def test_noise_is_not_taken_for_motion():
    camera = watched(np.zeros((12, 2)))
    found = camera.estimate()
    assert not found.motion.any()
    assert not found.used.any()
    assert camera.findings(found) == ()
    assert 0.001 < camera.watch.as_it_is.std_px(found.common) < 0.05


def test_a_knock_in_mid_run_is_corrected_and_reported():
    camera = watched([(0, 0)] * 6 + [(20, -15)] * 6)
    found = camera.estimate()
    assert [one.code for one in camera.findings(found)] == ["camera_moved"]
    seen = np.array([seen_through(moved_view(CAMERA, FLOOR, motion)) for motion in found.motion])
    assert np.abs(seen[:6] - seen[0]).max() < 0.05
    assert np.abs(seen[6:] - seen[0] - [20, -15]).max() < 0.1


def test_a_picture_that_cannot_be_registered_is_not_trusted():
    camera = watched([(0, 0)] * 8)
    for i in range(8, 18):
        camera.register(i / 25, np.full_like(FIRST, 90), [POSE])
    for i in range(18, 24):
        camera.register(i / 25, floor_picture(seed=i), [POSE])
    found = camera.estimate()
    (said,) = camera.findings(found)
    assert said.code == "camera_not_registered"
    assert "compression" in said.text
    assert (~found.known).sum() == 10


def test_a_floor_that_one_picture_shows_with_much_noise_is_seen_in_the_mean_of_the_first():
    pictures = noisy_floor([(0, 0)] * 30 + [(3, -2)] * 6)
    alone = FloorRegistration(CAMERA, FLOOR, pictures[0], ())
    camera = CameraMotion(CAMERA, FLOOR, pictures[0], [BODY], [POSE])
    for i, luma in enumerate(pictures):
        camera.register(i / 25, luma, [POSE])
    found = camera.estimate()
    by_one = [alone.register(luma, np.zeros(9), []) for luma in pictures[1:12]]
    assert sum(one is not None for one in by_one) < 6
    assert found.known.all()
    seen = np.array([seen_through(moved_view(CAMERA, FLOOR, motion)) for motion in found.motion])
    assert np.sqrt(np.mean(np.square(seen[:30] - seen_through((CAMERA, FLOOR))))) < 0.15
    assert np.abs(seen[30:] - seen_through((CAMERA, FLOOR)) - [3, -2]).mean() < 0.3


@pytest.mark.parametrize(("by_picture_px", "averaged"), [(0.05, True), (0.4, False)])
def test_a_camera_that_creeps_over_a_noisy_floor_is_referred_to_the_first_picture(by_picture_px, averaged):
    """Where it moves too far within the first pictures for a mean of them, one has to do."""
    pictures = noisy_floor([(by_picture_px * i, 0) for i in range(36)])
    camera = CameraMotion(CAMERA, FLOOR, pictures[0], [BODY], [POSE])
    watch = camera.watch
    for i, luma in enumerate(pictures):
        camera.register(i / 25, luma, [POSE])
    assert (camera.watch is not watch) == averaged
    found = camera.estimate()
    seen = np.array([seen_through(moved_view(CAMERA, FLOOR, motion)) for motion in found.motion])
    gap = seen - seen_through((CAMERA, FLOOR)) - by_picture_px * np.arange(36)[:, None, None] * [1, 0]
    assert np.sqrt(np.mean(gap**2)) < 2 * camera.watch.as_it_is.std_px(found.common)


@pytest.mark.parametrize(("deviations", "averaged"), [(3.5, True), (5.0, False)])
def test_the_first_pictures_are_averaged_where_none_moved_by_three_deviations_of_two(deviations, averaged, monkeypatch):
    camera, std_px = CameraMotion(CAMERA, FLOOR, FIRST, [BODY], [POSE]), 0.1
    by_a_pixel = np.array([0, 0, 0, 0, 0, 0, 0, 1.0, 0])
    moved = Registered(by_a_pixel * deviations * std_px / camera.watch.as_it_is.shift_px(by_a_pixel), np.eye(9), std_px)
    mean = SimpleNamespace(shows_texture=True, as_it_is=camera.watch.as_it_is, register=lambda *_: moved)
    monkeypatch.setattr(camera_motion, "WatchedFloor", lambda *_: mean)
    monkeypatch.setattr(camera.watch, "register", lambda *_: replace(moved, std_px=1.0))
    for i in range(13):
        camera.register(i / 25, FIRST, [POSE])
    assert (camera.watch is mean) == averaged


def test_places_of_the_floor_are_compared_over_a_tenth_of_its_longer_side():
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    along = registration.template.points[:, 0]
    sizes = [np.ptp(along[registration.cluster == i]) for i in range(registration.cluster.max() + 1)]
    assert 0.06 < np.quantile(sizes, 0.9) / np.ptp(along) < 0.11


@pytest.mark.parametrize(("sure", "averaged"), [(5, True), (6, False)])
def test_the_first_pictures_are_averaged_where_fewer_than_six_of_them_are_sure(sure, averaged, monkeypatch):
    picture = floor_picture()
    camera, took_mean = CameraMotion(CAMERA, FLOOR, picture, [BODY], [POSE]), []
    found = camera.watch.register(picture, np.zeros(9), [])
    stds_px = iter([0.01] * sure + [1.0] * 20)
    camera.watch = SimpleNamespace(
        shows_texture=True, as_it_is=camera.watch.as_it_is, register=lambda *_: replace(found, std_px=next(stds_px))
    )
    monkeypatch.setattr(camera, "_average", lambda: took_mean.append(len(camera.opening)))
    for i in range(16):
        camera.register(i / 25, picture, [POSE])
        assert len(camera.opening) < 12
    assert took_mean == ([12] if averaged else [])


def test_shaking_is_kept_noise_is_not():
    rng = np.random.default_rng(0)
    time_s = np.arange(400) / 25
    noise, shaking = rng.standard_normal((2, 400, 9))
    drift = 30 * np.linspace(0, 1, 400)[:, None]
    alike = np.ones(400)
    _, _, fast, own = _separated(time_s, noise, alike)
    assert np.sqrt(np.mean(fast**2)) < 0.2
    slow, _, fast, own = _separated(time_s, noise + 10 * shaking + drift, alike)
    assert np.sqrt(np.mean((slow + fast - 10 * shaking - drift) ** 2)) < 1.1
    assert 0.8 < own.mean() < 1.3


def test_pictures_in_which_the_floor_is_hard_to_see_are_not_taken_for_shaking():
    rng = np.random.default_rng(4)
    time_s, deviation = np.arange(400) / 25, np.where(np.arange(400) < 200, 1.0, 4.0)
    _, _, fast, _ = _separated(time_s, deviation[:, None] * rng.standard_normal((400, 9)), deviation)
    assert np.sqrt(np.mean(fast[200:] ** 2)) < 0.2 * 4


def test_what_noise_and_an_arm_do_to_a_plain_floor_does_not_warp_it():
    scene, times = challenges.arm_and_tether(902).scene, np.arange(0.0, 3.0, 0.08)
    truth, (rover, thing) = scene.truth(times), [body for body in scene.bodies if body.name in ("rover", "object")]
    camera = None
    for i, (time_s, luma) in enumerate(CeilingCamera(scene).frames(times)):
        poses = [truth[body.name][i] for body in (rover, thing)]
        camera = camera or CameraMotion(scene.camera, scene.floor, luma, (rover, thing), poses)
        camera.register(time_s, luma, poses)
    found = camera.estimate()
    assert found.known.mean() > 0.9
    assert not {"picture_warped", "camera_moved"} & {one.code for one in camera.findings(found)}
    assert camera.watch.as_it_is.scattered_px == 0


@pytest.mark.parametrize(("step", "kept_apart"), [(8.0, False), (16.0, True)])
def test_a_step_of_eleven_deviations_is_a_jump_of_the_camera_and_not_smoothed(step, kept_apart):
    time_s = np.arange(400) / 25
    noise = np.random.default_rng(0).standard_normal((400, 9))
    slow, *_ = _separated(time_s, noise + step * (np.arange(400) >= 200)[:, None], np.ones(400))
    # A window over half a second that reaches across the step would be in the middle of it there.
    assert (np.abs(slow[198:202].mean(axis=1) - [0, 0, step, step]).max() < 0.15 * step) == kept_apart


@pytest.mark.parametrize(("scatter_px", "found"), [(3.0, True), (6.0, False)])
def test_blocks_that_scatter_by_more_than_four_pixels_have_no_motion_in_common(scatter_px, found, monkeypatch):
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    angles = iter(2 * np.pi * np.random.default_rng(0).random(len(registration.blocks)))

    def scattered(_small, _block, expected):
        angle = next(angles)
        return expected + (np.array([20.0, -10.0]) + scatter_px * np.array([np.cos(angle), np.sin(angle)])) / 2

    monkeypatch.setattr(floor_registration, "_search", scattered)
    assert (registration._by_blocks(FIRST, np.zeros(9)) is not None) == found


@pytest.mark.parametrize("floor", [FLOOR, ceiling((480, 360), 450.0, tilt_rad=0.0)[1]], ids=["tilted", "level"])
def test_what_is_left_of_the_motion_moves_poses_as_a_moved_camera_sees_them(floor):
    motion = np.array([2e-4, -3e-4, 1e-4, 0, 0, 0, 1e-3, 0.2, -0.1])
    corners = transform(POSE, BODY.top_corners_m)
    pixels = project(*moved_view(CAMERA, floor, motion), np.column_stack([corners, np.full(4, 0.4)]))
    apparent = to_plane(CAMERA, floor, pixels, 0.4)
    by_motion = pose_sensitivity(CAMERA, floor, BODY, POSE[None])[0][0] @ parameters_by_motion(CAMERA, floor)
    assert np.allclose((by_motion @ motion)[:2], (corners - apparent).mean(axis=0), atol=3e-5)


def test_parameters_follow_a_motion():
    motion = 1e-4 * np.array([1, -2, 3, 1, 2, -1, 2, 100, 50])
    moved = shared_parameters(*moved_view(CAMERA, FLOOR, motion)) - shared_parameters(CAMERA, FLOOR)
    assert np.allclose(parameters_by_motion(CAMERA, FLOOR) @ motion, moved, atol=1e-6 + 1e-3 * np.abs(moved).max())


def test_poses_of_a_long_video_are_differentiated_piece_by_piece():
    poses = POSE + np.random.default_rng(3).normal(0, 0.1, (2500, 3))
    whole = pose_sensitivity(CAMERA, FLOOR, BODY, poses)
    pieces = [pose_sensitivity(CAMERA, FLOOR, BODY, poses[i : i + 500]) for i in range(0, 2500, 500)]
    for each, parts in zip(whole, zip(*pieces, strict=True), strict=True):
        np.testing.assert_allclose(each, np.concatenate(parts), rtol=1e-12)


def test_the_record_says_what_the_motion_did_to_the_picture():
    """Pictures warped by OpenCV, whose positive turn is anticlockwise; one in between that shows no floor."""
    camera = watched([(0, 0)] * 6)
    camera.register(6 / 25, np.full_like(FIRST, 90), [POSE])
    for i in range(7, 13):
        camera.register(i / 25, warped(floor_picture(seed=i), (12, -7), turn_deg=1.5, zoom=1.02), [POSE])
    seen = camera.estimate().track()
    assert np.flatnonzero(~seen.registered).tolist() == [6]
    expected = np.array([12, -7, -np.deg2rad(1.5), np.log(1.02)])
    unit = np.array([1, 1, 1 / 240, 1 / 240])
    assert (np.abs(seen.picture[:6]) < 0.03 * unit).all()
    assert (np.abs(seen.picture[7:] - expected) < 0.03 * unit).all()
    assert (seen.picture_std[seen.registered] > 0).all()
    assert (np.abs(seen.picture[7:] - expected) < 4 * seen.picture_std[7:] + 0.01 * unit).all()


def test_a_floor_that_shows_nothing_leaves_no_record():
    camera = CameraMotion(CAMERA, FLOOR, np.full_like(FIRST, 90), [BODY], [POSE])
    for i in range(4):
        camera.register(i / 25, np.full_like(FIRST, 90), [POSE])
    seen = camera.estimate().track()
    assert not seen.registered.any()
    assert not seen.motion.any()


@pytest.mark.parametrize("waves_px", [0.0, 0.15, 1.0])
def test_pictures_read_row_by_row_by_a_shaking_camera_are_reported(waves_px):
    """Rows displaced sideways in waves, as OpenCV draws them; the deviation of poses is that of the rows."""
    rng = np.random.default_rng(5)
    u, v = np.meshgrid(np.arange(480, dtype=np.float32), np.arange(360, dtype=np.float32))
    camera = CameraMotion(CAMERA, FLOOR, FIRST, [BODY], [POSE])
    for i in range(42):
        wave = waves_px * np.sin(2 * np.pi * (1.7 * v / 360 + rng.random())) * (i > 0)
        bent = cv2.remap(floor_picture(seed=i), u + wave.astype(np.float32), v, cv2.INTER_CUBIC, borderMode=4)
        camera.register(i / 25, bent, [POSE])
    found = camera.estimate()
    codes = [one.code for one in camera.findings(found)]
    _, covariance = found.of_poses(BODY, np.tile(POSE, (42, 1)))
    std_px = np.sqrt(covariance[20, 0, 0]) / ((FLOOR.camera_position_m[2] - 0.4) / 450)
    assert ("picture_warped" in codes) == (waves_px == 1.0)
    assert std_px == pytest.approx(1 / np.sqrt(2), rel=0.5) if waves_px == 1.0 else std_px < 0.15


PLAIN = np.full_like(FIRST, 90)


def registered_as(found, by_s=0.04, scattered_px=0.0, unregistered=PLAIN):
    """A camera whose pictures after the first are registered as given; None where one is not, which shows so much."""
    camera = CameraMotion(CAMERA, FLOOR, FIRST, [BODY], [POSE])
    answers, as_it_is, camera.opening = iter(found), camera.watch.as_it_is, []
    camera.watch = SimpleNamespace(
        shows_texture=True, as_it_is=as_it_is, scattered_px=scattered_px, register=lambda *_: next(answers)
    )
    for i, one in enumerate([moved_by(0.0), *found]):
        camera.register(by_s * i, unregistered if one is None else FIRST, [POSE])
    return camera


def codes_of(camera):
    return [one.code for one in camera.findings(camera.estimate())]


@pytest.mark.parametrize(("missing", "said"), [(9, []), (14, ["camera_not_registered"])])
def test_the_camera_may_be_lost_for_a_quarter_of_a_second(missing, said):
    """Between the pictures before and after that are 0.20 and 0.30 s, at fifty pictures a second."""
    found = [moved_by(0.0)] * 600
    found[300 : 300 + missing] = [None] * missing
    assert codes_of(registered_as(found, by_s=0.02)) == said


@pytest.mark.parametrize(("every", "said"), [(26, []), (13, ["camera_not_registered"])])
def test_one_picture_in_twenty_may_be_missing_by_itself(every, said):
    assert codes_of(registered_as([None if i % every == 5 else moved_by(0.0) for i in range(520)])) == said


@pytest.mark.parametrize(("shift_px", "said"), [(0, []), (0.5, []), (6, ["camera_not_registered"])])
def test_a_floor_that_is_too_faint_to_be_registered_in_a_picture_is_not_lost_if_it_is_not_displaced(shift_px, said):
    faint = np.clip(np.round(128 + 0.3 * (warped(FIRST, (shift_px, 0)) - 128.0)), 0, 255).astype(np.uint8)
    camera = registered_as([None if i % 3 == 1 else moved_by(0.1) for i in range(120)], unregistered=faint)
    assert codes_of(camera) == said
    assert camera.estimate().motion[1:, 7] == pytest.approx(0.1, abs=0.02)


def test_a_faint_floor_that_is_not_displaced_is_not_known_beside_pictures_of_a_moved_camera():
    """Its motion is interpolated, which is 12 px off in the last picture before a knock."""
    faint = np.clip(np.round(128 + 0.3 * (FIRST - 128.0)), 0, 255).astype(np.uint8)
    found = registered_as([moved_by(0.0)] * 20 + [None] + [moved_by(25.0)] * 20, unregistered=faint).estimate()
    assert np.flatnonzero(~found.known).tolist() == [21]


def test_a_view_in_which_the_floor_is_seldom_found_is_not_followed():
    camera = registered_as([None] * 5 + [moved_by(40.0)] + [None] * 5)
    assert not camera.used.any()


def test_what_was_tracked_through_a_moved_view_is_moved_back_where_that_turns_out_to_be_unknown():
    """A floor that was found in the first pictures and hardly ever again."""
    camera = registered_as([moved_by(4.0)] * 3 + [None] * 20)
    found = camera.estimate()
    assert [one.code for one in camera.findings(found)] == ["camera_not_watched"]
    height = BODY.tracked_plane_height_m
    pixel = project(CAMERA, FLOOR, np.array([[*POSE[:2], height]]))
    tracked = to_plane(*camera.view, pixel, height)[0]
    shift, _ = found.of_poses(BODY, np.tile([*tracked, POSE[2]], (24, 1)))
    assert np.linalg.norm(tracked - POSE[:2]) > 0.02
    assert np.abs(tracked + shift[10, :2] - POSE[:2]).max() < 2e-4
    assert not shift[0].any()


@pytest.mark.parametrize(
    ("sure", "slope", "said"),
    [(6, 2.9, "camera_not_registered"), (6, 1.7, "camera_not_watched"), (5, 2.9, "camera_not_watched")],
)
def test_a_floor_with_texture_that_was_surely_found_at_first_and_hardly_ever_again_was_lost(
    sure, slope, said, monkeypatch
):
    """As copies of the floor are that a codec gives up at last: the camera may have crept all along."""
    camera = registered_as([moved_by(0.0)] * 10 + [None] * 30)
    assert camera._slope() > 2 * 2.2
    monkeypatch.setattr(CameraMotion, "_slope", lambda _: slope)
    camera.sure = sure
    assert codes_of(camera) == [said]


@pytest.mark.parametrize(("known", "watched"), [(7, True), (3, False)])
def test_the_motion_of_a_camera_is_known_where_half_of_the_pictures_are_registered(known, watched):
    camera = registered_as([moved_by(4.0) if i % 10 < known else None for i in range(100)])
    assert camera.estimate().motion.any() == watched
    assert ("camera_not_watched" not in codes_of(camera)) == watched


@pytest.mark.parametrize(("shift_px", "followed"), [(0.2, False), (0.4, True)])
def test_bodies_are_tracked_through_a_view_that_follows_the_floor_from_a_quarter_of_a_pixel_on(shift_px, followed):
    camera = registered_as([moved_by(shift_px)] * 4)
    moved = seen_through(camera.view) - seen_through((CAMERA, FLOOR))
    assert np.abs(moved - [shift_px * followed, 0]).max() < 1e-6


@pytest.mark.parametrize(("shift_px", "corrected"), [(0.04, False), (0.08, True)])
def test_a_motion_of_less_than_a_twentieth_of_a_pixel_is_not_corrected(shift_px, corrected):
    motion = registered_as([moved_by(0.0)] * 50 + [moved_by(shift_px)] * 50).estimate().motion
    assert np.abs(motion[[0, 25, 75, 100], 7] - np.array([0, 0, 1, 1]) * shift_px * corrected).max() < 0.005


@pytest.mark.parametrize(("scattered_px", "said"), [(0.1, []), (0.2, ["picture_warped"])])
def test_places_that_scatter_by_more_than_a_seventh_of_a_pixel_tell_of_a_warped_picture(scattered_px, said):
    camera = registered_as([moved_by(0.0)] * 20, scattered_px=scattered_px)
    assert codes_of(camera) == said
    _, covariance = camera.estimate().of_poses(BODY, np.tile(POSE, (21, 1)))
    assert covariance[10, 0, 0] > 0 if said else covariance[10, 0, 0] < 1e-10


def test_a_floor_that_moved_farther_than_a_pixel_or_two_did_not_stay():
    still, moved = noisy_floor([(0, 0), (3, -2)], contrast=0.5, seed=6)
    seen = FloorRegistration(CAMERA, FLOOR, noisy_floor([(0, 0)], contrast=0.5)[0], (), worst_std_px=np.inf)
    assert not seen.unmoved(still).motion.any()
    learned = seen.learned
    assert seen.unmoved(moved) is None
    assert seen.learned is learned


@pytest.mark.parametrize(("missing", "gap"), [([24], (1.0, 23.0)), ([23], (2.0, 22.0)), ([23, 24], (2.0, 22.0))])
def test_a_gap_at_the_end_lasts_to_the_last_picture(missing, gap):
    """Pictures of one a second."""
    known = ~np.isin(np.arange(25), missing)
    assert camera_motion._longest_gap(np.arange(25.0), known) == gap


def test_a_body_hides_the_floor_to_a_third_beyond_its_outline():
    camera = CameraMotion(CAMERA, FLOOR, FIRST, [BODY], [POSE])
    from_it = np.abs(inverse_transform(POSE, camera.watch.as_it_is.template.points)) / [0.4, 0.3]
    assert 1.2 < from_it.max(axis=1).min() < 1.7
    (place, radius_m), (behind, _) = camera.hidden_discs([POSE])
    assert np.allclose(place, POSE[:2])
    assert np.linalg.norm(behind) > np.linalg.norm(place)
    assert 1.1 < radius_m / np.hypot(0.4, 0.3) < 1.7


def test_the_place_of_a_camera_that_creeps_is_averaged_over_half_a_second():
    """Of 25 pictures a second 13 are within it, so that 0.28 of the noise is left."""
    noise = np.random.default_rng(0).standard_normal((400, 9))
    slow, *_ = _separated(np.arange(400) / 25, 30 + noise, np.ones(400))
    assert 0.24 < np.std(slow[20:-20]) < 0.32


@pytest.mark.parametrize(("variance", "kept"), [(1.4, False), (3.0, True)])
def test_pictures_shake_where_they_scatter_by_twice_the_variance_of_noise(variance, kept):
    shaken = np.sqrt(variance) * np.random.default_rng(0).standard_normal((400, 9))
    _, _, fast, _ = _separated(np.arange(400) / 25, shaken, np.ones(400))
    assert (np.std(fast) > 0.25 * np.std(shaken)) == kept


@pytest.mark.parametrize(("before_s", "kept"), [(0.75, True), (1.5, False)])
def test_a_picture_is_judged_by_how_it_shakes_within_a_second_of_it(before_s, kept):
    """A camera that shakes five times a second, from the eighth second on."""
    time_s = np.arange(400) / 25
    shaking = 8 * np.sin(2 * np.pi * 5 * time_s) * (time_s > 8)
    noise = np.random.default_rng(0).standard_normal((400, 9))
    _, _, fast, _ = _separated(time_s, noise + shaking[:, None], np.ones(400))
    at = round((8 - before_s) * 25)
    assert (np.std(fast[at - 2 : at + 3]) > 0.5) == kept


@pytest.mark.parametrize(("share", "found"), [(0.4, True), (0.2, False)])
def test_three_tenths_of_the_floor_have_to_be_in_view(share, found):
    """A disc round a corner of the picture hides the rest."""
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    corner = to_plane(CAMERA, FLOOR, np.array([[0.0, 0.0]]), 0.0)[0]
    away_m = np.linalg.norm(registration.template.points - corner, axis=1)
    hidden = [(corner, float(np.quantile(away_m, 1 - share)))]
    assert (registration.near(FIRST, np.zeros(9), hidden) is not None) == found


@pytest.mark.parametrize(
    ("usual", "correlation", "taken"), [(0.1, 0.5, True), (0.1, 0.3, False), (1.0, 0.75, True), (1.0, 0.5, False)]
)
def test_the_floor_correlates_by_a_third_and_by_three_fifths_of_what_is_usual(usual, correlation, taken, monkeypatch):
    registration, kernel = FloorRegistration(CAMERA, FLOOR, FIRST, ()), floor_registration.register_kernel
    registration.learned = replace(registration.learned, correlation=usual)
    monkeypatch.setattr(floor_registration, "register_kernel", lambda *given: (*kernel(*given)[:-2], correlation, True))
    assert (registration.near(FIRST, np.zeros(9), []) is not None) == taken


@pytest.mark.parametrize(("std_px", "known"), [(0.2, True), (0.45, False)])
def test_a_floor_known_to_less_than_three_tenths_of_a_pixel_is_not_found(std_px, known, monkeypatch):
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    monkeypatch.setattr(registration, "std_px", lambda _: std_px)
    assert (registration.near(FIRST, np.zeros(9), []) is not None) == known
    assert registration.hardly_moved(FIRST, []) is not None


@pytest.mark.parametrize(("off_px", "converged"), [(0.007, True), (0.015, False)])
def test_a_registration_has_converged_when_it_moves_by_less_than_a_hundredth_of_a_pixel(off_px, converged, monkeypatch):
    """A single round, which goes all the way from where it begins."""
    kernel = floor_registration.register_kernel
    monkeypatch.setattr(
        floor_registration, "register_kernel", lambda *given: kernel(*given[:6], (*given[6][:-1], 1), *given[7:])
    )
    start = np.array([0, 0, 0, 0, 0, 0, 0, off_px, 0.0])
    assert (FloorRegistration(CAMERA, FLOOR, FIRST, ()).near(FIRST, start, []) is not None) == converged


@pytest.mark.parametrize(("share", "found"), [(0.35, True), (0.2, False)])
def test_a_knock_is_found_by_eight_blocks_of_some_thirty(share, found, monkeypatch):
    """What hides a floor leaves a share of its blocks, and all of these agree."""
    number = iter(range(100))

    def search(_small, _block, expected):
        i = next(number)
        return expected + np.array([10.0, -5.0]) if int(share * (i + 1)) > int(share * i) else None

    monkeypatch.setattr(floor_registration, "_search", search)
    assert (FloorRegistration(CAMERA, FLOOR, FIRST, ())._by_blocks(FIRST, np.zeros(9)) is not None) == found


def block_in_noise(fit, at):
    """A block, and a picture of noise that shows it at a place (2,) with such a correlation."""
    rng, (u, v), half = np.random.default_rng(0), at, 16
    block, luma = rng.standard_normal((2 * half + 1, 2 * half + 1)), rng.standard_normal((300, 300))
    shown = luma[v - half : v + half + 1, u - half : u + half + 1]
    shown[:] = fit * block + np.sqrt(1 - fit**2) * shown
    return tuple(np.clip(np.round(128 + 30 * each), 0, 255).astype(np.uint8) for each in (block, luma))


@pytest.mark.parametrize(("fit", "found"), [(0.6, True), (0.3, False)])
def test_a_block_is_found_where_it_correlates_by_nearly_a_half(fit, found):
    block, luma = block_in_noise(fit, (155, 145))
    place = floor_registration._search(luma, block, np.array([150.0, 150.0]))
    assert (place is not None) == found
    assert place is None or np.abs(place - [155, 145]).max() < 1


@pytest.mark.parametrize(("off_px", "found"), [(60, True), (100, False)])
def test_a_block_is_searched_up_to_eighty_pixels_off(off_px, found):
    """In pictures of half the size."""
    block, luma = block_in_noise(1.0, (150 + off_px // 2, 150))
    assert (floor_registration._search(luma, block, np.array([150.0, 150.0])) is not None) == found


@pytest.mark.parametrize(
    ("noise", "slope", "texture"), [(0.0, 3.0, False), (0.0, 5.0, True), (5.0, 8.0, False), (5.0, 12.0, True)]
)
def test_texture_is_steeper_than_four_levels_a_pixel_and_than_twice_the_noise(noise, slope, texture):
    """A point ten times as steep as the floor's texture is of none; where there is no texture, it is a mark."""
    luma = np.round(128 + noise * np.random.default_rng(0).standard_normal((200, 200))).astype(np.uint8)
    template = SimpleNamespace(slopes=np.array([[slope, 0.0, 0.0]] * 9 + [[10 * slope, 0.0, 0.0]]), pixel_m=1.0)
    assert floor_registration._trust(luma, template)[-1] == pytest.approx(0.01 if texture else 1.0)


@pytest.mark.parametrize(("fit", "places"), [(0.8, 0), (0.95, 2)])
def test_a_place_is_alike_where_blocks_fit_nine_tenths_as_well(fit, places, monkeypatch):
    fits = np.zeros((81, 81))
    fits[40, 40], fits[40, 60] = 1.0, fit
    monkeypatch.setattr(floor_registration, "_correlations", lambda *_: (fits, (0, 0)))
    assert len(FloorRegistration(CAMERA, FLOOR, FIRST, ())._places_alike(FIRST)) == places


@pytest.mark.parametrize(("left_over", "taken"), [(0.7, True), (0.9, False)])
def test_another_place_is_the_right_one_where_a_fifth_less_is_left_over(left_over, taken, monkeypatch):
    registration, still = FloorRegistration(CAMERA, FLOOR, FIRST, ()), np.zeros(9)
    place = np.append(np.zeros(7), [20.0, 0.0])

    def near(luma, start, hidden):
        scale = left_over if start[7] else 1.0
        registration.learned = replace(registration.learned, last=(np.zeros(0), np.zeros(0), scale))
        return Registered(start, np.zeros((9, 9)), 0.1)

    monkeypatch.setattr(registration, "near", near)
    monkeypatch.setattr(registration, "_places_alike", lambda _: [still, place])
    assert (registration.anywhere(FIRST).motion[7] > 0) == taken
    assert registration.learned.last[2] == (left_over if taken else 1.0)


@pytest.mark.parametrize(("clusters", "points", "known"), [(12, 8, True), (6, 8, False), (40, 8, True), (40, 5, False)])
def test_the_scatter_of_places_is_known_by_eight_of_them_with_six_points_each(clusters, points, known):
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    cluster, seen = registration.cluster, np.zeros(len(registration.cluster), dtype=bool)
    for one in np.argsort(-np.bincount(cluster), kind="stable")[:clusters]:
        seen[np.flatnonzero(cluster == one)[:points]] = True
    residual = np.random.default_rng(0).standard_normal(len(seen))
    assert bool(registration._scatter_px2(seen, residual)) == known


@pytest.mark.parametrize(("deviations", "said"), [(1.5, False), (3.0, True)])
def test_places_scatter_where_they_do_by_twice_the_noise(deviations, said):
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    registration.learned = replace(registration.learned, scatter=(((0.1 * deviations) ** 2, 0.1**2),) * 5)
    assert registration.scattered_px == pytest.approx(0.1 * deviations * said)


def test_the_floor_is_watched_up_to_a_twenty_fifth_of_the_picture_from_its_border():
    points = FloorRegistration(CAMERA, FLOOR, FIRST, ()).template.points
    share = project(CAMERA, FLOOR, np.column_stack([points, np.zeros(len(points))])) / [480, 360]
    border = np.concatenate([share.min(axis=0), 1 - share.max(axis=0)])
    assert (border > 0.035).all()
    assert (border < 0.07).all()


@pytest.mark.parametrize(("turn_deg", "found"), [(3.0, True), (6.0, False)])
def test_blocks_of_a_fine_floor_are_found_after_a_turn_by_a_few_degrees(turn_deg, found):
    """Waves of three to fourteen pixels: at the sides of a block six degrees displace them by more than three."""
    first = floor_picture(grey=texture(3, finest_m=0.03))
    registration = FloorRegistration(CAMERA, FLOOR, first, ())
    motion = registration._by_blocks(warped(first, turn_deg=turn_deg), np.zeros(9))
    assert (motion is not None) == found
    assert motion is None or np.rad2deg(-motion[2]) == pytest.approx(turn_deg, abs=0.1)


@pytest.mark.parametrize(("off_px", "found"), [(5, True), (14, False)])
def test_a_faint_floor_is_registered_from_five_pixels_off_in_a_dozen_rounds(off_px, found):
    """Its deviation is six grey levels, noise has two: steps are short, and from 14 pixels off it takes 17 rounds."""
    plain = 128 + 0.3 * (FIRST.astype(float) - 128)
    first, other = (plain, warped(plain, (off_px, 0))) + 2 * np.random.default_rng(5).standard_normal((2, *plain.shape))
    first, other = (np.clip(np.round(luma), 0, 255).astype(np.uint8) for luma in (first, other))
    assert (FloorRegistration(CAMERA, FLOOR, first, ()).near(other, np.zeros(9), []) is not None) == found


@pytest.mark.parametrize(("inliers", "found"), [(0.45, True), (0.25, False)])
def test_a_third_of_the_points_in_view_have_to_show_the_floor(inliers, found, monkeypatch):
    monkeypatch.setattr(floor_registration, "shares", lambda *_: (0.9, inliers))
    assert (FloorRegistration(CAMERA, FLOOR, FIRST, ()).near(FIRST, np.zeros(9), []) is not None) == found


def test_a_picture_that_is_repeated_fits_no_better_than_to_half_a_grey_level():
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    registration.near(FIRST, np.zeros(9), [])
    _, residual, scale = registration.learned.last
    assert np.std(residual) < 0.1
    assert 0.3 < scale < 0.8


@pytest.mark.parametrize(("share", "low", "high"), [(0.45, 0.42, 0.48), (0.1, 0.2, 0.4)])
def test_a_floor_that_shows_less_than_a_third_of_its_texture_counts_as_one_that_does(share, low, high):
    registration = FloorRegistration(CAMERA, FLOOR, FIRST, ())
    fainter = np.round(128 + share * (FIRST.astype(float) - 128)).astype(np.uint8)
    alike, information = np.ones(len(registration.slopes)), registration.slopes.T @ registration.slopes
    assert low < registration._shared_texture(fainter, np.zeros(9), information, alike, alike, 1.0) < high


def test_residuals_of_neighbours_are_compared_in_every_tenth_picture(monkeypatch):
    registration, compared = FloorRegistration(CAMERA, FLOOR, FIRST, ()), []
    monkeypatch.setattr(registration, "_variance_factor", lambda *_: compared.append(1) or 1.0)
    monkeypatch.setattr(registration, "_shared_texture", lambda *_: 1.0)
    for _ in range(40):
        registration.near(FIRST, np.zeros(9), [])
    assert 3 <= len(compared) <= 6


def from_straight_above(motion):
    """A floor registered by a camera that looks straight down and moves, without noise."""
    view = ceiling((240, 180), 450.0, tilt_rad=1e-3, distortion=())
    first, moved = (floor_picture(*each, noise=0.0) for each in (view, moved_view(*view, np.array(motion))))
    return FloorRegistration(*view, first, ()).near(moved, np.zeros(9), [])


def test_whether_a_mount_shifts_is_known_to_three_centimetres():
    """From straight above it looks like a shift or a zoom of the picture."""
    std_m = np.sqrt(np.diag(from_straight_above(np.zeros(9)).covariance))[3:6]
    assert (std_m > 0.02).all()
    assert (std_m < 0.045).all()


def test_a_shift_of_the_picture_is_put_down_to_the_stabiliser_and_little_of_it_to_the_mount():
    """To the squares of 60 and 3.4 px, by which the two shift a picture: 3 cm at a height of 4 m and 450 px."""
    found = from_straight_above([0, 0, 0, 0, 0, 0, 0, 6.0, 0]).motion
    assert found[7] == pytest.approx(6.0, abs=0.05)
    assert 1 / 600 < found[3] * (450 / 4) / 6.0 < 1 / 160


def test_an_enlarged_picture_is_put_down_to_the_focus_and_little_of_it_to_the_height():
    """To the squares of 5 % and of the 0.75 % that 3 cm are of the height."""
    found = from_straight_above([0, 0, 0, 0, 0, 0, 0.02, 0, 0]).motion
    assert found[6] == pytest.approx(0.0196, abs=3e-4)
    assert 1 / 90 < -found[5] / 4 / 0.02 < 1 / 24

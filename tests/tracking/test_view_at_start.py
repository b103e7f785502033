"""Where the camera stands at a video's first picture, over a floor that was painted from there."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from tests.tracking.painted import texture
from tests.tracking.painted_floor import BODY, CAMERA, FIRST, FLOOR, floor_picture, moved_by, noisy_floor, seen_through
from towval.commands.track import calibrated_at_start
from towval.model import Calibration
from towval.optics.moved_view import pose_sensitivity
from towval.optics.projection import project, to_plane
from towval.optics.view_motion import moved_view, view_before
from towval.tracking import view_at_start
from towval.tracking.floor_registration import Learned
from towval.tracking.view_at_start import calibration_at_start


def test_a_floor_of_tiles_is_not_found_a_tile_off():
    """The camera was turned by the width of a tile between calibration and run; only the grain of the tiles tells."""
    grain = texture(3, finest_m=0.03)

    def tiles(places):
        off_m = np.linalg.norm(np.mod(places, 0.16) - 0.08, axis=1)
        return 150 - 60 / (1 + np.exp((off_m - 0.048) / 0.006)) + 0.12 * (grain(places) - 128)

    before, tile_px = floor_picture(grey=tiles), 0.16 * 450 / 4
    moved = moved_view(CAMERA, FLOOR, np.array([0, 0, 0, 0, 0, 0, 0, tile_px, 0.0]))
    luma = floor_picture(*moved, seed=1, grey=tiles)
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.0)
    found, findings = calibration_at_start(calibration, luma, [("floor", before)])
    assert [one.code for one in findings] == ["camera_moved_before"]
    assert np.abs(seen_through((found.camera, found.floor)) - seen_through(moved)).max() < 0.3


def test_a_bump_between_calibration_and_run_is_taken_off():
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    true = moved_view(CAMERA, FLOOR, np.array([0.01, -0.015, 0.01, 0, 0, 0, 0.01, 3, 0]))
    boards = [("floor.jpg", floor_picture(seed=5)), ("more.jpg", floor_picture(seed=6))]
    moved, findings = calibration_at_start(calibration, floor_picture(*true, seed=7), boards)
    assert [one.code for one in findings] == ["camera_moved_before"]
    assert np.abs(seen_through((moved.camera, moved.floor)) - seen_through(true)).max() < 0.1
    same, findings = calibration_at_start(calibration, floor_picture(seed=7), boards)
    assert findings == ()
    assert same is calibration
    plain = [
        (
            "floor.jpg",
            cv2.GaussianBlur(np.random.default_rng(1).integers(60, 180, FIRST.shape).astype(np.uint8), (0, 0), 2),
        )
    ]
    _, findings = calibration_at_start(calibration, FIRST, plain)
    assert [one.code for one in findings] == ["floor_not_recognised"]
    _, findings = calibration_at_start(calibration, np.ascontiguousarray(floor_picture(seed=7)[::-1, ::-1]), boards)
    assert [one.code for one in findings] == ["video_upside_down"]


def cloudy_floor(seed):
    """A floor whose soft spots place it to a quarter of a pixel only."""
    soft = cv2.GaussianBlur(floor_picture(noise=0.0).astype(float), (0, 0), 9)
    luma = 128 + 12 * (soft - soft.mean()) / soft.std() + 2 * np.random.default_rng(seed).standard_normal(soft.shape)
    return np.clip(np.rint(luma), 0, 255).astype(np.uint8)


def off_at_a_top(found, motion, height=0.4):
    """By how much places of a top (n, 2) [m] are off, and their deviations, after a motion before the video."""
    at = np.array([(-0.8, 0.6), (0.8, -0.6), (0.1, 0.0)])
    pixels = project(*moved_view(CAMERA, FLOOR, motion), np.column_stack([at, np.full(len(at), height)]))
    sensitivity = pose_sensitivity(found.camera, found.floor, BODY, np.column_stack([at, np.zeros(len(at))]))[0]
    covariance = sensitivity @ found.covariance @ np.swapaxes(sensitivity, 1, 2)
    off = to_plane(found.camera, found.floor, pixels, height) - at
    return off, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[:, :2])


@pytest.mark.parametrize(
    "motion",
    [
        [0.01, 0, 0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0.008, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, -0.02, 0, 0, 0, 0],
        [0.02, -0.01, 0, 0.01, 0.005, 0.01, 0, 0, 0],
        [0, 0, 0, 0, 0, 0, 0.005, 0, 0],
    ],
)
def test_what_the_floor_does_not_tell_of_a_bump_is_in_the_deviations(motion):
    """A turn and a slide of the mount look alike on the floor, and displace a top otherwise."""
    calibration, motion = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1), np.array(motion)
    video = floor_picture(*moved_view(CAMERA, FLOOR, motion), seed=7)
    boards = [(f"floor_{seed}.jpg", floor_picture(seed=seed)) for seed in (5, 6)]
    found, findings = calibration_at_start(calibration, video, boards)
    assert [one.code for one in findings] == ["camera_moved_before"]
    off, std = off_at_a_top(found, motion)
    assert (np.abs(off) < 3 * std + 1e-4).all()
    assert np.abs(off).max() < 3e-3


def test_a_floor_that_places_the_camera_badly_does_not_move_the_tops_of_bodies():
    """The camera stood still: noise of the floor must not be taken for a mount that slid while it turned back."""
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    for seed in range(20, 50, 10):
        boards = [(f"floor_{i}.jpg", cloudy_floor(seed + i)) for i in (1, 2, 3)]
        found, _ = calibration_at_start(calibration, cloudy_floor(seed), boards)
        off, std = off_at_a_top(found, np.zeros(9))
        assert found.covariance.any()
        assert np.abs(off).max() < 1.5e-3
        assert (np.abs(off) < 3 * std + 1e-4).all()
        assert std.max() < 1.5e-3


def test_a_plain_floor_is_told_from_a_camera_that_moved():
    calibration, rng = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1), np.random.default_rng(4)
    first, *plain = [np.rint(rng.normal(120, 3, FIRST.shape)).astype(np.uint8) for _ in range(4)]
    boards = [(f"floor_{i}.jpg", luma) for i, luma in enumerate(plain)]
    same, findings = calibration_at_start(calibration, first, boards)
    assert [one.code for one in findings] == ["floor_too_plain"]
    assert same is calibration
    # One picture cannot tell; textured ones recognise one another.
    assert [one.code for one in calibration_at_start(calibration, first, boards[:1])[1]] == ["floor_not_recognised"]
    textured = [(f"floor_{seed}.jpg", floor_picture(seed=seed)) for seed in (5, 6, 7)]
    assert [one.code for one in calibration_at_start(calibration, first, textured)[1]] == ["floor_not_recognised"]


@pytest.mark.parametrize(
    ("wider", "said"), [(1.0, []), (1.003, ["floor_not_recognised"]), (1.015, ["floor_not_recognised"])]
)
def test_a_video_with_other_pixels_than_the_pictures_is_not_recognised(wider, said):
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    M = np.array([[wider, 0, 239.5 * (1 - wider)], [0, 1.0, 0]])
    first = cv2.warpAffine(floor_picture(seed=7), M, (480, 360), flags=cv2.INTER_LANCZOS4, borderMode=4)
    _, findings = calibration_at_start(calibration, first, [("floor.jpg", floor_picture(seed=5))])
    assert [one.code for one in findings] == said


@pytest.mark.parametrize(("wider", "said"), [(1.0, []), (1.02, ["floor_not_recognised"])])
def test_a_noisy_floor_is_recognised_in_the_mean_of_the_first_pictures(wider, said):
    """Of one of them the stretch scatters by more than what is taken for another lens."""
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    M = np.array([[wider, 0, 239.5 * (1 - wider)], [0, 1.0, 0]])
    pictures = [
        cv2.warpAffine(luma, M, (480, 360), flags=cv2.INTER_LANCZOS4, borderMode=4)
        for luma in noisy_floor([(0, 0)] * 16, contrast=0.07)
    ]
    floors = [
        (f"floor_{i}.jpg", luma) for i, luma in enumerate(noisy_floor([(0, 0)] * 4, contrast=0.07, noise=1.0, seed=7))
    ]
    video = SimpleNamespace(mean_of_first=lambda count: np.rint(np.mean(pictures[:count], axis=0)).astype(np.uint8))
    _, alone = calibration_at_start(calibration, pictures[0], floors)
    assert [one.code for one in alone] == ["floor_not_recognised"]
    assert "compression took the floor's grain" in alone[0].text
    _, found = calibrated_at_start(calibration, video, pictures[0], floors)
    assert [one.code for one in found if one.code != "camera_moved_before"] == said


@pytest.mark.parametrize("moved", [False, True])
def test_bands_of_light_and_dead_pixels_do_not_hide_the_floor(moved):
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    true = moved_view(CAMERA, FLOOR, np.array([0.01, -0.015, 0.01, 0, 0, 0, 0.01, 3, 0]) * moved)
    first, rng = floor_picture(*true, seed=7), np.random.default_rng(8)
    first = first * (1 + 0.3 * np.sin(2 * np.pi * 1.4 * np.arange(360) / 360))[:, None]
    first = np.clip(np.rint(first), 0, 255).astype(np.uint8)
    first[rng.integers(0, 360, 800), rng.integers(0, 480, 800)] = 0
    found, findings = calibration_at_start(calibration, first, [("floor.jpg", floor_picture(seed=5))])
    assert [one.code for one in findings] == ["camera_moved_before"] * moved
    assert np.abs(seen_through((found.camera, found.floor)) - seen_through(true)).max() < 0.15


def finding(places_px, left=None, **changes):
    """A floor that is found in pictures, which are numbers here, shifted sideways, and what its residuals leave."""
    left = left or dict.fromkeys(places_px, [1.0] * len(places_px))

    def near(number, place, _):
        seen.learned = Learned(last=(np.zeros(0), np.zeros(0), left[place[7]][number]))
        return moved_by(place[7])

    seen = SimpleNamespace(
        anywhere=lambda number: moved_by(places_px[number]), near=near, shift_px=lambda motion: abs(motion[7]),
        stretch_px=lambda: (0.0, 0.1), scattered_px=0.0,
    )  # fmt: skip
    for name, value in changes.items():
        setattr(seen, name, value)
    return seen


@pytest.mark.parametrize(("shift_px", "said"), [(0.07, []), (0.15, ["camera_moved_before"])])
def test_the_calibration_is_referred_to_the_video_where_the_floor_is_a_tenth_of_a_pixel_off(
    shift_px, said, monkeypatch
):
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    monkeypatch.setattr(view_at_start, "_found", lambda *_: {0: moved_by(shift_px)})
    moved, findings = calibration_at_start(calibration, FIRST, [("floor.jpg", FIRST)])
    assert [one.code for one in findings] == said
    assert (moved is not calibration) == bool(said)


@pytest.mark.parametrize(
    ("scattered_px", "stretch_px", "same"),
    [(0.4, 0.0, True), (0.7, 0.0, False), (0.0, 0.15, True), (0.0, 0.3, False), (0.0, -0.3, False)],
)
def test_a_floor_is_the_same_where_places_scatter_by_half_a_pixel_or_its_sides_are_a_fifth_off(
    scattered_px, stretch_px, same
):
    seen = finding([0.0, 0.0], stretch_px=lambda: (stretch_px, 0.01), scattered_px=scattered_px)
    assert len(view_at_start._found(seen, [0, 1])) == 2 * same


@pytest.mark.parametrize("pictures", [1, 2, 8])
@pytest.mark.parametrize(("stretch_px", "same"), [(0.45, True), (0.75, False)])
def test_sides_that_are_off_by_less_than_three_deviations_are_noise_in_any_number_of_pictures(
    stretch_px, same, pictures
):
    seen = finding([0.0] * pictures, stretch_px=lambda: (stretch_px, 0.2))
    assert len(view_at_start._found(seen, range(pictures))) == pictures * same


@pytest.mark.parametrize(("left_at_two", "found_px"), [(0.9, 0.0), (0.5, 2.0)])
def test_the_floor_is_where_all_pictures_of_one_camera_have_it(left_at_two, found_px):
    """Three of five end at 0 px, two at 2 px, where they fit better: it counts what all five leave."""
    left = {0.0: [1.0] * 5, 2.0: [1.1] * 3 + [left_at_two] * 2}
    found = view_at_start._found(finding([0.0, 0.0, 0.0, 2.0, 2.0], left), range(5))
    assert [one.motion[7] for one in found.values()] == [found_px] * 5


def test_the_first_picture_counts_where_it_shows_the_floor_far_from_the_others():
    """Beyond the reach of the slopes from where those do. The mean of those was taken for its place."""
    places_px = [9.0, 0.0, 0.1, 0.2]
    seen = finding(places_px)
    near = seen.near
    seen.near = lambda number, place, hidden: (
        near(number, place, hidden) if abs(place[7] - places_px[number]) < 4 else None
    )
    seen.unmoved = lambda _: None
    found = view_at_start._found(seen, range(4))
    assert list(found) == [0, 1, 2, 3]
    assert found[0].motion[7] == 9.0
    seen.anywhere = lambda number: moved_by(places_px[number]) if number else None
    assert list(view_at_start._found(seen, range(4))) == [1, 2, 3]


@pytest.mark.parametrize("textured", [True, False])
def test_a_floor_is_not_too_plain_where_the_camera_moved_between_its_pictures(textured):
    rng, turns = np.random.default_rng(4), [0.0, 0.03, -0.03, 0.06]
    views = [moved_view(CAMERA, FLOOR, np.array([turn, -turn, 0, 0, 0, 0, 0, 0, 0])) for turn in turns]
    pictures = [floor_picture(*view, seed=5 + i) for i, view in enumerate(views)]
    plain = [np.rint(rng.normal(120, 3, FIRST.shape)).astype(np.uint8) for _ in turns]
    assert view_at_start._too_plain(CAMERA, FLOOR, pictures if textured else plain) != textured


@pytest.mark.parametrize("odd", [0, 2])
def test_a_camera_that_moved_between_the_pictures_of_the_floor_is_referred_to_the_first(odd):
    """Which holds the floor frame. The mean of all was taken: a camera that was knocked after it left poses off."""
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    knocked = moved_view(CAMERA, FLOOR, np.array([0.002, -0.0015, 0, 0, 0, 0, 0, 0, 0]))
    views = [(CAMERA, FLOOR)] * 4
    views[odd] = knocked
    names = [f"floor_{i}.jpg" for i in range(4)]
    floors = [(name, floor_picture(*view, seed=5 + i)) for i, (name, view) in enumerate(zip(names, views, strict=True))]
    _, findings = calibration_at_start(calibration, floor_picture(seed=9), floors[1:] if odd == 0 else floors[:2])
    assert findings == ()
    found, findings = calibration_at_start(calibration, floor_picture(seed=9), floors)
    codes = ["camera_moved_between", *["camera_moved_before"] * (odd == 0)]
    assert [one.code for one in findings] == codes
    others = names[1:] if odd == 0 else names[odd : odd + 1]
    assert f"in {', '.join(others)} the floor is displaced" in findings[0].text
    # Before the first picture: the calibration holds there, and the video's camera is turned back.
    true = view_before(CAMERA, FLOOR, np.array([0.002, -0.0015, 0, 0, 0, 0, 0, 0, 0])) if odd == 0 else (CAMERA, FLOOR)
    assert np.abs(seen_through((found.camera, found.floor)) - seen_through(true)).max() < 0.15


def test_a_floor_too_faint_to_settle_a_motion_shows_that_there_was_none():
    """Of one picture no fit ends."""
    calibration, first = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1), noisy_floor([(0, 0)], contrast=0.05)[0]
    for seed in (6, 8):
        floors = noisy_floor([(0, 0)] * 4, contrast=0.05, noise=1.0, seed=seed)
        found, findings = calibration_at_start(calibration, first, [(f"{i}.jpg", one) for i, one in enumerate(floors)])
        assert findings == ()
        assert found.camera is CAMERA
        assert 1e-3 < off_at_a_top(found, np.zeros(9))[1].max() < 4e-3

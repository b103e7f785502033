"""Held pictures of another zoom or crop, or turned over, seen by the floor behind the boards."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studies.worlds.boards import CornerScene, calibration_set
from studies.worlds.campaign import OBJECT, ROVER, THICKNESS_M, bending_tow, board_picture, view
from studies.worlds.folder import write_campaign
from studies.worlds.scenes import CeilingCamera, FilmedScene
from towval.calibration import behind_boards
from towval.calibration.behind_boards import Crop, as_floor_shows
from towval.calibration.blocks import DOUBTS
from towval.calibration.calibrate import CalibrateSettings, calibrate
from towval.commands import calibrate as calibrate_command
from towval.io.campaign import load_campaign
from towval.io.records import read_calibration
from towval.model import Floor
from towval.model.errors import RefusedError

SIZE = (1920, 1080)
MIDDLE = (np.array(SIZE) - 1) / 2
ZOOM = np.array([[1.03, 0.0, -40.0], [0.0, 1.03, -10.0], [0.0, 0.0, 1.0]])
FLIPS = {
    "mirrored": np.diag([-1.0, 1.0, 1.0]),
    "upside down and mirrored": np.diag([1.0, -1.0, 1.0]),
    "upside down": np.diag([-1.0, -1.0, 1.0]),
}
for flip in FLIPS.values():
    flip[:2, 2] = np.where(np.diag(flip)[:2] < 0, 2 * MIDDLE, 0.0)


def texture(seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).uniform(0, 255, (SIZE[1], SIZE[0])).astype(np.float32)
    blurred = cv2.GaussianBlur(noise, (0, 0), 6)
    return np.clip(128 + 15 * (blurred - blurred.mean()), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def scene() -> CornerScene:
    made = calibration_set(8300, floor="boards", noise_px=0.04, views=8)
    return replace(made, seen=replace(made.seen, doubts_std=np.ones(len(DOUBTS))))


def film(scene: CornerScene, moved: dict[str, np.ndarray], behind: dict[str, int] | None = None):
    """Corners and pictures of the boards before a floor of texture 0, some of them moved by homographies."""
    pictures, boards = [], []
    for each in scene.seen.observations:
        H = moved.get(each.name, np.eye(3))
        corners = cv2.perspectiveTransform(each.corners_px[:, None], H)[:, 0]
        picture = cv2.warpPerspective(texture((behind or {}).get(each.name, 0)), H, SIZE, flags=cv2.INTER_CUBIC)
        hull = cv2.convexHull(corners.astype(np.float32)).reshape(-1, 2)
        cv2.fillConvexPoly(picture, np.rint(hull).astype(np.int32), 255)
        pictures.append((each.name, picture))
        boards.append(replace(each, corners_px=corners))
    held = len(scene.seen.boards)
    observed = replace(scene.seen, boards=tuple(boards[:held]), floor_boards=tuple(boards[held:]))
    return observed, pictures


def held(scene: CornerScene) -> list[str]:
    return [each.name for each in scene.seen.boards]


def farthest_px(found, scene: CornerScene) -> float:
    truth = {each.name: each.corners_px for each in scene.seen.boards}
    return max(float(np.abs(each.corners_px - truth[each.name]).max()) for each in found.boards)


@pytest.mark.parametrize("every", [1, 2])
def test_another_zoom_and_crop_is_corrected_and_named(scene, every):
    observed, pictures = film(scene, dict.fromkeys(held(scene)[::every], ZOOM))
    assert farthest_px(observed, scene) > 20
    found, dropped, (named,) = as_floor_shows(observed, pictures, 1)
    assert farthest_px(found, scene) < 0.5
    assert not dropped
    assert named.code == "held-differ"
    assert re.search(r"magnified by \+(3\.0|2\.99)", named.text)
    assert held(scene)[0] in named.text
    assert (held(scene)[1] in named.text) == (every == 1)
    # What is known is not doubted any more; the board's own doubts are left.
    assert (found.doubts_std > 0).tolist() == [True] * 7 + [False] * 3


def test_another_zoom_of_pictures_of_the_floor_is_corrected_and_named(scene):
    """They were taken for pictures of the same camera: places came out up to 36 mm off."""
    flat = [each.name for each in scene.seen.floor_boards]
    observed, pictures = film(scene, dict.fromkeys(flat[1:3], ZOOM))
    found, dropped, (named,) = as_floor_shows(observed, pictures, 1)
    truth = {each.name: each.corners_px for each in scene.seen.floor_boards}
    assert max(np.abs(each.corners_px - truth[each.name]).max() for each in found.floor_boards) < 0.5
    assert all(a is b for a, b in zip(found.boards, observed.boards, strict=True))
    assert not dropped
    assert named.code == "held-differ"
    assert flat[1] in named.text
    assert held(scene)[0] not in named.text


def test_pictures_of_the_floor_of_another_zoom_leave_boards_before_other_backgrounds(scene):
    flat, elsewhere = scene.seen.floor_boards[1].name, {name: 1 + i for i, name in enumerate(held(scene))}
    observed, pictures = film(scene, {flat: ZOOM}, elsewhere)
    found, dropped, (named,) = as_floor_shows(observed, pictures, 1)
    assert not dropped
    assert found.boards == observed.boards
    assert (found.doubts_std == observed.doubts_std).all()
    assert flat in named.text


def test_a_zoom_scatters_by_what_is_stated():
    """Monte-Carlo over backgrounds and noise, a picture magnified by 1 % by OpenCV."""
    errors, board = [], np.array([[450.0, 250.0], [500.0, 250.0], [500.0, 290.0], [450.0, 290.0]])
    for seed in range(8):
        rng = np.random.default_rng(seed)
        octaves = [(side, rng.normal(size=(540 // side + 2, 960 // side + 2))) for side in (2, 4, 8, 16)]
        wall = sum(np.sqrt(side) * cv2.resize(own, (960, 540), interpolation=cv2.INTER_CUBIC) for side, own in octaves)
        wall = 128 + 30 * wall / np.std(wall)
        larger = cv2.getRotationMatrix2D(((960 - 1) / 2, (540 - 1) / 2), 0, 1.01)
        magnified = cv2.warpAffine(wall, larger, (960, 540), flags=cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REFLECT)
        noisy = [np.clip(np.rint(luma + rng.normal(0, 3, luma.shape)), 0, 255) for luma in (wall, magnified)]
        floor, held = (behind_boards._features(luma.astype(np.uint8), [board], mirrored=False) for luma in noisy)
        errors.append(100 * (behind_boards._crop((floor, floor), held, 800.0).zoom - 1.01))
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) / behind_boards.CONSTANTS.zoom_std_percent < 1.6


def test_a_turned_camera_took_the_same_pictures(scene):
    K = scene.camera.matrix
    turned = K @ cv2.Rodrigues(np.array([0.01, -0.015, 0.03]))[0] @ np.linalg.inv(K)
    observed, pictures = film(scene, dict.fromkeys(held(scene), turned))
    found, dropped, findings = as_floor_shows(observed, pictures, 1)
    assert not dropped
    assert not findings
    assert all(a is b for a, b in zip(found.boards, observed.boards, strict=True))


def test_boards_on_the_floor_seen_by_a_camera_that_was_turned_are_left_out(scene):
    """They tilted the floor, and positions were off by many stated deviations without a word."""
    K = scene.camera.matrix
    turned = K @ cv2.Rodrigues(np.array([0.006, -0.008, 0.002]))[0] @ np.linalg.inv(K)
    flat = [each.name for each in scene.seen.floor_boards]
    observed, pictures = film(scene, dict.fromkeys([*flat[2:4], *held(scene)[:2]], turned))
    found, dropped, (named,) = as_floor_shows(observed, pictures, 1)
    assert [each.name for each in found.floor_boards] == [name for name in flat if name not in flat[2:4]]
    assert found.boards == observed.boards
    assert list(dropped) == flat[2:4]
    assert named.code == "floor-turned"
    assert flat[2] in named.text


def test_of_a_board_on_the_floor_that_is_left_out_no_other_crop_is_named(scene):
    K, flat = scene.camera.matrix, [each.name for each in scene.seen.floor_boards]
    turned = K @ cv2.Rodrigues(np.array([0.006, -0.008, 0.02]))[0] @ np.linalg.inv(K)
    turned = np.array([[1.02, 0, 40.0], [0, 1.02, -15.0], [0, 0, 1]]) @ turned
    observed, pictures = film(scene, {flat[2]: turned})
    found, dropped, named = as_floor_shows(observed, pictures, 1)
    assert [each.code for each in named] == ["floor-turned"]
    assert list(dropped) == [flat[2]]
    assert all(a is b for a, b in zip(found.boards, observed.boards, strict=True))


@pytest.mark.parametrize(("middle_px", "turn_rad", "turned"), [(0.7, 0.0, False), (1.5, 0.0, True), (0.0, 0.002, True)])
def test_a_turn_counts_that_displaces_a_corner_of_a_picture_by_a_pixel(middle_px, turn_rad, turned):
    seen = Crop(middle_px=np.array([middle_px, 0.0]), turn_rad=turn_rad, std_px=0.1)
    assert (seen.turned_px(SIZE) > 0) == turned


def test_a_crop_is_no_turn():
    shift_px = np.array([30.0, -10.0])
    assert Crop(shift_px=shift_px, std_px=0.3, middle_px=shift_px + 0.5).turned_px(SIZE) == 0


@pytest.mark.parametrize(("middle_px", "shift_px"), [(0.5, 0.0), (2.0, 5.0)])
def test_a_crop_and_a_turn_that_undo_one_another_are_noise(middle_px, shift_px):
    """A camera that stood still was said to have filmed with another crop, shifted by (1.4, -3.0) px."""
    focal_px = 1500.0
    H = np.array([[1.0, 0.0, middle_px], [0.0, 1.0, 0.0], [(5.0 - middle_px) / focal_px**2, 0.0, 1.0]])
    found = behind_boards._crop_of(H, 1e-9, focal_px, mirrored=False)
    assert found.shift_px == pytest.approx([shift_px, 0.0], abs=0.1)


@pytest.mark.parametrize("name", FLIPS)
def test_pictures_turned_over_are_named(scene, name):
    observed, pictures = film(scene, dict.fromkeys(held(scene)[1::2], FLIPS[name]))
    _, _, (named,) = as_floor_shows(observed, pictures, 1)
    assert named.code == "held-flipped"
    assert named.severity == "refusal"
    assert f"are {name} against" in named.text
    assert held(scene)[1] in named.text
    assert held(scene)[0] not in named.text


def test_the_command_refuses_mirrored_pictures(lab_small):
    def pictures(pattern, change=lambda picture: picture):
        paths = sorted((lab_small / "calibration").glob(pattern))
        return [(path.name, np.ascontiguousarray(change(cv2.imread(str(path), 0)))) for path in paths]

    given = load_campaign(lab_small)
    flat = pictures("floor.jpg") + pictures("floor_0.jpg")
    mirrored = pictures("board_0[0-5].jpg", lambda picture: picture[:, ::-1])
    with pytest.raises(RefusedError, match="mirrored against those of the floor"):
        calibrate(mirrored, flat, given.board, given.floor_reference, CalibrateSettings(("k1",), folds=3))


def test_other_backgrounds_say_nothing(scene):
    elsewhere = {name: 1 + i for i, name in enumerate(held(scene))}
    observed, pictures = film(scene, {}, elsewhere)
    assert as_floor_shows(observed, pictures, 1) == (observed, {}, ())


def test_a_board_is_not_taken_for_the_floor(scene):
    """On a plain floor the board is all that can be seen again, elsewhere in each picture."""
    observed, pictures = film(scene, {})
    plain, stamp = [], texture(5)
    for (name, picture), each in zip(pictures, observed.observations, strict=True):
        first = observed.floor_boards[0].corners_px
        H = cv2.findHomography(first, each.corners_px)[0] if len(first) == len(each.corners_px) else np.eye(3)
        board = cv2.warpPerspective(stamp, H, SIZE)
        plain.append((name, np.where(picture == 255, board, 128).astype(np.uint8)))
    assert as_floor_shows(observed, plain, 1) == (observed, {}, ())


def test_a_picture_without_the_floor_follows_the_others_where_they_agree(scene):
    names = held(scene)
    observed, pictures = film(scene, dict.fromkeys(names, ZOOM), {names[2]: 1})
    found, dropped, _ = as_floor_shows(observed, pictures, 1)
    assert farthest_px(found, scene) < 0.5
    assert not dropped
    observed, pictures = film(scene, dict.fromkeys(names[::2], ZOOM), {names[2]: 1})
    found, dropped, _ = as_floor_shows(observed, pictures, 1)
    assert list(dropped) == [names[2]]
    assert names[2] not in [each.name for each in found.boards]
    assert farthest_px(found, scene) < 0.5


def test_boards_without_a_picture_of_the_floor_are_as_they_were():
    marks = calibration_set(8301, views=4)
    assert as_floor_shows(marks.seen, [], 1) == (marks.seen, {}, ())


def test_a_camera_carried_round_a_board_on_the_floor_is_calibrated(tmp_path):
    """The lens is filmed by hand before the camera is mounted: the floor behind the boards says nothing of a crop."""
    folder, rng = tmp_path / "lab", np.random.default_rng(3)
    write_campaign(folder, frames=2)
    camera, _ = view()
    rover, towed = bending_tow(2)
    lying = np.eye(4)
    lying[2, 3] = THICKNESS_M
    for k in range(16):
        about = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi)).as_matrix()
        turn = Rotation.from_euler("x", rng.uniform(0.3, 0.6)).as_matrix() @ np.diag([1.0, -1, -1]) @ about
        place = [0.18, 0.12, 0.0] - rng.uniform(1.2, 1.9) / abs(turn[2, 2]) * turn[2]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = turn, -turn @ (place + np.array([*rng.uniform(-0.15, 0.15, 2), 0.0]))
        scene = FilmedScene(camera, Floor(T), (ROVER, OBJECT), (rover, lambda _: towed[0]), seed=0)
        picture = board_picture(camera, Floor(T), lying, rng, CeilingCamera(scene).ground)
        cv2.imwrite(str(folder / "calibration" / f"board_{k:02d}.png"), picture)
    calibrate_command.run(folder, tmp_path / "camera.mcap")
    found = read_calibration(tmp_path / "camera.mcap")
    assert found.camera.matrix[0, 0] == pytest.approx(camera.matrix[0, 0], rel=0.01)
    assert not {"held-differ", "held-flipped"} & {each.code for each in found.findings}


def test_a_picture_that_differs_by_chance_alone_is_not_named(scene, monkeypatch):
    """It was named as "magnified by +0.00 %, shifted by (0.1, 0.0) px", which is the mean of those that are like it."""
    shifts = dict.fromkeys((each.name for each in scene.seen.observations[:-1]), 0.2) | {held(scene)[3]: 1.1}
    crops = {name: Crop(shift_px=np.array([shift, 0.0]), std_px=0.1) for name, shift in shifts.items()}
    monkeypatch.setattr(behind_boards, "_crops", lambda *_: crops)
    found, dropped, findings = as_floor_shows(scene.seen, [], 1)
    assert all(a is b for a, b in zip(found.boards, scene.seen.boards, strict=True))
    assert not dropped
    assert not findings


@pytest.mark.parametrize(("shift_px", "differs"), [(3.0, False), (5.5, True)])
def test_a_shift_differs_from_four_deviations_on(shift_px, differs):
    held = Crop(shift_px=np.array([shift_px, 0.0]), std_px=1.0)
    assert held.differs(Crop(), SIZE) == differs


@pytest.mark.parametrize(("crop_px", "shift_px"), [(25.0, 0.0), (50.0, 50.0)])
def test_a_shift_of_a_third_of_a_turn_of_the_camera_is_of_its_lens(crop_px, shift_px):
    """The camera turned by 100 px between the pictures, the held one of which is cropped beside."""
    focal_px = 1500.0
    K = np.diag([focal_px, focal_px, 1.0])
    H = K @ cv2.Rodrigues(np.array([0.0, np.arctan(100 / focal_px), 0.0]))[0] @ np.linalg.inv(K)
    H = np.array([[1.0, 0.0, crop_px], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) @ H
    found = behind_boards._crop_of(H / H[2, 2], 1e-9, focal_px, mirrored=False)
    assert found.shift_px == pytest.approx([shift_px, 0.0], abs=2.0)


def features(places, own, reduced=1.0):
    """Places with descriptors of random numbers, the same for the same number ``own``."""
    descriptors = np.random.default_rng(own).normal(size=(len(places), 128))
    return behind_boards._Features(np.asarray(places, dtype=float), descriptors.astype(np.float32), reduced)


def both(one, other):
    """Features of two parts of a picture."""
    places, descriptors = (
        np.concatenate([getattr(each, name) for each in (one, other)]) for name in ("places", "descriptors")
    )
    return behind_boards._Features(places, descriptors, one.reduced)


@pytest.mark.parametrize(("share", "same"), [(0.11, False), (0.2, True)])
def test_what_is_the_same_in_a_sixth_of_a_picture_is_the_floor(share, same):
    """A person who stays has less; all over the picture there is something else."""
    places = np.stack(np.meshgrid(np.linspace(-190, 190, 8), np.linspace(-110, 110, 8)), axis=-1).reshape(-1, 2)
    stays = features(np.sqrt(share) * places, 1)
    found = behind_boards._common_motion(*(both(stays, features(places, own)) for own in (2, 3)))
    assert (found is not None) == same


@pytest.mark.parametrize(("off_px", "agree"), [(0.7, True), (1.5, False)])
def test_places_agree_within_a_pixel_of_the_reduced_picture(off_px, agree):
    """Of 48 features of pictures reduced to half, 18 moved together, too few, and the others so far off."""
    places = 2.0 * np.stack(np.meshgrid(np.linspace(-190, 190, 8), np.linspace(-110, 110, 6)), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(0)
    off, angle = np.where(rng.permutation(48) < 18, 0.0, 2 * off_px), rng.uniform(0, 2 * np.pi, 48)
    moved = places + off[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    found = behind_boards._common_motion(features(places, 1, 2.0), features(moved, 1, 2.0))
    assert (found is not None) == agree


@pytest.mark.parametrize(("times", "seen"), [(1.3, False), (1.8, True)])
def test_half_as_much_again_of_a_board_is_left_out(times, seen):
    """A dot on a plain picture, so many times as far from the middle of the corners as the outermost of them."""
    picture = np.full((SIZE[1], SIZE[0]), 128, np.uint8)
    cv2.circle(picture, np.rint(MIDDLE + np.array([300 * times, 0.0])).astype(int).tolist(), 15, 255, -1)
    corners = MIDDLE + np.array([[-300, -200], [300, -200], [300, 200], [-300, 200]])
    assert bool(len(behind_boards._features(picture, [corners], mirrored=False).places)) == seen


def test_some_hundred_features_of_a_picture_are_compared():
    corner = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]])
    assert 250 < len(behind_boards._features(texture(0), [corner], mirrored=False).places) < 600


@pytest.mark.parametrize(("zoom", "shift_px", "differs"), [(1.0, 0.7, False), (1.0, 1.5, True), (1.0015, 0.0, True)])
def test_a_crop_differs_that_displaces_a_corner_of_a_picture_by_a_pixel(zoom, shift_px, differs):
    """From its middle the corner is 1100 px away."""
    assert Crop(zoom=zoom, shift_px=np.array([0.0, shift_px]), std_px=0.01).differs(Crop(), SIZE) == differs


@pytest.mark.parametrize(("turn_rad", "carried"), [(0.07, False), (0.15, True), (-0.15, True)])
def test_a_camera_that_turned_by_a_tenth_of_a_radian_in_its_picture_was_carried(turn_rad, carried):
    assert behind_boards._carried([Crop(), Crop(turn_rad=turn_rad)], SIZE) == carried


@pytest.mark.parametrize(("zooms", "carried"), [((1.0, 1.3), False), ((1.0, 1.3, 1.6), True)])
def test_a_camera_that_saw_the_floor_at_three_sizes_was_carried(zooms, carried):
    """A camera that stays has the zoom of the floor's pictures and another, each for several pictures."""
    assert behind_boards._carried([Crop(zoom=zoom) for zoom in zooms for _ in range(3)], SIZE) == carried


@pytest.mark.parametrize(("apart_px", "carried"), [(80.0, False), (150.0, True)])
def test_two_views_are_a_tenth_of_a_picture_apart(apart_px, carried):
    """110 px of 1920 × 1080, from the middle to a corner; of three views that is too many for a camera that stays."""
    crops = [Crop(shift_px=np.array([i * apart_px, 0.0])) for i in range(3)]
    assert behind_boards._carried(crops, SIZE) == carried


@pytest.mark.parametrize(("nearness", "tells"), [(0.65, True), (0.92, False)])
def test_a_feature_is_seen_again_where_the_next_is_a_quarter_farther(nearness, tells):
    """Each of thirty features has its match at this distance over that of another one elsewhere."""
    rng = np.random.default_rng(0)
    places, elsewhere = rng.uniform(-500, 500, (2, 30, 2))
    own, decoys, off = features(places, 1), features(elsewhere, 1), 0.1 * rng.normal(size=(30, 128))
    moved = replace(own, places=places + 30.0, descriptors=(own.descriptors + nearness * off).astype(np.float32))
    decoys = replace(decoys, descriptors=(own.descriptors - off).astype(np.float32))
    assert (behind_boards._common_motion(own, both(moved, decoys)) is not None) == tells


@pytest.mark.parametrize(("width_px", "compared_px"), [(1920, 400), (300, 300)])
def test_pictures_are_compared_at_four_hundred_pixels_of_width_or_their_own(width_px, compared_px):
    picture, corner = cv2.resize(texture(0), (width_px, width_px // 2)), np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]])
    found = behind_boards._features(picture, [corner], mirrored=False)
    assert width_px / found.reduced == pytest.approx(compared_px, rel=0.3)
    assert np.ptp(found.places[:, 0]) == pytest.approx(width_px, rel=0.1)

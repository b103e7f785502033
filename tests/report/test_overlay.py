import dataclasses

import av
import cv2
import numpy as np
import pytest

from report_scenes import LOST, SMALL_SIZE_PX, grey_film, quarter_turned, simulated_up_to, small_calibration, towed_run
from towval.io.video import Video
from towval.model import CameraTrack, Floor
from towval.model.errors import InputError
from towval.model.geometry import transform, turned_pixels
from towval.optics.projection import project
from towval.report.film import film_view
from towval.report.outlines import film_layers
from towval.report.overlay import drawn_pictures, stills, write_overlay
from towval.report.overlay_painter import Painter

FRAMES = 80
SIZE = SMALL_SIZE_PX


@pytest.fixture(scope="module")
def calibration():
    return small_calibration()


@pytest.fixture(scope="module")
def run():
    return towed_run(n=FRAMES)


@pytest.fixture(scope="module")
def footage(tmp_path_factory):
    return grey_film(tmp_path_factory.mktemp("footage") / "grey.mp4", frames=FRAMES)


@pytest.fixture(scope="module", autouse=True)
def _little_loss():
    """Colours of thin lines are told apart at a higher bit rate."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("towval.io.film._RATE_FACTOR", "12")
        yield


@pytest.fixture(scope="module")
def overlay(footage, calibration, run, tmp_path_factory):
    return write_overlay(footage, tmp_path_factory.mktemp("overlay") / "overlay.mp4", calibration, run)


def decoded(path):
    with av.open(path) as film:
        return [(float(f.pts * f.time_base), f.to_ndarray(format="rgb24")) for f in film.decode(video=0)]


def reddest(picture, at):
    """How much red stands out within two pixels of a place."""
    u, v = np.round(at).astype(int)
    patch = picture[v - 2 : v + 3, u - 2 : u + 3].astype(int)
    return (patch[..., 0] - patch[..., 1:].max(axis=-1)).max()


def test_format_is_what_phones_play(overlay):
    with av.open(overlay) as film:
        context = film.streams.video[0].codec_context
        assert (context.name, context.profile, context.pix_fmt) == ("h264", "High", "yuv420p")
        assert (context.width, context.height) == SIZE
    content = overlay.read_bytes()
    assert 0 < content.index(b"moov") < content.index(b"mdat"), "the index does not come first"


def test_frames_and_times_are_those_of_the_footage(overlay, footage):
    assert [t for t, _ in decoded(overlay)] == pytest.approx([t for t, _ in decoded(footage)], abs=1e-9)


def test_measured_outline_is_drawn_at_the_height_of_the_top(overlay, calibration, run):
    frames = decoded(overlay)
    height = run.towed.tracked_plane_height_m
    for i in (5, 40):
        # In the first dash of the outline, from the first corner towards the second.
        start, end = transform(run.object_track.pose[i], run.towed.top_corners_m[:2])
        at = start + 0.04 * (end - start)
        top = project(calibration.camera, calibration.floor, [*at, height])
        on_the_floor = project(calibration.camera, calibration.floor, [*at, 0.0])
        assert np.linalg.norm(top - on_the_floor) > 3, "the place says nothing about the height"
        assert reddest(frames[i][1], top) > 60


def test_lost_frames_show_no_measured_outline(overlay, calibration, run):
    _, picture = decoded(overlay)[LOST.start + 5]
    corner = transform(run.simulated.pose[LOST.start + 5], run.towed.top_corners_m[0])
    at = project(calibration.camera, calibration.floor, [*corner, run.towed.tracked_plane_height_m])
    assert reddest(picture, at) < 40


def test_a_frame_after_the_simulation_is_told_from_one_that_was_not_tracked(calibration, run):
    text = Painter(calibration, simulated_up_to(run, 62), 640)._error_text
    assert text(run.rover_track.time_s[50]).startswith("error")
    assert text(run.rover_track.time_s[61]) == "object not tracked"
    assert text(run.rover_track.time_s[64]) == "object not simulated"


def test_colours_survive_where_nothing_is_drawn(overlay):
    _, picture = decoded(overlay)[20]
    # A corner without text or outline; coding at this quality moves a flat grey by a level or two.
    assert np.abs(picture[5:40, -60:].astype(int) - 128).max() <= 3


def test_wide_footage_is_scaled_down_to_even_sizes(calibration, run, footage, tmp_path):
    small = write_overlay(footage, tmp_path / "small.mp4", calibration, run, width_px=321)
    with av.open(small) as film:
        context = film.streams.video[0].codec_context
        assert (context.width, context.height) == (320, 180)


def test_same_data_give_the_same_bytes(calibration, run, footage, overlay, tmp_path):
    again = write_overlay(footage, tmp_path / "again.mp4", calibration, run)
    assert again.read_bytes() == overlay.read_bytes()


def test_an_overlay_replaces_overlays_and_nothing_else(calibration, run, footage, tmp_path):
    """Footage of another camera, or a picture, at the place of the output is kept to the last byte."""
    short = grey_film(tmp_path / "short.mp4", frames=2)
    target = write_overlay(short, tmp_path / "overlay.mp4", calibration, run)
    before = target.stat().st_ino
    assert write_overlay(short, target, calibration, run).stat().st_ino != before, "it was not written again"
    notes = tmp_path / "notes.mp4"
    notes.write_text("no film")
    for other in (short, footage, notes):
        content = other.read_bytes()
        with pytest.raises(InputError, match="is not replaced"):
            write_overlay(footage, other, calibration, run)
        assert other.read_bytes() == content


def test_frames_show_their_own_poses_where_tracking_has_found_other_times(calibration, footage, tmp_path):
    """A video that states 25 pictures a second of a camera that took 12.5: frame 40 is row 40, at 3.2 s."""
    slow = towed_run(n=FRAMES, fps=12.5)
    frames = decoded(write_overlay(footage, tmp_path / "slow.mp4", calibration, slow))
    start, end = transform(slow.object_track.pose[40], slow.towed.top_corners_m[:2])
    at = [*(start + 0.04 * (end - start)), slow.towed.tracked_plane_height_m]
    assert reddest(frames[40][1], project(calibration.camera, calibration.floor, at)) > 60
    assert [still.time_s for still in stills(footage, calibration, slow, [1.6])] == pytest.approx([3.2])


def test_an_offset_of_the_footage_is_taken_off(calibration, run, tmp_path):
    late = grey_film(tmp_path / "late.mp4", frames=5, first_pts=50)
    assert decoded(late)[0][0] == pytest.approx(2.0)
    film = decoded(write_overlay(late, tmp_path / "overlay.mp4", calibration, run))
    assert [t for t, _ in film] == pytest.approx([0, 0.04, 0.08, 0.12, 0.16], abs=1e-9)


def test_stills_are_the_drawn_frames_of_the_wanted_times(footage, overlay, calibration, run):
    # Backwards, and between two frames.
    found = stills(footage, calibration, run, [3.0, 0.99, 100.0])
    assert [still.time_s for still in found] == pytest.approx([3.0, 1.0], abs=1e-9)
    picture = cv2.imdecode(np.frombuffer(found[1].data, np.uint8), cv2.IMREAD_COLOR)
    assert found[1].size_px == SIZE
    assert np.abs(picture[..., ::-1].astype(int) - decoded(overlay)[25][1]).mean() < 2


def test_pictures_are_the_first_after_each_fifth_of_a_second_that_others_are_coded_from(footage, calibration, run):
    pictures = list(drawn_pictures(footage, calibration, run))
    times_s = [picture.time_s for picture in pictures]
    late_s = np.array(times_s) - np.arange(0, FRAMES / 25, 0.2)
    assert (late_s > -1e-9).all()
    assert (late_s < 4 / 25).all()
    # What was passed over changes no picture.
    assert [still.data for still in stills(footage, calibration, run, times_s)] == [each.data for each in pictures]


def test_footage_of_another_size_is_refused(calibration, run, tmp_path):
    film = grey_film(tmp_path / "other.mp4", frames=3, size_px=(320, 180))
    with pytest.raises(InputError, match="another size") as caught:
        write_overlay(film, tmp_path / "overlay.mp4", calibration, run)
    assert caught.value.got == "320 × 180"


def test_what_is_no_video_is_refused_and_nothing_is_left(calibration, run, tmp_path):
    (tmp_path / "notes.mp4").write_text("not a film")
    with pytest.raises(InputError, match=r"notes\.mp4"):
        write_overlay(tmp_path / "notes.mp4", tmp_path / "out" / "overlay.mp4", calibration, run)
    assert not (tmp_path / "out").exists()


def test_a_damaged_film_is_refused(calibration, run, footage, tmp_path):
    whole = footage.read_bytes()
    (tmp_path / "cut.mp4").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"cut\.mp4"):
        write_overlay(tmp_path / "cut.mp4", tmp_path / "overlay.mp4", calibration, run)
    assert not list(tmp_path.glob("*overlay*"))


def test_footage_of_a_turned_phone_comes_out_upright(calibration, run, footage, tmp_path):
    turned = tmp_path / "turned.mp4"
    turned.write_bytes(quarter_turned(footage.read_bytes()))
    upright_camera = dataclasses.replace(calibration.camera, resolution_px=SIZE[::-1])
    upright = dataclasses.replace(calibration, camera=upright_camera)
    with av.open(write_overlay(turned, tmp_path / "overlay.mp4", upright, run)) as film:
        context = film.streams.video[0].codec_context
        assert (context.width, context.height) == SIZE[::-1]


def test_footage_that_was_turned_for_tracking_is_drawn_on_as_it_was_tracked(calibration, run, footage, tmp_path):
    """And the page, whose film a browser turns by its tag, has its outlines where that shows them."""
    turned, n = tmp_path / "turned.mp4", len(run.rover_track.time_s)
    turned.write_bytes(quarter_turned(footage.read_bytes()))
    turns = -Video(turned).tagged_turns() % 4
    unknown, sound = np.full((n, 4), np.nan), np.zeros(n, dtype=np.uint8)
    view = calibration.camera, calibration.floor
    camera = CameraTrack(*view, np.zeros((n, 9)), unknown, unknown, sound, quarter_turns=turns)
    tracked = dataclasses.replace(run, rover_track=dataclasses.replace(run.rover_track, camera=camera))
    drawn = decoded(write_overlay(turned, tmp_path / "overlay.mp4", calibration, tracked))[20][1]
    as_it_is = decoded(write_overlay(footage, tmp_path / "upright.mp4", calibration, run))[20][1]
    assert drawn.shape == as_it_is.shape
    assert np.abs(drawn.astype(int) - as_it_is).mean() < 1.0

    film = film_view(turned, tracked, calibration, run.rover_track.time_s, "H.264", tmp_path / "report.html", False)
    assert film.size_px == SIZE[::-1]
    layers = film_layers(tracked, calibration, run.rover_track.time_s)
    shown = layers.turned(SIZE, -turns).pixels()["rover"][20]
    np.testing.assert_allclose(turned_pixels(shown, SIZE[::-1], turns), layers.pixels()["rover"][20], atol=0.1)


def test_outlines_follow_the_camera(calibration, run):
    """A knock of 9 px in the middle of the run, and a bump before it: the view is that of each picture."""
    motion = np.zeros((FRAMES, 9))
    motion[30:, 7:] = 9.0, -4.0
    floor = Floor(calibration.floor.T_camera_floor + 0.05 * np.eye(4, k=3))
    unknown, sound = np.full((FRAMES, 4), np.nan), np.zeros(FRAMES, dtype=np.uint8)
    camera = CameraTrack(calibration.camera, floor, motion, unknown, unknown, sound)
    moved = dataclasses.replace(run, rover_track=dataclasses.replace(run.rover_track, camera=camera))
    bumped = dataclasses.replace(calibration, floor=floor)
    times = run.rover_track.time_s
    seen, still = (film_layers(each, view, times).pixels() for each, view in ((moved, calibration), (run, bumped)))
    for name in ("rover", "measured", "tether", "simulated path"):
        gap = seen[name] - still[name]
        assert np.nanmax(np.abs(gap[:30])) < 0.05, name
        assert np.nanmax(np.abs(gap[30:] - [9, -4])) < 0.1, name

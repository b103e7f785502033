"""The command ``track`` where the clicks are missing or the video is damaged."""

import dataclasses
import itertools
import json

import cv2
import numpy as np
import pytest
import yaml

import towval.io.video
from marker_pictures import picture_with
from studies.camera_faults.film import read_film
from studies.camera_faults.light import glint_at_start
from studies.worlds.film import cut_off, write_video
from studies.worlds.scenes import ceiling
from towval.commands.calibrate import run as calibrate
from towval.commands.check import _start
from towval.commands.track import Begun, begin, known_starts, open_video
from towval.commands.track import run as track
from towval.io.campaign import load_campaign
from towval.io.mcap_file import read_provenance
from towval.io.records import read_calibration, read_tracks, write_calibration
from towval.io.video import Video, luma_plane
from towval.model import Calibration, Tag
from towval.model.conventions import FEWEST_FRAMES
from towval.model.errors import Faults, InputError
from towval.model.findings import finding
from towval.model.geometry import turned_pixels, wrapped
from towval.tracking import klt


@pytest.fixture(scope="module")
def camera(lab_small, tmp_path_factory):
    path = tmp_path_factory.mktemp("camera") / "camera.mcap"
    calibrate(lab_small, path)
    return path


@pytest.fixture
def campaign(tmp_path, lab_small):
    """A function that writes a changed copy of the sample campaign, whose run ``a`` is another video."""
    document = yaml.safe_load((lab_small / "campaign.yaml").read_text())
    (tmp_path / "calibration").symlink_to(lab_small / "calibration")

    def changed(change, video=None):
        document["runs"] = {"a": document["runs"]["a"] | {"video": str(video or lab_small / "a.mp4")}}
        change(document)
        (tmp_path / "campaign.yaml").write_text(yaml.safe_dump(document))
        return tmp_path

    return changed


def test_without_clicks_the_start_is_found(campaign, camera, lab_small, tmp_path):
    video = tmp_path / "short.mp4"
    write_video(video, itertools.islice(Video(lab_small / "a.mp4"), 60, 140, 10), crf="16")
    folder = campaign(lambda d: d["runs"]["a"].pop("first_frame_clicks_px"), video)
    track(folder, "a", camera, tmp_path / "track.mcap")
    truth = np.genfromtxt(lab_small / "a_truth.csv", delimiter=",", names=True)
    for body, found in read_tracks(tmp_path / "track.mcap").items():
        assert found.seen.all()
        assert "start_found" in {finding.code for finding in found.findings}
        true = np.array([truth[f"{body}_x_m"], truth[f"{body}_y_m"]]).T[60:140:10]
        # 2 px: half the resolution of lab_a, and one run's registration.
        assert np.linalg.norm(found.pose[:, :2] - true, axis=1).max() < 0.009


def test_the_correction_of_a_camera_that_moved_is_written_with_its_covariance(
    campaign, camera, lab_small, tmp_path, monkeypatch
):
    def corrected(calibration, *_):
        return dataclasses.replace(calibration, covariance=5 * calibration.covariance), ()

    video, known = tmp_path / "short.mp4", np.diagonal(read_calibration(camera).covariance)
    write_video(video, itertools.islice(Video(lab_small / "a.mp4"), 8), crf="16")
    folder, added = campaign(lambda _: None, video), []
    for _ in range(2):
        track(folder, "a", camera, tmp_path / "track.mcap")
        added.append(np.diagonal(read_tracks(tmp_path / "track.mcap")["rover"].camera.added))
        monkeypatch.setattr("towval.commands.track.calibrated_at_start", corrected)
    as_it_is, moved = added
    np.testing.assert_allclose(moved - as_it_is, 4 * known, rtol=1e-6)


def test_a_banner_over_the_object_is_not_tracked(campaign, camera, lab_small, tmp_path):
    def marked(luma):
        luma = luma.copy()
        cv2.rectangle(luma, (100, 445), (142, 462), 30, -1)
        cv2.putText(luma, "CAM 1", (101, 458), cv2.FONT_HERSHEY_SIMPLEX, 0.4, 250, 1)
        return luma

    frames = itertools.islice(Video(lab_small / "a.mp4"), 0, 120, 5)
    write_video(tmp_path / "banner.mp4", ((t, marked(luma)) for t, luma in frames), crf="16")
    track(campaign(lambda d: None, tmp_path / "banner.mp4"), "a", camera, tmp_path / "track.mcap")
    found = read_tracks(tmp_path / "track.mcap")["object"]
    assert "covered_at_start" in {finding.code for finding in found.findings}
    truth = np.genfromtxt(lab_small / "a_truth.csv", delimiter=",", names=True)
    true = np.array([truth["object_x_m"], truth["object_y_m"]]).T[0:120:5]
    assert found.seen.mean() > 0.9
    assert np.linalg.norm(found.pose[:, :2] - true, axis=1)[found.seen].max() < 0.009


@pytest.mark.parametrize("percent", [2, 3])
def test_light_on_a_top_leads_no_clicks_astray(lab_small, camera, percent):
    given, calibration = load_campaign(lab_small), read_calibration(camera)
    film = read_film(lab_small / "b.mp4", 8.0, (800.0, 480.0, 270.0, 0.0))
    lit = glint_at_start(film, percent, np.random.default_rng(0))
    starts = known_starts(given, given.run("b"), (lit.picture(0), lit.picture(len(film) - 1)), calibration)
    for body, start in starts.items():
        assert np.array_equal(start.corners_px, given.run("b").clicks_px[body])
        assert not start.findings
        assert not start.spread.any()


def test_a_start_that_is_not_certain_is_drawn_and_asked_for(campaign, camera, lab_small, tmp_path):
    def change(document):
        document["runs"]["a"].pop("first_frame_clicks_px")
        document["tether"]["rest_length_m"] = 0.2

    with pytest.raises(InputError, match="starts is not certain") as caught:
        track(campaign(change), "a", camera, tmp_path / "out" / "track.mcap")
    assert "best guess [[" in caught.value.got
    assert (tmp_path / "out" / "start.png").is_file()
    assert str(tmp_path / "out" / "start.png") in str(caught.value)
    assert not (tmp_path / "out" / "track.mcap").exists()


def test_tags_are_as_good_as_clicks(campaign, tmp_path):
    lens, floor = ceiling((960, 540), 780.0, distortion=(-0.05,))
    calibration = Calibration(lens, floor, np.zeros((18, 18)), 0.1)
    write_calibration(tmp_path / "camera.mcap", calibration, {})
    poses = {"rover": np.array([0.5, 0.3, 0.4]), "object": np.array([-0.6, -0.3, -0.2])}
    heights = {"rover": 0.42, "object": 0.25}
    tags = {
        "rover": [Tag("4X4_50", 3, 0.3, np.array([0.15, 0.05, 0.3]))],
        "object": [Tag("APRILTAG_36h11", 5, 0.2, np.array([-0.1, -0.05, 0.0]))],
    }
    luma = picture_with(tags["rover"], poses["rover"], heights["rover"], lens, floor)
    other = picture_with(tags["object"], poses["object"], heights["object"], lens, floor)
    luma[:, :480] = other[:, :480]
    noise = np.random.default_rng(3)
    noisy = (np.clip(luma + noise.normal(0, 2, luma.shape), 0, 255).astype(np.uint8) for _ in range(12))
    write_video(tmp_path / "tags.mp4", ((i / 25, picture) for i, picture in enumerate(noisy)), crf="12")

    def change(document):
        del document["runs"]["a"]["first_frame_clicks_px"]
        for body, own in tags.items():
            document[body]["tags"] = [
                {
                    "dictionary": tag.dictionary,
                    "number": tag.number,
                    "size_m": tag.size_m,
                    "at_m": tag.pose[:2].tolist(),
                    "heading_rad": float(tag.pose[2]),
                }
                for tag in own
            ]
        del document["object"]["load"]

    folder = campaign(change, tmp_path / "tags.mp4")
    given = load_campaign(folder)
    video = Video(tmp_path / "tags.mp4")
    seen = video.first_picture()
    start = _start(given, Begun(given.runs["a"], video, seen, calibration, ()), Faults())
    assert start.doubts == {}, "a check of the campaign searches for no outline where tags say it"
    track(folder, "a", tmp_path / "camera.mcap", tmp_path / "track.mcap")
    for body, found in read_tracks(tmp_path / "track.mcap").items():
        assert found.seen.all()
        assert np.linalg.norm(start.poses[body][:2] - poses[body][:2]) < 2.5e-3
        # The tops have no edges here: the pose is that of the tags alone, half a pixel of 4.7 mm.
        assert np.linalg.norm(found.pose[:, :2] - poses[body][:2], axis=1).max() < 2.5e-3
        assert np.abs(wrapped(found.pose[:, 2] - poses[body][2])).max() < np.deg2rad(1.0)


@pytest.mark.parametrize(("grey", "noise", "said"), [(16, 0, "16 throughout$"), (0, 3, "1 throughout but for noise"),
                                                     (128, 12, "128 throughout but for noise")])  # fmt: skip
def test_a_first_picture_that_shows_nothing_is_refused(campaign, camera, tmp_path, grey, noise, said):
    """A film that begins with black or grey: outlines, textures and clicks were said to be wrong."""
    rng = np.random.default_rng(0)
    pictures = [np.clip(grey + noise * rng.normal(size=(540, 960)), 0, 255).astype(np.uint8) for _ in range(12)]
    write_video(tmp_path / "black.mp4", ((i / 25, luma) for i, luma in enumerate(pictures)))
    folder = campaign(lambda _: None, tmp_path / "black.mp4")
    words = rf"(?m)first picture of the video .* shows nothing\n  got: the grey level {said}"
    with pytest.raises(InputError, match=words):
        track(folder, "a", camera, tmp_path / "track.mcap")


def test_a_video_of_a_camera_that_hung_the_other_way_up_is_turned(campaign, camera, lab_small, tmp_path):
    """It was refused. Its clicks were made in the picture that players show."""
    upside_down = ((at, np.ascontiguousarray(luma[::-1, ::-1])) for at, luma in Video(lab_small / "a.mp4"))
    write_video(tmp_path / "turned.mp4", itertools.islice(upside_down, FEWEST_FRAMES), crf="16")

    def clicked(document):
        clicks = document["runs"]["a"]["first_frame_clicks_px"]
        for body in clicks:
            clicks[body] = turned_pixels(clicks[body], (960, 540), 2).tolist()

    as_it_is = load_campaign(lab_small).runs["a"]
    given = load_campaign(campaign(clicked, tmp_path / "turned.mp4"))
    begun = begin(given, given.runs["a"], open_video(given, given.runs["a"]), read_calibration(camera))
    assert ([one.code for one in begun.findings], begun.video.quarter_turns) == (["video_turned"], 2)
    for body, pixels in as_it_is.clicks_px.items():
        np.testing.assert_allclose(begun.entry.clicks_px[body], pixels)


def test_a_cut_off_video_is_used_only_where_that_is_allowed(campaign, camera, lab_small, tmp_path):
    cut_off(lab_small / "a.mp4", tmp_path / "cut.mp4", 0.33)
    frames = Video(lab_small / "a.mp4").header.frames
    with pytest.raises(
        InputError, match=rf"damaged or truncated(.|\n)*of {frames} frames are good(.|\n)*damaged_video"
    ):
        track(campaign(lambda d: None, tmp_path / "cut.mp4"), "a", camera, tmp_path / "track.mcap")
    assert not (tmp_path / "track.mcap").exists()
    allowed = campaign(lambda d: d["runs"]["a"].update(damaged_video=True), tmp_path / "cut.mp4")
    track(allowed, "a", camera, tmp_path / "track.mcap")
    for found in read_tracks(tmp_path / "track.mcap").values():
        assert 10 < len(found.time_s) < frames
        assert found.seen.all()
        assert "video_damaged" in {finding.code for finding in found.findings}


def test_the_papers_points_leave_nothing_to_choose(campaign, camera, lab_small, tmp_path, monkeypatch):
    video, decoded = tmp_path / "short.mp4", []
    write_video(video, itertools.islice(Video(lab_small / "a.mp4"), 20), crf="20")
    monkeypatch.setattr(towval.io.video, "luma_plane", lambda frame: decoded.append(frame.pts) or luma_plane(frame))
    track(campaign(lambda d: None, video), "a", camera, tmp_path / "t.mcap", {"method": "klt", "samples": "auto"})
    constants = json.loads(read_provenance(tmp_path / "t.mcap")["constants"])
    assert constants["klt"] == dataclasses.asdict(klt.CONSTANTS)
    assert len(constants) > 10
    for found in read_tracks(tmp_path / "t.mcap").values():
        assert [(choice.chosen, choice.next) for choice in found.choices] == [("KLT points", "plane, 1024 points")]
    # The first frame, those up to a late one (the last, in so short a video), and the pass.
    assert len(decoded) == 1 + 20 + 20


@pytest.mark.parametrize(
    ("codes", "words"),
    [
        (["video_upside_down"], r"turned by 180°(.|\n)*turn the pixels(.|\n)*got: the clicks do not fit"),
        (["camera_moved_before"], "^the clicks do not fit"),
    ],
)
def test_a_run_is_refused_for_what_its_camera_shows_rather_than_for_its_clicks(
    campaign, camera, tmp_path, monkeypatch, codes, words
):
    """A video that its tag turned upside down was refused for clicks that do not fit, or bodies that are not found."""

    def refused(*_):
        raise InputError("the clicks do not fit", remedy="click anew")

    since = tuple(finding(code, shift_px=1.0, std_px=0.1) for code in codes)
    monkeypatch.setattr("towval.commands.track.calibrated_at_start", lambda calibration, *_: (calibration, since))
    monkeypatch.setattr("towval.commands.track._starts", refused)
    with pytest.raises(InputError, match=words):
        track(campaign(lambda _: None), "a", camera, tmp_path / "track.mcap")

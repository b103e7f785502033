"""The file for viewers: what is in it, that layouts name what is in it, and that other people's programs read it."""

import json
import os
import re
import shutil
import subprocess
import tracemalloc
from dataclasses import replace
from importlib.resources import files
from io import BytesIO

import av
import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from report_scenes import grey_film, numbered_film, small_calibration, towed_run, uncertainty_of
from towval.commands.exchange import film_pictures
from towval.io import records, ros
from towval.io.campaign import Run
from towval.io.exchange import LAYOUTS, _tether, write_layouts, write_run_file
from towval.io.mcap_file import Message, read_mcap, write_mcap
from towval.model.geometry import transform
from towval.report.overlay import drawn_pictures

FRAMES = 80


@pytest.fixture(scope="module")
def run():
    return towed_run(n=FRAMES)


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    """A folder with a run's files for viewers and those of two stages."""
    folder, calibration = tmp_path_factory.mktemp("exchange"), small_calibration()
    pictures = drawn_pictures(grey_film(folder / "a.mp4", FRAMES), calibration, run)
    write_run_file(folder / "exchange.mcap", run, calibration, pictures, {"versions": "{}"})
    write_layouts(folder)
    records.write_comparison(folder / "compare.mcap", run.comparison, run.object_track, run.simulated, {})
    records.write_uncertainty(folder / "uncertainty.mcap", uncertainty_of(run), run.simulated, {})
    records.write_calibration(folder / "camera.mcap", calibration, {})
    return folder


@pytest.fixture(scope="module")
def content(folder):
    return read_mcap(folder / "exchange.mcap")


def program(name):
    """Path of somebody else's program: called, never imported, for two of them are GPL."""
    path = shutil.which(name, path=os.pathsep.join([os.environ.get("TOWVAL_VIEWERS", ""), os.environ["PATH"]]))
    if path is None:
        pytest.skip(f"{name} is not installed: see docs/formats.md, or set TOWVAL_VIEWERS to its folder")
    return path


def output_of(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_outlines_are_the_tops_at_their_height(content, run):
    for frame, body in (("rover", run.rover), ("object", run.towed), ("object_simulated", run.towed)):
        cloud = content.values(f"/{frame}/outline")[-1]
        points = np.frombuffer(bytes(cloud.data), "<f4").reshape(-1, 3)
        assert cloud.header.frame_id == frame
        np.testing.assert_allclose(points[:, 2], body.tracked_plane_height_m, rtol=1e-6)
        np.testing.assert_allclose(points.min(axis=0)[:2], body.top_corners_m.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(points[0], points[-1])


def test_an_outline_comes_with_every_pose_for_viewers_draw_it_where_its_frame_was_at_its_own_time(content):
    for body, poses in (
        ("rover", "rover/pose"),
        ("object", "object/pose"),
        ("object_simulated", "object/pose_simulated"),
    ):
        np.testing.assert_array_equal(content.times_s(f"/{body}/outline"), content.times_s(f"/{poses}"))


def test_tether_runs_from_the_simulated_anchor_to_the_measured_hinge(content, run):
    clouds = content.values("/tether/line")
    points = np.frombuffer(bytes(clouds[20].data), "<f4").reshape(-1, 3)
    np.testing.assert_allclose(points[0, :2], transform(run.simulated.pose[20], run.anchor), atol=1e-6)
    np.testing.assert_allclose(points[-1, :2], transform(run.rover_track.pose[20], run.hinge), atol=1e-6)


def test_the_tether_is_drawn_at_the_heights_of_its_ends(run):
    raised = replace(run, hinge_height_m=0.4, anchor_height_m=0.1)
    clouds = (message.value for message in _tether(raised) if message.topic == "/tether/line")
    points = np.frombuffer(bytes(next(clouds).data), "<f4").reshape(-1, 3)
    np.testing.assert_allclose(points[[0, -1], 2], [0.1, 0.4], rtol=1e-6)


def test_errors_and_tension_are_numbers_that_viewers_plot(content, run):
    values = content.values("/object/error_state")
    seen = np.isfinite(run.comparison.along_across[:, 0])
    np.testing.assert_allclose([v.position[:2] for v in values], run.comparison.along_across[seen])
    tension = [v.effort[0] for v in content.values("/tether/state")]
    np.testing.assert_allclose(tension, np.hypot(*run.simulated.tether_force.T))


def test_pictures_come_five_times_a_second_with_a_camera_of_their_size(content):
    pictures, cameras = content.values("/camera/image"), content.values("/camera/camera_info")
    assert len(pictures) == len(cameras) == int(np.ceil(FRAMES / 25 / 0.2))
    with av.open(BytesIO(bytes(pictures[0].data)), format="mjpeg") as film:
        picture = next(film.decode(video=0))
    assert (picture.width, picture.height) == (cameras[0].width, cameras[0].height)


@pytest.fixture(scope="module")
def passed_on(run, tmp_path_factory):
    """The file of a run whose footage viewers decode themselves, and the footage."""
    folder, calibration = tmp_path_factory.mktemp("passed_on"), small_calibration()
    film = numbered_film(folder / "a.mp4", FRAMES, bf="0")
    pictures = film_pictures(Run("a", film, {}), calibration, run)
    write_run_file(folder / "exchange.mcap", run, calibration, pictures, {"versions": "{}"})
    return folder / "exchange.mcap", film


def test_footage_that_viewers_take_is_passed_on_as_it_is_at_the_times_of_its_poses(passed_on, run):
    file, film = passed_on
    content = read_mcap(file)
    pictures, cameras = content.values("/camera/image"), content.values("/camera/camera_info")
    assert {picture.format for picture in pictures} == {"h264"}
    np.testing.assert_allclose(content.times_s("/camera/image"), run.rover_track.time_s, atol=1e-9)
    assert (cameras[0].width, cameras[0].height) == small_calibration().camera.resolution_px
    # Start codes, some of a byte less, take the place of lengths.
    stored = sum(packet.size for packet in av.open(film).demux(video=0))
    passed = sum(len(picture.data) for picture in pictures)
    assert abs(passed - stored) < 4 * FRAMES


def test_footage_whose_pictures_are_not_those_of_the_poses_is_drawn(run, tmp_path):
    """As of a damaged film, whose good part was tracked."""
    film = numbered_film(tmp_path / "a.mp4", FRAMES + 5, bf="0")
    pictures = list(film_pictures(Run("a", film, {}), small_calibration(), run))
    assert {picture.coding for picture in pictures} == {"jpeg"}


def test_rerun_takes_passed_on_footage_for_a_film(passed_on, tmp_path):
    rerun = program("rerun")
    output_of(rerun, "mcap", "convert", passed_on[0], "-o", tmp_path / "run.rrd")
    printed = output_of(rerun, "rrd", "print", tmp_path / "run.rrd")
    assert re.search(r"/camera/image - data columns: \[.*VideoStream:codec.*VideoStream:sample", printed)


def test_the_layout_names_only_topics_and_frames_of_the_file(folder, content):
    layout = json.loads((folder / "lichtblick.json").read_text())
    panels = layout["configById"]
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    named = {path.split(".")[0] for path in paths if path.startswith("/")}
    named |= set(panels["3D!floor"]["topics"]) | set(panels["Image!camera"]["imageMode"].values())
    assert named <= set(content.topics)
    shown = re.findall(r"\w+!\w+", json.dumps(layout["layout"]))
    assert sorted(shown) == sorted(panels)


def test_the_layout_says_a_field_with_each_colour_for_without_one_the_viewer_chooses_its_own(folder):
    topics = json.loads((folder / "lichtblick.json").read_text())["configById"]["3D!floor"]["topics"]
    clouds = [settings for settings in topics.values() if settings.get("colorMode") == "flat"]
    assert len(clouds) == 4
    assert all(settings["colorField"] == "x" for settings in clouds)


def test_layouts_are_copied_whole(folder):
    for name in LAYOUTS:
        assert (folder / name).read_bytes() == (files("towval.io") / "layouts" / name).read_bytes()


def test_rosbags_reads_every_message(folder):
    with AnyReader([folder / "exchange.mcap"]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


@pytest.mark.parametrize("name", ["exchange", "compare", "uncertainty", "camera"])
def test_pymcap_cli_doctor_finds_nothing(folder, name):
    assert "passed" in output_of(program("pymcap-cli"), "doctor", folder / f"{name}.mcap")


def test_evo_finds_the_same_path_error(folder, run):
    from_evo = output_of(program("evo_ape"), "bag2", folder / "compare.mcap", "/object/pose", "/object/pose_simulated")
    rmse = float(re.search(r"rmse\s+([\d.]+)", from_evo)[1])
    assert rmse == pytest.approx(run.comparison.path_rms_m, abs=3e-4)


def test_rerun_understands_bodies_camera_and_plots(folder, tmp_path):
    rerun = program("rerun")
    output_of(rerun, "mcap", "convert", folder / "exchange.mcap", "-o", tmp_path / "run.rrd")
    printed = output_of(rerun, "rrd", "print", tmp_path / "run.rrd")
    for entity, component in (
        ("/camera/image", "EncodedImage"),
        ("/camera/camera_info", "Pinhole"),
        ("/tf", "Transform3D"),
        ("/rover/outline", "Points3D"),
        ("/tether/line", "Points3D"),
        ("/object/error_state/position", "Scalars"),
        ("/tether/state/effort", "Scalars"),
    ):
        assert re.search(rf"{entity} - data columns: \[.*{component}", printed), entity
    output_of(rerun, "rrd", "verify", folder / "rerun.rbl")


def test_rerun_has_run_and_layout_under_one_application_with_entities_that_are_there(folder, tmp_path):
    rerun, run = program("rerun"), tmp_path / "run.rrd"
    output_of(rerun, "mcap", "convert", folder / "exchange.mcap", "--application-id", "towval", "-o", run)
    recording = output_of(rerun, "rrd", "print", run)
    layout = output_of(rerun, "rrd", "print", "-vvv", folder / "rerun.rbl")
    assert re.search(r'StoreId\(\s*Recording,\s*"towval"', recording)
    assert re.search(r'StoreId\(\s*Blueprint,\s*"towval"', layout)
    named = set(re.findall(r"(?<![\w/])/(?:rover|object|object_simulated|tether|camera|tf|tf_static)\b[\w/]*", layout))
    assert {"/tether/line", "/object/error_state/position", "/camera/image"} <= named
    for entity in named:
        assert re.search(rf"{entity} - data columns", recording), entity


def test_messages_that_come_in_order_are_stored_among_the_others_and_not_held(tmp_path):
    """A film may be larger than memory."""

    def film():
        for i in range(60):
            picture = np.random.default_rng(i).integers(0, 256, 500_000, dtype=np.uint8)
            yield Message("/film", 10 * i, ros.compressed_image(1e-8 * i, "h264", picture))

    others = [Message("/other", 10 * i + 5, ros.number(i)) for i in range(59, -1, -1)]
    tracemalloc.start()
    write_mcap(tmp_path / "a.mcap", others, {}, {}, in_order=film())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 15e6, "half of the film"
    with (tmp_path / "a.mcap").open("rb") as stream:
        read = make_reader(stream).iter_messages(log_time_order=False)
        stored = [(channel.topic, message.log_time) for _, channel, message in read]
    assert [time for _, time in stored] == list(range(0, 600, 5))
    assert [topic for topic, _ in stored] == 60 * ["/film", "/other"]

"""MCAP: what is written is what is read, by us and by readers that share no code with us."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from towval.io import records
from towval.io.mcap_file import read_mcap, read_provenance, write_mcap
from towval.model import (
    Calibration,
    Camera,
    CameraTrack,
    Choice,
    Comparison,
    Features,
    Finding,
    Floor,
    Severity,
    SimulatedMotion,
    Stamp,
    Verdict,
    View,
)
from towval.model.errors import InputError
from towval.validation.decimate import decimate

PROVENANCE = {"versions": "{}", "settings": "{}"}


def circle(time_s):
    """More than one turn, so that headings must be unwrapped on reading."""
    angle = 0.8 * time_s
    return np.stack([np.cos(angle), np.sin(angle), angle], axis=1)


@pytest.fixture
def track(make_track):
    return make_track(circle, body="object", lost=range(40, 44))


@pytest.fixture
def calibration():
    T = np.eye(4)
    T[:3, :3] = np.diag([1.0, -1.0, -1.0])
    T[:3, 3] = 0.1, 0.2, 4.0
    view = View(
        "board_00.jpg", np.arange(6.0).reshape(3, 2), np.ones((3, 2)), np.full((3, 2), np.nan), 12.5, False, "blurred"
    )
    return Calibration(
        camera=Camera(
            (960, 540), np.array([[700.0, 0, 480], [0, 701, 270], [0, 0, 1]]), np.arange(8) / 100, "rational"
        ),
        floor=Floor(T),
        covariance=np.eye(18) * 1e-6,
        corner_noise_px=0.07,
        views=(view,),
        findings=(Finding(Severity.WARNING, "extrapolated", "the boards cover half the floor"),),
        quality={"camera_height_m": 4.0},
    )


@pytest.fixture
def simulated():
    time_s = np.arange(50) / 25
    pose = circle(time_s)
    return SimulatedMotion(
        time_s,
        pose,
        pose * 0.1,
        pose[:, :2] * 3,
        0.6 + 0.01 * time_s,
        "converged",
        "nothing to do",
        "dynamics",
        statistics={"steps": 120.0},
    )


def watched_camera(count):
    """A camera that moved, was not registered twice, and whose stamps are doubted; its tops showed no edges."""
    rng = np.random.default_rng(2)
    picture = rng.normal(size=(count, 4))
    picture[3:5] = np.nan
    stamps = np.zeros(count, dtype=np.uint8)
    stamps[[2, 7]] = Stamp.REPEATED, Stamp.CONTRADICTED
    camera = Camera((640, 480), np.diag([500.0, 500, 1]), np.zeros(8), "none")
    motion, added = rng.normal(size=(count, 9)), rng.normal(size=(18, 18))
    return CameraTrack(camera, Floor(np.eye(4)), motion, picture, np.abs(picture), stamps, added=added, quarter_turns=2)


def same(first, second):
    for name in first.__dataclass_fields__:
        a, b = getattr(first, name), getattr(second, name)
        if isinstance(a, np.ndarray):
            np.testing.assert_allclose(a, b, atol=1e-12, err_msg=name)
        elif isinstance(a, float):
            assert a == b or (np.isnan(a) and np.isnan(b)), name
        elif name not in ("camera", "floor", "views", "features"):
            assert a == b, name


def test_calibration_round_trip(tmp_path, calibration):
    records.write_calibration(tmp_path / "camera.mcap", calibration, PROVENANCE)
    back = records.read_calibration(tmp_path / "camera.mcap")
    same(calibration, back)
    same(calibration.camera, back.camera)
    same(calibration.views[0], back.views[0])


@pytest.mark.parametrize(
    ("lens_model", "given", "model", "stored"),
    [
        ("k1 k2", [0.1, 0.2, 0, 0, 0, 0, 0, 0], "plumb_bob", [0.1, 0.2, 0, 0, 0]),
        ("rational", [0.1, 0.2, 0, 0, 0, 0.3, 0, 0], "rational_polynomial", [0.1, 0.2, 0, 0, 0, 0.3, 0, 0]),
        ("fisheye k1 k2 k3", [0.1, 0.2, 0, 0, 0.3, 0, 0, 0], "equidistant", [0.1, 0.2, 0.3, 0]),
    ],
)
def test_other_programs_read_the_lens_by_the_name_that_ros_has_for_it(
    tmp_path, calibration, lens_model, given, model, stored
):
    camera = replace(calibration.camera, distortion=np.array(given), lens_model=lens_model)
    records.write_calibration(tmp_path / "a.mcap", replace(calibration, camera=camera), PROVENANCE)
    with (tmp_path / "a.mcap").open("rb") as stream:
        read = make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages(["/camera/camera_info"])
        (info,) = (message for *_, message in read)
    assert info.distortion_model == model
    assert list(info.d) == pytest.approx(stored)
    again = records.read_calibration(tmp_path / "a.mcap").camera
    np.testing.assert_array_equal(again.lens, camera.lens)


def test_details_without_a_number_are_json_that_every_program_reads(tmp_path, calibration, track, simulated):
    apart = Choice("tracking", "40", "80", np.inf, "RMS of the measured path")
    written = replace(calibration, quality={"halves_difference_mm": np.inf}, choices=(apart,))
    records.write_calibration(tmp_path / "camera.mcap", written, PROVENANCE)
    records.write_tracks(tmp_path / "track.mcap", {"object": replace(track, choices=(apart,))}, PROVENANCE)

    def refuse(name):
        raise AssertionError(f"{name} is no JSON")

    # A simpler model that ends early is infinitely far from the dynamics.
    records.write_simulated(tmp_path / "simulate.mcap", replace(simulated, statistics={"far": np.inf}), PROVENANCE)
    for name in ("camera.mcap", "track.mcap", "simulate.mcap"):
        with (tmp_path / name).open("rb") as stream:
            (details,) = make_reader(stream).iter_attachments()
        json.loads(details.data, parse_constant=refuse)
    back = records.read_calibration(tmp_path / "camera.mcap")
    assert np.isnan(back.quality["halves_difference_mm"])
    assert np.isnan(back.choices[0].change_m)
    assert np.isnan(records.read_simulated(tmp_path / "simulate.mcap").statistics["far"])


def test_tracks_round_trip(tmp_path, track, make_track):
    points = np.random.default_rng(0).normal(size=(6, 3))
    features = Features(np.array([0, 0, 0, 1, 1, 7]), points.astype(np.float32), np.ones(6))
    tracks = {"rover": make_track(circle, seed=9), "object": track}
    tracks["object"] = type(track)(**{**track.__dict__, "features": features})
    camera = watched_camera(len(track.time_s))
    tracks = {name: replace(each, camera=camera) for name, each in tracks.items()}
    records.write_tracks(tmp_path / "track.mcap", tracks, PROVENANCE)
    back = records.read_tracks(tmp_path / "track.mcap", features=True)
    assert back.keys() == tracks.keys()
    for name, written in tracks.items():
        same(written, back[name])
        same(camera, back[name].camera)
    same(features, back["object"].features)


def test_decimated_round_trip(tmp_path, track):
    thin = {"object": decimate(track)}
    records.write_decimated(tmp_path / "decimate.mcap", thin, PROVENANCE)
    same(thin["object"], records.read_decimated(tmp_path / "decimate.mcap")["object"])


def test_a_body_that_turns_on_the_spot_has_turned_as_far_when_it_is_read_again(tmp_path, make_track):
    """By more than half a turn between two kept poses: the shorter way to that heading leads the other way round."""

    def turning(t):
        return np.column_stack([0 * t, 0 * t, 0.2 * np.clip(t - 2, 0, 18)])

    thin = decimate(make_track(turning, duration_s=22.0))
    assert np.diff(thin.pose[:, 2]).max() > np.pi
    records.write_decimated(tmp_path / "decimate.mcap", {"rover": thin}, PROVENANCE)
    same(thin, records.read_decimated(tmp_path / "decimate.mcap")["rover"])


def test_simulated_round_trip(tmp_path, simulated):
    records.write_simulated(tmp_path / "simulate.mcap", simulated, PROVENANCE)
    same(simulated, records.read_simulated(tmp_path / "simulate.mcap"))


def test_comparison_round_trip(tmp_path, track, simulated):
    n = len(track.time_s)
    error = np.where(track.seen[:, None], 0.001 * np.ones((n, 3)), np.nan)
    comparison = Comparison(
        "a",
        track.time_s,
        error,
        error[:, :2],
        error[:, 0] / 2e-3,
        0.001,
        0.002,
        0.001,
        0.01,
        3.0,
        1e-7,
        np.nan,
        5e-4,
        np.nan,
        Verdict.NOT_JUDGED,
        n - 4,
        4,
        0.0015,
        0.0004,
        np.nan,
        0.0005,
    )
    records.write_comparison(tmp_path / "compare.mcap", comparison, track, simulated, PROVENANCE)
    same(comparison, records.read_comparison(tmp_path / "compare.mcap"))


def test_the_same_content_gives_the_same_bytes(tmp_path, track):
    for name in ("one", "two"):
        records.write_tracks(tmp_path / f"{name}.mcap", {"object": track}, PROVENANCE)
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()


def test_mcap_ros2_reads_the_poses(tmp_path, track):
    """A decoder that works from the message definitions in the file alone."""
    records.write_tracks(tmp_path / "track.mcap", {"object": track}, PROVENANCE)
    with (tmp_path / "track.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        rows = [(m.log_time, v) for _, _, m, v in reader.iter_decoded_messages(topics=["/object/pose"])]
        assert reader.get_header().profile == "ros2"
    seen = np.flatnonzero(track.seen)
    assert len(rows) == len(seen)
    for i, (log_time, value) in zip(seen, rows, strict=True):
        assert value.header.frame_id == "floor"
        assert log_time == round(track.time_s[i] * 1e9)
        assert value.header.stamp.sec * 10**9 + value.header.stamp.nanosec == log_time
        assert value.pose.pose.position.x == track.pose[i, 0]
        assert value.pose.pose.orientation.z == pytest.approx(np.sin(track.pose[i, 2] / 2), abs=1e-15)
        assert value.pose.covariance[35] == track.covariance[i, 2, 2]


def test_rosbags_reads_every_message(tmp_path, calibration, simulated):
    records.write_simulated(tmp_path / "simulate.mcap", simulated, PROVENANCE)
    records.write_calibration(tmp_path / "camera.mcap", calibration, PROVENANCE)
    for name, topics in (
        ("simulate", {"/object/pose_simulated", "/tether/wrench"}),
        ("camera", {"/camera/camera_info", "/tf_static"}),
    ):
        with AnyReader([tmp_path / f"{name}.mcap"]) as reader:
            assert topics <= set(reader.topics)
            for connection, _, data in reader.messages():
                reader.deserialize(data, connection.msgtype)


def test_the_camera_is_turned_as_scipy_says():
    """At random, and where a part of the quaternion is zero or two are equal: half turns, thirds of a turn."""
    turns = [*Rotation.random(200, rng=3), *(Rotation.create_group("O"))]
    for turn in turns:
        T = np.eye(4)
        T[:3, :3] = turn.as_matrix().T
        q = records.camera_place(Floor(T), 0.0).value.transforms[0].transform.rotation
        parts, expected = np.array([q.x, q.y, q.z, q.w]), turn.as_quat()
        np.testing.assert_allclose(parts * np.sign(parts @ expected), expected, atol=1e-15)


def test_one_wrong_byte_is_always_refused(tmp_path, track):
    """Sixty places over the whole file."""
    path = tmp_path / "track.mcap"
    records.write_tracks(path, {"object": track}, PROVENANCE)
    whole = path.read_bytes()
    for place in np.linspace(0, len(whole) - 1, 60).astype(int):
        data = bytearray(whole)
        data[place] ^= 0x55
        path.write_bytes(data)
        with pytest.raises(InputError):
            records.read_tracks(path)


def test_a_missing_file_and_one_of_another_stage_are_told(tmp_path, simulated):
    with pytest.raises(InputError, match="is missing"):
        records.read_tracks(tmp_path / "no.mcap")
    records.write_simulated(tmp_path / "simulate.mcap", simulated, PROVENANCE)
    with pytest.raises(InputError, match="another stage"):
        records.read_calibration(tmp_path / "simulate.mcap")


def test_a_body_that_a_file_does_not_hold_is_told(track, tmp_path):
    """A track of one body, as of another program: the stage that asked for the other one ended with a traceback."""
    records.write_tracks(tmp_path / "track.mcap", {"object": track}, PROVENANCE)
    records.write_decimated(tmp_path / "decimate.mcap", {"object": decimate(track)}, PROVENANCE)
    for read, name in ((records.read_tracks, "track.mcap"), (records.read_decimated, "decimate.mcap")):
        found = read(tmp_path / name)
        assert list(found) == ["object"]
        with pytest.raises(InputError, match=rf"{name} holds no track of the rover\n  got: object"):
            found["rover"]


def test_a_failed_write_leaves_the_old_file(tmp_path, simulated):
    path = tmp_path / "simulate.mcap"
    records.write_simulated(path, simulated, PROVENANCE)
    before = path.read_bytes()
    with pytest.raises(AttributeError):
        records.write_simulated(path, simulated, {"versions": object()})
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["simulate.mcap"]


def test_provenance_is_kept(tmp_path, simulated):
    records.write_simulated(tmp_path / "simulate.mcap", simulated, {"versions": '{"towval": "1"}'})
    assert read_mcap(tmp_path / "simulate.mcap").provenance == {"versions": '{"towval": "1"}'}
    assert read_provenance(tmp_path / "simulate.mcap") == {"versions": '{"towval": "1"}'}
    with pytest.raises(InputError, match="missing"):
        read_provenance(tmp_path / "track.mcap")


READERS = {
    "camera": records.read_calibration,
    "track": records.read_tracks,
    "decimate": records.read_decimated,
    "simulate": records.read_simulated,
    "uncertainty": records.read_uncertainty,
    "compare": records.read_comparison,
}


@pytest.mark.parametrize("details", [{}, {"rover": 1}, {"rover": {}}, {"rover": {"time_ns": ["x"], "noise": None}}])
@pytest.mark.parametrize("name", READERS)
def test_a_whole_file_of_nonsense_is_one_message(tmp_path, name, details):
    path = tmp_path / f"{name}.mcap"
    write_mcap(path, [], details, PROVENANCE)
    with pytest.raises(InputError):
        READERS[name](path)


@pytest.mark.parametrize(
    ("begin", "name", "source"), [(b"SQLite format 3\0", "bag/x.db3", "bag"), (b"#ROSBAG V2.0\n", "x.bag", "x.bag")]
)
def test_other_recordings_of_ros_are_to_be_converted(tmp_path, monkeypatch, begin, name, source):
    """The advice was to run the stage again that made them."""
    monkeypatch.chdir(tmp_path)
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_bytes(begin)
    with pytest.raises(InputError, match=rf"no MCAP file(.|\n)*rosbags-convert --src {source} --dst"):
        read_mcap(Path(name))

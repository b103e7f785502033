"""The command tow: recordings of others, and where the object starts behind them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mcap.writer import Writer

from paper_plan import quick_plan
from towval.commands.plan import run, run_tow
from towval.io.campaign import load_campaign
from towval.io.chain import changed_sections, read_origin
from towval.io.mcap_file import Message, write_mcap
from towval.io.plan_files import read_tow
from towval.io.provenance import file_hash
from towval.io.records import read_simulated
from towval.io.ros import make, stamped_pose, stamped_vector, typestore
from towval.model.errors import InputError, RefusedError
from towval.validation.recorded_tow import standing

SAMPLE = Path(__file__).parents[2] / "data_samples" / "lab_small"


def test_rover_poses_of_somebody_elses_recording_are_read_too(tmp_path):
    file = tmp_path / "other.mcap"
    poses = np.array([[0.0, 0.0, 3.0], [0.1, 0.0, 3.2]])
    messages = [
        Message(topic, k * 10**9, stamped_pose(float(k), pose))
        for topic in ("/rover/pose", "/object/pose")
        for k, pose in enumerate(poses)
    ]
    write_mcap(file, messages, {}, {})
    times, read, _ = read_tow(file)
    np.testing.assert_allclose(times, [0.0, 1.0])
    np.testing.assert_allclose(read, poses)  # unwrapped across π


def bag(file, *topics):
    """A recording of others with poses on some topics, late and in bursts, and types that nobody knows here."""
    kind = "geometry_msgs/msg/PoseStamped"
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        text, _ = typestore().generate_msgdef(kind, ros_version=2)
        pose = writer.register_schema(name=kind, encoding="ros2msg", data=text.encode())
        custom = writer.register_schema(name="lab_msgs/msg/Wheels", encoding="ros2msg", data=b"float64 speed")
        channels = {
            topic: writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
            for topic, schema in {**dict.fromkeys(topics, pose), "/wheels": custom, "/raw": 0}.items()
        }
        for topic in ("/wheels", "/raw"):
            writer.add_message(channel_id=channels[topic], log_time=1, publish_time=1, data=b"12345678")
        for k in (1, 0, 2):
            data = typestore().serialize_cdr(stamped_pose(0.5 * k, np.array([0.1 * k, 0.0, 0.0])), kind)
            log_time = 7 * 10**9 + 10**6 * k
            for topic in topics:
                writer.add_message(
                    channel_id=channels[topic], log_time=log_time, publish_time=log_time, data=bytes(data)
                )
        writer.finish()
    return file


def test_a_recording_of_others_is_read_by_the_stamps_of_its_poses_whatever_else_it_holds(tmp_path):
    """Its own times are when messages arrived."""
    times, poses, _ = read_tow(bag(tmp_path / "bag.mcap", "/rover/pose", "/object/pose"))
    assert times.tolist() == [0.0, 0.5, 1.0]
    np.testing.assert_allclose(poses[:, 0], [0.0, 0.1, 0.2])
    with pytest.raises(InputError, match=r"no poses of the object(.|\n)*got: /raw, /rover/pose, /wheels"):
        read_tow(bag(tmp_path / "rover.mcap", "/rover/pose"))


def test_poses_of_another_type_are_named(tmp_path):
    file = tmp_path / "vectors.mcap"
    vectors = [Message("/rover/pose", 0, stamped_vector(0.0, "floor", np.zeros(3)))]
    write_mcap(file, vectors, {}, {})
    with pytest.raises(InputError, match=r"no stamped poses(.|\n)*geometry_msgs/msg/Vector3Stamped"):
        read_tow(file)


@pytest.mark.parametrize(
    ("x", "y", "z", "w"), [(0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.3, 0.0, 0.9), (0.2, 0.2, 0.2, 0.3)]
)
def test_an_orientation_that_is_no_heading_is_refused(tmp_path, x, y, z, w):
    """Of one that is not known, of a marker's frame with z down, of tracking with y up: all were headings."""
    poses = [stamped_pose(t, np.array([t, 0.0, 0.1])) for t in (0.0, 1.0)]
    leaning = make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
    poses[1] = replace(poses[1], pose=replace(poses[1].pose, orientation=leaning))
    messages = [Message(topic, 0, pose) for pose in poses for topic in ("/rover/pose", "/object/pose")]
    write_mcap(tmp_path / "leaning.mcap", messages, {}, {})
    with pytest.raises(InputError, match=r"/rover/pose of .* not upright(.|\n)*the first at 1 s"):
        read_tow(tmp_path / "leaning.mcap")


def test_poses_in_two_frames_are_refused(tmp_path):
    """Odometry of the rover and a map of the object were taken for one frame."""

    def in_frame(name, t):
        pose = stamped_pose(t, np.zeros(3))
        return replace(pose, header=replace(pose.header, frame_id=name))

    def written(rover, towed):
        messages = [Message("/rover/pose", 0, in_frame(rover, t)) for t in (0.0, 1.0)]
        write_mcap(tmp_path / "two.mcap", [*messages, Message("/object/pose", 0, in_frame(towed, 0.0))], {}, {})
        return tmp_path / "two.mcap"

    with pytest.raises(InputError, match=r"several frames\n  got: map, odom"):
        read_tow(written("odom", "map"))
    for rover, towed in (("/map", "map"), ("", "map")):
        assert len(read_tow(written(rover, towed))[0]) == 2


def recording(file, rover_s, object_s):
    """Rover at (t, 2 t, 0), object at (t − 1, 3, 0) at some times t."""
    messages = [Message("/rover/pose", round(1e9 * t), stamped_pose(t, np.array([t, 2 * t, 0.0]))) for t in rover_s]
    messages += [
        Message("/object/pose", round(1e9 * t), stamped_pose(t, np.array([t - 1, 3.0, 0.0]))) for t in object_s
    ]
    write_mcap(file, messages, {}, {})
    return file


@pytest.mark.parametrize(
    ("rover_s", "object_s", "times_s"),
    [
        ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0], [0.0, 1.0, 2.0, 3.0]),
        ([0.0, 1.0, 2.0, 3.0], [1.25, 2.0], [1.25, 2.0, 3.0]),
        ([0.5, 1.0, 2.0], [0.0, 1.0], [0.5, 1.0, 2.0]),
    ],
)
def test_a_tow_starts_when_both_bodies_are_known(tmp_path, rover_s, object_s, times_s):
    times, poses, start = read_tow(recording(tmp_path / "a.mcap", rover_s, object_s))
    assert times.tolist() == times_s
    np.testing.assert_allclose(poses, np.outer(times_s, [1.0, 2.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(start, [times_s[0] - 1, 3.0, 0.0], atol=1e-12)


def test_an_object_first_seen_after_the_rover_cannot_be_towed(tmp_path):
    with pytest.raises(InputError, match=r"after the last pose of the rover(.|\n)*the object from 5 s on"):
        read_tow(recording(tmp_path / "a.mcap", [0.0, 1.0], [5.0, 6.0]))


@pytest.mark.parametrize(
    ("rover_s", "object_s", "got"),
    [
        ([0.0, 1.0, 1.0, 2.0], [0.0], "two at 1 s"),
        ([0.0, 2.0], [2.0], "none after 2 s"),
        ([3.0], [0.0], "none after 3"),
    ],
)
def test_poses_of_the_rover_that_drive_no_tow_are_told_with_their_file_and_time(tmp_path, rover_s, object_s, got):
    with pytest.raises(InputError, match=rf"a\.mcap drive no tow(.|\n)*got: {got}"):
        read_tow(recording(tmp_path / "a.mcap", rover_s, object_s))


@pytest.mark.parametrize("topic", ["/rover/pose", "/object/pose"])
def test_a_pose_that_is_not_finite_is_told_with_its_file_and_time(tmp_path, topic):
    unknown = {topic: np.array([np.nan, 0.0, 0.0])}
    messages = [
        Message(name, k * 10**9, stamped_pose(float(k), unknown.get(name, np.zeros(3)) if k == 1 else np.zeros(3)))
        for name in ("/rover/pose", "/object/pose")
        for k in range(3)
    ]
    write_mcap(tmp_path / "a.mcap", messages, {}, {})
    with pytest.raises(InputError, match=rf"{topic} of .*a\.mcap holds poses(.|\n)*the first at 1 s"):
        read_tow(tmp_path / "a.mcap")


def beginning(file, apart_m):
    """A rover that drives off at 0.1 m/s, its hinge at first so far ahead of the anchor of an object at rest."""
    poses = {"/rover/pose": [[0.2 + apart_m + 0.1 * t, 0.0, 0.0] for t in range(5)], "/object/pose": [[0.0, 0.0, 0.0]]}
    messages = [
        Message(topic, t * 10**9, stamped_pose(float(t), np.array(pose)))
        for topic, rows in poses.items()
        for t, pose in enumerate(rows)
    ]
    write_mcap(file, messages, {}, {})
    return file


def test_a_tether_that_does_not_reach_at_first_is_refused(tmp_path):
    """A recording with the scene of another tow: the simulation threw the object over hundreds of metres."""
    towed = tmp_path / "t.mcap"
    with pytest.raises(RefusedError, match=r"1\.80 m apart(.|\n)*0\.60 m, where friction holds"):
        run_tow(quick_plan(), beginning(tmp_path / "a.mcap", 1.8), towed)
    assert not towed.exists()


@pytest.mark.parametrize(("longer_m", "codes"), [(-0.01, []), (0.0001, []), (0.003, ["start_nearer"])])
def test_a_tow_starts_as_near_as_friction_holds_the_object_at_rest(tmp_path, longer_m, codes):
    """Lengths are known to millimetres, by which the scene's tether of 100 kN/m pulled with hundreds of newtons."""
    plan, towed = quick_plan(), tmp_path / "t.mcap"
    outcome = run_tow(plan, beginning(tmp_path / "a.mcap", plan["tether"]["rest_length_m"] + longer_m), towed)
    assert [found.code for found in outcome.findings] == codes
    assert read_simulated(towed).findings == outcome.findings  # the file had only those of the integration
    weight_n = 9.81 * plan["cube"]["mass_kg"]
    pull_n = np.hypot(*read_simulated(towed).tether_force.T)
    assert pull_n[0] <= 1.25 * plan["friction"]["static"] * weight_n + 1e-6
    assert outcome.numbers["path_length_m"] == pytest.approx(0.4, abs=0.02)


def test_a_plan_and_a_tow_record_all_they_were_made_of(tmp_path):
    """With a campaign its keys were not recorded, and of a path from a file nothing was."""
    path, plan, towed = (tmp_path / name for name in ("path.csv", "plan.mcap", "towed.mcap"))
    pd.DataFrame({"x_m": np.linspace(0, 0.5, 9), "y_m": 0.0}).to_csv(path, index=False)
    run(quick_plan(), str(path), plan, tmp_path / "plan.csv", campaign=SAMPLE)
    run_tow(quick_plan(), plan, towed, campaign=SAMPLE)
    document = load_campaign(SAMPLE).document
    for file, of in ((plan, path), (towed, plan)):
        origin = read_origin(file)
        assert origin.inputs == {of.name: file_hash(of)}
        assert not changed_sections(origin, document)
        changed = changed_sections(origin, {**document, "object": {**document["object"], "mass_kg": 5.0}})
        assert changed == ["object"]


def test_an_mcap_without_rover_poses_is_refused_by_name(tmp_path):
    file = tmp_path / "empty.mcap"
    write_mcap(file, [], {}, {})
    with pytest.raises(InputError, match="no poses of the rover"):
        read_tow(file)


def test_a_gap_in_which_the_rover_changes_its_speed_is_stated(tmp_path):
    """A smooth curve bridges it, whatever the rover did: it waited and then hurried, or the other way round."""
    found = {}
    for name, missing in (("whole", ()), ("gap", range(12, 32))):
        hinge_m = 0.8 + np.r_[np.zeros(20), 0.01 * np.arange(30)]  # at rest, then 0.1 m/s from 2 s on
        messages = [
            Message("/rover/pose", k * 10**8, stamped_pose(0.1 * k, np.array([x, 0.0, 0.0])))
            for k, x in enumerate(hinge_m)
            if k not in missing
        ]
        messages.append(Message("/object/pose", 0, stamped_pose(0.0, np.zeros(3))))
        write_mcap(tmp_path / f"{name}.mcap", messages, {}, {})
        found[name] = run_tow(quick_plan(), tmp_path / f"{name}.mcap", tmp_path / f"towed_{name}.mcap").findings
    assert not found["whole"]
    (gap,) = found["gap"]
    assert gap.code == "tow_gap"
    assert "for 2.1 s from 1.10 s on" in gap.text


def test_a_decimated_track_cannot_tow(tmp_path):
    """Its few poses go with rates that a tow does not read: the object went up to 26 mm from where it should."""
    file = tmp_path / "decimate.mcap"
    write_mcap(file, [], {}, {"stage": "decimate"})
    with pytest.raises(InputError, match=r"decimated track(.|\n)*track\.mcap"):
        run_tow(quick_plan(), file, tmp_path / "t.mcap")


def driven(file, until_s, heading=0.0):
    """A rover of the sample campaign that drives 0.5 m between 1 and 6 s, its object with a heading 0.6 m behind.

    Its poses are a tenth of a millimetre off.
    """
    times, rng = np.arange(round(25 * until_s)) / 25, np.random.default_rng(3)
    share = np.clip((times - 1) / 5, 0, 1)
    rover = np.outer(0.42 + 0.5 * share**2 * (3 - 2 * share), [1, 0, 0])
    rover += 1e-4 * rng.standard_normal(rover.shape) * [1, 1, 0]
    towed = np.array([-0.6 - 0.25 * np.cos(heading), -0.25 * np.sin(heading), heading])
    messages = [
        Message(topic, round(1e9 * t), stamped_pose(t, pose))
        for topic, rows in {"/rover/pose": rover, "/object/pose": towed[None]}.items()
        for t, pose in zip(times, rows, strict=False)
    ]
    write_mcap(file, messages, {}, {})
    return file


def test_a_recorded_tow_sticks_while_its_rover_stands_as_a_simulated_run_does(tmp_path):
    """On the tether's pull the object crept after a parked rover by 16 mm, "converged" and without a word."""
    towed = tmp_path / "t.mcap"
    outcome = run_tow(quick_plan(), driven(tmp_path / "a.mcap", until_s=60), towed, campaign=SAMPLE)
    motion = read_simulated(towed)
    parked = motion.pose[motion.time_s > 8.0]
    assert outcome.numbers["outcome"] == "converged"
    assert motion.sticking
    assert outcome.numbers["path_length_m"] > 0.4
    assert np.ptp(parked, axis=0).max() < 1e-6


def test_a_plan_that_never_stands_is_towed_as_it_was_planned(tmp_path):
    plan, towed = tmp_path / "plan.mcap", tmp_path / "towed.mcap"
    run(quick_plan(), "line", plan, tmp_path / "plan.csv")
    run_tow(quick_plan(), plan, towed)
    assert not read_simulated(towed).sticking


def test_noise_of_poses_is_no_motion_of_a_rover_that_stands():
    """From one pose to the next the noise is thirty times as fast as what counts as standing."""
    times = np.arange(0, 20, 0.04)
    x = 0.1 * np.clip(times - 5, 0, 5)
    noise = 3e-4 * np.random.default_rng(1).standard_normal((len(times), 2))
    found = standing(times, np.column_stack([x, 0 * x]) + noise)
    assert np.mean(found[(times < 4.5) | (times > 10.5)]) > 0.8
    assert not found[(times > 5.2) & (times < 9.8)].any()
    assert not standing(times[:5], noise[:5]).any()


def test_a_tow_through_the_object_is_reported(tmp_path):
    """The stage simulate leaves such a run unjudged; the command said nothing."""
    found = {}
    for heading in (0.0, 3.0):
        file = driven(tmp_path / f"{heading}.mcap", 6, heading)
        found[heading] = run_tow(quick_plan(), file, tmp_path / "t.mcap", campaign=SAMPLE).findings
    assert "tether_across" not in {each.code for each in found[0.0]}
    assert "tether_across" in {each.code for each in found[3.0]}

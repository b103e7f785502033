"""``track.mcap`` and ``decimate.mcap`` and back."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np

from towval.io import ros
from towval.io.mcap_file import McapContent, Message, read_mcap, write_mcap
from towval.io.records.details import (
    choices_in,
    findings_in,
    planar_poses,
    planar_twists,
    result_reader,
    rows_of,
    view_in,
    view_out,
)
from towval.model import Array, CameraTrack, DecimatedTrack, Features, Stamp, Track, TrackStatus
from towval.model.conventions import CAMERA_FRAME, FLOOR_FRAME, PICTURE_MOTION, VIEW_MOTION
from towval.model.errors import InputError

OfBody = TypeVar("OfBody")

_LEVELS = {TrackStatus.TRACKED: 0, TrackStatus.COASTING: 1, TrackStatus.LOST: 2}
"""Level of a DiagnosticStatus (OK, WARN, ERROR) of a pose's status."""


def _stamp_text(stamp: Stamp) -> str:
    return "stamp " + stamp.name.lower().replace("_", " ")


_STAMPS = {_stamp_text(stamp): stamp for stamp in Stamp}

_MOTION = (*VIEW_MOTION, *PICTURE_MOTION, *(f"{name}_std" for name in PICTURE_MOTION))
"""Names of the numbers on ``/camera/motion``."""

_CORRELATION = (
    "the covariance on pose_frame is independent from picture to picture; what pose has beyond it (registration, "
    "calibration, height, motion of the camera, readout) is one unknown shared by all pictures of the run"
)
"""How the covariances of a track's poses go together in time."""

_STATUS = {level: status for status, level in _LEVELS.items()}


def write_tracks(path: Path, tracks: dict[str, Track], provenance: dict[str, str]) -> None:
    """Write ``track.mcap``: poses, features, tf and the diagnostics of every frame."""
    messages = [message for name, track in tracks.items() for message in track_messages(name, track)]
    messages += _frame_messages(tracks)
    camera = next(iter(tracks.values())).camera
    details: dict[str, Any] = {
        name: {
            "method": track.method,
            "start_covariance": track.start_covariance.tolist(),
            "correlation": _CORRELATION,
            "has_total": track.total_covariance is not None,
            "findings": rows_of(track.findings),
            "choices": rows_of(track.choices),
            "time_ns": [ros.nanoseconds(t) for t in track.time_s],
        }
        for name, track in tracks.items()
    }
    if camera is not None:
        messages += _camera_messages(next(iter(tracks.values())).time_s, camera)
        details[CAMERA_FRAME] = {
            **view_out(camera.camera, camera.floor),
            "size": camera.size,
            "size_std": camera.size_std,
            "added_covariance": camera.added.tolist(),
            "quarter_turns": camera.quarter_turns,
        }
    write_mcap(path, messages, details, provenance)


def track_messages(name: str, track: Track) -> Iterator[Message]:
    """Poses and features of a body, on the topics of its name."""
    for i in np.flatnonzero(track.status != TrackStatus.LOST):
        t = track.time_s[i]
        total = track.covariance if track.total_covariance is None else track.total_covariance
        for topic, covariance in (("pose", total[i]), ("pose_frame", track.covariance[i])):
            value = ros.pose_with_covariance(t, track.pose[i], covariance)
            yield Message(f"/{name}/{topic}", ros.nanoseconds(t), value)
    if track.features is not None and len(track.features.frame):
        order = np.argsort(track.features.frame, kind="stable")
        frames, starts = np.unique(track.features.frame[order], return_index=True)
        for frame, rows in zip(frames, np.split(order, starts[1:]), strict=True):
            t = track.time_s[frame]
            points = np.column_stack([track.features.floor_m[rows], track.features.weight[rows]])
            cloud = ros.point_cloud(t, FLOOR_FRAME, points, ("x", "y", "z", "weight"))
            yield Message(f"/{name}/features", ros.nanoseconds(t), cloud)


def _camera_messages(time_s: Array, camera: CameraTrack) -> Iterator[Message]:
    """How the view moved in every picture, and what that did to it."""
    rows = np.column_stack([camera.motion, camera.picture, camera.picture_std])
    for t, row in zip(time_s, rows, strict=True):
        yield Message("/camera/motion", ros.nanoseconds(t), ros.joint_state(t, _MOTION, row, [], []))


def _frame_messages(tracks: dict[str, Track]) -> Iterator[Message]:
    first = next(iter(tracks.values()))
    time_s, camera = first.time_s, first.camera
    for i, t in enumerate(time_s):
        poses = {name: track.pose[i] for name, track in tracks.items() if track.status[i] != TrackStatus.LOST}
        if poses:
            yield Message("/tf", ros.nanoseconds(t), ros.transforms(t, poses))
        entries = [
            (
                _LEVELS[TrackStatus(track.status[i])],
                name,
                TrackStatus(track.status[i]).name.lower(),
                {"inlier_fraction": repr(float(track.inlier_fraction[i])), "residual": repr(float(track.residual[i]))},
            )
            for name, track in tracks.items()
        ]
        if camera is not None:
            stamp = Stamp(camera.stamps[i])
            entries.append((0 if stamp == Stamp.AS_WRITTEN else 1, CAMERA_FRAME, _stamp_text(stamp), {}))
        yield Message("/diagnostics", ros.nanoseconds(t), ros.diagnostics(t, entries))


@result_reader
def read_tracks(path: Path, *, features: bool = False) -> dict[str, Track]:
    """Read ``track.mcap``: the track of each body by name, on request with its features, which take most time.

    Raises `InputError` when the file is missing, damaged or holds no tracks.
    """
    content = read_mcap(path, without=("/tf",) if features else ("/tf", "/features"))
    if not content.details or not content.values("/diagnostics"):
        raise InputError(f"{path} holds no tracks", allowed="a file that the stage track made")
    camera = _camera(content)
    bodies = {name: details for name, details in content.details.items() if name != CAMERA_FRAME}
    found = {name: replace(_track(name, content, details), camera=camera) for name, details in bodies.items()}
    return _OfBodies(path, found)


class _OfBodies(dict[str, OfBody]):
    """What a file holds by the names of the bodies; to ask for one that it does not hold raises `InputError`."""

    def __init__(self, path: Path, found: dict[str, OfBody]):
        super().__init__(found)
        self.path = path

    def __missing__(self, name: str) -> NoReturn:
        raise InputError(f"{self.path} holds no track of the {name}", got=", ".join(self), allowed="rover and object")


def _camera(content: McapContent) -> CameraTrack | None:
    details = content.details.get(CAMERA_FRAME)
    if details is None:
        return None
    rows = np.array([value.position for value in content.values("/camera/motion")])
    motion, picture, std = np.split(rows, np.cumsum([len(VIEW_MOTION), len(PICTURE_MOTION)]), axis=1)
    stamps = np.array([_STAMPS[_entry(value, CAMERA_FRAME).message] for value in content.values("/diagnostics")])
    size, size_std = (np.nan if details[name] is None else details[name] for name in ("size", "size_std"))
    turns = details.get("quarter_turns", 0)
    found = CameraTrack(*view_in(details), motion, picture, std, stamps, size, size_std, quarter_turns=turns)
    added = details.get("added_covariance")
    return found if added is None else found.with_added(np.array(added))


def _entry(diagnostics: Any, name: str) -> Any:
    """The status of a name in a DiagnosticArray."""
    return next(entry for entry in diagnostics.status if entry.name == name)


def _track(name: str, content: McapContent, details: dict[str, Any]) -> Track:
    time_ns = np.array(details["time_ns"], dtype=np.int64)
    n = len(time_ns)
    index = {int(t): i for i, t in enumerate(time_ns)}
    pose, covariance, total = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((n, 3, 3), np.nan)
    for message in content.topics.get(f"/{name}/pose", []):
        i = index[message.time_ns]
        position = message.value.pose.pose.position
        pose[i] = position.x, position.y, ros.heading_of(message.value.pose.pose.orientation)
        total[i] = ros.planar_covariance(message.value)
    for message in content.topics.get(f"/{name}/pose_frame", []):
        covariance[index[message.time_ns]] = ros.planar_covariance(message.value)
    seen = np.isfinite(pose[:, 2])
    pose[seen, 2] = np.unwrap(pose[seen, 2])
    status, inliers, residual = np.zeros(n, dtype=np.uint8), np.full(n, np.nan), np.full(n, np.nan)
    for message in content.topics["/diagnostics"]:
        i = index[message.time_ns]
        entry = _entry(message.value, name)
        values = {pair.key: float(pair.value) for pair in entry.values}
        status[i], inliers[i], residual[i] = _STATUS[entry.level], values["inlier_fraction"], values["residual"]
    return Track(
        body=name,
        time_s=time_ns / 1e9,
        pose=pose,
        covariance=covariance,
        status=status,
        inlier_fraction=inliers,
        residual=residual,
        start_covariance=np.array(details["start_covariance"]),
        features=_features(content.topics.get(f"/{name}/features", []), index),
        findings=findings_in(details["findings"]),
        method=details["method"],
        choices=choices_in(details),
        total_covariance=total if details["has_total"] else None,
    )


def _features(messages: list[Message], index: dict[int, int]) -> Features | None:
    if not messages:
        return None
    clouds = [ros.cloud_points(message.value) for message in messages]
    frames = np.repeat([index[message.time_ns] for message in messages], [len(cloud) for cloud in clouds])
    table = np.concatenate(clouds)
    return Features(frame=frames, floor_m=table[:, :3], weight=table[:, 3])


def write_decimated(path: Path, decimated: dict[str, DecimatedTrack], provenance: dict[str, str]) -> None:
    """Write ``decimate.mcap``: the kept poses and their rates."""
    messages, details = [], {}
    for name, track in decimated.items():
        for t, pose, rate, covariance in zip(track.time_s, track.pose, track.rate, track.covariance, strict=True):
            ns = ros.nanoseconds(t)
            messages.append(Message(f"/{name}/pose", ns, ros.pose_with_covariance(t, pose, covariance)))
            messages.append(Message(f"/{name}/twist", ns, ros.stamped_twist(t, rate)))
            messages.append(Message("/tf", ns, ros.transforms(t, {name: pose})))
        details[name] = {
            "heading_rad": track.pose[:, 2].tolist(),
            "noise": track.noise.tolist(),
            "pauses": track.pauses.tolist(),
            "frames": track.frames,
            "misfit": track.misfit.tolist(),
            "findings": rows_of(track.findings),
        }
    write_mcap(path, messages, details, provenance)


@result_reader
def read_decimated(path: Path) -> dict[str, DecimatedTrack]:
    """Read ``decimate.mcap``: the decimated track of each body by name.

    Raises `InputError` when the file is missing, damaged or holds no decimated tracks.
    """
    content = read_mcap(path)
    if not content.details:
        raise InputError(f"{path} holds no decimated tracks", allowed="a file that the stage decimate made")
    tracks = {}
    for name, details in content.details.items():
        values, further = content.values(f"/{name}/pose"), dict(details)
        pose, heading = planar_poses([value.pose.pose for value in values]), further.pop("heading_rad", None)
        if heading is not None:
            pose[:, 2] += _whole_turns(np.array(heading), pose[:, 2])
        tracks[name] = DecimatedTrack(
            body=name,
            time_s=content.times_s(f"/{name}/pose"),
            pose=pose,
            rate=planar_twists(content.values(f"/{name}/twist")),
            covariance=np.array([ros.planar_covariance(value) for value in values]),
            **{**further, "findings": findings_in(details["findings"])},
        )
    return _OfBodies(path, tracks)


def _whole_turns(heading: Array, unwrapped: Array) -> Array:
    """Turns (n,) [rad] that headings (n,), ``unwrapped`` from one to the next, lack since the first.

    A body that turns on the spot may turn by more than half a turn from one kept pose to the next, which neither their
    quaternions nor the shorter way from one to the next tells.
    """
    lacking = (heading - heading[0]) - (unwrapped - unwrapped[0])
    return np.asarray(2 * np.pi * np.round(lacking / (2 * np.pi)))

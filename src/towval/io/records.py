"""The stages' results as MCAP files and back: one pair of functions a file of ``results/``.

Topics are those of docs/formats.md. What fits no ROS message (findings, covariances of parameters, names of outcomes)
is in the file's attachment ``details.json``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from towval.conventions import CAMERA_FRAME, FLOOR_FRAME
from towval.errors import InputError
from towval.io import ros
from towval.io.mcap_file import McapContent, Message, read_mcap, write_mcap
from towval.types import (
    Array,
    Calibration,
    Camera,
    Choice,
    Comparison,
    DecimatedTrack,
    Features,
    Finding,
    Floor,
    RunUncertainty,
    Severity,
    SimulatedMotion,
    Track,
    TrackStatus,
    Verdict,
    View,
)

_LEVELS = {TrackStatus.TRACKED: 0, TrackStatus.COASTING: 1, TrackStatus.LOST: 2}
"""Level of a DiagnosticStatus (OK, WARN, ERROR) of a pose's status."""

_STATUS = {level: status for status, level in _LEVELS.items()}


def write_calibration(path: Path, calibration: Calibration, provenance: dict[str, str]) -> None:
    """Write ``camera.mcap``: ``/camera/camera_info`` and ``/tf_static``, both at time zero."""
    T = calibration.floor.T_camera_floor
    messages = [
        Message("/camera/camera_info", 0, ros.camera_info(0.0, CAMERA_FRAME, calibration.camera)),
        camera_place(calibration.floor, 0.0),
    ]
    details = {
        "camera": {
            "resolution_px": list(calibration.camera.resolution_px),
            "matrix": calibration.camera.matrix.tolist(),
            "distortion": calibration.camera.distortion.tolist(),
            "lens_model": calibration.camera.lens_model,
        },
        "T_camera_floor": T.tolist(),
        "covariance": calibration.covariance.tolist(),
        "corner_noise_px": calibration.corner_noise_px,
        "views": [_plain(view) for view in calibration.views],
        "findings": _findings_out(calibration.findings),
        "choices": _choices_out(calibration.choices),
        "quality": dict(calibration.quality),
    }
    write_mcap(path, messages, details, provenance)


def read_calibration(path: Path) -> Calibration:
    """Read ``camera.mcap``.

    Raises
    ------
    InputError
        When the file is missing, damaged or no calibration.
    """
    details = _details(read_mcap(path), path, "camera", "T_camera_floor", "covariance")
    camera = dict(details["camera"])
    camera["resolution_px"] = tuple(camera["resolution_px"])
    return Calibration(
        camera=Camera(**camera),
        floor=Floor(details["T_camera_floor"]),
        covariance=details["covariance"],
        corner_noise_px=details["corner_noise_px"],
        views=tuple(View(**_arrays(view)) for view in details["views"]),
        findings=_findings_in(details["findings"]),
        quality=details["quality"],
        choices=_choices_in(details),
    )


def camera_place(floor: Floor, time_s: float) -> Message:
    """The camera in the floor frame, on ``/tf_static``."""
    quaternion = Rotation.from_matrix(floor.T_camera_floor[:3, :3].T).as_quat()
    static = ros.rigid_transform(time_s, FLOOR_FRAME, CAMERA_FRAME, floor.camera_position_m, quaternion)
    return Message("/tf_static", ros.nanoseconds(time_s), static)


def write_tracks(path: Path, tracks: dict[str, Track], provenance: dict[str, str]) -> None:
    """Write ``track.mcap``: poses, features, tf and the diagnostics of every frame."""
    messages = [message for name, track in tracks.items() for message in _track_messages(name, track)]
    messages += _frame_messages(tracks)
    details = {
        name: {
            "method": track.method,
            "start_covariance": track.start_covariance.tolist(),
            "findings": _findings_out(track.findings),
            "choices": _choices_out(track.choices),
            "time_ns": [ros.nanoseconds(t) for t in track.time_s],
        }
        for name, track in tracks.items()
    }
    write_mcap(path, messages, details, provenance)


def _track_messages(name: str, track: Track) -> Iterator[Message]:
    for i in np.flatnonzero(track.status != TrackStatus.LOST):
        t = track.time_s[i]
        value = ros.pose_with_covariance(t, FLOOR_FRAME, track.pose[i], track.covariance[i])
        yield Message(f"/{name}/pose", ros.nanoseconds(t), value)
    if track.features is not None:
        order = np.argsort(track.features.frame, kind="stable")
        frames, starts = np.unique(track.features.frame[order], return_index=True)
        for frame, rows in zip(frames, np.split(order, starts[1:]), strict=True):
            t = track.time_s[frame]
            points = np.column_stack([track.features.floor_m[rows], track.features.weight[rows]])
            cloud = ros.point_cloud(t, FLOOR_FRAME, points, ("x", "y", "z", "weight"))
            yield Message(f"/{name}/features", ros.nanoseconds(t), cloud)


def _frame_messages(tracks: dict[str, Track]) -> Iterator[Message]:
    time_s = next(iter(tracks.values())).time_s
    for i, t in enumerate(time_s):
        poses = {name: track.pose[i] for name, track in tracks.items() if track.status[i] != TrackStatus.LOST}
        if poses:
            yield Message("/tf", ros.nanoseconds(t), ros.transforms(t, FLOOR_FRAME, poses))
        entries = [
            (
                _LEVELS[TrackStatus(track.status[i])],
                name,
                TrackStatus(track.status[i]).name.lower(),
                {"inlier_fraction": repr(float(track.inlier_fraction[i])), "residual": repr(float(track.residual[i]))},
            )
            for name, track in tracks.items()
        ]
        yield Message("/diagnostics", ros.nanoseconds(t), ros.diagnostics(t, entries))


def read_tracks(path: Path) -> dict[str, Track]:
    """Read ``track.mcap``: the track of each body by name.

    Raises
    ------
    InputError
        When the file is missing, damaged or holds no tracks.
    """
    content = read_mcap(path)
    if not content.details or not content.values("/diagnostics"):
        raise InputError(f"{path} holds no tracks", allowed="a file that the stage track made")
    try:
        return {name: _track(name, content, details) for name, details in content.details.items()}
    except (KeyError, StopIteration) as error:
        raise InputError(
            f"{path} contradicts itself",
            got=f"{type(error).__name__}: {error}",
            remedy="delete it and run the stage track again",
        ) from None


def _track(name: str, content: McapContent, details: dict[str, Any]) -> Track:
    time_ns = np.array(details["time_ns"], dtype=np.int64)
    n = len(time_ns)
    index = {int(t): i for i, t in enumerate(time_ns)}
    pose, covariance = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    for message in content.topics.get(f"/{name}/pose", []):
        i = index[message.time_ns]
        position = message.value.pose.pose.position
        pose[i] = position.x, position.y, ros.heading_of(message.value.pose.pose.orientation)
        covariance[i] = ros.planar_covariance(message.value)
    seen = np.isfinite(pose[:, 2])
    pose[seen, 2] = np.unwrap(pose[seen, 2])
    status, inliers, residual = np.zeros(n, dtype=np.uint8), np.full(n, np.nan), np.full(n, np.nan)
    for message in content.topics["/diagnostics"]:
        i = index[message.time_ns]
        entry = next(entry for entry in message.value.status if entry.name == name)
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
        findings=_findings_in(details["findings"]),
        method=details["method"],
        choices=_choices_in(details),
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
            messages.append(Message(f"/{name}/pose", ns, ros.pose_with_covariance(t, FLOOR_FRAME, pose, covariance)))
            messages.append(Message(f"/{name}/twist", ns, ros.stamped_twist(t, FLOOR_FRAME, rate)))
            messages.append(Message("/tf", ns, ros.transforms(t, FLOOR_FRAME, {name: pose})))
        details[name] = {
            "noise": track.noise.tolist(),
            "pauses": track.pauses.tolist(),
            "frames": track.frames,
            "misfit": track.misfit.tolist(),
            "findings": _findings_out(track.findings),
        }
    write_mcap(path, messages, details, provenance)


def read_decimated(path: Path) -> dict[str, DecimatedTrack]:
    """Read ``decimate.mcap``: the thinned track of each body by name.

    Raises
    ------
    InputError
        When the file is missing, damaged or holds no thinned tracks.
    """
    content = read_mcap(path)
    if not content.details:
        raise InputError(f"{path} holds no decimated tracks", allowed="a file that the stage decimate made")
    tracks = {}
    for name, details in content.details.items():
        values = content.values(f"/{name}/pose")
        tracks[name] = DecimatedTrack(
            body=name,
            time_s=content.times_s(f"/{name}/pose"),
            pose=_planar_poses([value.pose.pose for value in values]),
            rate=_planar_twists(content.values(f"/{name}/twist")),
            covariance=np.array([ros.planar_covariance(value) for value in values]),
            noise=details["noise"],
            pauses=details["pauses"],
            frames=details["frames"],
            misfit=details["misfit"],
            findings=_findings_in(details["findings"]),
        )
    return tracks


def write_simulated(path: Path, simulated: SimulatedMotion, provenance: dict[str, str]) -> None:
    """Write ``simulate.mcap``: simulated poses and twists, tether force, tether length and tension."""
    messages = []
    for i, t in enumerate(simulated.time_s):
        ns, pose, force = ros.nanoseconds(t), simulated.pose[i], simulated.tether_force[i]
        state = ros.joint_state(t, ["tether"], [simulated.tether_length[i]], [], [np.hypot(*force)])
        messages += [
            Message("/object/pose_simulated", ns, ros.stamped_pose(t, FLOOR_FRAME, pose)),
            Message("/object/twist_simulated", ns, ros.stamped_twist(t, FLOOR_FRAME, simulated.twist[i])),
            Message("/tether/wrench", ns, ros.wrench(t, FLOOR_FRAME, force)),
            Message("/tether/state", ns, state),
            Message("/tf", ns, ros.transforms(t, FLOOR_FRAME, {"object_simulated": pose})),
        ]
    details = {
        "outcome": str(simulated.outcome),
        "advice": simulated.advice,
        "rung": str(simulated.rung),
        "findings": _findings_out(simulated.findings),
        "statistics": dict(simulated.statistics),
        "choices": _choices_out(simulated.choices),
    }
    write_mcap(path, messages, details, provenance)


def read_simulated(path: Path) -> SimulatedMotion:
    """Read ``simulate.mcap``.

    Raises
    ------
    InputError
        When the file is missing, damaged or no simulation.
    """
    content = read_mcap(path)
    details = _details(content, path, "outcome", "rung")
    pose = _planar_poses([value.pose for value in content.values("/object/pose_simulated")])
    return SimulatedMotion(
        time_s=content.times_s("/object/pose_simulated"),
        pose=pose,
        twist=_planar_twists(content.values("/object/twist_simulated")),
        tether_force=np.array([[v.wrench.force.x, v.wrench.force.y] for v in content.values("/tether/wrench")]),
        tether_length=np.array([value.position[0] for value in content.values("/tether/state")]),
        outcome=details["outcome"],
        advice=details["advice"],
        rung=details["rung"],
        findings=_findings_in(details["findings"]),
        statistics=details["statistics"],
        choices=_choices_in(details),
    )


_UNCERTAINTY_ARRAYS = ("measurement", "simulation", "validation")


def write_uncertainty(
    path: Path, uncertainty: RunUncertainty, simulated: SimulatedMotion, provenance: dict[str, str]
) -> None:
    """Write ``uncertainty.mcap``: the simulated pose with the covariances of measurement, simulation and error."""
    messages = []
    for i, t in enumerate(uncertainty.time_s):
        for name in _UNCERTAINTY_ARRAYS:
            covariance = getattr(uncertainty, name)[i]
            value = ros.pose_with_covariance(t, FLOOR_FRAME, simulated.pose[i], covariance)
            messages.append(Message(f"/object/{name}_uncertainty", ros.nanoseconds(t), value))
    skipped = ("time_s", "findings", *_UNCERTAINTY_ARRAYS)
    names = [field.name for field in dataclasses.fields(uncertainty) if field.name not in skipped]
    details = {name: getattr(uncertainty, name) for name in names}
    details["signature"] = uncertainty.signature.tolist()
    details["findings"] = _findings_out(uncertainty.findings)
    details["choices"] = _choices_out(uncertainty.choices)
    write_mcap(path, messages, details, provenance)


def read_uncertainty(path: Path) -> RunUncertainty:
    """Read ``uncertainty.mcap``.

    Raises
    ------
    InputError
        When the file is missing, damaged or of another stage.
    """
    content = read_mcap(path)
    details = dict(_details(content, path, "signature_limit", "shares"))
    details["findings"], details["choices"] = _findings_in(details["findings"]), _choices_in(details)
    topics = {name: f"/object/{name}_uncertainty" for name in _UNCERTAINTY_ARRAYS}
    arrays = {
        name: np.array([ros.planar_covariance(value) for value in content.values(topic)])
        for name, topic in topics.items()
    }
    return RunUncertainty(time_s=content.times_s(topics["validation"]), **arrays, **details)


_COMPARISON_ARRAYS = ("time_s", "error", "along_across", "ratio")
_COMPARISON_SCALARS = tuple(
    f.name for f in dataclasses.fields(Comparison) if f.name not in (*_COMPARISON_ARRAYS, "findings")
)


def write_comparison(
    path: Path, comparison: Comparison, measured: Track, simulated: SimulatedMotion, provenance: dict[str, str]
) -> None:
    """Write ``compare.mcap``: ``/object/error``, and both paths again, so that one file serves other tools."""
    messages = error_messages(comparison)
    messages += _track_messages("object", dataclasses.replace(measured, features=None))
    for t, pose in zip(simulated.time_s, simulated.pose, strict=True):
        value = ros.stamped_pose(t, FLOOR_FRAME, pose)
        messages.append(Message("/object/pose_simulated", ros.nanoseconds(t), value))
    details = {name: _scalar(getattr(comparison, name)) for name in _COMPARISON_SCALARS}
    details["time_ns"] = [ros.nanoseconds(t) for t in comparison.time_s]
    details["findings"] = _findings_out(comparison.findings)
    write_mcap(path, messages, details, provenance)


def error_messages(comparison: Comparison) -> list[Message]:
    """The errors of a run on ``/object/error``, ``/object/error_along_across`` and ``/object/error_ratio``."""
    messages = []
    rows = zip(*(getattr(comparison, name) for name in _COMPARISON_ARRAYS), strict=True)
    for t, error, shift, ratio in rows:
        ns = ros.nanoseconds(t)
        if np.isfinite(ratio):
            messages.append(Message("/object/error_ratio", ns, ros.number(ratio)))
        if np.isfinite(error).all():
            messages.append(Message("/object/error", ns, ros.stamped_vector(t, FLOOR_FRAME, error)))
            value = ros.stamped_vector(t, "object_path", np.append(shift, error[2]))
            messages.append(Message("/object/error_along_across", ns, value))
    return messages


def read_comparison(path: Path) -> Comparison:
    """Read ``compare.mcap``.

    Raises
    ------
    InputError
        When the file is missing, damaged or no comparison.
    """
    content = read_mcap(path)
    details = _details(content, path, *_COMPARISON_SCALARS)
    time_ns = np.array(details["time_ns"], dtype=np.int64)
    index = {int(t): i for i, t in enumerate(time_ns)}
    error, shift = np.full((len(time_ns), 3), np.nan), np.full((len(time_ns), 2), np.nan)
    ratio = np.full(len(time_ns), np.nan)
    for message in content.topics.get("/object/error_ratio", []):
        ratio[index[message.time_ns]] = message.value.data
    for message in content.topics.get("/object/error", []):
        vector = message.value.vector
        error[index[message.time_ns]] = vector.x, vector.y, vector.z
    for message in content.topics.get("/object/error_along_across", []):
        shift[index[message.time_ns]] = message.value.vector.x, message.value.vector.y
    scalars = {name: np.nan if details[name] is None else details[name] for name in _COMPARISON_SCALARS}
    scalars["verdict"] = Verdict(scalars["verdict"])
    findings = _findings_in(details["findings"])
    arrays = {"time_s": time_ns / 1e9, "error": error, "along_across": shift, "ratio": ratio}
    return Comparison(**arrays, findings=findings, **scalars)


def _planar_poses(values: list[Any]) -> Array:
    pose = np.array([[v.position.x, v.position.y, ros.heading_of(v.orientation)] for v in values]).reshape(-1, 3)
    pose[:, 2] = np.unwrap(pose[:, 2])
    return pose


def _planar_twists(values: list[Any]) -> Array:
    rows = [[v.twist.linear.x, v.twist.linear.y, v.twist.angular.z] for v in values]
    return np.array(rows).reshape(-1, 3)


def _scalar(value: Any) -> Any:
    """A JSON value: NaN, which JSON does not know, becomes null."""
    return None if isinstance(value, float) and np.isnan(value) else value


def _plain(value: Any) -> dict[str, Any]:
    """A dataclass of arrays, numbers and texts as JSON-able values; NaN becomes null."""
    plain = {}
    for field in dataclasses.fields(value):
        item = getattr(value, field.name)
        if isinstance(item, np.ndarray):
            item = [[_scalar(x) for x in row] for row in item.tolist()]
        plain[field.name] = _scalar(item)
    return plain


def _arrays(plain: dict[str, Any]) -> dict[str, Any]:
    """Undo :func:`_plain`: lists become arrays and null becomes NaN."""
    return {
        key: np.array(item, dtype=np.float64).reshape(len(item), 2)
        if isinstance(item, list)
        else np.nan
        if item is None
        else item
        for key, item in plain.items()
    }


def _findings_out(findings: tuple[Finding, ...]) -> list[dict[str, str]]:
    return [{"severity": str(f.severity), "code": f.code, "text": f.text} for f in findings]


def _findings_in(rows: list[dict[str, str]]) -> tuple[Finding, ...]:
    return tuple(Finding(Severity(row["severity"]), row["code"], row["text"]) for row in rows)


def _choices_out(choices: tuple[Choice, ...]) -> list[dict[str, Any]]:
    return [{name: _scalar(value) for name, value in dataclasses.asdict(choice).items()} for choice in choices]


def _choices_in(details: dict[str, Any]) -> tuple[Choice, ...]:
    """Choices of a file's details; files of versions that recorded none have none."""
    rows = details.get("choices", [])
    return tuple(Choice(**{**row, "change_m": np.nan if row["change_m"] is None else row["change_m"]}) for row in rows)


def _details(content: McapContent, path: Path, *names: str) -> dict[str, Any]:
    missing = [name for name in names if name not in content.details]
    if missing:
        raise InputError(
            f"{path} was made by another stage",
            got=f"no {', '.join(missing)} in its details",
            remedy="give the file that this stage's documentation names",
        )
    return content.details

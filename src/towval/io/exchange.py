"""One MCAP file per run for viewers: film, camera, both bodies, tether, errors and tension together.

The stages' own files each hold what one stage found; a viewer wants them side by side in one file. Layouts that open it
are in the folder ``layouts``.
"""

from collections.abc import Iterable, Iterator
from importlib.resources import files
from pathlib import Path

import numpy as np

from towval.io import ros
from towval.io.atomic import not_ours, write_bytes
from towval.io.mcap_file import Message, write_mcap
from towval.io.reading import is_plain_file
from towval.io.records import camera_place
from towval.model import Array, Calibration, Camera, Comparison
from towval.model.conventions import FLOOR_FRAME
from towval.model.geometry import arc_lengths, lifted, transform
from towval.model.run_record import RunRecord, Still, measured_poses

LAYOUTS = ("lichtblick.json", "rerun.rbl")
"""Layouts for Lichtblick and Foxglove, and for Rerun."""

_STEP_M = 0.01
_LEAST_Z_M = 0.02
"""Height above the floor at which the tether is drawn at least: at the floor's own height viewers hide it."""

_ERRORS = ("along_m", "across_m", "heading_rad", "ratio")


def write_run_file(
    path: Path, run: RunRecord, calibration: Calibration, pictures: Iterable[Still], provenance: dict[str, str]
) -> None:
    """Write ``exchange.mcap`` with all ``pictures`` of the footage, which come in the order of their times."""
    start_s = float(run.rover_track.time_s[0])
    messages = [camera_place(calibration.floor, start_s), *_motions(run), *_tether(run), *_errors(run.comparison)]
    write_mcap(path, messages, {"run": run.name}, provenance, in_order=_pictures(pictures, calibration.camera))


def check_layouts(path: Path) -> None:
    """Refuse to write layouts beside an ``exchange.mcap`` to be made where files of somebody else's have their names.

    Beside one that is there they are those of an earlier version, or of this one. Raises `InputError`.
    """
    for name in LAYOUTS if not path.exists() else ():
        layout = path.parent / name
        if is_plain_file(layout) and layout.read_bytes() != _layout(name):
            raise not_ours(layout)


def write_layouts(folder: Path) -> tuple[Path, ...]:
    """Copy the layouts into a folder; returns their paths."""
    for name in LAYOUTS:
        write_bytes(folder / name, _layout(name))
    return tuple(folder / name for name in LAYOUTS)


def packaged_layouts() -> dict[str, Path]:
    """The layouts of this version by name; ``exchange.mcap`` records them as its inputs."""
    return {name: Path(str(files("towval.io") / "layouts" / name)) for name in LAYOUTS}


def _layout(name: str) -> bytes:
    return packaged_layouts()[name].read_bytes()


def _pictures(pictures: Iterable[Still], camera: Camera) -> Iterator[Message]:
    """Pictures of the footage, and with each the camera of its size."""
    for still in pictures:
        ns = ros.nanoseconds(still.time_s)
        data = np.frombuffer(still.data, np.uint8)
        yield Message("/camera/image", ns, ros.compressed_image(still.time_s, still.coding, data))
        scaled = _scaled(camera, still.size_px)
        yield Message("/camera/camera_info", ns, ros.camera_info(still.time_s, scaled))


def _scaled(camera: Camera, size_px: tuple[int, int]) -> Camera:
    """The camera of pictures of another size; (0, 0) is the centre of the first pixel in both."""
    factors = np.array(size_px) / camera.resolution_px
    matrix = camera.matrix.copy()
    matrix[:2] *= factors[:, None]
    matrix[:2, 2] += 0.5 * factors - 0.5
    return Camera(size_px, matrix, camera.distortion, camera.lens_model)


def _points_along(line: Array) -> Array:
    """Points (m, 3) at equal small steps along a line through corners (n, 3) [m]."""
    length = arc_lengths(line)
    steps = np.linspace(0, length[-1], max(2, round(length[-1] / _STEP_M)))
    return np.stack([np.interp(steps, length, line[:, k]) for k in range(3)], axis=1)


def _motions(run: RunRecord) -> Iterator[Message]:
    """Poses of both bodies, measured and simulated, as transforms and as poses, and with each the outline of the top.

    Viewers draw an outline where its frame was at the outline's own time: one outline a run would stay at the start.
    """
    motions = {
        "rover": ("/rover/pose", run.rover, run.rover_track.time_s, measured_poses(run.rover_track)),
        "object": ("/object/pose", run.towed, run.object_track.time_s, measured_poses(run.object_track)),
        "object_simulated": ("/object/pose_simulated", run.towed, run.simulated.time_s, run.simulated.pose),
    }
    for frame, (topic, body, times, poses) in motions.items():
        outline = _points_along(lifted(body.outline_m, body.tracked_plane_height_m))
        for time_s, pose in zip(times, poses, strict=True):
            if np.isfinite(pose).all():
                ns = ros.nanoseconds(time_s)
                yield Message(topic, ns, ros.stamped_pose(time_s, pose))
                yield Message("/tf", ns, ros.transforms(time_s, {frame: pose}))
                yield Message(f"/{frame}/outline", ns, ros.point_cloud(time_s, frame, outline, "xyz"))


def _tether(run: RunRecord) -> Iterator[Message]:
    """The simulated tether as points at its ends' heights, with its length as position and its tension as effort."""
    simulated, heights = run.simulated, np.maximum([run.anchor_height_m, run.hinge_height_m], _LEAST_Z_M)
    hinge, anchor = _hinge(run), transform(simulated.pose, run.anchor)
    tension = np.linalg.norm(simulated.tether_force, axis=1)
    for i, time_s in enumerate(simulated.time_s):
        ns = ros.nanoseconds(time_s)
        state = ros.joint_state(time_s, ["tether"], [simulated.tether_length[i]], [], [tension[i]])
        yield Message("/tether/state", ns, state)
        if np.isfinite(hinge[i]).all():
            line = _points_along(np.column_stack([[anchor[i], hinge[i]], heights]))
            yield Message("/tether/line", ns, ros.point_cloud(time_s, FLOOR_FRAME, line, "xyz"))


def _errors(comparison: Comparison) -> Iterator[Message]:
    """Errors as the positions of a JointState, the one message of named numbers that every viewer plots."""
    shift, heading = comparison.along_across, comparison.error[:, 2]
    for time_s, (along, across), turn, ratio in zip(comparison.time_s, shift, heading, comparison.ratio, strict=True):
        if np.isfinite(along):
            value = ros.joint_state(time_s, _ERRORS, [along, across, turn, ratio], [], [])
            yield Message("/object/error_state", ros.nanoseconds(time_s), value)


def _hinge(run: RunRecord) -> Array:
    """Places (n, 2) of the tether's hinge at the simulated times, NaN where the rover was not seen."""
    track = run.rover_track
    return transform(measured_poses(track)[track.rows_at(run.simulated.time_s)], run.hinge)

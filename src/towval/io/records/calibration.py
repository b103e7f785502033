"""``camera.mcap`` and back."""

from pathlib import Path

from towval.io import ros
from towval.io.mcap_file import Message, read_mcap, write_mcap
from towval.io.records.details import (
    arrays,
    choices_in,
    details_with,
    findings_in,
    result_reader,
    rows_of,
    view_in,
    view_out,
    with_nan,
)
from towval.model import Calibration, Floor, View


def write_calibration(path: Path, calibration: Calibration, provenance: dict[str, str]) -> None:
    """Write ``camera.mcap``: ``/camera/camera_info`` and ``/tf_static``, both at time zero."""
    messages = [
        Message("/camera/camera_info", 0, ros.camera_info(0.0, calibration.camera)),
        camera_place(calibration.floor, 0.0),
    ]
    details = {
        **view_out(calibration.camera, calibration.floor),
        "covariance": calibration.covariance.tolist(),
        "corner_noise_px": calibration.corner_noise_px,
        "views": rows_of(calibration.views),
        "findings": rows_of(calibration.findings),
        "choices": rows_of(calibration.choices),
        "quality": dict(calibration.quality),
    }
    write_mcap(path, messages, details, provenance)


@result_reader
def read_calibration(path: Path) -> Calibration:
    """Read ``camera.mcap``.

    Raises `InputError` when the file is missing, damaged or no calibration.
    """
    details = details_with(read_mcap(path), path, "camera", "T_camera_floor", "covariance")
    camera, floor = view_in(details)
    return Calibration(
        camera=camera,
        floor=floor,
        covariance=details["covariance"],
        corner_noise_px=details["corner_noise_px"],
        views=tuple(View(**arrays(view)) for view in details["views"]),
        findings=findings_in(details["findings"]),
        quality=with_nan(details["quality"]),
        choices=choices_in(details),
    )


def camera_place(floor: Floor, time_s: float) -> Message:
    """The camera in the floor frame, on ``/tf_static``."""
    static = ros.camera_transform(time_s, floor.camera_position_m, floor.T_camera_floor[:3, :3].T)
    return Message("/tf_static", ros.nanoseconds(time_s), static)

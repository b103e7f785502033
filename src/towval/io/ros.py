"""ROS 2 messages of the types that the package exchanges: how a pose, a wrench or a camera looks on a topic.

Poses, twists and forces are in the frame of the floor, pictures in that of the camera; others name theirs.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from towval.model import Array, Camera
from towval.model.camera import is_fisheye
from towval.model.conventions import CAMERA_FRAME, FLOOR_FRAME, NANOSECONDS_PER_SECOND

_FLOAT32 = 7
"""Value of sensor_msgs/PointField.FLOAT32."""


@cache
def typestore() -> Typestore:
    """The message types of ROS 2 Humble, made at the first message: planning a workflow reads and writes none."""
    return get_typestore(Stores.ROS2_HUMBLE)


def nanoseconds(time_s: float) -> int:
    """Integer nanoseconds of float seconds."""
    return round(float(time_s) * NANOSECONDS_PER_SECOND)


def make(kind: str, **values: Any) -> Any:
    """A message of the type ``package/msg/Name``."""
    return typestore().types[kind](**values)


def stamp_ns(message: Any) -> int:
    """The time in the header of a message [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec * NANOSECONDS_PER_SECOND + stamp.nanosec)


def header(time_s: float, frame: str) -> Any:
    """A header with the time as stamp."""
    seconds, rest = divmod(nanoseconds(time_s), NANOSECONDS_PER_SECOND)
    return make(
        "std_msgs/msg/Header", stamp=make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest), frame_id=frame
    )


def vector(x: float, y: float, z: float = 0.0) -> Any:
    """A vector."""
    return make("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))


def number(value: float) -> Any:
    """A number without a stamp: its time is that of its message."""
    return make("std_msgs/msg/Float64", data=float(value))


def point(x: float, y: float, z: float = 0.0) -> Any:
    """A point."""
    return make("geometry_msgs/msg/Point", x=float(x), y=float(y), z=float(z))


def heading_quaternion(heading: float) -> Any:
    """The turn about z by ``heading`` [rad]."""
    return make(
        "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=float(np.sin(heading / 2)), w=float(np.cos(heading / 2))
    )


def heading_of(quaternion: Any) -> float:
    """The heading of a turn about z [rad], not wrapped."""
    return float(2 * np.arctan2(quaternion.z, quaternion.w))


def planar_pose(pose: Array) -> Any:
    """A pose on the floor from (x, y, heading)."""
    return make("geometry_msgs/msg/Pose", position=point(pose[0], pose[1]), orientation=heading_quaternion(pose[2]))


_PLANAR = np.ix_((0, 1, 5), (0, 1, 5))
"""Where x, y and the turn about z stand in ROS's 6 × 6 covariance."""


def pose_with_covariance(time_s: float, pose: Array, covariance: Array) -> Any:
    """A stamped pose with the covariance (3, 3) of (x, y, heading)."""
    full = np.zeros((6, 6))
    full[_PLANAR] = covariance
    return make(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        header=header(time_s, FLOOR_FRAME),
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=planar_pose(pose), covariance=full.ravel()),
    )


def planar_covariance(message: Any) -> Array:
    """The covariance (3, 3) of (x, y, heading) of a PoseWithCovarianceStamped."""
    return np.asarray(message.pose.covariance, dtype=np.float64).reshape(6, 6)[_PLANAR]


def stamped_pose(time_s: float, pose: Array) -> Any:
    """A stamped pose."""
    return make("geometry_msgs/msg/PoseStamped", header=header(time_s, FLOOR_FRAME), pose=planar_pose(pose))


def stamped_twist(time_s: float, twist: Array) -> Any:
    """A stamped planar twist from (vx, vy, heading rate)."""
    value = make("geometry_msgs/msg/Twist", linear=vector(twist[0], twist[1]), angular=vector(0, 0, twist[2]))
    return make("geometry_msgs/msg/TwistStamped", header=header(time_s, FLOOR_FRAME), twist=value)


def transforms(time_s: float, poses: dict[str, Array]) -> Any:
    """A tf message with the pose of each child frame on the floor."""
    children = [
        _transform(time_s, child, vector(pose[0], pose[1]), heading_quaternion(pose[2]))
        for child, pose in poses.items()
    ]
    return make("tf2_msgs/msg/TFMessage", transforms=children)


def camera_transform(time_s: float, shift: Array, rotation: Array) -> Any:
    """A tf message with the pose of the camera above the floor: its place (3,) [m], and its axes as columns (3, 3)."""
    x, y, z, w = _quaternion(rotation).tolist()
    turned = make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
    return make("tf2_msgs/msg/TFMessage", transforms=[_transform(time_s, CAMERA_FRAME, vector(*shift), turned)])


def _quaternion(R: Array) -> Array:
    """Quaternion (4,) in the order x, y, z, w of a rotation (3, 3).

    SciPy has it, too, but takes half of a small stage's start to import. A row of the quaternion's product with itself
    is a multiple of it; the one of the largest part loses no digits.
    """
    product, trace = np.empty((4, 4)), np.trace(R)
    product[:3, :3] = R + R.T + (1 - trace) * np.eye(3)
    product[3, :3] = product[:3, 3] = R[[2, 0, 1], [1, 2, 0]] - R[[1, 2, 0], [2, 0, 1]]
    product[3, 3] = 1 + trace
    largest = product[np.argmax(np.diagonal(product))]
    return np.asarray(largest / np.linalg.norm(largest))


def _transform(time_s: float, child: str, translation: Any, rotation: Any) -> Any:
    return make(
        "geometry_msgs/msg/TransformStamped",
        header=header(time_s, FLOOR_FRAME),
        child_frame_id=child,
        transform=make("geometry_msgs/msg/Transform", translation=translation, rotation=rotation),
    )


def camera_info(time_s: float, camera: Camera) -> Any:
    """The intrinsics of a camera; of a fisheye ``equidistant``, else what the lens needs of the others."""
    k, d = camera.matrix, camera.distortion
    if is_fisheye(camera.lens_model):
        model, d = "equidistant", np.append(d[[0, 1, 4]], 0.0)
    elif d[5:].any():
        model = "rational_polynomial"
    else:
        model, d = "plumb_bob", d[:5]
    projection = np.concatenate([k, np.zeros((3, 1))], axis=1)
    width, height = camera.resolution_px
    region = make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=header(time_s, CAMERA_FRAME),
        height=height,
        width=width,
        distortion_model=model,
        d=np.array(d),
        k=k.ravel().copy(),
        r=np.eye(3).ravel(),
        p=projection.ravel(),
        binning_x=0,
        binning_y=0,
        roi=region,
    )


def point_cloud(time_s: float, frame: str, points: Array, names: Sequence[str]) -> Any:
    """A cloud of points (n, k) as 32-bit floats, one field a column."""
    data = np.ascontiguousarray(points, dtype="<f4")
    n, k = data.shape
    fields = [
        make("sensor_msgs/msg/PointField", name=name, offset=4 * i, datatype=_FLOAT32, count=1)
        for i, name in enumerate(names)
    ]
    return make(
        "sensor_msgs/msg/PointCloud2",
        header=header(time_s, frame),
        height=1,
        width=n,
        fields=fields,
        is_bigendian=False,
        point_step=4 * k,
        row_step=4 * k * n,
        data=data.view(np.uint8).ravel(),
        is_dense=True,
    )


def cloud_points(message: Any) -> Array:
    """The points (n, k) of a cloud that :func:`point_cloud` made."""
    return np.frombuffer(np.asarray(message.data).tobytes(), dtype="<f4").reshape(message.width, -1).astype(np.float64)


def number_array(values: Array) -> Any:
    """Numbers (n, k) as 32-bit floats, in a message without a stamp."""
    data = np.ascontiguousarray(values, dtype=np.float32)
    n, k = data.shape
    dimensions = [
        make("std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=stride)
        for label, size, stride in (("rows", n, n * k), ("columns", k, k))
    ]
    layout = make("std_msgs/msg/MultiArrayLayout", dim=dimensions, data_offset=0)
    return make("std_msgs/msg/Float32MultiArray", layout=layout, data=data.ravel())


def numbers_of(message: Any) -> Array:
    """The numbers (n, k) of :func:`number_array`."""
    return np.asarray(message.data, dtype=np.float64).reshape(-1, message.layout.dim[1].size)


def wrench(time_s: float, force: Array) -> Any:
    """A stamped planar force."""
    value = make("geometry_msgs/msg/Wrench", force=vector(force[0], force[1]), torque=vector(0, 0))
    return make("geometry_msgs/msg/WrenchStamped", header=header(time_s, FLOOR_FRAME), wrench=value)


def stamped_vector(time_s: float, frame: str, xyz: Array) -> Any:
    """A stamped vector."""
    return make("geometry_msgs/msg/Vector3Stamped", header=header(time_s, frame), vector=vector(*xyz))


def joint_state(
    time_s: float, names: Sequence[str], position: ArrayLike, velocity: ArrayLike, effort: ArrayLike
) -> Any:
    """A stamped JointState; an empty array leaves a quantity out."""
    return make(
        "sensor_msgs/msg/JointState",
        header=header(time_s, ""),
        name=list(names),
        position=np.asarray(position, dtype=np.float64),
        velocity=np.asarray(velocity, dtype=np.float64),
        effort=np.asarray(effort, dtype=np.float64),
    )


def diagnostics(time_s: float, entries: Sequence[tuple[int, str, str, dict[str, str]]]) -> Any:
    """A DiagnosticArray from (level, name, message, values)."""
    status = [
        make(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=level,
            name=name,
            message=text,
            hardware_id="",
            values=[make("diagnostic_msgs/msg/KeyValue", key=k, value=v) for k, v in values.items()],
        )
        for level, name, text, values in entries
    ]
    return make("diagnostic_msgs/msg/DiagnosticArray", header=header(time_s, ""), status=status)


def compressed_image(time_s: float, coding: str, data: NDArray[np.uint8]) -> Any:
    """A stamped picture from the bytes (n,) of its coding: ``jpeg``, or ``h264`` and ``h265`` of a film."""
    return make("sensor_msgs/msg/CompressedImage", header=header(time_s, CAMERA_FRAME), format=coding, data=data)

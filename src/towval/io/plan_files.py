"""Plans as files: MCAP with the topics of a campaign, CSV for everybody, paths from CSV."""

import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pandas as pd

from towval.io import ros
from towval.io.atomic import check_own, check_plain, replacing
from towval.io.mcap_file import McapContent, Message, read_mcap, write_mcap
from towval.io.records.details import planar_poses, rows_of
from towval.model import Array, SimulatedMotion, TimedPath
from towval.model.conventions import NANOSECONDS_PER_SECOND
from towval.model.errors import InputError
from towval.planning.kinematics import WHEEL_NAMES
from towval.planning.planner import PlanCase, RoverPlan

JOINT_NAMES = (*(f"{name}_steering" for name in WHEEL_NAMES), *(f"{name}_wheel" for name in WHEEL_NAMES))
"""Joints of ``/rover/joint_states``: steering angles, then wheels."""

NO_COVARIANCE = np.zeros((3, 3))
"""A plan is exact: its poses carry no uncertainty."""


def write_plan_mcap(path: FilePath, plan: RoverPlan, towed: SimulatedMotion, provenance: dict[str, str]) -> None:
    """Write a plan as MCAP: poses of the rover, its joints, the tow wrench and the object behind it.

    ``/rover/pose`` PoseWithCovarianceStamped, ``/rover/joint_states`` JointState, ``/object/pose_simulated``
    PoseStamped, ``/tether/wrench`` WrenchStamped and ``/tf``, all in the frame ``floor``; details hold the findings of
    the ``plan``.
    """
    details = {
        "outcome": str(plan.outcome),
        "advice": plan.advice,
        "rover_rms_m": plan.rms,
        "case": "".join(PlanCase(case).name for case in plan.case),
        "wheels": list(WHEEL_NAMES),
        "findings": rows_of(plan.findings),
    }
    write_mcap(path, [*_rover_messages(plan), *_object_messages(towed)], details, provenance)


def _rover_messages(plan: RoverPlan) -> Iterator[Message]:
    turned = np.concatenate(
        [np.zeros((1, 4)), np.cumsum(plan.wheel_rates[:-1] * np.diff(plan.time_s)[:, None], axis=0)]
    )
    still = [0.0] * len(WHEEL_NAMES)
    for k, t in enumerate(plan.time_s):
        ns = ros.nanoseconds(t)
        positions, rates = [*plan.steering[k], *turned[k]], [*still, *plan.wheel_rates[k]]
        yield Message("/rover/pose", ns, ros.pose_with_covariance(t, plan.pose[k], NO_COVARIANCE))
        yield Message("/rover/joint_states", ns, ros.joint_state(t, list(JOINT_NAMES), positions, rates, []))
        yield Message("/tf", ns, ros.transforms(t, {"rover": plan.pose[k]}))


def _object_messages(towed: SimulatedMotion) -> Iterator[Message]:
    for k, t in enumerate(towed.time_s):
        ns = ros.nanoseconds(t)
        yield Message("/object/pose_simulated", ns, ros.stamped_pose(t, towed.pose[k]))
        yield Message("/tether/wrench", ns, ros.wrench(t, towed.tether_force[k]))
        yield Message("/tf", ns, ros.transforms(t, {"object_simulated": towed.pose[k]}))


_ROVER, _OBJECT = ("/rover/pose",), ("/object/pose", "/object/pose_simulated")
_STAMPED = "PoseStamped, PoseWithCovarianceStamped or Odometry"


_MOST_LEAN_DEG = 30.0
"""Of a body that drives on the floor: no noise of a marker is more, and with another axis up there is no heading."""


def _stamped_poses(
    content: McapContent, path: FilePath, body: str, topics: Sequence[str]
) -> tuple[Array, Array, set[str]]:
    """Times (n,) [s] and poses (n, 3) of the first of the ``topics`` that has any, in the order of their headers.

    And the names of the frames that the poses are in, as far as they are stated.
    """
    for topic in topics:
        values = content.values(topic)
        other = next((one for one in values if not (hasattr(one, "header") and hasattr(one, "pose"))), None)
        if other is not None:
            raise InputError(f"{topic} of {path} holds no stamped poses", got=other.__msgtype__, allowed=_STAMPED)
        if values:
            values = sorted(values, key=ros.stamp_ns)
            times_s = np.array([ros.stamp_ns(value) for value in values], dtype=np.float64) / NANOSECONDS_PER_SECOND
            full = [getattr(value.pose, "pose", value.pose) for value in values]
            poses, upright = planar_poses(full), np.array([_is_upright(each.orientation) for each in full])
            for good, wrong, remedy in (
                (np.isfinite(poses).all(axis=1), "not finite", "leave out the times at which the pose is not known"),
                (upright, "not upright", f"give orientations whose z axis is up, to {_MOST_LEAN_DEG:g} degrees"),
            ):
                if not good.all():
                    raise InputError(
                        f"{topic} of {path} holds poses that are {wrong}",
                        got=f"the first at {times_s[good.argmin()]:.12g} s",
                        remedy=remedy,
                    )
            return times_s, poses, {value.header.frame_id.strip("/") for value in values} - {""}
    raise InputError(
        f"{path} has no poses of the {body}",
        got=", ".join(sorted(content.topics)) or "no topics",
        allowed=f"the topic {' or '.join(topics)}",
    )


def _is_upright(quaternion: Any) -> bool:
    """Whether the z axis is about upright; false for zeros, which stand for an orientation that is not known."""
    lean, turn = quaternion.x**2 + quaternion.y**2, quaternion.z**2 + quaternion.w**2
    return bool(lean < np.tan(np.radians(_MOST_LEAN_DEG / 2)) ** 2 * turn)


def read_tow(path: FilePath) -> tuple[Array, Array, Array]:
    """What a tow behind the rover of any MCAP needs, from the first time at which rover and object are known.

    Times (n,) [s] and poses (n, 3) [m, m, rad, unwrapped] of ``/rover/pose``, and the object's pose (3,) at the first
    of these; at a time between two poses it is interpolated, and after its last the object has stayed. The object's
    topic is ``/object/pose``, else ``/object/pose_simulated``. The file may be a plan, a measured track or a recording
    of somebody else's. Times are those of the headers: a recording's own are when the messages arrived.

    Raises `InputError` when the file is missing, damaged or without one of these topics, or one holds other messages or
    poses that are not finite or not upright, or their frames differ, or the object is first seen after the last pose of
    the rover, or the rover has one pose only from there on, or two at one time.
    """
    content = read_mcap(path, only=(*_ROVER, *_OBJECT))
    times_s, poses, frames = _stamped_poses(content, path, "rover", _ROVER)
    object_times_s, object_poses, further = _stamped_poses(content, path, "object", _OBJECT)
    if len(frames | further) > 1:
        raise InputError(
            f"the poses in {path} are in several frames",
            got=", ".join(sorted(frames | further)),
            allowed="one frame for rover and object",
            remedy="transform the poses to one frame, that of the floor",
        )
    first = max(times_s[0], object_times_s[0])
    if first > times_s[-1]:
        raise InputError(
            f"the object is first seen after the last pose of the rover in {path}",
            got=f"the object from {first:.12g} s on, the rover until {times_s[-1]:.6g} s",
        )
    later = times_s > first
    driven_s = np.r_[first, times_s[later]]
    again = np.flatnonzero(np.diff(driven_s) <= 0)
    if len(driven_s) < 2 or len(again):
        raise InputError(
            f"the poses of the rover in {path} drive no tow",
            got=f"two at {driven_s[again[0]]:.12g} s" if len(again) else f"none after {first:.6g} s",
            allowed="two or more from where the object is known, each at a time of its own",
        )
    start, rover = _pose_at(first, object_times_s, object_poses), _pose_at(first, times_s, poses)
    return driven_s, np.vstack([rover, poses[later]]), start


def _pose_at(time_s: float, times_s: Array, poses: Array) -> Array:
    return np.array([np.interp(time_s, times_s, column) for column in poses.T])


def check_table(path: FilePath) -> None:
    """Refuse to write the table of a plan where something else stands."""
    check_plain(path)
    check_own(path, "time_s,rover_x_m,")


def write_plan_csv(path: FilePath, plan: RoverPlan, towed: SimulatedMotion) -> None:
    """Write a plan as CSV, a row a step: poses, wheel angles and rates, case, tow force, object.

    Columns of the object are interpolated between its reported times; they are empty after the last of these.
    """
    columns: dict[str, Array] = {"time_s": plan.time_s}
    for index, name in enumerate(("x_m", "y_m", "heading_rad")):
        columns[f"rover_{name}"] = plan.pose[:, index]
    for index, name in enumerate(WHEEL_NAMES):
        columns[f"{name}_steering_rad"] = plan.steering[:, index]
        columns[f"{name}_rate_rad_s"] = plan.wheel_rates[:, index]
    columns["case"] = np.array([PlanCase(case).name for case in plan.case])
    for index, name in enumerate(("x_m", "y_m", "heading_rad")):
        columns[f"object_{name}"] = _at(plan.time_s, towed.time_s, towed.pose[:, index])
    for index, name in enumerate(("x_n", "y_n")):
        columns[f"tether_force_{name}"] = _at(plan.time_s, towed.time_s, towed.tether_force[:, index])
    check_table(path)
    write_table(path, pd.DataFrame(columns))


def _at(times: Array, known: Array, values: Array) -> Array:
    return np.interp(times, known, values, left=np.nan, right=np.nan)


def write_table(path: FilePath, table: pd.DataFrame) -> None:
    """Write a table as CSV, whole or not at all, numbers with ten digits."""
    with replacing(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.10g", lineterminator="\n")


_NAME_OF_TIMES = re.compile(r"t|t[mun]?s|(time|stamp|sec).*")
"""Letters of names that times have in the files of others."""


def read_path(path: FilePath) -> Array | TimedPath:
    """Points (n, 2) [m] of a path from CSV with columns ``x_m`` and ``y_m``; with ``time_s`` a path with these times.

    Raises `InputError` when the file is missing, or a column is or is there twice, or times have another name, or a row
    has more numbers than there are names, or there are fewer than two rows.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            # Without an index: pandas makes one of what a row has too many, and moves the numbers to other names.
            table = pd.read_csv(path, index_col=False)
        # Of two columns of one name pandas calls the second x_m.1, and nothing tells which is meant.
        if not {"x_m", "y_m"} <= set(table) or not {"x_m.1", "y_m.1", "time_s.1"}.isdisjoint(table):
            raise InputError(
                f"{path} is no path",
                got=f"columns {', '.join(table)}",
                allowed="columns x_m, y_m and perhaps time_s, one of each, with commas between",
            )
        misnamed = [name for name in table if _NAME_OF_TIMES.fullmatch(re.sub(r"[\W\d_]", "", name.lower()))]
        if misnamed and "time_s" not in table:
            raise InputError(
                f"{path} states times under a name that is not read",
                got=f"column {misnamed[0]}",
                allowed="time_s, in seconds",
                remedy="name the column time_s, or leave it out",
            )
        points = table[["x_m", "y_m"]].to_numpy(dtype=np.float64)
        times_s = table["time_s"].to_numpy(dtype=np.float64) if "time_s" in table else None
    except FileNotFoundError:
        raise InputError(f"{path} is missing", remedy="give a CSV file with columns x_m and y_m") from None
    except pd.errors.ParserWarning:
        raise InputError(
            f"{path} is no table of numbers",
            got="rows with more numbers than there are names",
            allowed="a name for each column, a point in numbers: 0.5",
        ) from None
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(f"{path} is no table of numbers", got=error, allowed="CSV with a row of names") from None
    if len(points) < 2:
        raise InputError(f"{path} is no path", got=f"{len(points)} rows below the names", allowed="2 or more")
    wrong = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(wrong):
        point = ", ".join(f"{value:g}" for value in points[wrong[0]])
        raise InputError(f"{path} lacks a number", got=f"point {wrong[0] + 1}: {point}", allowed="finite x_m and y_m")
    return points if times_s is None else TimedPath(times_s, points)

"""Commands plan and tow: a path for the object → a plan for the rover; the rover's poses → the object's motion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from towval.commands.shared import provenance, tell
from towval.errors import InputError
from towval.io.plan_files import read_object_start, read_path, read_rover_poses, write_plan_csv, write_plan_mcap
from towval.io.records import write_simulated
from towval.physics.quasistatic import quasistatic_plan
from towval.plan import close_loop, hinge_of_poses, tow
from towval.rover.paths import Curve, through_points, timed
from towval.study.paper_scene import PaperScene, paper_scene
from towval.study.sensitivity import REPORT_STRIDE, cube_patch
from towval.types import Array
from towval.types import Path as TimedPath


def run(scene: Mapping[str, Any], wish: str, mcap: Path, csv: Path) -> None:
    """Plan the rover so that the cube follows a path, tow the cube behind it, and write both.

    Parameters
    ----------
    scene : mapping
        The scene, as ``workflow/plan.yaml`` describes it.
    wish : str
        Name of a curve of the scene, or a CSV file with columns ``x_m``, ``y_m`` and perhaps ``time_s``.
    mcap, csv : Path
        Files to write.
    """
    given = paper_scene(scene)
    patch, path = cube_patch(given), _wish(given, wish)
    nominal = quasistatic_plan(given.cube, patch, path, given.tether, times=_planner_times(given, path))
    loop = close_loop(nominal, given.cube, patch, given.tether, given.rover, given.planner, report_stride=REPORT_STRIDE)
    tell((*nominal.findings, *loop.rover.findings, *loop.towed.findings), "plan")
    print(f"plan: {loop.rover.outcome}. {loop.rover.advice}")
    write_plan_mcap(mcap, loop.rover, loop.towed, provenance(scene, {}))
    write_plan_csv(csv, loop.rover, loop.towed)


def run_tow(scene: Mapping[str, Any], recording: Path, output: Path) -> None:
    """Tow the cube behind the rover of a recording, from the object's first pose in it.

    Parameters
    ----------
    scene : mapping
        The scene, as ``workflow/plan.yaml`` describes it.
    recording : Path
        Any MCAP with ``/rover/pose`` and ``/object/pose`` or ``/object/pose_simulated``: a plan, a measured track.
    output : Path
        MCAP to write, as the stage simulate does.
    """
    given = paper_scene(scene)
    times, poses = read_rover_poses(recording)
    hinge = hinge_of_poses(poses, given.rover)
    start = read_object_start(recording)
    motion = tow(times, hinge, given.cube, cube_patch(given), given.tether, start_pose=start, stride=REPORT_STRIDE)
    tell(motion.findings, "tow")
    write_simulated(output, motion, provenance(scene, {recording.name: recording}))


def _wish(scene: PaperScene, wish: str) -> TimedPath:
    if wish in scene.curves:
        return _timed(scene, scene.curves[wish])
    if Path(wish).suffix != ".csv":
        raise InputError(
            f"the path {wish} is not known", allowed=f"{', '.join(scene.curves)}, or a CSV file with x_m and y_m"
        )
    read = read_path(Path(wish))
    return read if isinstance(read, TimedPath) else _timed(scene, through_points(read, name=Path(wish).stem))


def _timed(scene: PaperScene, curve: Curve) -> TimedPath:
    return timed(curve, scene.planner_step, duration=scene.duration)


def _planner_times(scene: PaperScene, path: TimedPath) -> Array:
    """Times in the planner's steps over the duration of a path that may have its own."""
    return path.time_s[0] + scene.planner_step * np.arange(
        int((path.time_s[-1] - path.time_s[0]) / scene.planner_step + 1e-9) + 1
    )

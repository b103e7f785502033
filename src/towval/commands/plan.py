"""Commands plan and tow: desired path of the object → motion of the rover; recorded rover → motion of the object."""

import shlex
from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from towval.commands.console import Outcome
from towval.io.atomic import check_own, check_plain, write_text
from towval.io.campaign import Campaign, load_campaign
from towval.io.mcap_file import read_provenance
from towval.io.plan_files import check_table, read_path, read_tow, write_plan_csv, write_plan_mcap
from towval.io.provenance import provenance
from towval.io.reading import is_plain_file
from towval.io.records import write_simulated
from towval.io.schema import check, packaged_schema
from towval.io.yaml_text import read_yaml
from towval.model import Array, SimulatedMotion, TimedPath
from towval.model.errors import InputError, RefusedError
from towval.model.geometry import path_length
from towval.physics.mass import towed_object
from towval.physics.quasistatic import quasistatic_plan
from towval.planning.paths import Curve, through_points, timed
from towval.planning.plan import close_loop, hinge_of_poses
from towval.planning.planner import PlanCase, PlanOutcome
from towval.planning.scene import PlanScene, friction_under, plan_scene
from towval.validation.across import tether_across
from towval.validation.recorded_tow import gap_findings, recorded_tow, start_at_rest

_PAPER = Path("paper")
"""Stands for the scene that comes with the package, whose path nobody knows after ``pip install``."""

_FEWEST_STEPS = 2
"""Of the planner: a path has a bend from three points on."""

_MOST_STEPS = 200_000
"""Of the planner: so many take minutes and gigabytes. Times in milliseconds filled the memory without a word."""

_MAP_MARK = "<!-- map of towval -->"
"""How a map of ours begins: no other file is replaced, nor another drawing of the same library."""


def run(
    scene: Mapping[str, Any] | Path,
    wanted: str,
    output: Path,
    csv: Path,
    campaign: Path | None = None,
    map_file: Path | None = None,
) -> Outcome:
    """Plan a rover motion that makes the object follow a path, simulate the object behind it, and write both.

    ``scene`` is as ``src/towval/workflow/plan.yaml`` describes it, or a file that holds it; the path ``paper`` stands
    for that file of the package. ``wanted`` is the name of one of its curves, or a CSV file with columns ``x_m``,
    ``y_m`` and optionally ``time_s``. Object, friction, tether and hinge of a ``campaign`` replace those of the scene.
    ``map_file`` is an SVG file for a map.

    Raises `RefusedError` when the rover does not arrive; no plan is written then.
    """
    check_table(csv)
    _check_map(map_file)
    if len({output.resolve(), csv.resolve(), *([map_file.resolve()] if map_file else [])}) < 2 + bool(map_file):
        raise InputError("two files of the plan have one name", got=csv.name, allowed="a name for each")
    document, given, lab = _scene(scene, campaign)
    law, path, tether = friction_under(given), _wanted(given, wanted), given.tether
    ground, height = given.ground, given.hinge_height
    times = _planner_times(given, path)
    nominal = quasistatic_plan(given.towed, law, path, tether, times=times, ground=ground, hinge_height=height)
    loop = close_loop(nominal, given.towed, law, tether, given.rover, given.planner, ground=ground, hinge_height=height)
    found = (*nominal.findings, *loop.rover.findings, *loop.towed.findings)
    if loop.rover.outcome is not PlanOutcome.ARRIVED:
        raise RefusedError(f"the rover does not arrive: {loop.rover.outcome}", remedy=loop.rover.advice)
    inputs = {} if wanted in given.curves else {Path(wanted).name: Path(wanted)}
    lab_document = lab.document if lab else None
    planned = replace(loop.rover, findings=found)
    write_plan_mcap(output, planned, loop.towed, provenance("plan", document, inputs, document=lab_document))
    write_plan_csv(csv, loop.rover, loop.towed)
    limited = loop.rover.case != PlanCase.A
    desired = nominal.pose[:, :2]  # between the points of a file it bends as well
    off = {"object_rms_mm": 1e3 * loop.object_rms, "hinge_rms_mm": 1e3 * loop.rover.rms}
    numbers = {
        **off,
        "limited_share": float(np.mean(limited)),
        "path_length_m": path_length(desired),
        "duration_s": float(np.ptp(loop.rover.time_s)),
    }
    text = (
        f"{loop.rover.outcome} after {numbers['duration_s']:.1f} s, path of {numbers['path_length_m']:.2f} m; "
        f"the object deviates from its path by {off['object_rms_mm']:.1f} mm RMS, "
        f"the hinge from its own by {off['hinge_rms_mm']:.1f} mm; its bends are the rover's limit for "
        f"{100 * numbers['limited_share']:.0f} % of the time, else the path's own"
    )
    files = (output, csv, *_mapped(map_file, loop.rover.hinge, loop.towed, given, desired, limited))
    return Outcome("plan", files, text, numbers, found)


def _check_map(file: Path | None) -> None:
    """Refuse the name of a map before anything is computed and written."""
    if file is None:
        return
    if file.suffix != ".svg":
        raise InputError("the map cannot be written", got=file.name, allowed="a name that ends in .svg")
    check_plain(file)
    check_own(file, _MAP_MARK)


def _mapped(
    file: Path | None,
    hinge: Array,
    motion: SimulatedMotion,
    scene: PlanScene,
    wanted: Array | None = None,
    limited: NDArray[np.bool_] | None = None,
) -> tuple[Path, ...]:
    """The map of a plan or a tow, where one is asked for."""
    if file is None:
        return ()
    # Not at start-up: they import matplotlib, which only maps need.
    from towval.report.figures.plan import plan_figure  # noqa: PLC0415
    from towval.report.style import svg_text  # noqa: PLC0415

    drawn = svg_text(plan_figure(hinge, motion, scene.towed, wanted, limited))
    write_text(file, f"{_MAP_MARK}\n{drawn}", own=_MAP_MARK)
    return (file,)


def run_tow(
    scene: Mapping[str, Any] | Path,
    recording: Path,
    output: Path,
    campaign: Path | None = None,
    map_file: Path | None = None,
) -> Outcome:
    """Simulate the object behind a recorded rover, from where the recording knows both, at rest.

    Where a stiff tether would pull with more than friction holds, it starts as much nearer to the rover as rest takes.
    ``recording`` is any MCAP with ``/rover/pose`` and ``/object/pose`` or ``/object/pose_simulated``: a plan, a
    measured track. Every pose of the rover drives the tether. ``output`` is in the format of simulate.mcap; the rest is
    as in :func:`run`.
    """
    _check_map(map_file)
    document, given, lab = _scene(scene, campaign)
    _refuse_decimated(recording)
    times, poses, measured = read_tow(recording)
    hinge = hinge_of_poses(poses, given.rover)
    towing = given.towed, given.friction, given.tether, given.ground, given.hinge_height
    start, nearer = start_at_rest(*towing, hinge[0], measured)
    motion = recorded_tow(*towing, TimedPath(times, hinge), start)
    across = tether_across(lab.scene, lab.object, motion) if lab else []
    motion = replace(motion, findings=(*nearer, *gap_findings(times, hinge), *motion.findings, *across))
    lab_document = lab.document if lab else None
    write_simulated(output, motion, provenance("tow", document, {recording.name: recording}, document=lab_document))
    moved_m = path_length(motion.pose[:, :2])
    text = f"{motion.outcome}; the object moves {moved_m:.2f} m in {np.ptp(times):.1f} s"
    files = (output, *_mapped(map_file, hinge, motion, given))
    numbers = {"outcome": motion.outcome, "path_length_m": moved_m}
    return Outcome("tow", files, text, numbers, motion.findings)


def _refuse_decimated(recording: Path) -> None:
    """Between the few poses of a decimated track the rover moves by their rates, which no other recording has."""
    if read_provenance(recording).get("stage") == "decimate":
        raise InputError(
            f"{recording} holds a decimated track",
            allowed="a recording of all poses of the rover",
            remedy="give the track.mcap of which it was made",
        )


def _scene(
    scene: Mapping[str, Any] | Path, campaign: Path | None
) -> tuple[Mapping[str, Any], PlanScene, Campaign | None]:
    """The scene as its document and as it is used, with what a campaign replaces; and the campaign."""
    if scene == _PAPER and not is_plain_file(_PAPER):  # a folder of that name holds a paper
        scene = Path(str(resources.files("towval").joinpath("workflow", "plan.yaml")))
    if isinstance(scene, Path) and (scene.name == "campaign.yaml" or is_plain_file(scene / "campaign.yaml")):
        folder = shlex.quote(str(scene.parent if scene.name == "campaign.yaml" else scene))
        raise InputError(
            "the scene is a campaign, which knows no wheels of the rover",
            got=scene,
            allowed="a scene file, or paper for the scene of the package",
            remedy=f"give the campaign beside the scene: paper --campaign {folder}",
        )
    missing = "give a scene file, or paper for the scene of the package"
    document: Any = read_yaml(scene, missing) if isinstance(scene, Path) else scene
    if isinstance(scene, Path):
        check(document, packaged_schema("plan.schema.yaml"), scene.name)
    given = plan_scene(document)
    if campaign is None:
        return document, given, None
    loaded = load_campaign(campaign)
    lab = loaded.scene
    rover = replace(given.rover, hinge=lab.hinge)
    given = replace(
        given, towed=towed_object(lab), friction=lab.friction, tether=lab.tether, rover=rover, ground=lab.ground,
        hinge_height=lab.hinge_height,
    )  # fmt: skip
    return document, given, loaded


def _wanted(scene: PlanScene, wanted: str) -> TimedPath:
    if wanted in scene.curves:
        return _timed(scene, scene.curves[wanted])
    if Path(wanted).suffix.lower() != ".csv":
        raise InputError(f"unknown path {wanted}", allowed=f"{', '.join(scene.curves)}, or a CSV file with x_m and y_m")
    read = read_path(Path(wanted))
    return read if isinstance(read, TimedPath) else _timed(scene, through_points(read, name=Path(wanted).stem))


def _timed(scene: PlanScene, curve: Curve) -> TimedPath:
    _steps(scene, scene.duration)  # before there are as many points
    return timed(curve, scene.planner_step, duration=scene.duration)


def _planner_times(scene: PlanScene, path: TimedPath) -> Array:
    """Times [s] at the planner's step over the whole duration of a path, or at a shorter one that divides it."""
    duration_s, step_s = float(np.ptp(path.time_s)), scene.planner_step
    steps = _steps(scene, duration_s)
    if duration_s - steps * step_s > 1e-6 * step_s:
        steps, step_s = steps + 1, duration_s / (steps + 1)
    times: Array = path.time_s[0] + step_s * np.arange(steps + 1)
    return times


def _steps(scene: PlanScene, duration_s: float) -> int:
    """Number of the planner's steps over a duration [s]."""
    steps = duration_s / scene.planner_step + 1e-9
    short = steps < _FEWEST_STEPS
    if short or steps >= _MOST_STEPS + 1:
        raise InputError(
            f"the path {'is too short in time' if short else 'takes too long'} for the planner",
            got=f"{duration_s:.6g} s",
            allowed=f"{_FEWEST_STEPS} to {_MOST_STEPS} steps of {scene.planner_step:g} s",
            remedy="state time_s of the path, or quasi_static.duration_s of the scene, in seconds; or change its "
            "planner.time_step_s",
        )
    return int(steps)

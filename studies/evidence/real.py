"""Checks on data that others measured: pushes, displaced pictures, surveyed marks, photographs of boards, clips."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, flawed, moved, numbers_of, replaced, result_of
from studies.real import clips, displaced_windows, feet_study, jackknife, measured_pushes, program_pushes
from studies.real.push_data import PROGRAMMED_HEIGHT_M, TIP_HEIGHT_M, PushLog, read_logs
from towval.calibration import bundle_adjustment, doubts, marks_alone, sound_views, view_covariance
from towval.calibration.bundle_adjustment import marginal_covariance
from towval.calibration.lens import LENS_MODELS
from towval.calibration.marks_alone import calibrate_marks
from towval.calibration.observations import CalibrationObservations
from towval.calibration.sound_views import adjust_sound_views
from towval.model import Array, FloorReference, Patch, Track
from towval.physics.spatial import problem as spatial_problem
from towval.tracking import stamps
from towval.tracking.follow import Follower
from towval.tracking.plane_tracker import PlaneTracker

_HERE = sys.modules[__name__]
_IN_THE_SET_DEG = 1e-6
_HEIGHTS = {"0": 0.0, "12.5 mm": PROGRAMMED_HEIGHT_M, "15 mm": TIP_HEIGHT_M, "18 mm": 0.018}


def _both(name: str, errors: pd.Series | Array) -> dict[str, float]:
    return {f"{name}, median": float(np.median(errors)), f"{name}, mean": float(np.mean(errors))}


def push_logs() -> list[PushLog]:
    """All logs of the measured pushes."""
    return read_logs(shared_folder() / "real" / "mlab_pushes")


def _feet() -> list[PushLog]:
    return [log for log in push_logs() if len(log.feet)]


def _wider(logs: list[PushLog]) -> list[PushLog]:
    return [replace(log, feet=1.1 * log.feet) for log in logs]


def _mirrored(logs: list[PushLog]) -> list[PushLog]:
    return [replace(log, feet=log.feet * [-1, 1]) for log in logs[1:]]


def _pushes() -> Values:
    found: dict[str, float] = {}
    for label, height in _HEIGHTS.items():
        rows = pd.concat([feet_study.push_rows(log, height) for log in _feet()], ignore_index=True)
        moving = rows[rows.slowest_path_m > measured_pushes.SLOW_M]
        found |= _both(f"twist from the mean wrench, h = {label}", rows.twist_deg)
        found |= _both(f"wrench from twist, all feet move 2 mm, h = {label}", moving.wrench_deg)
        if height == TIP_HEIGHT_M:
            found |= {"pushes": len(rows), "pushes in which all feet move 2 mm": len(moving)}
            found["against Coulomb's law at points, median"] = float(np.median(rows.closed_form_deg))
            found["against Coulomb's law at points, largest"] = float(rows.closed_form_deg.max())
            found |= _both("ellipsoid from statics, twist", rows.ellipsoid_twist_deg)
            found |= _both("ellipsoid from statics, wrench", moving.ellipsoid_wrench_deg)
            found |= _about_a_foot(rows)
    return found


def _about_a_foot(rows: pd.DataFrame) -> dict[str, float]:
    """Pushes of which the model alone says that the twist hardly fixes the wrench, the others, and friction by log."""
    near = rows[rows.wrench_spread_deg > feet_study.SPREAD_LIMIT_DEG]
    far = rows[rows.wrench_spread_deg <= feet_study.SPREAD_LIMIT_DEG]
    found = {"pushes about a foot": float(len(near))} | _both("about a foot, wrench from twist", near.wrench_deg)
    found["about a foot, wrench in the set"] = 100 * float(np.mean(near.set_error_deg < _IN_THE_SET_DEG))
    found["about a foot, wrench against the set, mean"] = float(np.mean(near.set_error_deg))
    found |= _both("about a foot, twist from wrench", near.twist_deg)
    found |= _both("not about a foot, wrench from twist", far.wrench_deg)
    for column, used in (("size", far), ("wrench", rows), ("power", rows)):
        _, (mean, _, scatter) = feet_study.friction_rows(used, f"friction_by_{column}")
        found |= {f"μ by {column}": mean, f"μ by {column}, scatter between logs": scatter}
    return found


def _at_the_floor(original: Any) -> Any:
    """The program lays out a push at the floor."""
    return lambda towed, *rest: original(replace(towed, anchor_height=0.0), *rest)


def _spread(original: Any) -> Any:
    """The program lays out soles 10 % too large, feet as far apart."""
    return lambda patch, *rest: original(Patch.of([1.1 * ring for ring in patch.outlines]), *rest)


PROGRAM_WRONG = {
    "the program lays out soles 10 % too far apart": replaced(spatial_problem, "soles", _spread),
    "the program takes the push to be at the floor": replaced(program_pushes, "tow_problem", _at_the_floor),
    "the program's friction is a tenth larger across than along": replaced(
        program_pushes, "Sliding", lambda sliding: lambda law, **keys: sliding(law, 1.1, **keys)
    ),
    "the program's friction is 2 % too large": both(
        replaced(program_pushes, "Coulomb", lambda law: lambda friction, rise: law(1.02 * friction, rise)),
        replaced(spatial_problem, "_holding_table", lambda table: lambda static: table(1.02 * static)),
    ),
}
"""Faults of the package in what it makes of a push."""

PUSHES = Check(
    _pushes,
    {
        **PROGRAM_WRONG,
        "feet are taken 10 % too far apart": replaced(_HERE, "push_logs", result_of(_wider)),
        "feet are mirrored, and a log is left out": replaced(_HERE, "push_logs", result_of(_mirrored)),
    },
    needs=("real/mlab_pushes",),
)


def _push_fits() -> Values:
    logs = push_logs()
    feet, faces = [log for log in logs if len(log.feet)], [log for log in logs if not len(log.feet)]
    return numbers_of([*measured_pushes.scale_lines(feet), *measured_pushes.slow_rows(feet, faces[0])])


def _turning_less(logs: list[PushLog]) -> list[PushLog]:
    return [replace(log, twist=log.twist * [1, 1, 0.9]) for log in logs]


def _forces_unsure(logs: list[PushLog]) -> list[PushLog]:
    rng = np.random.default_rng(1)
    wrenches = [log.wrench * (1 + 0.1 * rng.normal(size=log.wrench.shape)) for log in logs]
    twists = [log.twist * [1, 1, 0.5 if k % 2 else 1.0] for k, log in enumerate(logs)]
    return [replace(log, wrench=w, twist=v) for log, w, v in zip(logs, wrenches, twists, strict=True)]


PUSH_FITS = Check(
    _push_fits,
    {
        "the program lays out soles 10 % too far apart": PROGRAM_WRONG["the program lays out soles 10 % too far apart"],
        "a tenth of every twist's turning is lost": replaced(_HERE, "push_logs", result_of(_turning_less)),
        "forces scatter by a tenth, the turning of every second log by half": replaced(
            _HERE, "push_logs", result_of(_forces_unsure)
        ),
    },
    needs=("real/mlab_pushes",),
)


def _windows() -> Values:
    folder = shared_folder() / "real" / "dic"
    star, bound = displaced_windows.star_errors(folder, 31)
    rigid = [displaced_windows.rigid_errors(folder, name) for name in displaced_windows.RIGID]
    measured = sum(len(each.errors) for each in (star, *rigid)) / sum(each.windows for each in (star, *rigid))
    return {
        "noisy star, bias": star.bias,
        "noisy star, scatter over the Cramér-Rao bound": star.scatter / bound,
        "noisy star, stated deviation over scatter": star.stated_std / star.scatter,
        "rigid shifts, bias": max(each.bias for each in rigid),
        "rigid shifts, scatter": max(each.scatter for each in rigid),
        "windows measured": 100 * measured,
    }


def _shaken(original: Any) -> Any:
    """Every pose is off at random, by 0.008 px [m], and about one in ten is not found."""
    rng = np.random.default_rng(1)

    def measure(*args: Any, **kwargs: Any) -> Any:
        found, off, lost = original(*args, **kwargs), rng.normal(0, 8e-6, 3), rng.random() < 0.1
        return None if lost else found and replace(found, pose=found.pose + off)

    return measure


WINDOWS = Check(
    _windows,
    {
        "poses are 0.005 px off": replaced(PlaneTracker, "measure", moved(5e-6, 5e-6, 0.0)),
        "poses scatter by another 0.008 px, every tenth is not found": replaced(PlaneTracker, "measure", _shaken),
    },
    needs=("real/dic",),
)


def survey() -> FloorReference:
    """The surveyed marks of a real arena."""
    path = shared_folder() / "real" / "surveyed_floor" / "marks.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    pixels, places = (np.column_stack([table[a], table[b]]) for a, b in (("u_px", "v_px"), ("x_m", "y_m")))
    return FloorReference(marks_px=pixels, marks_m=places, mark_std_px=0.3)


def _marks() -> Values:
    found: dict[str, float | str] = {"marks": float(len(survey().marks_px))}
    for model in ("none", "k1", "k1 k2"):
        calibration = calibrate_marks((640, 480), survey(), (model,))
        found[f"left-out marks, lens {model}"] = calibration.quality["held_out_rms_mm"]
    chosen = calibrate_marks((640, 480), survey(), tuple(LENS_MODELS))
    found["lens"] = chosen.camera.lens_model
    found["focal length"] = float(chosen.camera.matrix[0, 0])
    return found | {"deviation of the focal length": chosen.quality["focal_length_std_px"]}


def _rounded(reference: FloorReference) -> FloorReference:
    return replace(reference, marks_px=np.round(reference.marks_px / 3) * 3)


MARKS = Check(
    _marks,
    {
        "marks are read to 3 px, and of the lenses the largest is taken": both(
            replaced(_HERE, "survey", result_of(_rounded)),
            replaced(marks_alone, "choose_lens", lambda _: lambda trials: trials[-1]),
        ),
        "a mark helps to predict itself": replaced(
            marks_alone, "_block", lambda block: lambda reference, std_px, _kept=None: block(reference, std_px)
        ),
        "the focal length is stated half as uncertain": replaced(
            marks_alone, "marginal_covariance", result_of(lambda found: (found[0] / 4, *found[1:]))
        ),
        "a mark is left out": replaced(
            _HERE,
            "survey",
            result_of(lambda all_of: replace(all_of, marks_px=all_of.marks_px[1:], marks_m=all_of.marks_m[1:])),
        ),
    },
    needs=("real/surveyed_floor",),
)


def _photographs() -> Values:
    found: dict[str, float] = {}
    for folder in jackknife.SETS:
        stated, alone = jackknife.over_jackknife(shared_folder() / "real" / folder)
        for name, ratio, independent in zip(jackknife.JUDGED, stated, alone, strict=True):
            found |= {f"{folder}, {name}": float(ratio), f"{folder}, {name}, corners independent": float(independent)}
    return found


def _as_independent(_: Any) -> Any:
    """The covariance of corners whose errors have nothing to do with each other."""

    def alone(blocks: Any, estimate: Any, active: Any) -> Array:
        return marginal_covariance(blocks, estimate, active)[0][np.ix_(active, active)]

    return alone


DEVIATIONS_WRONG = {
    "the errors of corners are taken for independent": replaced(view_covariance, "view_covariance", _as_independent),
    "deviations are stated half as large": replaced(
        view_covariance, "view_covariance", result_of(lambda covariance: covariance / 4)
    ),
    "those of independent corners are half as large": replaced(
        jackknife, "marginal_covariance", result_of(lambda found: (found[0] / 4, *found[1:]))
    ),
}
"""Faults of the deviations that a calibration states."""


def _derivatives_at_known_places(original: Any) -> Any:
    """Residuals and derivatives without those by the places of the boards."""
    return lambda *args: ((r, A, B[:, :0]) for r, A, B in original(*args))


def _at_known_places(original: Any) -> Any:
    """The covariance of independent corners of boards whose places are taken for known."""

    def wrong(*args: Any) -> Any:
        apart = result_of(lambda normal: replace(normal, AB=0 * normal.AB))
        with replaced(bundle_adjustment, "_normal", apart)():
            return original(*args)

    return wrong


JACKKNIFE = Check(
    _photographs,
    {
        "the errors of corners are taken for independent": DEVIATIONS_WRONG[
            "the errors of corners are taken for independent"
        ],
        "the places of the boards are taken for known, corners apart and together": both(
            replaced(view_covariance, "whitened", _derivatives_at_known_places),
            replaced(jackknife, "marginal_covariance", _at_known_places),
        ),
    },
    needs=("real/opencv_left", "real/gopro_wide_calib"),
)


def _lenses() -> Values:
    """Which lens is chosen for photographs, and the errors of views that are held out."""
    folder, found = shared_folder() / "real", dict[str, float | str]()
    for name in jackknife.SETS:
        adjusted = adjust_sound_views(jackknife.photographs(folder / name), tuple(LENS_MODELS), 6, 4.0)
        chosen, better = adjusted.settled.chosen, adjusted.fisheye
        found |= {f"{name}, lens": chosen.model, f"{name}, held out": float(np.sqrt(chosen.score_px2))}
        found[f"{name}, fisheye named"] = "none" if better is None else better.model
        if better is not None:
            found[f"{name}, fisheye, held out"] = float(np.sqrt(better.score_px2))
    return found


def _noisier(seen: CalibrationObservations) -> CalibrationObservations:
    rng = np.random.default_rng(0)
    boards = (replace(one, corners_px=one.corners_px + rng.normal(0, 0.3, one.corners_px.shape)) for one in seen.boards)
    return replace(seen, boards=tuple(boards))


LENSES = Check(
    _lenses,
    {
        "no model of a fisheye is tried": replaced(
            sound_views, "families", lambda original: lambda models: (original(models)[0], ())
        ),
        "corners are 0.3 px off": replaced(jackknife, "photographs", result_of(_noisier)),
        "of the lenses the smallest is taken": replaced(doubts, "choose_lens", lambda _: lambda trials: trials[0]),
        "every lens may be a fisheye, however little the views say so": both(
            replaced(sound_views, "may_be_fisheye", lambda _: lambda *_: True),
            replaced(sound_views, "choose_lens", lambda _: lambda trials: trials[0]),
        ),
    },
    needs=("real/opencv_left", "real/gopro_wide_calib"),
)


def _clips() -> Values:
    folder = shared_folder() / "real"
    pucks = [errors for first in (200, 230) for errors in clips.puck_errors(folder, first).values()]
    robots = [clips.robot_distances(folder, clip) for clip in clips.PLATES]
    found = {
        "discs, share of frames": min(errors.tracked for errors in pucks),
        "discs, farthest from the colour fit": max(errors.most_px for errors in pucks),
        "discs, RMS from the colour fit": max(errors.rms_px for errors in pucks),
        "discs, axis": max(errors.axis_deg for errors in pucks),
        "discs, offset of the colour fit": max(float(np.linalg.norm(errors.offset_px)) for errors in pucks),
        "robot, farthest from the arrow": max(float(distance.max()) for _, distance in robots),
    }
    seen = [np.split(track.seen, [-clips.WRITTEN_AGAIN]) for track, _ in robots]
    found["robot, frames tracked, least of the clips"] = 100 * min(float(own.mean()) for own, _ in seen)
    for clip, (own, _) in zip(clips.PLATES, seen, strict=True):
        found[f"robot, frames lost, {clip}"] = float(np.count_nonzero(~own))
    found["robot, frames written again that count"] = float(sum(np.count_nonzero(again) for _, again in seen))
    return found


def _aside(tracks: dict[str, Track]) -> dict[str, Track]:
    """All poses 1 px to the left [m]."""
    return {body: replace(track, pose=track.pose - np.array([1e-3, 0.0, 0.0])) for body, track in tracks.items()}


CLIPS = Check(
    _clips,
    {
        "lost bodies are not searched for": replaced(Follower, "_search", lambda _: lambda *args, **kwargs: None),
        "poses scatter by 2 px and 12° and are 1 px to the left, every twentieth is lost": replaced(
            clips, "track", lambda original: flawed(2e-3, 0.2)(result_of(_aside)(original))
        ),
        "a film that freezes to its end is taken to go on": replaced(
            stamps, "frozen_at_the_end", result_of(np.zeros_like)
        ),
    },
    needs=("real/sliding_pucks", "real/rover_overhead_4fps"),
)

"""Stage compare: simulated against measured path of the object, unaligned."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from towval.errors import RefusedError
from towval.geometry import path_length, rotation, wrapped
from towval.types import (
    Array,
    Body,
    Calibration,
    Comparison,
    Finding,
    Severity,
    SimulatedMotion,
    Track,
    TrackStatus,
    Verdict,
)
from towval.vision.camera import project
from towval.vision.uncertainty import position_covariance


def compare(run: str, simulated: SimulatedMotion, measured: Track, calibration: Calibration, body: Body) -> Comparison:
    """Compare a simulated motion with the measured one, frame by frame and without aligning them.

    Parameters
    ----------
    run : str
        Name of the run.
    simulated : SimulatedMotion
        What the model says.
    measured : Track
        What the camera saw; only frames in which the object was seen count.
    calibration : Calibration
        The camera that measured, for the uncertainty of the measurement.
    body : Body
        The object.

    Returns
    -------
    Comparison
        Errors over time and their summary. ``u_measurement_m`` is the root mean square standard uncertainty of a
        measured position: calibration, height of the top, registration in the first frame and the frame's own noise.

    Raises
    ------
    RefusedError
        When no simulated frame was seen.
    """
    rows = np.searchsorted(measured.time_s, simulated.time_s)
    rows = np.minimum(rows, len(measured.time_s) - 1)
    matched = np.abs(measured.time_s[rows] - simulated.time_s) < 1e-6
    rows, simulated_pose = rows[matched], simulated.pose[matched]
    pose = np.where(measured.seen[rows, None], measured.pose[rows], np.nan)
    if not np.isfinite(pose).any():
        raise RefusedError(
            f"run {run} cannot be compared",
            got="no simulated frame in which the object was seen",
            remedy="look at the findings of the stage track",
        )
    error = simulated_pose - pose
    error[:, 2] = wrapped(error[:, 2])
    distance = np.linalg.norm(error[:, :2], axis=1)
    u_measurement = _measurement_uncertainty(measured, rows, pose, calibration, body)
    u_num = simulated.statistics.get("u_num_m", np.nan)
    status = measured.status[rows]
    return Comparison(
        run=run,
        time_s=measured.time_s[rows],
        error=error,
        along_across=_along_across(error[:, :2], pose),
        path_rms_m=_rms(distance),
        path_max_m=float(np.nanmax(distance)),
        final_error_m=float(distance[np.isfinite(distance)][-1]),
        heading_rms_rad=_rms(error[:, 2]),
        path_length_m=_length_without_noise(pose, measured.std[rows]),
        u_num_m=u_num,
        u_input_m=np.nan,
        u_measurement_m=u_measurement,
        u_val_m=np.nan,
        verdict=Verdict.NOT_JUDGED,
        tracked_frames=int(np.count_nonzero(status == TrackStatus.TRACKED)),
        lost_frames=int(np.count_nonzero(status != TrackStatus.TRACKED)),
        findings=tuple(_findings(measured, simulated)),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _along_across(shift: Array, pose: Array) -> Array:
    """Shifts (n, 2) along and across the measured path; where the object rests, along its last direction."""
    direction = np.full(len(pose), np.nan)
    seen = np.flatnonzero(np.isfinite(pose[:, 0]))
    anchor = pose[seen[0], :2]
    for i in seen:
        step = pose[i, :2] - anchor
        if step @ step > _STEP_M**2:
            direction[i], anchor = np.arctan2(step[1], step[0]), pose[i, :2]
    known = np.flatnonzero(np.isfinite(direction))
    if len(known) == 0:
        return np.where(np.isfinite(shift), np.nan, np.nan)
    filled = direction[known[np.clip(np.searchsorted(known, np.arange(len(pose))), 0, len(known) - 1)]]
    return np.einsum("nji,nj->ni", rotation(filled), shift)


_STEP_M = 0.01
"""Way after which the direction of the path is read again [m]: long against tracking noise, short against its bends."""


def _length_without_noise(pose: Array, std: Array) -> float:
    """Length of the measured path [m], read off at steps longer than the noise, so that a rest adds nothing."""
    seen = pose[np.isfinite(pose[:, 0]), :2]
    step = max(_STEP_M, 5 * float(np.nanmedian(std[:, :2])))
    corners = [seen[0]]
    for position in seen:
        if np.linalg.norm(position - corners[-1]) > step:
            corners.append(position)
    corners.append(seen[-1])
    return path_length(np.array(corners))


def _measurement_uncertainty(measured: Track, rows: Array, pose: Array, calibration: Calibration, body: Body) -> float:
    seen = np.isfinite(pose[:, 0])
    height = body.tracked_plane_height_m
    points = np.column_stack([pose[seen, :2], np.full(np.count_nonzero(seen), height)])
    pixels = project(calibration.camera, calibration.floor, points)
    covariance = position_covariance(calibration, pixels, height, height_std_m=body.height_std_m)
    turn = rotation(pose[seen, 2])
    covariance = covariance + turn @ measured.start_covariance[:2, :2] @ turn.transpose(0, 2, 1)
    covariance += measured.covariance[rows][seen][:, :2, :2]
    return float(np.sqrt(np.mean(np.trace(covariance, axis1=1, axis2=2))))


def _findings(measured: Track, simulated: SimulatedMotion) -> Iterable[Finding]:
    lost = int(np.count_nonzero(measured.status != TrackStatus.TRACKED))
    if lost:
        yield Finding(Severity.WARNING, "compare_lost", f"{lost} frames in which the object was not seen take no part.")
    if len(simulated.time_s) < len(measured.time_s):
        yield Finding(
            Severity.WARNING,
            "compare_cut",
            f"{len(measured.time_s) - len(simulated.time_s)} measured frames have no simulated counterpart.",
        )
    yield Finding(
        Severity.NOTE, "not_judged", "No verdict: the uncertainty of the simulation's inputs is not computed yet."
    )

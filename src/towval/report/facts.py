"""Text and numbers of the report: reasons for the verdicts, facts of each stage."""

from collections.abc import Mapping

import numpy as np

from towval.model import Calibration, Comparison, Identification, Stamp, Track, Verdict
from towval.model.geometry import polygon_centroid, transform
from towval.model.results import START_OFF, STICKING, TO_DYNAMICS
from towval.model.run_record import RunRecord
from towval.report.wording import (
    NOT_COMPUTED,
    NOT_JUDGED,
    at_most,
    at_most_degrees,
    decimal,
    degrees,
    millimetres,
    named_scalar,
    signed,
)

Facts = tuple[tuple[str, str], ...]
"""Names and values as shown."""

Table = tuple[tuple[str, tuple[str, ...]], ...]
"""Names, each with the values of all runs."""

Rows = tuple[tuple[str, ...], ...]
"""Rows of a table; the first cell is the row's name."""

VERDICT_CODES = ("verdict", "statement", "explanation", "tolerance_default")
"""Codes of the findings in which the comparison states its verdict, the reason and what would explain the error."""

_UNCERTAINTIES = (("u_num_m", "numerical"), ("u_input_m", "inputs"), ("u_measurement_m", "measurement"))

# Quality figures of the calibration that have a line of their own on the page.
_LISTED = ("views_used", "views_dropped", "camera_height_m", "camera_height_std_m", "focal_length_std_px")

# Parameters of the board fitted together with the camera: label, key and unit.
_OF_BOARD = (
    ("Board, measured − stated size", "board_size", "percent", "%"),
    ("Board, measured − stated thickness", "board_thickness", "mm", "mm"),
    ("Board, bow", "board_bow", "mm", "mm"),
)

_WORDS = {
    "median_tilt_deg": "tilt of the held boards, median",
    "covered_share": "image covered by corners",
    "reprojection_rms_px": "reprojection error, RMS",
    "held_out_rms_px": "error on held-out views, RMS per coordinate",
    "marks_rms_px": "error of the marks on the floor, RMS",
    "steps": "integration steps",
    "rejections": "steps rejected and repeated",
    "mode_changes": "transitions between slack and taut",
    "u_num_m": "numerical uncertainty u_num",
    "u_tolerance_m": "of it, by the tolerance of a step",
    START_OFF: "motion of the object at the start: path moves by up to",
}
"""Labels of scalars whose keys are not clear enough."""

_STILL = 1e-9
"""Shift [px], turn [rad] and growth below which a camera's motion is rounding."""

# Columns of the calibration's table by height: keys and labels.
_AT_HEIGHT = {
    "position_std_mm": "standard deviation of a position, mm",
    "halves_difference_mm": "difference between two halves of the views, mm",
    "halves_expected_mm": "expected difference, mm",
}


def verdict_reason(comparison: Comparison) -> str:
    """Reason for a run's verdict: that of the comparison, else the uncertainties that are missing."""
    stated = _stated(comparison, "verdict")
    if stated:
        return " ".join(stated)
    missing = [name for field, name in _UNCERTAINTIES if not np.isfinite(getattr(comparison, field))]
    if missing:
        return f"No verdict without the uncertainty of: {', '.join(missing)}."
    return f"Error {millimetres(comparison.path_rms_m)} RMS, validation uncertainty {millimetres(comparison.u_val_m)}."


def statement(run: RunRecord) -> tuple[str, ...]:
    """Bounds of the simulation's and the model's error, visible faults, and what explains the error: slips first."""
    return (*_stated(run.comparison, "statement"), *slips(run), *_stated(run.comparison, "explanation"))


def slips(run: RunRecord) -> tuple[str, ...]:
    """What is said of slips in campaign.yaml that would explain the error."""
    found = () if run.uncertainty is None else run.uncertainty.findings
    return tuple(finding.text for finding in found if finding.code == "slip")


def deciding(c: Comparison) -> tuple[tuple[str, str, float], ...]:
    """The basis of the verdict: name, value and limit as text, value over limit; without what was not computed.

    Nothing where the run is not judged: none of it decided, and a bound there is not to be cited.
    """
    if c.verdict is Verdict.NOT_JUDGED:
        return ()
    lengths = (("Error at most", c.error_upper_m), ("Faults seen from", c.detectable_m))
    names = {"size": "Size of the error", "shape": "Shape of the error", "input": "Effect of one input"}
    rows = [
        *(
            (name, f"{at_most(value).removesuffix(' mm')} of {millimetres(c.tolerance_m)}", value / c.tolerance_m)
            for name, value in lengths
        ),
        *(
            (names[name], f"{decimal(value)} of {decimal(limit)}", value / limit)
            for name, (value, limit) in c.tested.items()
        ),
    ]
    return tuple(row for row in rows if np.isfinite(row[2]))


def _stated(comparison: Comparison, *codes: str) -> tuple[str, ...]:
    return tuple(finding.text for finding in comparison.findings if finding.code in codes)


def side_by_side(runs: list[Facts]) -> Table:
    """The facts of several runs as one table, one row per name; empty cells where a run lacks a fact."""
    names = dict.fromkeys(name for facts in runs for name, _ in facts)
    return tuple((name, tuple(dict(facts).get(name, "") for facts in runs)) for name in names)


def summary_cells(comparisons: list[Comparison]) -> Facts:
    """Columns and values of a run in the summary table; the unit is part of the column's name.

    For several runs: root mean square over the runs, largest maximum, sums of lengths and frames.
    """

    def over_runs(name: str) -> float:
        values = np.array([getattr(c, name) for c in comparisons])
        return float(values[0]) if len(values) == 1 else float(np.sqrt(np.mean(values**2)))

    length_m = sum(c.path_length_m for c in comparisons)
    frames = sum(c.tracked_frames for c in comparisons), sum(c.lost_frames for c in comparisons)
    return (
        ("Path RMS, mm", decimal(1e3 * over_runs("path_rms_m"))),
        ("Path max., mm", decimal(1e3 * max(c.path_max_m for c in comparisons))),
        ("Heading RMS, °", decimal(float(np.rad2deg(over_runs("heading_rms_rad"))))),
        ("Length, m", f"{length_m:.3f}" if np.isfinite(length_m) else NOT_COMPUTED),
        ("Frames tracked / lost", "{} / {}".format(*frames)),
        ("u_num, mm", decimal(1e3 * over_runs("u_num_m"))),
        ("u_input, mm", decimal(1e3 * over_runs("u_input_m"))),
        ("u_D, mm", decimal(1e3 * over_runs("u_measurement_m"))),
        ("u_val, mm", decimal(1e3 * over_runs("u_val_m"))),
    )


def metric_facts(run: RunRecord) -> Facts:
    """Further measures of the error of a run; the last one is marked as aligned."""
    c = run.comparison
    known = c.ratio[np.isfinite(c.ratio)]
    share = c.path_rms_m / c.path_length_m if c.path_length_m > 0 else float("nan")
    return (
        ("Error at the end, mm", decimal(1e3 * c.final_error_m)),
        ("Path RMS of the middle of the top, which the paper compares, mm", decimal(1e3 * middle_rms_m(run))),
        ("Path RMS over path length, %", decimal(100 * share)),
        ("Discrete Fréchet distance, mm", decimal(1e3 * c.frechet_m)),
        ("Area metric of the error along the path, mm", decimal(1e3 * c.area_along_m)),
        ("Area metric of the error across the path, mm", decimal(1e3 * c.area_across_m)),
        ("Size of the error, in those of right models, and limit", _of_limit(c, "size")),
        ("Shape of the error, in deviations, and limit", _of_limit(c, "shape")),
        ("One input's effect, in deviations, and limit", _of_limit(c, "input")),
        ("|E| / u_val, largest", decimal(c.ratio_max)),
        ("|E| / u_val at most 2, % of the time", f"{100 * np.mean(known <= 2):.0f}" if len(known) else NOT_COMPUTED),
        ("Path RMS after rigid alignment (aligned), mm", decimal(1e3 * c.aligned_rms_m)),
    )


def middle_rms_m(run: RunRecord) -> float:
    """Root mean square distance of the geometric centre of the object's top, simulated from measured, unaligned [m].

    All other measures refer to the origin of the body frame; the two differ where that is not the centre.
    """
    simulated, middle = run.simulated.pose, polygon_centroid(run.towed.top_corners_m)
    apart = transform(simulated, middle) - transform(simulated - run.comparison.error, middle)
    return float(np.sqrt(np.nanmean(np.sum(apart**2, axis=-1))))


def _of_limit(c: Comparison, name: str) -> str:
    return "{:.2f} / {:.2f}".format(*c.tested[name]) if name in c.tested else NOT_COMPUTED


def key_numbers(c: Comparison) -> Facts:
    """The errors of a run."""
    heading = c.bounds.simulation.get("heading_max", (np.nan, np.nan))[1]
    judged = c.verdict is not Verdict.NOT_JUDGED
    return (
        ("Path error, RMS", millimetres(c.path_rms_m)),
        ("maximum", millimetres(c.path_max_m)),
        ("at most", at_most(c.error_upper_m) if judged else NOT_JUDGED),
        ("Heading error, RMS", degrees(c.heading_rms_rad)),
        ("at most", at_most_degrees(heading) if judged else NOT_JUDGED),
    )


def simulation_facts(run: RunRecord) -> Facts:
    """Model, outcome and statistics of the simulation of a run."""
    simulated = run.simulated
    tension = np.linalg.norm(simulated.tether_force, axis=1)
    facts = [
        ("Model", simulated.rung),
        ("Outcome", simulated.outcome),
        ("Tension, maximum", f"{tension.max():.1f} N"),
        ("Tether slack", f"{100 * np.mean(tension == 0):.0f} % of the frames"),
    ]
    facts += [_statistic(name, value) for name, value in simulated.statistics.items()]
    facts.append(("Advice", simulated.advice))
    return tuple(facts)


def _statistic(name: str, value: float) -> tuple[str, str]:
    if name == STICKING:
        return "friction holds the object at rest", "yes" if value else "no"
    if name.endswith(TO_DYNAMICS):
        simpler = name.removesuffix(TO_DYNAMICS)
        return f"{simpler} instead of dynamics: path moves by up to", millimetres(value)
    return _labelled(name, value)


def _labelled(name: str, value: float) -> tuple[str, str]:
    """Label and value, with unit, of a scalar."""
    stem, text = named_scalar(name, value)
    return _WORDS.get(name, stem), text


def tracking_facts(run: RunRecord) -> Facts:
    """Tracked frames, standard deviations and method for each body."""
    facts = []
    for track in (run.rover_track, run.object_track):
        std = np.nanmedian(track.std[track.seen], axis=0) if track.seen.any() else np.full(3, np.nan)
        position, body = millimetres(float(np.hypot(std[0], std[1]))), track.body
        facts += [
            (f"{body}: frames tracked", f"{int(track.seen.sum())} of {len(track.time_s)}"),
            (f"{body}: standard deviation of position and heading, median", f"{position}, {degrees(float(std[2]))}"),
            (f"{body}: method", track.method),
        ]
    return (*facts, ("camera: its own motion", camera_text(run.rover_track)), *_stamps_facts(run.rover_track))


def camera_text(track: Track) -> str:
    """How far the camera moved, and the standard deviation of that."""
    camera = track.camera
    if camera is None or not camera.registered.any():
        return "the floor shows too little to tell"
    shift = np.hypot(*camera.picture[camera.registered, :2].T)
    turn, growth = np.abs(camera.picture[camera.registered, 2:]).max(axis=0)
    std = decimal(float(np.median(np.hypot(*camera.picture_std[camera.registered, :2].T))))
    if max(shift.max(), turn, growth) < _STILL:
        return f"none found (picture shifted by 0 ± {std} px); nothing corrected"
    return (
        f"picture shifted by up to {decimal(float(shift.max()))} px (± {std} px), turned by "
        f"{degrees(float(turn))}, grown by {decimal(100 * float(growth))} %; corrected"
    )


def _stamps_facts(track: Track) -> Facts:
    """Number of doubtful time stamps."""
    if track.camera is None:
        return ()
    repeated, contradicted = (int((track.camera.stamps == s).sum()) for s in (Stamp.REPEATED, Stamp.CONTRADICTED))
    text = f"{repeated} repeated, {contradicted} contradicted, of {len(track.time_s)}"
    return (("camera: stamps", text),)


def scale_facts(records: tuple[RunRecord, ...]) -> Facts:
    """Measured size of the tops in each run against the stated one: the check of the calibration's scale."""
    seen = [(run.name, run.rover_track.camera) for run in records]
    return tuple(
        (f"Tops in run {name}, measured − stated size", f"{signed(100 * c.size)} ± {decimal(100 * c.size_std)} %")
        for name, c in seen
        if c is not None and np.isfinite(c.size)
    )


def decimation_facts(run: RunRecord) -> Facts:
    """Result of decimating the rover's track; empty where it was not decimated."""
    thin = run.decimated
    if thin is None:
        return ()
    noise = f"{decimal(1e3 * thin.noise[0])}, {millimetres(thin.noise[1])}, {degrees(thin.noise[2])}"
    pauses = f"{len(thin.pauses)} ({np.ptp(thin.pauses, axis=1).sum():.1f} s)" if len(thin.pauses) else "none"
    return (
        ("rover: poses kept", f"{len(thin.time_s)} of {thin.frames} ({100 * len(thin.time_s) / thin.frames:.0f} %)"),
        ("rover: noise of one pose in x, y and heading", noise),
        ("rover: misfit of the smoothing curve in units of that noise", ", ".join(f"{v:.2f}" for v in thin.misfit)),
        ("rover: pauses", pauses),
    )


def calibration_facts(calibration: Calibration) -> Facts:
    """Camera, lens and quality figures of the calibration, except those by height of the plane."""
    camera, quality = calibration.camera, calibration.quality
    used = sum(not view.dropped for view in calibration.views)
    height_std, focal_std = (quality.get(name, np.nan) for name in ("camera_height_std_m", "focal_length_std_px"))
    facts = [
        ("Camera height", f"{calibration.floor.camera_position_m[2]:.4f} m" + _deviation(millimetres(height_std))),
        ("Image", "{} × {} px".format(*camera.resolution_px)),
        (
            "Focal length",
            f"{camera.matrix[0, 0]:.1f}, {camera.matrix[1, 1]:.1f} px" + _deviation(f"{decimal(focal_std)} px"),
        ),
        ("Lens model", camera.lens_model),
        ("Corner noise per coordinate", f"{calibration.corner_noise_px:.3f} px"),
        ("Views used", f"{used} of {len(calibration.views)}"),
    ]
    plain = [name for name in quality if name not in _LISTED and " at " not in name and not name.startswith("board_")]
    return (*facts, *(_labelled(name, quality[name]) for name in plain), *_board_facts(quality))


def _board_facts(quality: Mapping[str, float]) -> Facts:
    """The board as fitted together with the camera, against its stated values."""
    return tuple(
        (label, f"{signed(quality[f'{key}_{unit}'])} ± {decimal(quality[f'{key}_std_{unit}'])} {shown}")
        for label, key, unit, shown in _OF_BOARD
        if quality.get(f"{key}_std_{unit}", 0.0) > 0
    )


def _deviation(text: str) -> str:
    """A standard deviation to follow its value; empty where unknown."""
    return "" if NOT_COMPUTED in text else f" ± {text}"


def plane_table(calibration: Calibration) -> tuple[tuple[str, ...], Rows]:
    """Quality of the calibration by height of the plane: column labels, then one row per height."""
    quality = calibration.quality
    heights = dict.fromkeys(name.partition(" at ")[2] for name in quality if " at " in name)
    columns = [name for name in _AT_HEIGHT if any(f"{name} at {height}" in quality for height in heights)]
    rows = tuple((at, *(decimal(quality.get(f"{name} at {at}", np.nan)) for name in columns)) for at in heights)
    return tuple(_AT_HEIGHT[name] for name in columns), rows


def identified_rows(found: Identification) -> Rows:
    """One row per identified input: name, value as stated, identified value, whether the runs determine it."""
    std = np.sqrt(np.diag(found.covariance))
    return tuple(
        (
            name.replace(" [", ", ").removesuffix("]"),
            _with_std(given, given_std),
            _with_std(value, deviation) if np.isfinite(deviation) else "no value",
            "yes" if determined else "no",
        )
        for name, given, given_std, value, deviation, determined in zip(
            found.parameters, found.given, found.given_std, found.values, std, found.identifiable, strict=True
        )
    )


def predicted_rows(found: Identification) -> Rows:
    """One row per run left out: name, values fitted without it, path error with stated inputs and with these values."""
    std = np.sqrt(np.diag(found.covariance))
    return tuple(
        (
            f"run {p.run}",
            "; ".join(_to_its_deviation(value, deviation) for value, deviation in zip(p.values, std, strict=True)),
            millimetres(p.given_rms_m),
            millimetres(p.predicted_rms_m),
        )
        for p in found.predictions
    )


def _with_std(value: float, std: float) -> str:
    return f"{_to_its_deviation(value, std)} ± {_to_its_deviation(std, std)}"


def _to_its_deviation(value: float, std: float) -> str:
    """A value to the second significant digit of its standard deviation; to five digits where that is unknown."""
    if not (np.isfinite(std) and std > 0):
        return f"{value:.5g}"
    return f"{value:.{max(0, 1 - int(np.floor(np.log10(std))))}f}"

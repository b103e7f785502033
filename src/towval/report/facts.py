"""What the report says in words and numbers: headline, reasons of verdicts, facts of each stage."""

from __future__ import annotations

import numpy as np

from towval.model import Calibration, Comparison, Identification, Verdict
from towval.model.run_record import RunRecord
from towval.report.wording import NOT_COMPUTED, decimal, degrees, millimetres, named_scalar

Facts = tuple[tuple[str, str], ...]
"""Names and values, as they are shown."""

Table = tuple[tuple[str, tuple[str, ...]], ...]
"""Names and the values of all runs."""

Rows = tuple[tuple[str, ...], ...]
"""Rows of a table, the first cell the name of the row."""

VERDICT_CODE = "verdict"
"""Code of the finding in which the comparison gives the reason of its verdict."""

_UNCERTAINTIES = (("u_num_m", "numerical"), ("u_input_m", "inputs"), ("u_measurement_m", "measurement"))

_VERDICT_PHRASES = {
    Verdict.AGREES: ("agrees within its uncertainty", "agree within their uncertainty"),
    Verdict.MODEL_ERROR: ("shows an error of the model", "show an error of the model"),
    Verdict.TOO_UNCERTAIN: ("is too uncertain to tell", "are too uncertain to tell"),
    Verdict.NOT_JUDGED: ("not judged", "not judged"),
}

# What the calibration says of itself that the page says in its own words.
_SAID_ABOVE = ("views_used", "views_dropped", "camera_height_m", "camera_height_std_m", "focal_length_std_px")

_WORDS = {
    "median_tilt_deg": "tilt of the held boards, median",
    "covered_share": "image covered by corners",
    "reprojection_rms_px": "reprojection error, RMS",
    "held_out_rms_px": "error on views held out, RMS a coordinate",
    "marks_rms_px": "error of the marks on the floor, RMS",
    "steps": "steps of the integrator",
    "rejections": "steps rejected and repeated",
    "mode_changes": "changes between slack and taut",
    "u_num_m": "numerical uncertainty u_num",
}
"""Names of scalars in words, where their own name is not clear enough."""

_TO_DYNAMICS = " to dynamics, m"
"""How the names of statistics end that say how far a simpler model is from the dynamics."""

# Columns of the calibration's table by height: how its scalars are called, and what that is.
_AT_HEIGHT = {
    "position_std_mm": "standard deviation of a place, mm",
    "halves_difference_mm": "two halves of the views differ by, mm",
    "halves_expected_mm": "expected difference, mm",
}


def headline(comparisons: list[Comparison]) -> str:
    """The result of a campaign in one sentence: how many runs came to which verdict, and how far they are off."""
    counts = [(verdict, sum(c.verdict is verdict for c in comparisons)) for verdict in Verdict]
    phrases = [f"{count} {_VERDICT_PHRASES[verdict][count != 1]}" for verdict, count in counts if count]
    errors = [c.path_rms_m for c in comparisons if np.isfinite(c.path_rms_m)]
    runs = f"{len(comparisons)} run" + "s" * (len(comparisons) != 1)
    sentence = f"{runs}: {', '.join(phrases)}."
    if errors:
        lower = f"{decimal(1e3 * min(errors))} to " if len(errors) > 1 else ""
        span = lower + millimetres(max(errors))
        sentence += f" The simulated path of the object is {span} (RMS) from the measured one, unaligned."
    return sentence


def verdict_reason(comparison: Comparison) -> str:
    """Why a run came to its verdict: what the comparison says of it, else which uncertainty is missing."""
    errors_reported = [finding.text for finding in comparison.findings if finding.code == VERDICT_CODE]
    if errors_reported:
        return " ".join(errors_reported)
    missing = [name for field, name in _UNCERTAINTIES if not np.isfinite(getattr(comparison, field))]
    if missing:
        return f"No verdict without the uncertainty of: {', '.join(missing)}."
    return f"Error {millimetres(comparison.path_rms_m)} RMS, validation uncertainty {millimetres(comparison.u_val_m)}."


def reasons(comparisons: list[Comparison]) -> Facts:
    """Who was judged how, and why; runs with the same reason together."""
    runs_of: dict[tuple[Verdict, str], list[str]] = {}
    for comparison in comparisons:
        runs_of.setdefault((comparison.verdict, verdict_reason(comparison)), []).append(comparison.run)
    return tuple(
        (f"{'Runs' if len(runs) > 1 else 'Run'} {', '.join(runs)}: {verdict.value}.", reason)
        for (verdict, reason), runs in runs_of.items()
    )


def side_by_side(runs: list[Facts]) -> Table:
    """The facts of several runs as one table, a row a name; a run that lacks a fact has an empty cell."""
    names = dict.fromkeys(name for facts in runs for name, _ in facts)
    return tuple((name, tuple(dict(facts).get(name, "") for facts in runs)) for name in names)


def summary_cells(c: Comparison) -> Facts:
    """The cells of a run in the summary table: column and value, the unit in the column's name."""
    lengths = (("Path RMS, mm", c.path_rms_m), ("Path max., mm", c.path_max_m))
    uncertainties = (("num", c.u_num_m), ("input", c.u_input_m), ("D", c.u_measurement_m), ("val", c.u_val_m))
    return (
        *((name, millimetres(value).removesuffix(" mm")) for name, value in lengths),
        ("Heading RMS, °", degrees(c.heading_rms_rad).removesuffix("°")),
        ("Length, m", f"{c.path_length_m:.3f}" if np.isfinite(c.path_length_m) else NOT_COMPUTED),
        ("Frames seen / lost", f"{c.tracked_frames} / {c.lost_frames}"),
        *((f"u_{name}, mm", millimetres(value).removesuffix(" mm")) for name, value in uncertainties),
    )


def campaign_cells(comparisons: list[Comparison]) -> Facts:
    """The same cells for all runs: root mean square over the runs, largest maximum, sums of lengths and frames."""

    def over_runs(name: str) -> float:
        values = np.array([getattr(c, name) for c in comparisons])
        return float(np.sqrt(np.mean(values**2)))

    lengths = (("Path RMS, mm", over_runs("path_rms_m")), ("Path max., mm", max(c.path_max_m for c in comparisons)))
    uncertainties = (("num", "u_num_m"), ("input", "u_input_m"), ("D", "u_measurement_m"), ("val", "u_val_m"))
    frames = sum(c.tracked_frames for c in comparisons), sum(c.lost_frames for c in comparisons)
    return (
        *((name, millimetres(value).removesuffix(" mm")) for name, value in lengths),
        ("Heading RMS, °", degrees(over_runs("heading_rms_rad")).removesuffix("°")),
        ("Length, m", f"{sum(c.path_length_m for c in comparisons):.3f}"),
        ("Frames seen / lost", "{} / {}".format(*frames)),
        *((f"u_{name}, mm", millimetres(over_runs(field)).removesuffix(" mm")) for name, field in uncertainties),
    )


def metric_facts(c: Comparison) -> Facts:
    """Further measures of how far a run is off; the one after alignment comes last and says so."""
    known = c.ratio[np.isfinite(c.ratio)]
    within = f"{100 * np.mean(known <= 2):.0f}" if len(known) else NOT_COMPUTED

    def length(value: float) -> str:
        return millimetres(value).removesuffix(" mm")

    return (
        ("Error at the end, mm", length(c.final_error_m)),
        ("Discrete Fréchet distance, mm", length(c.frechet_m)),
        ("Area metric of the error along the path, mm", length(c.area_along_m)),
        ("Area metric of the error across the path, mm", length(c.area_across_m)),
        ("|E| / u_val, largest", decimal(c.ratio_max)),
        ("|E| / u_val at most 2, % of the time", within),
        ("Path RMS after rigid alignment (aligned), mm", length(c.aligned_rms_m)),
    )


def key_numbers(c: Comparison) -> Facts:
    """The errors of a run."""
    share = c.path_rms_m / c.path_length_m if c.path_length_m > 0 else float("nan")
    return (
        ("Path error, RMS", millimetres(c.path_rms_m)),
        ("Path error, maximum", millimetres(c.path_max_m)),
        ("Path error, at the end", millimetres(c.final_error_m)),
        ("Heading error, RMS", degrees(c.heading_rms_rad)),
        ("RMS over path length", f"{decimal(100 * share)} %" if np.isfinite(share) else NOT_COMPUTED),
    )


def simulation_facts(run: RunRecord) -> Facts:
    """Model, outcome and statistics of a run's simulation."""
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
    """A statistic of the simulation in words."""
    if name.endswith(_TO_DYNAMICS):
        simpler = name.removesuffix(_TO_DYNAMICS)
        return f"{simpler} instead of dynamics: path moves by up to", millimetres(value)
    return _in_words(name, value)


def _in_words(name: str, value: float) -> tuple[str, str]:
    """A scalar with its unit in words."""
    stem, text = named_scalar(name, value)
    return _WORDS.get(name, stem), text


def tracking_facts(run: RunRecord) -> Facts:
    """How many frames were seen, and how well, of each body."""
    facts = []
    for track in (run.rover_track, run.object_track):
        std = np.nanmedian(track.std[track.seen], axis=0) if track.seen.any() else np.full(3, np.nan)
        place, body = millimetres(float(np.hypot(std[0], std[1]))), track.body
        facts.append((f"{body}: frames seen", f"{int(track.seen.sum())} of {len(track.time_s)}"))
        facts.append((f"{body}: standard deviation of place and heading, median", f"{place}, {degrees(float(std[2]))}"))
        facts.append((f"{body}: method", track.method))
    return tuple(facts)


def decimation_facts(run: RunRecord) -> Facts:
    """What thinning left of the rover's track; nothing where it was not thinned."""
    thin = run.decimated
    if thin is None:
        return ()
    noise = f"{decimal(1e3 * thin.noise[0])}, {millimetres(thin.noise[1])}, {degrees(thin.noise[2])}"
    return (
        ("rover: poses kept", f"{len(thin.time_s)} of {thin.frames} ({100 * len(thin.time_s) / thin.frames:.0f} %)"),
        ("rover: noise of one pose in x, y and heading", noise),
        (
            "rover: misfit of the kept poses' curve in units of that noise",
            ", ".join(f"{value:.2f}" for value in thin.misfit),
        ),
        (
            "rover: pauses",
            f"{len(thin.pauses)} ({np.ptp(thin.pauses, axis=1).sum():.1f} s)" if len(thin.pauses) else "none",
        ),
    )


def calibration_facts(calibration: Calibration) -> Facts:
    """Camera, lens and what the calibration says of itself, but for what it says of planes."""
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
        ("Corner noise a coordinate", f"{calibration.corner_noise_px:.3f} px"),
        ("Views used", f"{used} of {len(calibration.views)}"),
    ]
    facts += [
        _in_words(name, value) for name, value in quality.items() if name not in _SAID_ABOVE and " at " not in name
    ]
    return tuple(facts)


def _deviation(text: str) -> str:
    """A standard deviation to be put behind its value; nothing where it is not known."""
    return "" if NOT_COMPUTED in text else f" ± {text}"


def plane_table(calibration: Calibration) -> tuple[tuple[str, ...], Rows]:
    """What the calibration says of planes: names of the columns, then a row a height of the plane."""
    quality = calibration.quality
    places = dict.fromkeys(name.partition(" at ")[2] for name in quality if " at " in name)
    columns = [name for name in _AT_HEIGHT if any(f"{name} at {place}" in quality for place in places)]
    rows = tuple((place, *(decimal(quality.get(f"{name} at {place}", np.nan)) for name in columns)) for place in places)
    return tuple(_AT_HEIGHT[name] for name in columns), rows


def identified_rows(found: Identification) -> Rows:
    """Each identified input: name, given and its deviation, identified and its deviation, whether the runs fix it."""
    std = np.sqrt(np.diag(found.covariance))
    return tuple(
        (
            name.replace(" [", ", ").removesuffix("]"),
            f"{_to_its_deviation(given, given_std)} ± {_to_its_deviation(given_std, given_std)}",
            f"{_to_its_deviation(value, deviation)} ± {_to_its_deviation(deviation, deviation)}"
            if np.isfinite(deviation)
            else "no value",
            "yes" if fixed else "no",
        )
        for name, given, given_std, value, deviation, fixed in zip(
            found.parameters, found.given, found.given_std, found.values, std, found.identifiable, strict=True
        )
    )


def predicted_rows(found: Identification) -> Rows:
    """Each run left out: name, values fitted without it, path error as given and as predicted."""
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


def _to_its_deviation(value: float, std: float) -> str:
    """A value to the second digit that counts of its deviation; to five digits where that is not known."""
    if not (np.isfinite(std) and std > 0):
        return f"{value:.5g}"
    return f"{value:.{max(0, 1 - int(np.floor(np.log10(std))))}f}"


def alternatives(run: RunRecord) -> dict[str, str]:
    """What each figure of a run shows, for readers who do not see it."""
    c = run.comparison
    return {
        "fig10": f"Run {run.name} on the floor: path of the rover, simulated and measured path of the object with "
        f"outlines along the way. RMS distance {millimetres(c.path_rms_m)}, maximum {millimetres(c.path_max_m)}.",
        "errors": f"Run {run.name}: errors in x, y and heading and the tether's tension over "
        f"{c.time_s[-1] - c.time_s[0]:.1f} s. The last error is {millimetres(c.final_error_m)}.",
        "agreement": f"Run {run.name}: error along and across the path beside the validation uncertainty, over time.",
        "tracking_rover": f"Run {run.name}: residual, inliers and deviations of the rover's track over time.",
        "tracking_object": f"Run {run.name}: residual, inliers and deviations of the object's track over time.",
        "decimate": f"Run {run.name}: measured and kept points of the hinge's way; measured minus smoothed over time.",
    }

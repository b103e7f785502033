"""What the template of the report shows: numbers as words, figures and videos as text, findings in order.

Numbers that do not exist are called "not computed"; nothing is filled in.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from markupsafe import Markup

from towval.errors import InputError
from towval.io.overlay import overlay_frames
from towval.io.report_data import ReportData, RunReport
from towval.io.run_record import RunRecord, seen_poses
from towval.io.style import Frame
from towval.io.summary import summary_csv, summary_latex
from towval.types import Array, Calibration, Comparison, Finding, Severity, Verdict

NOT_COMPUTED = "not computed"

_SEVERITIES = (Severity.REFUSAL, Severity.WARNING, Severity.NOTE)
_UNCERTAINTIES = (
    ("u_num_m", "numerical"),
    ("u_input_m", "inputs"),
    ("u_measurement_m", "measurement"),
    ("u_val_m", "validation, all together"),
)


@dataclass(frozen=True)
class FindingView:
    """A finding with the stage and the runs it comes from."""

    severity: str
    stage: str
    runs: tuple[str, ...]
    code: str
    text: str


@dataclass(frozen=True)
class RunView:
    """One run, ready to be written into the page."""

    name: str
    verdict: str
    summary: tuple[tuple[str, str], ...]
    key_numbers: tuple[tuple[str, str], ...]
    simulation: tuple[tuple[str, str], ...]
    outcome_advice: str
    tracking: tuple[tuple[str, str], ...]
    decimation: tuple[tuple[str, str], ...]
    figures: dict[str, Markup]
    alternatives: dict[str, str]
    time_frame: Frame
    plan_frame: Frame
    series: Markup
    video: str | None
    video_start_s: float
    stills: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class ReportView:
    """The whole page."""

    campaign: str
    headline: str
    reasons: tuple[tuple[str, str], ...]
    runs: tuple[RunView, ...]
    findings: tuple[FindingView, ...]
    notes: tuple[FindingView, ...]
    tables: tuple[tuple[str, str], ...]
    campaign_figure: Markup
    calibration: tuple[tuple[str, str], ...]
    calibration_figures: tuple[tuple[Markup, str], ...]
    dropped_views: tuple[tuple[str, str], ...]
    data: ReportData


def build(data: ReportData, svgs: Mapping[str, str], frames: Mapping[str, Frame]) -> ReportView:
    """Turn the data of a report and its figures into what the template shows.

    Parameters
    ----------
    data : ReportData
        The data.
    svgs : mapping of str to str
        The figures of :func:`towval.io.report.report_figures` as SVG, by name.
    frames : mapping of str to Frame
        Where the axes lie in the figures ``errors_<run>`` and ``fig10_<run>``.

    Returns
    -------
    ReportView
        Strings and markup only, but for ``data`` itself, whose own strings the template shows as they are.
    """
    calibration, found = data.calibration, collect_findings(data)
    comparisons = [run.record.comparison for run in data.runs]
    return ReportView(
        campaign=data.campaign,
        headline=headline(comparisons),
        reasons=_reasons(comparisons),
        runs=tuple(_run_view(run, svgs, frames) for run in data.runs),
        findings=tuple(f for f in found if f.severity != Severity.NOTE),
        notes=tuple(f for f in found if f.severity == Severity.NOTE),
        tables=_tables(comparisons),
        campaign_figure=inline_svg(svgs["fig10"], "fig10"),
        calibration=() if calibration is None else _calibration_facts(calibration),
        calibration_figures=tuple(
            (inline_svg(svg, name), _CALIBRATION_CAPTIONS[name])
            for name, svg in svgs.items()
            if name in _CALIBRATION_CAPTIONS
        ),
        dropped_views=()
        if calibration is None
        else tuple((view.name, view.dropped) for view in calibration.views if view.dropped),
        data=data,
    )


def headline(comparisons: list[Comparison]) -> str:
    """The result of a campaign in one sentence: how many runs came to which verdict, and how far they are off."""
    counts = [(verdict, sum(c.verdict is verdict for c in comparisons)) for verdict in Verdict]
    phrases = [f"{count} {_VERDICT_PHRASES[verdict][count != 1]}" for verdict, count in counts if count]
    errors = [c.path_rms_m for c in comparisons if np.isfinite(c.path_rms_m)]
    runs = f"{len(comparisons)} run" + "s" * (len(comparisons) != 1)
    sentence = f"{runs}: {', '.join(phrases)}."
    if errors:
        span = (
            millimetres(min(errors)) if len(errors) == 1 else f"{1e3 * min(errors):.1f} to {millimetres(max(errors))}"
        )
        sentence += f" The simulated path of the object is {span} (RMS) from the measured one, unaligned."
    return sentence


def verdict_reason(comparison: Comparison) -> str:
    """Why a run came to its verdict, in one sentence with its numbers."""
    error, uncertainty = millimetres(comparison.path_rms_m), millimetres(comparison.u_val_m)
    if comparison.verdict is Verdict.AGREES:
        return f"The error ({error} RMS) is within the validation uncertainty of {uncertainty}."
    if comparison.verdict is Verdict.MODEL_ERROR:
        return f"The error ({error} RMS) exceeds the validation uncertainty of {uncertainty}."
    if comparison.verdict is Verdict.TOO_UNCERTAIN:
        return f"The validation uncertainty of {uncertainty} is too large to tell."
    missing = [name for field, name in _UNCERTAINTIES[:3] if not np.isfinite(getattr(comparison, field))]
    if missing:
        return f"No verdict without the uncertainty of: {', '.join(missing)}."
    return "No verdict was given."


def collect_findings(data: ReportData) -> tuple[FindingView, ...]:
    """Findings of every stage, the gravest first, what several runs share said once."""
    found = [(f.stage, f.run, f.finding) for f in data.findings]
    if data.calibration is not None:
        found += [("calibrate", "", f) for f in data.calibration.findings]
    for run in (run.record for run in data.runs):
        for stage, findings in (
            ("track", (*run.rover_track.findings, *run.object_track.findings)),
            ("decimate", () if run.decimated is None else run.decimated.findings),
            ("simulate", run.simulated.findings),
            ("compare", run.comparison.findings),
        ):
            found += [(stage, run.name, f) for f in findings]
    runs_of: dict[tuple[str, Finding], list[str]] = {}
    for stage, run_name, finding in found:
        runs_of.setdefault((stage, finding), []).append(run_name)
    views = [
        FindingView(f.severity.value, stage, tuple(name for name in names if name), f.code, f.text)
        for (stage, f), names in runs_of.items()
    ]
    return tuple(sorted(views, key=lambda view: _SEVERITIES.index(Severity(view.severity))))


def inline_svg(svg: str, name: str) -> Markup:
    """An SVG whose ids no other figure of the page shares, without a fixed size.

    Two figures hold the same glyphs under the same ids; a page must not.
    """
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", svg)
    head, _, rest = svg.partition(">")
    head = re.sub(r'\s(width|height)="[^"]*"', "", head) + ' aria-hidden="true" focusable="false"'
    rest = re.sub(r"<metadata>.*?</metadata>", "", rest, flags=re.DOTALL)
    # Safe to put in as it is: matplotlib's own output, in which all text is outlines.
    return Markup(f"{head}>{rest}")


def millimetres(value_m: float) -> str:
    """A length in mm with a sensible number of digits, or "not computed"."""
    if not np.isfinite(value_m):
        return NOT_COMPUTED
    value = 1e3 * value_m
    return f"{value:.2f} mm" if abs(value) < 1 else f"{value:.1f} mm"


def degrees(value_rad: float) -> str:
    """An angle in degrees, or "not computed"."""
    return f"{np.rad2deg(value_rad):.2f}°" if np.isfinite(value_rad) else NOT_COMPUTED


def _tables(comparisons: list[Comparison]) -> tuple[tuple[str, str], ...]:
    """Names and contents of the summary to download, as data URIs."""
    contents = (
        ("summary.csv", "text/csv", summary_csv(comparisons)),
        ("summary.tex", "text/plain", summary_latex(comparisons)),
    )
    return tuple((name, f"data:{kind};base64,{_base64(text.encode())}") for name, kind, text in contents)


def _reasons(comparisons: list[Comparison]) -> tuple[tuple[str, str], ...]:
    """Who was judged how, and why; runs with the same reason together."""
    runs_of: dict[tuple[Verdict, str], list[str]] = {}
    for comparison in comparisons:
        runs_of.setdefault((comparison.verdict, verdict_reason(comparison)), []).append(comparison.run)
    return tuple(
        (f"{'Runs' if len(runs) > 1 else 'Run'} {', '.join(runs)}: {verdict.value}.", reason)
        for (verdict, reason), runs in runs_of.items()
    )


def _run_view(report: RunReport, svgs: Mapping[str, str], frames: Mapping[str, Frame]) -> RunView:
    run, name = report.record, report.record.name
    comparison = run.comparison
    parts = {key: f"{key}_{name}" for key in ("fig10", "errors", "tracking_rover", "tracking_object", "decimate")}
    stills = () if report.overlay is None else overlay_frames(report.overlay)
    return RunView(
        name=name,
        verdict=comparison.verdict.value,
        summary=_summary(comparison),
        key_numbers=_key_numbers(comparison),
        simulation=_simulation_facts(run),
        outcome_advice=run.simulated.advice,
        tracking=_tracking_facts(run),
        decimation=_decimation_facts(run),
        figures={key: inline_svg(svgs[full], full) for key, full in parts.items() if full in svgs},
        alternatives=_alternatives(run),
        time_frame=frames[f"errors_{name}"],
        plan_frame=frames[f"fig10_{name}"],
        series=_series(run),
        video=None if report.overlay is None else _data_uri(report.overlay, "video/mp4"),
        video_start_s=float(run.rover_track.time_s[0]),
        stills=tuple((f"{s.time_s:.2f} s", "data:image/jpeg;base64," + _base64(s.jpeg)) for s in stills),
    )


def _summary(c: Comparison) -> tuple[tuple[str, str], ...]:
    lengths = (("path RMS, mm", c.path_rms_m), ("path max, mm", c.path_max_m))
    uncertainties = (("num", c.u_num_m), ("input", c.u_input_m), ("meas.", c.u_measurement_m), ("val", c.u_val_m))
    return (
        *((name, millimetres(value).removesuffix(" mm")) for name, value in lengths),
        ("heading RMS, °", degrees(c.heading_rms_rad).removesuffix("°")),
        ("length, m", f"{c.path_length_m:.3f}" if np.isfinite(c.path_length_m) else NOT_COMPUTED),
        ("frames seen / lost", f"{c.tracked_frames} / {c.lost_frames}"),
        *((f"u {name}, mm", millimetres(value).removesuffix(" mm")) for name, value in uncertainties),
    )


def _key_numbers(c: Comparison) -> tuple[tuple[str, str], ...]:
    share = c.path_rms_m / c.path_length_m if c.path_length_m > 0 else float("nan")
    return (
        ("Path error, RMS", millimetres(c.path_rms_m)),
        ("Path error, maximum", millimetres(c.path_max_m)),
        ("Path error, at the end", millimetres(c.final_error_m)),
        ("Heading error, RMS", degrees(c.heading_rms_rad)),
        ("RMS over path length", f"{100 * share:.2f} %" if np.isfinite(share) else NOT_COMPUTED),
    )


def _simulation_facts(run: RunRecord) -> tuple[tuple[str, str], ...]:
    simulated = run.simulated
    tension = np.linalg.norm(simulated.tether_force, axis=1)
    facts = [
        ("Model", simulated.rung),
        ("Outcome", simulated.outcome),
        ("Tension, maximum", f"{tension.max():.1f} N"),
        ("Tether slack", f"{100 * np.mean(tension == 0):.0f} % of the frames"),
    ]
    facts += [(key.replace("_", " "), _plain(value)) for key, value in simulated.statistics.items()]
    return tuple(facts)


def _tracking_facts(run: RunRecord) -> tuple[tuple[str, str], ...]:
    facts = []
    for track in (run.rover_track, run.object_track):
        std = np.nanmedian(track.std[track.seen], axis=0) if track.seen.any() else np.full(3, np.nan)
        place = millimetres(float(np.hypot(std[0], std[1])))
        facts.append((track.body.capitalize(), f"{int(track.seen.sum())} of {len(track.time_s)} frames seen"))
        facts.append((f"{track.body.capitalize()}, median deviation", f"{place}, {degrees(float(std[2]))}"))
        if track.method:
            facts.append((f"{track.body.capitalize()}, method", track.method))
    return tuple(facts)


def _decimation_facts(run: RunRecord) -> tuple[tuple[str, str], ...]:
    thin = run.decimated
    if thin is None:
        return ()
    return (
        ("Points kept", f"{len(thin.time_s)} of {thin.frames} ({100 * len(thin.time_s) / thin.frames:.0f} %)"),
        ("Noise of one pose", f"{millimetres(thin.noise[0])}, {millimetres(thin.noise[1])}, {degrees(thin.noise[2])}"),
        ("Misfit in units of that noise", ", ".join(f"{value:.2f}" for value in thin.misfit)),
        ("Pauses", f"{len(thin.pauses)}, {np.ptp(thin.pauses, axis=1).sum():.1f} s"),
    )


def _calibration_facts(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    camera = calibration.camera
    used = sum(not view.dropped for view in calibration.views)
    facts = [
        ("Camera height", f"{calibration.floor.camera_position_m[2]:.3f} m"),
        ("Image", "{} × {} px".format(*camera.resolution_px)),
        ("Focal length", f"{camera.matrix[0, 0]:.1f}, {camera.matrix[1, 1]:.1f} px"),
        ("Lens model", camera.lens_model),
        ("Corner noise", f"{calibration.corner_noise_px:.3f} px"),
        ("Views used", f"{used} of {len(calibration.views)}"),
    ]
    facts += [(key.replace("_", " "), _plain(value)) for key, value in calibration.quality.items()]
    return tuple(facts)


def _alternatives(run: RunRecord) -> dict[str, str]:
    c = run.comparison
    return {
        "fig10": f"Run {run.name} on the floor: path of the rover, simulated and measured path of the object with "
        f"outlines along the way. RMS distance {millimetres(c.path_rms_m)}, maximum {millimetres(c.path_max_m)}.",
        "errors": f"Run {run.name}: errors in x, y and heading and the tether's tension over "
        f"{c.time_s[-1] - c.time_s[0]:.1f} s. The last error is {millimetres(c.final_error_m)}.",
        "tracking_rover": f"Run {run.name}: residual, inliers and deviations of the rover's track over time.",
        "tracking_object": f"Run {run.name}: residual, inliers and deviations of the object's track over time.",
        "decimate": f"Run {run.name}: measured and kept points of the hinge's way; measured minus smoothed over time.",
    }


def _series(run: RunRecord) -> Markup:
    """Times and values under the cursor as JSON, rounded to what is shown; null where missing."""
    c, simulated = run.comparison, run.simulated
    tension = np.interp(c.time_s, simulated.time_s, np.linalg.norm(simulated.tether_force, axis=1))
    columns = {
        "time_s": _rounded(c.time_s, 6),
        "x_mm": _rounded(1e3 * c.error[:, 0], 2),
        "y_mm": _rounded(1e3 * c.error[:, 1], 2),
        "heading_deg": _rounded(np.rad2deg(c.error[:, 2]), 3),
        "tension_N": _rounded(tension, 2),
        "rover": _track_at(c.time_s, run.rover_track.time_s, seen_poses(run.rover_track)),
        "measured": _track_at(c.time_s, run.object_track.time_s, seen_poses(run.object_track)),
    }
    return Markup(json.dumps(columns, separators=(",", ":")))


def _track_at(wanted_s: Array, time_s: Array, pose: Array) -> list[list[float] | None]:
    """Places [m] at the samples nearest to the wanted times, to the millimetre; None where the body was not seen."""
    nearest = np.abs(time_s[:, None] - wanted_s).argmin(axis=0)
    return [None if np.isnan(x) else [round(float(x), 3), round(float(y), 3)] for x, y in pose[nearest, :2]]


def _rounded(values: Array, digits: int) -> list[float | None]:
    return [round(float(v), digits) if np.isfinite(v) else None for v in values]


def _plain(value: float) -> str:
    if not np.isfinite(value):
        return NOT_COMPUTED
    return f"{int(value):,}".replace(",", " ") if float(value).is_integer() else f"{value:.4g}"


def _data_uri(path: FilePath, kind: str) -> str:
    try:
        return f"data:{kind};base64,{_base64(path.read_bytes())}"
    except OSError as error:
        raise InputError(f"{path.name} cannot be put into the report", got=error) from error


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


_VERDICT_PHRASES = {
    Verdict.AGREES: ("agrees within its uncertainty", "agree within their uncertainty"),
    Verdict.MODEL_ERROR: ("shows an error of the model", "show an error of the model"),
    Verdict.TOO_UNCERTAIN: ("is too uncertain to tell", "are too uncertain to tell"),
    Verdict.NOT_JUDGED: ("not judged", "not judged"),
}

_CALIBRATION_CAPTIONS = {
    "calibration_coverage": "Where in the image the board's corners were seen, with their residuals, exaggerated as "
    "stated. Parts of the image without corners are extrapolated.",
    "calibration_reprojection": "Reprojection error and tilt of each view. Views without tilt do not fix the focal "
    "length.",
    "calibration_uncertainty": "Standard deviation of a place on the plane of the tracked top, from the covariance of "
    "the calibration. It does not contain the error of the lens model.",
}

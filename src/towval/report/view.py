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

from towval.io.summary import summary_csv, summary_latex
from towval.model import Array, Comparison, Finding, Severity
from towval.model.errors import InputError
from towval.model.run_record import RunRecord, measured_poses, nearest_samples
from towval.report.data import ReportData, RunReport
from towval.report.facts import (
    VERDICT_CODE,
    Facts,
    Rows,
    Table,
    alternatives,
    calibration_facts,
    campaign_cells,
    decimation_facts,
    headline,
    identified_rows,
    key_numbers,
    metric_facts,
    plane_table,
    predicted_rows,
    reasons,
    side_by_side,
    simulation_facts,
    summary_cells,
    tracking_facts,
)
from towval.report.needed import NeededRow, needed_rows
from towval.report.overlay import overlay_frames
from towval.report.style import Frame

_SEVERITIES = (Severity.REFUSAL, Severity.WARNING, Severity.NOTE)


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
    summary: Facts
    key_numbers: Facts
    figures: dict[str, Markup]
    alternatives: dict[str, str]
    time_frame: Frame
    agreement_frame: Frame | None
    plan_frame: Frame
    series: Markup
    video: str | None
    video_start_s: float
    stills: Facts


@dataclass(frozen=True)
class ReportView:
    """The whole page."""

    campaign: str
    headline: str
    reasons: Facts
    confidence: str
    runs: tuple[RunView, ...]
    findings: tuple[FindingView, ...]
    notes: tuple[FindingView, ...]
    tables: Facts
    all_runs: Facts
    metrics: Table
    campaign_figure: Markup
    calibration: Facts
    planes: tuple[tuple[str, ...], Rows]
    calibration_figures: tuple[tuple[Markup, str], ...]
    dropped_views: Facts
    shares_figure: Markup | None
    identified: Rows
    predicted: Rows
    tracking: Table
    simulation: Table
    needed: tuple[NeededRow, ...]
    data: ReportData


def build(data: ReportData, svgs: Mapping[str, str], frames: Mapping[str, Frame]) -> ReportView:
    """Turn the data of a report and its figures into what the template shows.

    Parameters
    ----------
    data : ReportData
        The data.
    svgs : mapping of str to str
        The figures of :func:`towval.report.page.report_figures` as SVG, by name.
    frames : mapping of str to Frame
        Where the axes lie in the figures ``errors_<run>``, ``agreement_<run>`` and ``fig10_<run>``.

    Returns
    -------
    ReportView
        Strings and markup only, but for ``data`` itself, whose own strings the template shows as they are.
    """
    calibration, found = data.calibration, collect_findings(data)
    records = [run.record for run in data.runs]
    comparisons = [record.comparison for record in records]
    return ReportView(
        campaign=data.campaign,
        headline=headline(comparisons),
        reasons=reasons(comparisons),
        confidence=_confidence(records),
        runs=tuple(_run_view(run, svgs, frames) for run in data.runs),
        findings=tuple(f for f in found if f.severity != Severity.NOTE),
        notes=tuple(f for f in found if f.severity == Severity.NOTE),
        tables=_tables(comparisons),
        all_runs=campaign_cells(comparisons) if len(comparisons) > 1 else (),
        metrics=side_by_side([metric_facts(c) for c in comparisons]),
        campaign_figure=inline_svg(svgs["fig10"], "fig10"),
        calibration=() if calibration is None else calibration_facts(calibration),
        planes=((), ()) if calibration is None else plane_table(calibration),
        calibration_figures=tuple(
            (inline_svg(svg, name), _CALIBRATION_CAPTIONS[name])
            for name, svg in svgs.items()
            if name in _CALIBRATION_CAPTIONS
        ),
        dropped_views=()
        if calibration is None
        else tuple((view.name, view.dropped) for view in calibration.views if view.dropped),
        shares_figure=inline_svg(svgs["shares"], "shares") if "shares" in svgs else None,
        identified=() if data.identification is None else identified_rows(data.identification),
        predicted=() if data.identification is None else predicted_rows(data.identification),
        tracking=side_by_side([(*tracking_facts(r), *decimation_facts(r)) for r in records]),
        simulation=side_by_side([simulation_facts(r) for r in records]),
        needed=needed_rows(calibration, tuple(records)),
        data=data,
    )


def collect_findings(data: ReportData) -> tuple[FindingView, ...]:
    """Findings of every stage, the gravest first, what several runs share said once."""
    found = [(f.stage, f.run, f.finding) for f in data.findings]
    if data.identification is not None:
        found += [("identify", "", f) for f in data.identification.findings]
    if data.calibration is not None:
        found += [("calibrate", "", f) for f in data.calibration.findings]
    for run in (run.record for run in data.runs):
        for stage, findings in (
            ("track", (*run.rover_track.findings, *run.object_track.findings)),
            ("decimate", () if run.decimated is None else run.decimated.findings),
            ("simulate", run.simulated.findings),
            ("uncertainty", () if run.uncertainty is None else run.uncertainty.findings),
            ("compare", run.comparison.findings),
        ):
            # The reason of the verdict stands in the summary.
            found += [(stage, run.name, f) for f in findings if f.code != VERDICT_CODE]
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


def _tables(comparisons: list[Comparison]) -> Facts:
    """Names and contents of the summary to download, as data URIs."""
    contents = (
        ("summary.csv", "text/csv", summary_csv(comparisons)),
        ("summary.tex", "text/plain", summary_latex(comparisons)),
    )
    return tuple((name, f"data:{kind};base64,{_base64(text.encode())}") for name, kind, text in contents)


def _confidence(records: list[RunRecord]) -> str:
    """Share of right models that keep the limits of the verdict; empty where no run was judged."""
    shares = {f"{100 * record.uncertainty.confidence:g} %" for record in records if record.uncertainty is not None}
    return " or ".join(sorted(shares))


def _run_view(report: RunReport, svgs: Mapping[str, str], frames: Mapping[str, Frame]) -> RunView:
    run, name = report.record, report.record.name
    comparison = run.comparison
    parts = {
        key: f"{key}_{name}"
        for key in ("fig10", "errors", "agreement", "tracking_rover", "tracking_object", "decimate")
    }
    stills = () if report.overlay is None else overlay_frames(report.overlay)
    return RunView(
        name=name,
        verdict=comparison.verdict.value,
        summary=summary_cells(comparison),
        key_numbers=key_numbers(comparison),
        figures={key: inline_svg(svgs[full], full) for key, full in parts.items() if full in svgs},
        alternatives=alternatives(run),
        time_frame=frames[f"errors_{name}"],
        agreement_frame=frames.get(f"agreement_{name}"),
        plan_frame=frames[f"fig10_{name}"],
        series=_series(run),
        video=None if report.overlay is None else _data_uri(report.overlay, "video/mp4"),
        video_start_s=float(run.rover_track.time_s[0]),
        stills=tuple((f"{s.time_s:.2f} s", "data:image/jpeg;base64," + _base64(s.jpeg)) for s in stills),
    )


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
        "rover": _track_at(c.time_s, run.rover_track.time_s, measured_poses(run.rover_track)),
        "measured": _track_at(c.time_s, run.object_track.time_s, measured_poses(run.object_track)),
    }
    return Markup(json.dumps(columns, separators=(",", ":")))


def _track_at(wanted_s: Array, time_s: Array, pose: Array) -> list[list[float] | None]:
    """Places [m] at the samples nearest to the wanted times, to the millimetre; None where the body was not seen."""
    places = pose[nearest_samples(time_s, wanted_s), :2]
    return [None if np.isnan(x) else [round(float(x), 3), round(float(y), 3)] for x, y in places]


def _rounded(values: Array, digits: int) -> list[float | None]:
    return [round(float(v), digits) if np.isfinite(v) else None for v in values]


def _data_uri(path: FilePath, kind: str) -> str:
    try:
        return f"data:{kind};base64,{_base64(path.read_bytes())}"
    except OSError as error:
        raise InputError(f"{path.name} cannot be put into the report", got=error) from error


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


_CALIBRATION_CAPTIONS = {
    "calibration_coverage": "Where in the image the board's corners were seen, with their residuals, exaggerated as "
    "stated. Parts of the image without corners are extrapolated.",
    "calibration_reprojection": "Reprojection error and tilt of each view: held boards as blue circles, boards on the "
    "floor as green squares. Views without tilt do not fix the focal length.",
    "calibration_uncertainty": "Standard deviation of a place on the plane of the tracked top, from the covariance of "
    "the calibration. It does not contain the error of the lens model.",
}

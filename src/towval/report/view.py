"""Content of the page, ready for the template: figures and videos as text, findings in order of severity."""

import base64
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from markupsafe import Markup

from towval.io.summary import summary_csv, summary_latex
from towval.model import Array, Comparison, Finding, Severity
from towval.model.errors import InputError
from towval.model.run_record import RunRecord, measured_poses, nearest_samples
from towval.report import facts
from towval.report.contents import SECTIONS, Drawn, RunFigure
from towval.report.data import ReportData, RunReport
from towval.report.facts import Facts, Rows, Table
from towval.report.needed import NeededRow, needed_rows
from towval.report.overlay import overlay_frames
from towval.report.style import Frame, frame_of

_SEVERITIES = (Severity.REFUSAL, Severity.WARNING, Severity.NOTE)


@dataclass(frozen=True)
class FigureView:
    """A figure on the page; ``title`` is for readers who do not see it, ``frame`` given where a cursor marks it."""

    svg: Markup
    title: str
    caption: str
    run: str
    cursor: str
    frame: Frame | None


@dataclass(frozen=True)
class FindingView:
    """A finding with its stage and runs."""

    severity: str
    stage: str
    runs: tuple[str, ...]
    code: str
    text: str


@dataclass(frozen=True)
class RunView:
    """One run."""

    name: str
    verdict: str
    summary: Facts
    key_numbers: Facts
    series: Markup
    video: str | None
    video_start_s: float
    stills: Facts


@dataclass(frozen=True)
class ReportView:
    """The whole page; ``figures`` by section."""

    campaign: str
    headline: str
    reasons: Facts
    confidence: str
    runs: tuple[RunView, ...]
    figures: dict[str, tuple[FigureView, ...]]
    findings: tuple[FindingView, ...]
    notes: tuple[FindingView, ...]
    tables: Facts
    all_runs: Facts
    metrics: Table
    calibration: Facts
    planes: tuple[tuple[str, ...], Rows]
    dropped_views: Facts
    identified: Rows
    predicted: Rows
    tracking: Table
    simulation: Table
    needed: tuple[NeededRow, ...]
    data: ReportData


def build(data: ReportData, drawn: Sequence[tuple[Drawn, str]]) -> ReportView:
    """Convert the data of a report and its figures into what the template shows.

    Parameters
    ----------
    data : ReportData
        The data.
    drawn : sequence of (Drawn, str)
        The figures of :func:`towval.report.contents.draw_figures`, each with its SVG.

    Returns
    -------
    ReportView
        Strings and markup only, except for ``data``, whose own strings the template shows unchanged.
    """
    calibration, records, found = data.calibration, data.records, collect_findings(data)
    comparisons = [record.comparison for record in records]
    figures = [(figure.entry.section, _figure_view(figure, svg)) for figure, svg in drawn]
    return ReportView(
        campaign=data.campaign,
        headline=facts.headline(comparisons),
        reasons=facts.reasons(comparisons),
        confidence=_confidence(records),
        runs=tuple(_run_view(run) for run in data.runs),
        figures={section: tuple(view for place, view in figures if place == section) for section in SECTIONS},
        findings=tuple(f for f in found if f.severity != Severity.NOTE),
        notes=tuple(f for f in found if f.severity == Severity.NOTE),
        tables=_tables(comparisons),
        all_runs=facts.campaign_cells(comparisons) if len(comparisons) > 1 else (),
        metrics=facts.side_by_side([facts.metric_facts(c) for c in comparisons]),
        calibration=() if calibration is None else facts.calibration_facts(calibration),
        planes=((), ()) if calibration is None else facts.plane_table(calibration),
        dropped_views=()
        if calibration is None
        else tuple((view.name, view.dropped) for view in calibration.views if view.dropped),
        identified=() if data.identification is None else facts.identified_rows(data.identification),
        predicted=() if data.identification is None else facts.predicted_rows(data.identification),
        tracking=facts.side_by_side([(*facts.tracking_facts(r), *facts.decimation_facts(r)) for r in records]),
        simulation=facts.side_by_side([facts.simulation_facts(r) for r in records]),
        needed=needed_rows(calibration, records),
        data=data,
    )


def collect_findings(data: ReportData) -> tuple[FindingView, ...]:
    """Findings of all stages in order of severity; one that several runs share is listed once."""
    found = [(f.stage, f.run, f.finding) for f in data.findings]
    if data.identification is not None:
        found += [("identify", "", f) for f in data.identification.findings]
    if data.calibration is not None:
        found += [("calibrate", "", f) for f in data.calibration.findings]
    for run in data.records:
        for stage, findings in (
            ("track", (*run.rover_track.findings, *run.object_track.findings)),
            ("decimate", () if run.decimated is None else run.decimated.findings),
            ("simulate", run.simulated.findings),
            ("uncertainty", () if run.uncertainty is None else run.uncertainty.findings),
            ("compare", run.comparison.findings),
        ):
            # The reason for the verdict is part of the summary.
            found += [(stage, run.name, f) for f in findings if f.code not in facts.VERDICT_CODES]
    runs_of: dict[tuple[str, Finding], list[str]] = {}
    for stage, run_name, finding in found:
        runs_of.setdefault((stage, finding), []).append(run_name)
    views = [
        FindingView(f.severity.value, stage, tuple(name for name in names if name), f.code, f.text)
        for (stage, f), names in runs_of.items()
    ]
    return tuple(sorted(views, key=lambda view: _SEVERITIES.index(Severity(view.severity))))


def inline_svg(svg: str, name: str) -> Markup:
    """An SVG without fixed size, its ids made unique on the page by ``name``.

    Figures hold the same glyphs under the same ids; a page must not.
    """
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", svg)
    head, _, rest = svg.partition(">")
    head = re.sub(r'\s(width|height)="[^"]*"', "", head) + ' aria-hidden="true" focusable="false"'
    rest = re.sub(r"<metadata>.*?</metadata>", "", rest, flags=re.DOTALL)
    # Safe without escaping: matplotlib's own output, in which all text is outlines.
    return Markup(f"{head}>{rest}")


def _figure_view(drawn: Drawn, svg: str) -> FigureView:
    cursor = drawn.entry.cursor if isinstance(drawn.entry, RunFigure) else ""
    frame = frame_of(drawn.figure) if cursor else None
    return FigureView(inline_svg(svg, drawn.name), drawn.title, drawn.entry.caption, drawn.run, cursor, frame)


def _tables(comparisons: list[Comparison]) -> Facts:
    """Names and contents of the summary to download, as data URIs."""
    contents = (
        ("summary.csv", "text/csv", summary_csv(comparisons)),
        ("summary.tex", "text/plain", summary_latex(comparisons)),
    )
    return tuple((name, f"data:{kind};base64,{_base64(text.encode())}") for name, kind, text in contents)


def _confidence(records: Sequence[RunRecord]) -> str:
    """Share of runs with a correct model that stay below the limit of the verdict; empty where none was judged."""
    shares = {f"{100 * record.uncertainty.confidence:g} %" for record in records if record.uncertainty is not None}
    return " or ".join(sorted(shares))


def _run_view(report: RunReport) -> RunView:
    run = report.record
    stills = () if report.overlay is None else overlay_frames(report.overlay)
    return RunView(
        name=run.name,
        verdict=run.comparison.verdict.value,
        summary=facts.summary_cells(run.comparison),
        key_numbers=facts.key_numbers(run.comparison),
        series=_series(run),
        video=None if report.overlay is None else _data_uri(report.overlay, "video/mp4"),
        video_start_s=float(run.rover_track.time_s[0]),
        stills=tuple((f"{s.time_s:.2f} s", "data:image/jpeg;base64," + _base64(s.jpeg)) for s in stills),
    )


def _series(run: RunRecord) -> Markup:
    """Times and values under the cursor as JSON, rounded to the digits shown; null where missing."""
    c, simulated = run.comparison, run.simulated
    tension = np.interp(c.time_s, simulated.time_s, np.linalg.norm(simulated.tether_force, axis=1))
    columns = {
        "time_s": _rounded(c.time_s, 6),
        "x_mm": _rounded(1e3 * c.error[:, 0], 2),
        "y_mm": _rounded(1e3 * c.error[:, 1], 2),
        "heading_deg": _rounded(np.rad2deg(c.error[:, 2]), 3),
        "tension_N": _rounded(tension, 2),
        "rover": _positions(c.time_s, run.rover_track.time_s, measured_poses(run.rover_track)),
        "measured": _positions(c.time_s, run.object_track.time_s, measured_poses(run.object_track)),
    }
    return Markup(json.dumps(columns, separators=(",", ":")))


def _positions(wanted_s: Array, time_s: Array, pose: Array) -> list[list[float] | None]:
    """Positions [m] at the samples nearest to the wanted times, to 1 mm; None where the body was not tracked."""
    positions = pose[nearest_samples(time_s, wanted_s), :2]
    return [None if np.isnan(x) else [round(float(x), 3), round(float(y), 3)] for x, y in positions]


def _rounded(values: Array, digits: int) -> list[float | None]:
    return [round(float(v), digits) if np.isfinite(v) else None for v in values]


def _data_uri(path: FilePath, kind: str) -> str:
    try:
        return f"data:{kind};base64,{_base64(path.read_bytes())}"
    except OSError as error:
        raise InputError(f"{path.name} cannot be embedded in the report", got=error) from error


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")

"""Content of the page, ready for the template: figures and films as text, findings in order of severity."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from markupsafe import Markup

from towval.io.film import frame_times
from towval.io.summary import summary_csv, summary_latex
from towval.model import Calibration, Comparison, Finding, Severity
from towval.model.run_record import RunRecord, Still, nearest_samples
from towval.report import facts
from towval.report.contents import SECTIONS, RunFigure
from towval.report.data import ReportData, RunReport
from towval.report.drawing import Drawn
from towval.report.facts import Facts, Rows, Table
from towval.report.film import FilmView, deciding_time, embedded, film_view, run_times, series
from towval.report.inline import FigureSheet, data_uri
from towval.report.needed import NeededRow, needed_rows
from towval.report.overlay import stills
from towval.report.result import ResultRow, gists, legend, result_rows, sentence
from towval.report.style import Frame

_SEVERITIES = (Severity.REFUSAL, Severity.WARNING, Severity.NOTE)
_LEFT_OUT = "runs_left_out"
_BELOW_TABLE = ("campaign_verdict", _LEFT_OUT)
"""Findings on the first screen, below its table; that on all runs together where there are several."""

_PARTS = {
    "campaign": "inputs",
    "calibrate": "calibration",
    "track": "tracking",
    "decimate": "tracking",
    "simulate": "simulation",
    "uncertainty": "uncertainty",
    "identify": "identification",
}
"""Part of the page by stage; findings of other stages are shown with the numbers."""


@dataclass(frozen=True)
class FigureView:
    """A figure on the page; ``title`` is for readers who do not see it, ``frame`` given where a cursor marks a time."""

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
    kind: str
    summary: Facts
    key_numbers: Facts
    statement: tuple[str, ...]
    deciding: tuple[tuple[str, str, float], ...]
    frames: int
    series: Markup
    film: FilmView | None
    stills: Facts


@dataclass(frozen=True)
class ReportView:
    """The whole page; ``together`` is what stands below the first table, on all runs and on those that are left out.

    ``figures`` by section, ``findings`` and ``gists`` by the part of the page.
    """

    campaign: str
    sentence: str
    rows: tuple[ResultRow, ...]
    together: str
    legend: str
    confidence: str
    runs: tuple[RunView, ...]
    figures: dict[str, tuple[FigureView, ...]]
    glyphs: Markup
    figure_styles: Markup
    findings: dict[str, tuple[FindingView, ...]]
    gists: dict[str, str]
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


def build(data: ReportData, drawn: Sequence[Drawn], page: FilePath) -> ReportView:
    """The content of the template: strings and markup, and ``data``, whose own strings it shows unchanged.

    ``drawn`` are the figures of :func:`towval.report.drawing.draw_figures`; films are linked relative to the file
    ``page``.
    """
    calibration, records, sheet = data.calibration, data.records, FigureSheet()
    comparisons = [record.comparison for record in records]
    shown = [figure for figure in drawn if figure.entry.section != "files"]
    figures = [(figure.entry.section, _figure_view(figure, sheet)) for figure in shown]
    below_table = _BELOW_TABLE if len(records) > 1 else (_LEFT_OUT,)
    embed = embedded([run.film for run in data.runs if run.film is not None], data.embed_mb)
    return ReportView(
        campaign=data.campaign,
        sentence=sentence(records),
        rows=result_rows(records),
        together=" ".join(each.text for each in data.findings if each.code in below_table),
        legend=legend(records),
        confidence=_confidence(records),
        runs=tuple(_run_view(run, calibration, page, embed) for run in data.runs),
        figures={section: tuple(view for place, view in figures if place == section) for section in SECTIONS},
        glyphs=sheet.glyphs,
        figure_styles=sheet.styles,
        findings=findings_by_part(data),
        gists=gists(records, calibration),
        tables=_tables(comparisons),
        all_runs=facts.summary_cells(comparisons) if len(comparisons) > 1 else (),
        metrics=facts.side_by_side([facts.metric_facts(r) for r in records]),
        calibration=() if calibration is None else (*facts.calibration_facts(calibration), *facts.scale_facts(records)),
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


def findings_by_part(data: ReportData) -> dict[str, tuple[FindingView, ...]]:
    """Findings by the part of the page that holds them, the most severe first."""
    parts: dict[str, list[FindingView]] = {}
    for view in collect_findings(data):
        parts.setdefault(_PARTS.get(view.stage, "numbers"), []).append(view)
    return {part: tuple(views) for part, views in parts.items()}


def collect_findings(data: ReportData) -> tuple[FindingView, ...]:
    """Findings of all stages in order of severity; one that several runs share is listed once."""
    found = [("campaign", "", f) for f in data.findings if f.code not in _BELOW_TABLE]
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
        FindingView(f.severity.value, stage, tuple(dict.fromkeys(name for name in names if name)), f.code, f.text)
        for (stage, f), names in runs_of.items()
    ]
    return tuple(sorted(views, key=lambda view: _SEVERITIES.index(Severity(view.severity))))


def _figure_view(drawn: Drawn, sheet: FigureSheet) -> FigureView:
    cursor = drawn.entry.cursor if isinstance(drawn.entry, RunFigure) else ""
    return FigureView(
        sheet.inline(drawn.svg, drawn.name), drawn.title, drawn.entry.caption, drawn.run, cursor, drawn.frame
    )


def _tables(comparisons: list[Comparison]) -> Facts:
    """Names and contents of the summaries for download, as data URIs."""
    contents = (
        ("summary.csv", "text/csv", summary_csv(comparisons)),
        ("summary.tex", "text/plain", summary_latex(comparisons)),
    )
    return tuple((name, data_uri(kind, text.encode())) for name, kind, text in contents)


def _confidence(records: Sequence[RunRecord]) -> str:
    """Share of runs with a right model that stay below the limits of the verdict; empty without uncertainties."""
    shares = {f"{100 * record.uncertainty.confidence:g} %" for record in records if record.uncertainty is not None}
    return " or ".join(sorted(shares))


def _run_view(report: RunReport, calibration: Calibration | None, page: FilePath, embed: bool) -> RunView:
    run, film = report.record, None
    pictures: tuple[Still, ...] = ()
    time_s = presented_s = run.comparison.time_s
    if report.film is not None and calibration is not None:
        presented_s, coding = frame_times(report.film)
        time_s = run_times(run, presented_s)
        film = film_view(report.film, run, calibration, time_s, coding, page, embed)
        rows = np.unique(nearest_samples(time_s, [deciding_time(run), run.rover_track.time_s[-1]]))
        pictures = stills(report.film, calibration, run, presented_s[rows].tolist(), damaged=report.damaged)
    return RunView(
        name=run.name,
        verdict=run.comparison.verdict.value,
        kind=run.comparison.verdict.value.replace(" ", "-"),
        summary=facts.summary_cells([run.comparison]),
        key_numbers=facts.key_numbers(run.comparison),
        statement=facts.statement(run),
        deciding=facts.deciding(run.comparison),
        frames=len(time_s),
        series=series(run, presented_s, time_s),
        film=film,
        stills=tuple((f"{s.time_s:.2f} s", data_uri("image/jpeg", s.data)) for s in pictures),
    )

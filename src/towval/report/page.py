"""The report: one HTML file that holds figures, videos, numbers and provenance, and opens offline."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path as FilePath

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from towval.io.atomic import write_text
from towval.model.errors import InputError
from towval.model.run_record import RunRecord
from towval.report import figures, view
from towval.report.data import InputRow, Provenance, ReportData, RunReport, StageFinding
from towval.report.style import frame_of, save_figure, svg_text

__all__ = [
    "InputRow",
    "Provenance",
    "ReportData",
    "RunReport",
    "StageFinding",
    "report_figures",
    "run_figures",
    "write_report",
]


_UNCERTAINTY = re.compile(r"\bu_(num|input|D|val)\b")

_TIMED = ("errors_", "agreement_", "fig10_")
"""Figures over which the time cursor moves."""


def write_report(path: FilePath, data: ReportData, figures_folder: FilePath | None = None) -> FilePath:
    """Write the report of a campaign.

    Parameters
    ----------
    path : path
        The HTML file to write; its folder is made if it is not there.
    data : ReportData
        What to show.
    figures_folder : path, optional
        Where to save the figures as PDF, SVG and PNG as well; by default they are only in the page.

    Returns
    -------
    path
        ``path``: one file that asks for nothing from outside. The same data give the same bytes.

    Raises
    ------
    InputError
        When there is no run, two runs share a name, or a video cannot be read.
    """
    _check(data)
    drawn = report_figures(data)
    svgs = {name: svg_text(figure) for name, figure in drawn.items()}
    if figures_folder is not None:
        for name, figure in drawn.items():
            save_figure(figure, figures_folder, name, svg=svgs[name])
    frames = {name: frame_of(figure) for name, figure in drawn.items() if name.startswith(_TIMED)}
    shown = view.build(data, svgs, frames)
    template = _environment().get_template("report.html.j2")
    write_text(path, template.render(view=shown, css=_asset("report.css"), script=_asset("report.js")))
    return path


def _check(data: ReportData) -> None:
    names = [run.record.name for run in data.runs]
    if not names or len(set(names)) < len(names):
        raise InputError("the runs of a report need names of their own", got=names, allowed="one run or more")
    for run in data.runs:
        if run.overlay is not None and not run.overlay.is_file():
            raise InputError(f"the overlay {run.overlay.name} of run {run.record.name} is missing", got=run.overlay)


def run_figures(run: RunRecord) -> dict[str, Figure]:
    """The figures of one run by name.

    ``fig10_<run>``, ``errors_<run>``, ``agreement_<run>`` where its uncertainty is known, ``tracking_<body>_<run>``,
    and ``decimate_<run>`` where it was decimated.
    """
    drawn = {f"fig10_{run.name}": figures.run_figure(run), f"errors_{run.name}": figures.error_figure(run)}
    if run.uncertainty is not None:
        drawn[f"agreement_{run.name}"] = figures.agreement_figure(run)
    for track in (run.rover_track, run.object_track):
        drawn[f"tracking_{track.body}_{run.name}"] = figures.tracking_figure(track, run.name)
    if run.decimated is not None:
        drawn[f"decimate_{run.name}"] = figures.decimate_figure(run)
    return drawn


def report_figures(data: ReportData) -> dict[str, Figure]:
    """All figures of a report by name: ``fig10``, those of each run, ``shares``, ``calibration_<what>``.

    Parameters
    ----------
    data : ReportData
        What to show.

    Returns
    -------
    dict of str to Figure
        In the order of the page; figures whose data are missing are left out.
    """
    drawn = {"fig10": figures.campaign_figure([run.record for run in data.runs])}
    for run in data.runs:
        drawn |= run_figures(run.record)
    if any(run.record.uncertainty is not None for run in data.runs):
        drawn["shares"] = figures.shares_figure([run.record for run in data.runs])
    if data.calibration is not None:
        for name, figure in figures.calibration_figures(data.calibration, data.uncertainty).items():
            drawn[f"calibration_{name}"] = figure
    return drawn


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("towval.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["symbols"] = _symbols
    return environment


def _symbols(text: str) -> Markup:
    """A text with its uncertainties, ``u_val`` and the like, as symbols with an index."""
    return Markup(_UNCERTAINTY.sub(r"<i>u</i><sub>\1</sub>", str(escape(text))))


def _asset(name: str) -> Markup:
    # The package's own style sheet and script, never data: they go into the page as they are.
    return Markup((files("towval.report") / "templates" / name).read_text(encoding="utf-8"))

"""Figures of the report: one entry states what a figure shows, where it is placed and how it is drawn.

A new figure is a function of typed data and one line, ``RUN_FIGURES.register(id, RunFigure(...))`` or the same for the
campaign, here or in a plugin. The page, the files in ``figures`` and the texts for readers who do not see the figure
follow from the entry.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from matplotlib.figure import Figure

from towval.model import Calibration
from towval.model.errors import InputError
from towval.model.plugins import Registry
from towval.model.run_record import RunRecord
from towval.report import facts, figures
from towval.report.data import ReportData
from towval.report.wording import millimetres

Section = Literal["run", "details", "campaign", "uncertainty", "calibration", "tracking", "simulation", "files"]
SECTIONS: tuple[Section, ...] = get_args(Section)
"""Sections of the page that hold figures: ``run`` next to the film of each run, ``details`` folded below it,
``campaign`` on the first screen; figures of ``files`` are in the folder only."""
_OF_RUNS = ("run", "details")


@dataclass(frozen=True)
class ReportFigure:
    """Place and texts of a figure of the report.

    ``section``: one of :data:`SECTIONS`, of which ``run`` and ``details`` hold figures of one run only; ``title``: what
    the figure shows, for readers who do not see it; ``caption``: the text below it.
    """

    section: Section
    title: str
    caption: str = ""

    def __post_init__(self) -> None:
        allowed = [section for section in SECTIONS if isinstance(self, RunFigure) or section not in _OF_RUNS]
        if self.section not in allowed:
            raise InputError(f"the figure {self.title!r} has no place", got=self.section, allowed=", ".join(allowed))


@dataclass(frozen=True, kw_only=True)
class CampaignFigure(ReportFigure):
    """A figure of the whole campaign, in the files ``<id>.pdf``, ``.svg`` and ``.png``.

    ``draw`` makes a figure of the report's data; None where the data for it are missing.
    """

    draw: Callable[[ReportData], Figure | None]


@dataclass(frozen=True, kw_only=True)
class RunFigure(ReportFigure):
    """A figure of one run, in the files ``<id>_<run>.pdf``, ``.svg`` and ``.png``.

    ``draw`` makes a figure of the run; None where the data for it are missing; ``cursor`` "time" marks the film's time
    over a column of panels with time [s] as x axis; ``describe`` gives numbers of the run for readers who do not see
    the figure.
    """

    draw: Callable[[RunRecord], Figure | None]
    cursor: Literal["", "time"] = ""
    describe: Callable[[RunRecord], str] = lambda _: ""


CAMPAIGN_FIGURES: Registry[CampaignFigure] = Registry("figure of the campaign")
RUN_FIGURES: Registry[RunFigure] = Registry("figure of a run")
"""Figures by id, the stem of their file names; within a section in the order of the page."""


def _of_calibration(draw: Callable[[Calibration], Figure]) -> Callable[[ReportData], Figure | None]:
    return lambda data: None if data.calibration is None else draw(data.calibration)


def _uncertainty_map(data: ReportData) -> Figure | None:
    if data.calibration is None or data.uncertainty is None:
        return None
    return figures.uncertainty_figure(data.calibration, data.uncertainty)


def _path_errors(run: RunRecord) -> str:
    c = run.comparison
    return f"RMS distance {millimetres(c.path_rms_m)}, maximum {millimetres(c.path_max_m)}."


def _last_error(run: RunRecord) -> str:
    return f"Duration {np.ptp(run.comparison.time_s):.1f} s, last error {millimetres(run.comparison.final_error_m)}."


_CAMPAIGN = {
    "fig10": CampaignFigure(
        "campaign",
        "all runs on the floor at one scale",
        "Outlines: object at equal arc length, rover at its start and end. Gaps: frames without a pose. Errors "
        "narrower than a line, in large runs some centimetres, do not show here: see the plots of each run.",
        draw=lambda data: figures.campaign_figure(data.records),
    ),
    "repeats": CampaignFigure(
        "uncertainty",
        "errors of repeated runs along and across the path over its length, and what they have in common",
        "Simulated minus measured of runs that repeat one drive (grey), their mean (black), and the interval in which "
        "the error common to all lies at one place with 95 %. Scatter about the mean is what changes from run to run; "
        "a mean away from zero is the model's, or that of an input that all share.",
        draw=lambda data: figures.repeats_figure(data.repeats),
    ),
    "shares": CampaignFigure(
        "uncertainty",
        "shares of the error's variance by input",
        "First-order shares of the variance of simulated minus measured position by uncertain input; bars: mean of the "
        "runs, marks: single runs. The inputs with the largest shares are worth measuring better; grey is what no "
        "input explains alone.",
        draw=lambda data: figures.shares_figure(data.records),
    ),
    "calibration_coverage": CampaignFigure(
        "calibration",
        "detected board corners over the image",
        "Detected corners over the image with their residuals, magnified as stated. The lens model extrapolates where "
        "there are no corners.",
        draw=_of_calibration(figures.coverage_figure),
    ),
    "calibration_uncertainty": CampaignFigure(
        "calibration",
        "standard deviation of a position over the image",
        "Standard deviation of a position on the plane of the planar target, from the covariance of the calibration "
        "and the deviation of the target's height, without the error of the lens model. Drive where it is light.",
        draw=_uncertainty_map,
    ),
    "calibration_reprojection": CampaignFigure(
        "calibration",
        "reprojection error and tilt of each view",
        "Reprojection error and tilt of each view: held boards as blue circles, boards on the floor as green squares. "
        "Views without tilt do not determine the focal length: the advised tilts are shaded. The dashed line is what "
        "corner noise makes on average, so some views are beyond it; those that do not fit are dropped and named.",
        draw=_of_calibration(figures.reprojection_figure),
    ),
}
_RUN = {
    "fig10": RunFigure(
        "files",
        "path of the rover, simulated and measured path of the object, with outlines",
        draw=figures.run_figure,
        describe=_path_errors,
    ),
    "errors": RunFigure(
        "details",
        "errors in x, y and heading and tension of the tether over time",
        "Simulated minus measured in the floor frame, and the tension of the tether. Bands, where uncertainties were "
        "computed: ± two standard validation uncertainties; an error that stays outside is not explained by them.",
        draw=figures.error_figure,
        cursor="time",
        describe=_last_error,
    ),
    "agreement": RunFigure(
        "run",
        "error along and across the path and its ratio to the validation uncertainty over time",
        "Error along and across the path, bands: ± two standard validation uncertainties. Bottom: distance between "
        "simulated and measured position over its standard uncertainty. What stays above two the uncertainties do not "
        "explain; below two they may, but the verdict also tests the error's shape over time and the inputs.",
        draw=figures.agreement_figure,
        cursor="time",
    ),
    "statistics": RunFigure(
        "details",
        "size, shape and inputs of the error against their limits, and what right models reach",
        "Size and shape of the error and the largest effect of one input, each over its limit; bars: the largest of "
        "the three in draws of a right model, whose inputs are within their deviations. Beyond one it is rejected.",
        draw=figures.statistics_figure,
        describe=lambda run: f"Largest share of a limit: {run.comparison.tested_ratio:.2f}.",
    ),
    "tracking_rover": RunFigure(
        "tracking",
        "residual, inliers and standard deviations of the rover's track over time",
        draw=lambda run: figures.tracking_figure(run.rover_track, run.name),
    ),
    "tracking_object": RunFigure(
        "tracking",
        "residual, inliers and standard deviations of the object's track over time",
        draw=lambda run: figures.tracking_figure(run.object_track, run.name),
    ),
    "camera_motion": RunFigure(
        "tracking",
        "shift, turn and growth of the picture by the camera's own motion over time, and stamps that are doubted",
        draw=figures.camera_figure,
        describe=lambda run: facts.camera_text(run.rover_track),
    ),
    "decimate": RunFigure(
        "tracking",
        "measured and kept positions of the hinge; measured minus smoothed over time",
        draw=figures.decimate_figure,
    ),
}
for _id, _figure in _CAMPAIGN.items():
    CAMPAIGN_FIGURES.register(_id, _figure)
for _id, _run_figure in _RUN.items():
    RUN_FIGURES.register(_id, _run_figure)

"""Figures at column width from typed data: each function returns a matplotlib ``Figure`` and writes no file.

:mod:`towval.report.contents` places them on the page; :func:`towval.report.style.save_figure` writes a figure.
"""

from towval.report.figures.agreement import agreement_figure, shares_figure, statistics_figure
from towval.report.figures.calibration import coverage_figure, reprojection_figure, uncertainty_figure
from towval.report.figures.decimation import decimate_figure
from towval.report.figures.errors import error_figure
from towval.report.figures.repeats import repeats_figure
from towval.report.figures.runs import campaign_figure, run_figure
from towval.report.figures.tracking import camera_figure, tracking_figure

__all__ = [
    "agreement_figure", "camera_figure", "campaign_figure", "coverage_figure", "decimate_figure", "error_figure",
    "repeats_figure", "reprojection_figure", "run_figure", "shares_figure", "statistics_figure", "tracking_figure",
    "uncertainty_figure",
]  # fmt: skip

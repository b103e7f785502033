"""Errors of a run over time, with the tension of the tether below."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from towval.model import Array, SimulatedMotion
from towval.model.run_record import RunRecord
from towval.model.tracks import stretches
from towval.report.style import (
    BAND,
    COVERAGE,
    MEASURED,
    SHADE,
    SIMULATED,
    Margins,
    column_of_panels,
    figure_function,
    foot_note,
    symmetric,
)

_PANELS = ((0, "$x$ (mm)", 1e3), (1, "$y$ (mm)", 1e3), (2, "heading (°)", float(np.rad2deg(1.0))))


@figure_function
def error_figure(run: RunRecord) -> Figure:
    """Simulated minus measured over time in x, y and heading, and the tension of the tether, one column wide.

    Four panels over one time axis [s]: errors in mm and degrees, tension in N. Where the uncertainty is known, bands
    are ± two standard validation uncertainties (95 % for a normal error); an error that stays outside is not explained.
    Shaded where the tether is slack; a red line at the bottom of a panel marks frames without a pose of the object.
    """
    title = f"Run {run.name}: simulated minus measured"
    figure, panels = column_of_panels([0.76] * 4, Margins(bottom=0.5), title)
    comparison, simulated = run.comparison, run.simulated
    for axes, (column, label, scale) in zip(panels, _PANELS, strict=False):
        std = None if run.uncertainty is None else scale * np.sqrt(run.uncertainty.validation[:, column, column])
        _draw_error(axes, comparison.time_s, scale * comparison.error[:, column], std)
        axes.set_ylabel(label)
        symmetric(axes)
    _draw_tension(panels[3], simulated)
    shaded = _shade_slack(panels, simulated)
    panels[3].set_xlabel("time (s)")
    panels[0].set_xlim(comparison.time_s[0], comparison.time_s[-1])
    _explain(figure, banded=run.uncertainty is not None, shaded=shaded, gaps=bool(np.isnan(comparison.error).any()))
    return figure


def intervals(time_s: Array, mask: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Start and end [s] of each group of times with ``mask`` (n,) set, half an interval wider on each side."""
    bounds = np.concatenate([time_s[:1], (time_s[1:] + time_s[:-1]) / 2, time_s[-1:]])
    return [(float(bounds[first]), float(bounds[last + 1])) for first, last in stretches(mask)]


def _draw_error(axes: Axes, time_s: Array, error: Array, std: Array | None) -> None:
    axes.axhline(0.0, color="#333333", linewidth=0.5, zorder=2)
    if std is not None:
        axes.fill_between(time_s, -COVERAGE * std, COVERAGE * std, color=BAND, linewidth=0, zorder=1.5)
    axes.plot(time_s, error, color=SIMULATED, linewidth=0.9, zorder=3)
    for start_s, end_s in intervals(time_s, np.isnan(error)):
        axes.axvspan(start_s, end_s, ymax=0.035, color=MEASURED, linewidth=0, zorder=4)


def _draw_tension(axes: Axes, simulated: SimulatedMotion) -> None:
    tension = np.linalg.norm(simulated.tether_force, axis=1)
    axes.plot(simulated.time_s, tension, color=SIMULATED, linewidth=0.8, zorder=3)
    axes.set_ylim(bottom=0)
    axes.set_ylabel("tension (N)")


def _shade_slack(panels: list[Axes], simulated: SimulatedMotion) -> bool:
    slack = ~(np.linalg.norm(simulated.tether_force, axis=1) > 0)
    spans = intervals(simulated.time_s, slack)
    for axes in panels:
        for start_s, end_s in spans:
            axes.axvspan(start_s, end_s, color=SHADE, linewidth=0, zorder=0)
    return bool(spans)


def _explain(figure: Figure, *, banded: bool, shaded: bool, gaps: bool) -> None:
    parts = []
    if banded:
        parts.append("band: ± 2 standard validation uncertainties")
    if shaded:
        parts.append("shaded: tether slack")
    if gaps:
        parts.append("red: object not tracked")
    if parts:
        foot_note(figure, "; ".join(parts))

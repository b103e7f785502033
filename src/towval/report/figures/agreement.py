"""Error with its validation uncertainty, and the shares of its variance by input."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from towval.model import Array, Comparison, RunUncertainty
from towval.model.geometry import rotation
from towval.model.results import UNEXPLAINED
from towval.model.run_record import RunRecord
from towval.report.style import (
    BAND,
    COVERAGE,
    MEASURED,
    MUTED,
    ROVER,
    SHADE,
    SIMULATED,
    Margins,
    column_of_panels,
    figure_function,
    foot_legend,
    foot_note,
    symmetric,
)

_MARKERS = "osD^vPX*"
_LEAST_SHARE = 1.0  # [%] Smaller ones are shown together.
_LEGEND_LETTERS, _HANDLE_LETTERS = 60, 7
"""How many letters go into a line of a legend below a figure one column wide, and what a mark takes of them."""


@figure_function
def agreement_figure(run: RunRecord) -> Figure | None:
    """Error along and across the path with its validation uncertainty, and their ratio, one column wide.

    Three panels over one time axis [s]: the error along and across the measured path [mm] with bands of ± two standard
    validation uncertainties, and ``|E| / u_val`` of the position with a line at two, left out where ``u_val`` is below
    a hundredth of its root mean square. The title says by what a run is rejected, which need not show here. None where
    the uncertainty was not computed.
    """
    if run.uncertainty is None:
        return None
    comparison, uncertainty = run.comparison, run.uncertainty
    rejected = [name for name, (value, limit) in comparison.tested.items() if value > limit]
    by = f"rejected by its {' and '.join(rejected)}" if rejected else "with its validation uncertainty"
    title = f"Run {run.name}: error, {by}"
    figure, panels = column_of_panels([0.76] * 3, Margins(bottom=0.5), title)
    std = _along_across_std(comparison, uncertainty)
    for axes, column, label in zip(panels, (0, 1), ("along (mm)", "across (mm)"), strict=False):
        band = 1e3 * COVERAGE * std[:, column]
        axes.fill_between(comparison.time_s, -band, band, color=BAND, linewidth=0)
        axes.axhline(0.0, color="#333333", linewidth=0.5)
        axes.plot(comparison.time_s, 1e3 * comparison.along_across[:, column], color=SIMULATED, linewidth=0.9)
        axes.set_ylabel(label)
        symmetric(axes)
    _draw_ratio(panels[2], comparison)
    panels[2].set_xlabel("time (s)")
    panels[0].set_xlim(comparison.time_s[0], comparison.time_s[-1])
    foot_note(figure, "band: ± 2 standard validation uncertainties; dashed: ratio 2")
    return figure


@figure_function
def statistics_figure(run: RunRecord) -> Figure | None:
    """The test of the run: its statistics over their limits, with those of right models, one column wide.

    A histogram [% of draws] of the largest statistic over its limit in each draw of a right model, a dashed line at the
    limit, and a line for each of the run's size, shape and input that was tested. None where nothing was tested.
    """
    c = run.comparison
    if not len(c.drawn_tests):
        return None
    outcome = "rejected" if c.tested_ratio > 1 else "not rejected"
    title = f"Run {run.name}: {outcome}, largest {c.tested_ratio:.2f} of its limit"
    figure, (axes,) = column_of_panels([1.1], Margins(bottom=0.57), title)
    drawn = c.drawn_tests[:, 1]
    styles = {"size": (0, (1, 1)), "shape": (0, (4, 1, 1, 1)), "input": "-"}
    most = max(1.5, c.tested_ratio)
    bins = np.linspace(0, max(1.5, drawn.max()), 31)
    axes.hist(drawn, bins.tolist(), weights=np.full(len(drawn), 100 / len(drawn)), color=BAND, label="right models")
    axes.axvline(1.0, color=MEASURED, linewidth=0.8, linestyle="--")
    for name, (value, limit) in c.tested.items():
        axes.axvline(value / limit, color=SIMULATED, linewidth=1.1, linestyle=styles[name], label=name)
    axes.set_xlim(0, 1.05 * most)
    axes.set_xlabel("statistic over its limit")
    axes.set_ylabel("draws (%)")
    foot_legend(figure, axes.get_legend_handles_labels()[0], columns=4)
    return figure


@figure_function
def shares_figure(runs: Sequence[RunRecord]) -> Figure | None:
    """Shares of the error's variance by input, first order, one column wide.

    A row for each input, the largest mean share on top: a bar for the mean of the runs, a mark for each run [%]. Inputs
    below one per cent are one row, and what no input explains alone is the last, in grey. None where no run has an
    uncertainty.
    """
    shares = {run.name: run.uncertainty.shares for run in runs if run.uncertainty is not None}
    if not shares:
        return None
    names, table = _by_size(list(shares.values()))
    # Below the panel, since no place in it is free of bars and marks in all campaigns.
    columns = max(1, min(4, _LEGEND_LETTERS // (len("run ") + max(map(len, shares)) + _HANDLE_LETTERS)))
    rows_of_legend = -(-(1 + len(shares)) // columns)
    margins = Margins(left=0.2 + 0.044 * max(len(name) for name in names), bottom=0.42 + 0.16 * rows_of_legend)
    figure, (axes,) = column_of_panels([max(0.6, 0.14 * len(names))], margins)
    axes.set_title("Shares of the error's variance", loc="right")  # It is wider than the panel.
    rows = np.arange(len(names))
    colours = [MUTED if name == UNEXPLAINED else BAND for name in names]
    axes.barh(rows, np.nanmean(table, axis=0), height=0.62, color=colours, linewidth=0)
    for index, (run_name, values) in enumerate(zip(shares, table, strict=True)):
        marker = _MARKERS[index % len(_MARKERS)]
        axes.plot(values, rows, marker, color=ROVER, markersize=2.6, mfc="white", mew=0.7, label=f"run {run_name}")
    axes.set_yticks(rows, names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlim(left=0)
    axes.set_xlabel("first-order share (%)")
    handles = [Patch(color=BAND, linewidth=0, label="mean"), *axes.get_legend_handles_labels()[0]]
    foot_legend(figure, handles, columns)
    return figure


def _by_size(shares: Sequence[Mapping[str, float]]) -> tuple[list[str], Array]:
    """Names of the rows and shares (runs, rows) [%]: the largest first, small ones together, the unexplained last."""
    names = list(dict.fromkeys(name for of_run in shares for name in of_run if name != UNEXPLAINED))
    table = 100 * np.array([[of_run.get(name, np.nan) for name in names] for of_run in shares])
    mean = np.nanmean(table, axis=0)
    order = np.argsort(-mean, kind="stable")
    large = order[mean[order] >= _LEAST_SHARE]
    small = order[mean[order] < _LEAST_SHARE]
    columns, shown = [*table.T[large]], [names[i] for i in large]
    if len(small) == 1:
        columns, shown = [*columns, table[:, small[0]]], [*shown, names[small[0]]]
    elif len(small):
        columns.append(np.nansum(table[:, small], axis=1))
        shown.append(f"{len(small)} others together")
    if any(UNEXPLAINED in of_run for of_run in shares):
        columns.append(100 * np.array([of_run.get(UNEXPLAINED, np.nan) for of_run in shares]))
        shown.append(UNEXPLAINED)
    return shown, np.array(columns).T


def _draw_ratio(axes: Axes, comparison: Comparison) -> None:
    axes.axhspan(0, COVERAGE, color=SHADE, linewidth=0)
    axes.axhline(COVERAGE, color=MEASURED, linewidth=0.8, linestyle="--")
    axes.plot(comparison.time_s, comparison.ratio, color=SIMULATED, linewidth=0.9)
    axes.set_ylim(bottom=0)
    axes.set_ylabel(r"$|E|/u_\mathrm{val}$")


def _along_across_std(comparison: Comparison, uncertainty: RunUncertainty) -> Array:
    """Standard deviations (n, 2) of the error along and across the path [m].

    The comparison holds the error on floor axes and along the path; the angle between the two is the path's direction.
    """
    on_floor = comparison.error[:, 0] + 1j * comparison.error[:, 1]
    on_path = comparison.along_across[:, 0] + 1j * comparison.along_across[:, 1]
    turn = rotation(np.angle(on_floor * np.conj(on_path)))
    covariance = turn.transpose(0, 2, 1) @ uncertainty.validation[:, :2, :2] @ turn
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return np.where((np.abs(on_path) > 0)[:, None], std, np.nan)

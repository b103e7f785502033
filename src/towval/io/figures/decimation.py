"""Which measured points of the hinge path the simulation was driven with."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from towval.errors import InputError
from towval.io.run_record import RunRecord
from towval.io.style import COLUMN_WIDTH_IN, MEASURED, MUTED, ROVER, figure_function


@figure_function
def decimate_figure(run: RunRecord) -> Figure:
    """Raw against kept points of the hinge path, and how far the smoothed path is from the raw points.

    Parameters
    ----------
    run : RunRecord
        A run with ``raw_hinge`` and ``decimated``; with ``smoothed``, a second panel shows its distance from the raw
        points over time beside ``decimation_bound_m``.

    Returns
    -------
    Figure
        One column wide; floor coordinates [m], distances [mm].

    Raises
    ------
    InputError
        When the run was not decimated.
    """
    if run.raw_hinge is None or run.decimated is None:
        raise InputError(f"run {run.name} has no decimated path to draw", remedy="decimate it first")
    figure = Figure(figsize=(COLUMN_WIDTH_IN, 1.05 * COLUMN_WIDTH_IN), layout="constrained")
    if run.smoothed is None:
        plan = figure.add_subplot()
    else:
        plan, distance = figure.subplots(2, 1, height_ratios=[1.5, 1])
        _draw_distance(distance, run)
    raw, kept = run.raw_hinge.position, run.decimated.position
    plan.plot(*raw.T, ".", color=MUTED, markersize=2.2, markeredgewidth=0, label=f"measured ({len(raw)})")
    plan.plot(*kept.T, "o", mfc="none", mec=ROVER, mew=0.6, markersize=3, label=f"kept ({len(kept)})")
    plan.set_aspect("equal", adjustable="datalim")
    plan.set_xlabel("$x$ on the floor (m)")
    plan.set_ylabel("$y$ on the floor (m)")
    plan.set_title(f"Run {run.name}: way of the hinge")
    figure.legend(*plan.get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def _draw_distance(axes: Axes, run: RunRecord) -> None:
    raw, smoothed = run.raw_hinge, run.smoothed
    distance = np.linalg.norm(raw.position - smoothed.position, axis=1)
    axes.plot(raw.time_s, 1e3 * distance, ".", color=MUTED, markersize=2.2, markeredgewidth=0)
    if np.isfinite(run.decimation_bound_m):
        axes.axhline(1e3 * run.decimation_bound_m, color=MEASURED, linewidth=0.8, linestyle="--", label="bound")
        axes.legend(loc="upper right")
    axes.plot(run.decimated.time_s, np.zeros(len(run.decimated.time_s)), "|", color=ROVER, markersize=4, mew=0.5)
    axes.set_xlim(raw.time_s[0], raw.time_s[-1])
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("distance (mm)")

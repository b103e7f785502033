"""The paper's Fig. 10: rover path, simulated and measured object path on the floor, for one run or for all."""

from collections.abc import Sequence
from string import ascii_lowercase
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from towval.model import Array, Comparison
from towval.model.errors import InputError
from towval.model.geometry import arc_lengths, transform
from towval.model.run_record import RunRecord, measured_poses, pose_at
from towval.report.style import (
    COLUMN_WIDTH_IN,
    MEASURED,
    MUTED,
    PAGE_WIDTH_IN,
    ROVER,
    SIMULATED,
    Margins,
    figure_function,
    head_legend,
    place_maps,
    round_number,
)
from towval.report.wording import millimetres

# Line styles as well as colours: the curves can be told apart in grey and without colour vision.
ROVER_LINE: dict[str, Any] = {"color": ROVER, "linewidth": 0.9, "linestyle": "-"}
SIMULATED_LINE: dict[str, Any] = {"color": SIMULATED, "linewidth": 1.5, "linestyle": "-"}
MEASURED_LINE: dict[str, Any] = {"color": MEASURED, "linewidth": 1.1, "linestyle": (0, (3.2, 1.8))}

_MARGIN_M = 0.12
_MOST_STEPS = 8
_LEAST_RATIO, _LARGEST_RATIO = 0.45, 1.25


@figure_function
def run_figure(run: RunRecord) -> Figure:
    """The paper's Fig. 10 for one run, one column wide.

    Rover path (blue), simulated (black) and measured (red, dashed) object path in floor coordinates [m], equal scales,
    with about seven outlines of the object that do not overlap. Frames without a pose leave gaps.
    """
    figure = Figure(figsize=(COLUMN_WIDTH_IN, COLUMN_WIDTH_IN))
    axes = figure.add_subplot()
    low, high = map_limits(draw_run(axes, run))
    map_axes(axes, low, high)
    axes.set_title(f"Run {run.name}")
    axes.set_title(_error_text(run.comparison), loc="right", color="#444444")
    place_maps(figure, [axes], float((high - low)[1] / (high - low)[0]), Margins(left=0.46, top=0.54))
    head_legend(figure, _legend_handles(), columns=3)
    return figure


@figure_function
def campaign_figure(runs: Sequence[RunRecord]) -> Figure:
    """All runs of a campaign as small multiples at one scale, like the four panels of the paper's Fig. 10.

    Panels (a), (b), ... in the order of the runs, two to a row (three from five runs on), both columns of a page wide.
    Raises `InputError` when there is no run.
    """
    if not runs:
        raise InputError("a campaign figure needs a run", got="none", allowed="one run or more")
    columns = 1 if len(runs) == 1 else 2 if len(runs) <= 4 else 3
    figure = Figure(figsize=(PAGE_WIDTH_IN, PAGE_WIDTH_IN))
    panels = [figure.add_subplot() for _ in runs]
    extents = [map_limits(draw_run(axes, run)) for axes, run in zip(panels, runs, strict=True)]
    # One scale for all panels: the largest run sets the size, the others are centred in it.
    half = np.max([(high - low) / 2 for low, high in extents], axis=0)
    for index, (axes, run, (low, high)) in enumerate(zip(panels, runs, extents, strict=True)):
        centre = (low + high) / 2
        map_axes(axes, centre - half, centre + half)
        # Limits differ between panels, so each keeps its tick labels; axis labels are on the outer panels only.
        if index % columns:
            axes.set_ylabel("")
        if index + columns < len(panels):
            axes.set_xlabel("")
        axes.set_title(f"({ascii_lowercase[index % 26]}) run {run.name}")
        axes.set_title(_error_text(run.comparison), loc="right", color="#444444")
    margins = Margins(left=0.44, top=0.42, across=0.3, down=0.38)
    place_maps(figure, panels, float(half[1] / half[0]), margins, columns)
    head_legend(figure, _legend_handles(), columns=6)
    return figure


def draw_run(axes: Axes, run: RunRecord) -> Array:
    """Draw one run into ``axes``; return the corners (2, 2) of the bounding box of all that was drawn [m]."""
    rover, measured, simulated = measured_poses(run.rover_track), measured_poses(run.object_track), run.simulated.pose
    drawn = _draw_bodies(axes, run, _outline_times(run))
    axes.plot(*rover[:, :2].T, **ROVER_LINE, zorder=4)
    axes.plot(*simulated[:, :2].T, **SIMULATED_LINE, zorder=5)
    axes.plot(*measured[:, :2].T, **MEASURED_LINE, zorder=6)
    for poses, colour, order in ((rover, ROVER, 7), (simulated, SIMULATED, 7), (measured, MEASURED, 8)):
        _mark_ends(axes, poses, colour, order)
    points = np.concatenate([*drawn, rover[:, :2], measured[:, :2], simulated[:, :2]])
    return np.array([np.nanmin(points, axis=0), np.nanmax(points, axis=0)])


def _draw_bodies(axes: Axes, run: RunRecord, times_s: Array) -> list[Array]:
    measured, rover = measured_poses(run.object_track), measured_poses(run.rover_track)
    drawn = []
    for time_s in times_s:
        towed = pose_at(run.simulated.time_s, run.simulated.pose, time_s)
        seen = pose_at(run.object_track.time_s, measured, time_s)
        towing = pose_at(run.rover_track.time_s, rover, time_s)
        tether = np.array([transform(towed, run.anchor), transform(towing, run.hinge)])
        axes.plot(*tether.T, color=MUTED, linewidth=0.45, zorder=2)
        outline, visible_outline = transform(towed, run.towed.outline_m), transform(seen, run.towed.outline_m)
        axes.fill(*outline.T, facecolor="black", alpha=0.05, zorder=1)
        axes.plot(*outline.T, color=SIMULATED, linewidth=0.6, alpha=0.75, zorder=3)
        axes.plot(*visible_outline.T, color=MEASURED, linewidth=0.6, alpha=0.9, linestyle=(0, (3, 2)), zorder=3)
        drawn += [outline, visible_outline]
    for index in _ends(rover):
        outline = transform(rover[index], run.rover.outline_m)
        axes.fill(*outline.T, facecolor=ROVER, alpha=0.10, zorder=1)
        axes.plot(*outline.T, color=ROVER, linewidth=0.5, alpha=0.6, zorder=2)
        drawn.append(outline)
    return drawn


def _outline_times(run: RunRecord) -> Array:
    """Times [s] at equal steps along the simulated path; a track is noisy even at rest."""
    arc = arc_lengths(run.simulated.pose[:, :2])
    spacing_m = max(arc[-1] / 6, 1.1 * float(np.ptp(run.towed.top_corners_m, axis=0).max()))
    steps = np.arange(0.0, arc[-1] - 0.8 * spacing_m, spacing_m)
    times_s: Array = run.simulated.time_s[np.append(np.searchsorted(arc, steps), len(arc) - 1)]
    return times_s


def _ends(poses: Array) -> list[int]:
    seen = np.flatnonzero(np.isfinite(poses[:, 0]))
    return [int(seen[0]), int(seen[-1])] if len(seen) else []


def _mark_ends(axes: Axes, poses: Array, colour: str, order: int) -> None:
    for index, marker, face in zip(_ends(poses), "os", ("white", colour), strict=False):
        axes.plot(*poses[index, :2], marker, ms=3.2, mfc=face, mec=colour, mew=0.8, zorder=order)


def map_limits(extent: Array) -> tuple[Array, Array]:
    """The box with a margin, its aspect ratio limited to what fits a column."""
    low, high = extent[0] - _MARGIN_M, extent[1] + _MARGIN_M
    width, height = high - low
    centre, size = (low + high) / 2, np.array([max(width, height / _LARGEST_RATIO), max(height, width * _LEAST_RATIO)])
    return centre - size / 2, centre + size / 2


def map_axes(axes: Axes, low: Array, high: Array) -> None:
    """Limits, ticks and labels of a map of the floor between two corners [m]."""
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    step = 1 / round_number(_MOST_STEPS / float((high - low).max()))
    axes.xaxis.set_major_locator(MultipleLocator(step))
    axes.yaxis.set_major_locator(MultipleLocator(step))
    axes.set_xlabel("$x$ on the floor (m)")
    axes.set_ylabel("$y$ on the floor (m)")


def _error_text(comparison: Comparison) -> str:
    if not np.isfinite(comparison.path_rms_m):
        return "error not computed"
    errors = f"RMS {millimetres(comparison.path_rms_m)}, max {millimetres(comparison.path_max_m)}"
    return f"{comparison.verdict.value}: {errors}"


def _legend_handles() -> list[Line2D]:
    mark: dict[str, Any] = {
        "linestyle": "none",
        "markeredgecolor": "#444444",
        "markersize": 3.5,
        "markeredgewidth": 0.8,
    }
    return [
        Line2D([], [], label="rover", **ROVER_LINE),
        Line2D([], [], label="object, simulated", **SIMULATED_LINE),
        Line2D([], [], label="object, measured", **MEASURED_LINE),
        Line2D([], [], label="tether", color=MUTED, linewidth=0.6),
        Line2D([], [], label="start", marker="o", markerfacecolor="white", **mark),
        Line2D([], [], label="end", marker="s", markerfacecolor="#444444", **mark),
    ]

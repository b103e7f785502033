"""Points of the rover's track that drive the simulation."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from towval.model import DecimatedTrack, Track
from towval.model.geometry import transform
from towval.model.run_record import RunRecord
from towval.report.style import (
    BAND,
    COVERAGE,
    MEASURED,
    MUTED,
    ROVER,
    SHADE,
    Margins,
    column_of_panels,
    figure_function,
    foot_legend,
    head_legend,
    symmetric,
)


@figure_function
def decimate_figure(run: RunRecord) -> Figure | None:
    """Measured and kept positions of the hinge, and the distance of the measured poses from the smoothing curve.

    One column wide. Top: path of the hinge on the floor [m]; below, over time [s]: measured minus smoothed in x and y
    [mm] with a band of ± two standard deviations of one pose, pauses shaded, above a strip of the kept times. None
    where the run was not decimated.
    """
    if run.decimated is None:
        return None
    title = f"Run {run.name}: path of the hinge; Δ: measured minus smoothed"
    figure, (plan, *over_time, kept) = column_of_panels(
        [1.5, 0.62, 0.62, 0.12], Margins(top=0.4, bottom=0.53), title, apart=1
    )
    _draw_plan(plan, run, run.decimated)
    head_legend(figure, plan.lines, columns=2)
    figure.legends[0].get_lines()[0].set_markersize(5)
    for axes, column, name in zip(over_time, (0, 1), "xy", strict=True):
        _draw_misfit(axes, run.rover_track, run.decimated, column)
        axes.set_ylabel(rf"$\Delta {name}$ (mm)")
    kept.vlines(run.decimated.time_s, 0, 1, color=MEASURED, linewidth=0.5)
    kept.set_ylim(0, 1)
    kept.set_yticks([])
    kept.grid(visible=False)
    kept.set_xlabel("time (s)")
    kept.set_xlim(run.rover_track.time_s[0], run.rover_track.time_s[-1])
    foot_legend(figure, _marks(paused=len(run.decimated.pauses) > 0), columns=3)
    return figure


def _draw_plan(axes: Axes, run: RunRecord, decimated: DecimatedTrack) -> None:
    measured = transform(run.rover_track.pose[run.rover_track.seen], run.hinge)
    kept = transform(decimated.pose, run.hinge)
    axes.plot(*measured.T, ".", color=MUTED, markersize=2.2, markeredgewidth=0, label=f"measured ({len(measured)})")
    axes.plot(*kept.T, "o", mfc="none", mec=ROVER, mew=0.6, markersize=3, label=f"kept ({len(kept)})")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("$x$ on the floor (m)")
    axes.set_ylabel("$y$ on the floor (m)")


def _marks(*, paused: bool) -> list[Line2D | Patch]:
    """Legend of what is drawn over time in addition to the measured points."""
    ticks = Line2D([], [], linestyle="none", marker="|", color=MEASURED, markersize=6, label="time of a kept pose")
    band = Patch(color=BAND, alpha=0.6, linewidth=0, label=r"$\pm\,2\sigma$ of a pose")
    return [ticks, band, *([Patch(color=SHADE, linewidth=0, label="pause")] if paused else [])]


def _draw_misfit(axes: Axes, track: Track, decimated: DecimatedTrack, column: int) -> None:
    time_s, measured = track.time_s[track.seen], track.pose[track.seen, column]
    misfit = 1e3 * (measured - decimated.poses_at(time_s)[:, column])
    bound = 1e3 * COVERAGE * decimated.noise[column]
    for start_s, end_s in decimated.pauses:
        axes.axvspan(start_s, end_s, color=SHADE, linewidth=0, zorder=0)
    axes.axhspan(-bound, bound, color=BAND, alpha=0.6, linewidth=0, zorder=1)
    axes.plot(time_s, misfit, ".", color="#333333", markersize=1.8, markeredgewidth=0, zorder=3)
    symmetric(axes)

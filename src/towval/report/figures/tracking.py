"""Quality of a track, frame by frame."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch as Swatch

from towval.model import Track, TrackStatus
from towval.report.figures.errors import intervals
from towval.report.style import (
    BAND,
    MEASURED,
    ROVER,
    SIMULATED,
    Margins,
    column_of_panels,
    figure_function,
    foot_legend,
)

_STATUS_COLOURS = {TrackStatus.TRACKED: BAND, TrackStatus.COASTING: "#f2b84b", TrackStatus.LOST: MEASURED}

_RESIDUAL_UNITS = {"klt": " (px)", "plane": " (grey)"}


@figure_function
def tracking_figure(track: Track, run: str = "") -> Figure:
    """Residual, inliers and predicted standard deviations of a track over time, above a strip of its status.

    Five panels over one time axis [s], one column wide: residual [px or grey levels, depending on the method], inliers
    [%], standard deviation of position [mm] and heading [°] from the noise of the frame alone, status. ``run`` is the
    name of the run for the title.
    """
    title = f"Run {run}: tracking of the {track.body}" if run else f"Tracking of the {track.body}"
    heights = [0.7, 0.7, 0.7, 0.7, 0.15]
    figure, panels = column_of_panels(heights, Margins(bottom=0.53), title)
    panels[0].plot(track.time_s, track.residual, color=SIMULATED, linewidth=0.8)
    panels[0].set_ylabel("residual" + _RESIDUAL_UNITS.get(track.method, ""))
    panels[1].plot(track.time_s, 100 * track.inlier_fraction, color=SIMULATED, linewidth=0.8)
    panels[1].set_ylim(0, 104)
    panels[1].set_ylabel("inliers (%)")
    panels[2].plot(track.time_s, 1e3 * track.std[:, 1], color=ROVER, linewidth=1.4, label="$y$")
    panels[2].plot(track.time_s, 1e3 * track.std[:, 0], color=SIMULATED, linewidth=0.6, label="$x$")
    panels[2].legend(loc="upper right", ncols=2)
    panels[2].set_ylabel(r"$\sigma$ position (mm)")
    panels[3].plot(track.time_s, np.rad2deg(track.std[:, 2]), color=SIMULATED, linewidth=0.8)
    panels[3].set_ylabel(r"$\sigma$ heading (°)")
    for axes in (panels[0], *panels[2:4]):
        axes.set_ylim(bottom=0, top=1.35 * axes.get_ylim()[1])
    foot_legend(figure, _draw_status(panels[4], track), columns=3)
    panels[4].set_xlabel("time (s)")
    panels[0].set_xlim(track.time_s[0], track.time_s[-1])
    return figure


def _draw_status(axes: Axes, track: Track) -> list[Swatch]:
    """Draw the strip of the status; return its legend."""
    for status, colour in _STATUS_COLOURS.items():
        for start_s, end_s in intervals(track.time_s, track.status == status):
            axes.axvspan(start_s, end_s, color=colour, linewidth=0)
    present = [status for status in _STATUS_COLOURS if (track.status == status).any()]
    axes.set_yticks([])
    axes.grid(visible=False)
    return [
        Swatch(color=_STATUS_COLOURS[s], label=f"{s.name.lower()} ({int((track.status == s).sum())})") for s in present
    ]

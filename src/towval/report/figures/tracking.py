"""Quality of a track, and motion of the camera in a video, frame by frame."""

from collections.abc import Mapping
from enum import IntEnum
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch as Swatch
from numpy.typing import NDArray

from towval.model import Array, CameraTrack, Stamp, Track, TrackStatus
from towval.model.run_record import RunRecord
from towval.report.figures.errors import intervals
from towval.report.style import (
    BAND,
    COVERAGE,
    MEASURED,
    ROVER,
    SIMULATED,
    Margins,
    column_of_panels,
    figure_function,
    foot_legend,
)

_STATUS_COLOURS = {TrackStatus.TRACKED: BAND, TrackStatus.COASTING: "#f2b84b", TrackStatus.LOST: MEASURED}

_STAMP_COLOURS = {Stamp.AS_WRITTEN: BAND, Stamp.REPEATED: "#f2b84b", Stamp.CONTRADICTED: MEASURED}

_Kind = TypeVar("_Kind", bound=IntEnum)

_WIDE = 20  # Largest deviation of a pose over the median one, from which on their axes are logarithmic.
_RESIDUAL_UNITS = {"klt": " (px)", "plane": " (grey)"}


@figure_function
def tracking_figure(track: Track, run: str = "") -> Figure:
    """Residual, inliers and predicted standard deviations of a track over time, above a strip of its status.

    Five panels over one time axis [s], one column wide: residual [px or grey levels, depending on the method], inliers
    [%], standard deviation of position [mm] and heading [°] from the noise of the frame alone, status. ``run`` is the
    name of the run for the title. Axes of deviations are logarithmic where a few are far larger than the others.
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
    for axes, columns, unit in ((panels[2], slice(2), 1e3), (panels[3], slice(2, 3), float(np.rad2deg(1.0)))):
        known = track.std[:, columns][track.std[:, columns] > 0]
        # A few frames that are far less certain would hide how all others are.
        if len(known) and known.max() > _WIDE * np.median(known):
            axes.set_yscale("log")
            axes.set_ylim(unit * known.min() / 1.5, 4 * unit * known.max())
    foot_legend(figure, _draw_strip(panels[4], track.time_s, track.status, _STATUS_COLOURS), columns=3)
    panels[4].set_xlabel("time (s)")
    panels[0].set_xlim(track.time_s[0], track.time_s[-1])
    return figure


_BAND_SWATCH = Swatch(color=BAND, linewidth=0, label="band: ± 2 standard deviations")
_LEAST_RANGES = {"shift (px)": 0.06, "turn (°)": 0.012, "growth (%)": 0.012}
"""Panels of the camera's motion and what their axes span to either side at least: a tripod's is nothing to look at."""


@figure_function
def camera_figure(run: RunRecord) -> Figure | None:
    """Effect of the camera's own motion on the picture of the floor over time, above a strip of the time stamps.

    Four panels over one time axis [s], one column wide: shift of the picture's middle [px], turn [°], growth [%], each
    with a band of ± two deviations; stamps that the motion of the bodies contradicts, and repeated pictures. Gaps:
    the floor was not found. None where the floor was never found and no stamp is doubted.
    """
    camera, time_s = run.rover_track.camera, run.rover_track.time_s
    if camera is None or not (camera.registered.any() or camera.stamps.any()):
        return None
    title = f"Run {run.name}: the camera's own motion"
    figure, panels = column_of_panels([0.8, 0.6, 0.6, 0.15], Margins(bottom=0.68), title)
    _draw_motion(panels[0], time_s, camera, 1, 1.0, "$v$", ROVER)
    _draw_motion(panels[0], time_s, camera, 0, 1.0, "$u$", SIMULATED)
    _draw_motion(panels[1], time_s, camera, 2, float(np.rad2deg(1.0)), "", SIMULATED)
    _draw_motion(panels[2], time_s, camera, 3, 100.0, "", SIMULATED)
    for axes, (label, least) in zip(panels, _LEAST_RANGES.items(), strict=False):
        axes.set_ylabel(label)
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, -least), max(high, least))
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(top=high + 0.35 * (high - low))  # room for the legend
    panels[0].legend(loc="upper right", ncols=2)
    strip = [*_draw_strip(panels[3], time_s, camera.stamps, _STAMP_COLOURS), _BAND_SWATCH]
    panels[3].set_ylabel("stamps", rotation=0, ha="center", va="center", fontsize=7)
    foot_legend(figure, strip, columns=2)
    panels[3].set_xlabel("time (s)")
    panels[0].set_xlim(time_s[0], time_s[-1])
    return figure


def _draw_motion(
    axes: Axes, time_s: Array, camera: CameraTrack, column: int, scale: float, label: str, colour: str
) -> None:
    """Draw one component of the picture's motion with its band; a coloured one is seen below a black one."""
    value, half = scale * camera.picture[:, column], COVERAGE * scale * camera.picture_std[:, column]
    axes.fill_between(time_s, value - half, value + half, color=BAND, linewidth=0, zorder=1.5)
    axes.plot(time_s, value, color=colour, linewidth=0.6 if colour == SIMULATED else 1.6, label=label)


def _draw_strip(axes: Axes, time_s: Array, values: NDArray[np.uint8], colours: Mapping[_Kind, str]) -> list[Swatch]:
    """Draw the kind of each frame as a strip; return its legend."""
    for value, colour in colours.items():
        for start_s, end_s in intervals(time_s, values == value):
            axes.axvspan(start_s, end_s, color=colour, linewidth=0)
    present = [value for value in colours if (values == value).any()]
    axes.set_yticks([])
    axes.grid(visible=False)
    return [
        Swatch(color=colours[v], label=f"{v.name.lower().replace('_', ' ')} ({int((values == v).sum())})")
        for v in present
    ]

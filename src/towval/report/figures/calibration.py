"""Data and quality of the calibration: coverage, reprojection error, uncertainty on a plane."""

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from towval.model import Array, Calibration, UncertaintyMap, View
from towval.report.style import (
    COLUMN_WIDTH_IN,
    MEASURED,
    MUTED,
    ROVER,
    SHADE,
    Margins,
    figure_function,
    foot_legend,
    place_maps,
    round_number,
)
from towval.report.wording import decimal

_ADVISED_TILT_DEG = (20, 40)
# Length of a large residual (95th percentile) in the picture, as a share of the image's width.
_ARROW_SHARE = 0.02
_FLOOR = "#7fc4a0"
_CLEAR = {"facecolor": "white", "edgecolor": "none", "pad": 0.3}


@figure_function
def coverage_figure(calibration: Calibration) -> Figure:
    """Detected corners over the image with their residuals, magnified by a factor that the title states.

    The image [px], one column wide; residuals are detected minus predicted. Corners of dropped views are grey crosses.
    """
    figure = Figure(figsize=(COLUMN_WIDTH_IN, COLUMN_WIDTH_IN))
    axes = figure.add_subplot()
    used = [view for view in calibration.views if not view.dropped]
    held, lying = [v for v in used if not v.on_floor], [v for v in used if v.on_floor]
    for views, marker, colour, label in (
        (held, "o", ROVER, "held boards"),
        (lying, "s", _FLOOR, "boards on the floor"),
        ([v for v in calibration.views if v.dropped], "x", MUTED, "dropped"),
    ):
        corners = _stacked(views, "corners_px")
        if len(corners):
            axes.plot(*corners.T, marker, color=colour, markersize=1.6, markeredgewidth=0.4, label=label)
    factor = _draw_residuals(axes, calibration, used)
    width, height = _frame_image(axes, calibration)
    axes.set_title("Detected corners and their residuals" + (f", × {factor:.0f}" if factor else ""))
    place_maps(figure, [axes], height / width, Margins(left=0.46, bottom=0.55))
    foot_legend(figure, [line for line in axes.lines if not str(line.get_label()).startswith("_")], columns=4)
    return figure


@figure_function
def reprojection_figure(calibration: Calibration) -> Figure:
    """Root mean square reprojection error and tilt of each view; dropped views are labelled with the reason.

    One row per view, one column wide: errors [px] on the left with the corner noise of all views, tilts between board
    and image plane [°] on the right, the advised ones shaded. Views without tilt do not determine the focal length.
    """
    views = calibration.views
    margins = Margins(left=0.2 + 0.052 * max((len(_shown(view.name)) for view in views), default=0), bottom=0.53)
    height = margins.top + max(0.6, 0.115 * len(views)) + margins.bottom
    figure = Figure(figsize=(COLUMN_WIDTH_IN, height))
    errors, tilts = figure.subplots(1, 2, sharey=True, width_ratios=[1.6, 1])
    figure.subplots_adjust(
        left=margins.left / COLUMN_WIDTH_IN,
        right=1 - margins.right / COLUMN_WIDTH_IN,
        top=1 - margins.top / height,
        bottom=margins.bottom / height,
        wspace=0.06,
    )
    for row, view in enumerate(views):
        mark, colour = ("s", _FLOOR) if view.on_floor else ("o", ROVER)
        if view.dropped:
            errors.text(
                0.001, row, f"dropped: {view.dropped}", va="center", fontsize=6.5, color=MEASURED, bbox=_CLEAR, zorder=3
            )
            continue
        rms = float(np.sqrt(np.nanmean((view.residuals_px**2).sum(axis=1))))
        errors.plot([0, rms], [row, row], color=SHADE, linewidth=2.5, solid_capstyle="butt", zorder=1)
        errors.plot(rms, row, mark, color=colour, markersize=3)
        tilts.plot(view.tilt_deg, row, mark, color=colour, markersize=3)
    expected = np.sqrt(2) * calibration.corner_noise_px
    errors.axvline(expected, color="#333333", linewidth=0.7, linestyle="--")
    errors.set_yticks(range(len(views)), [_shown(view.name) for view in views], fontsize=6.5, parse_math=False)
    errors.set_ylim(len(views) - 0.4, -0.6)
    errors.set_xlim(left=0)
    errors.set_xlabel("reprojection error, RMS (px)")
    tilts.axvspan(*_ADVISED_TILT_DEG, color=SHADE, linewidth=0, zorder=0)
    tilts.xaxis.set_major_locator(MultipleLocator(20))
    tilts.set_xlabel("tilt (°)")
    tilts.set_xlim(left=0)
    kinds = (("o", ROVER, "held boards"), ("s", _FLOOR, "boards on the floor"))
    foot_legend(figure, [Line2D([], [], ls="", marker=m, color=c, ms=3, label=name) for m, c, name in kinds], columns=2)
    errors.set_title(f"Views; dashed: corner noise {decimal(calibration.corner_noise_px)} px × √2")
    return figure


@figure_function
def uncertainty_figure(calibration: Calibration, uncertainty: UncertaintyMap) -> Figure:
    """Standard deviation of a position on a plane over the image, from the covariance of the calibration.

    Filled contours [mm] with labels over the image [px], one column wide.
    """
    figure = Figure(figsize=(COLUMN_WIDTH_IN, COLUMN_WIDTH_IN))
    axes = figure.add_subplot()
    std_mm = np.ma.masked_invalid(1e3 * uncertainty.std_m)
    u, v = np.moveaxis(uncertainty.pixels, -1, 0)
    # Without its dark end, so that the labels stay readable.
    colours = ListedColormap(colormaps["YlGnBu"](np.linspace(0.05, 0.65, 64)))
    filled = axes.contourf(u, v, std_mm, levels=9, cmap=colours)
    lines = axes.contour(u, v, std_mm, levels=filled.levels, colors="#333333", linewidths=0.4)
    axes.clabel(lines, levels=list(lines.levels)[2::2], fontsize=6.5, fmt="%g")
    width, height = _frame_image(axes, calibration)
    place_maps(figure, [axes], height / width, Margins(left=0.46, right=0.68))
    box = axes.get_position()
    bar = figure.colorbar(filled, cax=figure.add_axes((box.x1 + 0.025, box.y0, 0.025, box.height)))
    bar.set_label("standard deviation (mm)")
    bar.outline.set_linewidth(0.4)
    axes.set_title(f"Uncertainty of a position {uncertainty.height_m:g} m above the floor")
    return figure


def _stacked(views: list[View], name: str) -> Array:
    return np.concatenate([np.empty((0, 2)), *(getattr(view, name) for view in views)])


def _draw_residuals(axes: Axes, calibration: Calibration, used: list[View]) -> float:
    """Draw the residuals as lines from the corners; return the magnification, zero where there are none."""
    corners, residuals = _stacked(used, "corners_px"), _stacked(used, "residuals_px")
    known = np.isfinite(residuals).all(axis=1)
    corners, residuals = corners[known], residuals[known]
    large = np.percentile(np.linalg.norm(residuals, axis=1), 95) if len(residuals) else 0.0
    if not large > 0:
        return 0.0
    factor = round_number(_ARROW_SHARE * calibration.camera.resolution_px[0] / float(large))
    ends = corners + factor * residuals
    gaps = np.full(len(corners), np.nan)
    u, v = (np.stack([corners[:, i], ends[:, i], gaps], axis=1).ravel() for i in (0, 1))
    axes.plot(u, v, color="black", linewidth=0.45, label="residual")
    return factor


def _frame_image(axes: Axes, calibration: Calibration) -> tuple[int, int]:
    """Set the axes to the image: v downward, edges half a pixel outside the outer pixel centres."""
    width, height = calibration.camera.resolution_px
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_xlabel("$u$ (px)")
    axes.set_ylabel("$v$ (px)")
    return width, height


def _shown(name: str) -> str:
    """The name of a picture, shortened to fit next to a plot."""
    return name if len(name) <= 28 else f"{name[:12]}…{name[-15:]}"

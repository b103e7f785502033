"""Map of a plan or a tow: the object behind the rover, and the bends that are due to the rover's limit."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from towval.model import Array, SimulatedMotion, TowedObject
from towval.model.geometry import transform
from towval.report.figures.runs import MEASURED_LINE, ROVER_LINE, SIMULATED_LINE, map_axes, map_limits
from towval.report.style import COLUMN_WIDTH_IN, MUTED, Margins, figure_function, head_legend, place_maps

_OUTLINES = 7
_WANTED_LINE = {**MEASURED_LINE, "color": MUTED}
_LIMIT_LINE = {"color": MEASURED_LINE["color"], "linewidth": 1.8, "linestyle": "-"}


@figure_function
def plan_figure(
    hinge: Array,
    motion: SimulatedMotion,
    towed: TowedObject,
    wanted: Array | None = None,
    limited: NDArray[np.bool_] | None = None,
) -> Figure:
    """Map of the hinge's path (n, 2) [m] and of the object behind it, one column wide, with equal scales.

    The footprint is drawn at equal steps of time; ``wanted`` (k, 2) is the desired path of the object [m]. Where
    ``limited`` (n,), the rover could not turn as tightly as the path requires: a bend there is due to the rover.
    """
    figure = Figure(figsize=(COLUMN_WIDTH_IN, COLUMN_WIDTH_IN))
    axes = figure.add_subplot()
    handles = [
        Line2D([], [], label="hinge on the rover", **ROVER_LINE),
        Line2D([], [], label="object", **SIMULATED_LINE),
    ]
    drawn = [hinge, motion.pose[:, :2]]
    axes.plot(*hinge.T, **ROVER_LINE, zorder=4)
    axes.plot(*motion.pose[:, :2].T, **SIMULATED_LINE, zorder=5)
    if wanted is not None:
        axes.plot(*wanted.T, **_WANTED_LINE, zorder=6)
        handles.append(Line2D([], [], label="object, desired", **_WANTED_LINE))
        drawn.append(wanted)
    if limited is not None and limited.any():
        axes.plot(*np.where(limited[:, None], hinge, np.nan).T, **_LIMIT_LINE, zorder=3)
        handles.append(Line2D([], [], label="bend due to the rover's limit", **_LIMIT_LINE))
    for row in np.unique(np.linspace(0, len(motion.time_s) - 1, _OUTLINES).astype(int)):
        for ring in towed.patch.outlines:
            outline = transform(motion.pose[row], np.vstack([ring, ring[:1]]))
            axes.fill(*outline.T, facecolor="black", alpha=0.05, zorder=1)
            axes.plot(*outline.T, color=MUTED, linewidth=0.6, zorder=2)
            drawn.append(outline)
    points = np.concatenate(drawn)
    low, high = map_limits(np.array([points.min(axis=0), points.max(axis=0)]))
    map_axes(axes, low, high)
    place_maps(figure, [axes], float((high - low)[1] / (high - low)[0]), Margins(left=0.46, top=0.46))
    head_legend(figure, handles, columns=2)
    return figure

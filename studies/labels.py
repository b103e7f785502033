"""Labels of points in a chart: beside their points, clear of marks, lines and each other."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from towval.model import Array

_LINE_STEP_PX = 3.0
_AROUND = (
    (1.0, 0.8, "left", "bottom"),
    (-1.0, 0.8, "right", "bottom"),
    (1.0, -0.8, "left", "top"),
    (-1.0, -0.8, "right", "top"),
    (1.4, 0.0, "left", "center"),
    (-1.4, 0.0, "right", "center"),
    (0.0, 1.3, "center", "bottom"),
    (0.0, -1.3, "center", "top"),
)
"""Places of a label around its point, the best first: steps right and up in its distance, and its alignment."""
_FARTHER = (0.0, 10.0, 20.0, 30.0)
"""What a label may be farther away [pt], tried in turn; from all but the first a thin line leads to the point."""


def place_labels(figure: Figure, axes: Sequence[Axes]) -> None:
    """Put each label beside its point, clear of marks, lines and labels before it.

    A label without such a place is not shown; the table has the settings of all points.
    """
    renderer = FigureCanvasAgg(figure).get_renderer()
    for own in axes:
        frame, taken = own.get_window_extent(renderer), _marks_and_lines(own, figure.dpi / 72)
        placed: list[Bbox] = []
        for label in (text for text in own.texts if isinstance(text, Annotation)):
            near = max(abs(step) for step in label.xyann)
            for farther in _FARTHER:
                box = _free_place(own, label, near + farther, frame, taken, placed, renderer)
                if box is not None:
                    placed.append(box)
                    if farther:
                        _lead(own, label, box)
                        taken += _way(own, label, box)
                    break
            label.set_visible(box is not None)


def _free_place(
    axes: Axes,
    label: Annotation,
    away: float,
    frame: Bbox,
    taken: Sequence[Bbox],
    placed: Sequence[Bbox],
    renderer: RendererBase,
) -> Bbox | None:
    """Move a label to the first place at a distance [pt] around its point that is free; its box there, or None.

    Nothing may be in its place, and no other mark and no label ``placed`` before on the way to its point.
    """
    around = [other for other in taken if not other.contains(*axes.transData.transform(label.xy))]
    for across, up, horizontal, vertical in _AROUND:
        label.xyann = (across * away, up * away)
        label.set(horizontalalignment=horizontal, verticalalignment=vertical)
        label.update_positions(renderer)
        box = label.get_window_extent(renderer)
        inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
        clear = not any(box.overlaps(other) for other in (*taken, *placed))
        way = _way(axes, label, box)
        if inside and clear and not any(step.overlaps(other) for step in way for other in (*around, *placed)):
            return box
    return None


def _lead(axes: Axes, label: Annotation, box: Bbox) -> None:
    """Draw a line from a point to the nearest place of its label's box."""
    point = axes.transData.transform(label.xy)
    # In the units of the axes: pixels are others in each format that the figure is saved in.
    line = axes.transData.inverted().transform([point, np.clip(point, box.min, box.max)])
    axes.add_artist(Line2D(*line.T, color="#777777", lw=0.5, zorder=2))


def _way(axes: Axes, label: Annotation, box: Bbox) -> list[Bbox]:
    """Boxes [px] along the line from a point to its label."""
    point = axes.transData.transform(label.xy)
    return _along(point, np.clip(point, box.min, box.max))


def _marks_and_lines(axes: Axes, px_per_point: float) -> list[Bbox]:
    """Boxes [px] around the marks of a panel and along its lines."""
    boxes = []
    for line in axes.lines:
        points = axes.transData.transform(np.column_stack(line.get_data()).astype(float))
        if line.get_marker() != "None":
            radius = 0.5 * line.get_markersize() * px_per_point
            boxes += [Bbox.from_extents(*(point - radius), *(point + radius)) for point in points]
        if line.get_linestyle() != "None":
            for start, end in itertools.pairwise(points):
                boxes += _along(start, end)
    for bars in axes.collections:
        if isinstance(bars, LineCollection):
            for bar in bars.get_segments():
                boxes += _along(*axes.transData.transform(bar))
    return boxes


def _along(start: Array, end: Array) -> list[Bbox]:
    steps = np.linspace(0, 1, max(2, int(np.hypot(*(end - start)) / _LINE_STEP_PX)))
    return [Bbox.from_extents(*point, *point) for point in start + steps[:, None] * (end - start)]

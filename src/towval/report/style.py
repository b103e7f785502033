"""Style of the figures: colours, widths, layout, and saving with reproducible bytes."""

import functools
import io
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path as FilePath
from typing import ParamSpec, TypeVar

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from towval.io.atomic import replacing, write_text
from towval.model.errors import InputError
from towval.report.data import FORMATS

COLUMN_WIDTH_IN = 85 / 25.4
"""Width of one column of a journal page, 85 mm [in]."""
PAGE_WIDTH_IN = 175 / 25.4
"""Width of both columns, 175 mm [in]."""

ROVER = "#1f63b4"
SIMULATED = "#000000"
MEASURED = "#e8412a"
"""The paper's blue, black and red; the red is light enough to differ from black without colour vision."""
MUTED = "#8a8a8a"
SHADE = "#ececec"
BAND = "#c9d8ea"

COVERAGE = 2.0
"""Half width of a band in standard uncertainties: 95 % for a normal error."""

# Dates and program names, which would change the bytes in every run.
_METADATA = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}

_Arguments = ParamSpec("_Arguments")
_Drawn = TypeVar("_Drawn", bound=Figure | None)


@contextmanager
def house_style() -> Iterator[None]:
    """Apply the settings of ``towval.mplstyle`` within a ``with`` block."""
    with matplotlib.rc_context(_house_settings()):
        yield


@functools.cache
def _house_settings() -> matplotlib.RcParams:
    with as_file(files("towval.report") / "towval.mplstyle") as path:
        return matplotlib.rc_params_from_file(path, use_default_template=False)


def figure_function(draw: Callable[_Arguments, _Drawn]) -> Callable[_Arguments, _Drawn]:
    """Run a drawing function under the house style."""

    @functools.wraps(draw)
    def drawn(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Drawn:
        with house_style():
            return draw(*args, **kwargs)

    return drawn


@dataclass(frozen=True)
class Margins:
    """Margins around and between the panels of a figure [in].

    They are fixed, not fitted to the labels: panels of all figures line up on a page, and their positions are known
    without drawing and are the same in every format.
    """

    left: float = 0.55
    right: float = 0.07
    top: float = 0.22
    bottom: float = 0.36
    across: float = 0.1
    down: float = 0.09


def column_of_panels(
    heights_in: Sequence[float], margins: Margins, title: str = "", apart: int = 0
) -> tuple[Figure, list[Axes]]:
    """A figure one column wide with stacked panels of given heights [in] that share an x axis, labelled at the lowest.

    The first ``apart`` panels have separate x axes and space for their labels; the title is at the top left.
    """
    gaps = [Margins.bottom + margins.down if i < apart else margins.down for i in range(len(heights_in) - 1)]
    height = margins.top + sum(heights_in) + sum(gaps) + margins.bottom
    figure = Figure(figsize=(COLUMN_WIDTH_IN, height))
    width = COLUMN_WIDTH_IN - margins.left - margins.right
    panels: list[Axes] = []
    top = margins.top
    for index, (panel_height, gap) in enumerate(zip(heights_in, [*gaps, 0.0], strict=True)):
        rectangle = (margins.left, height - top - panel_height, width, panel_height)
        axes = figure.add_axes(_share(rectangle, figure), sharex=panels[apart] if index > apart else None)
        axes.yaxis.set_label_coords((0.17 - margins.left) / width, 0.5)
        panels.append(axes)
        top += panel_height + gap
    for axes in panels[apart:-1]:
        axes.tick_params(labelbottom=False)
    panels[0].set_title(title)
    return figure, panels


def place_maps(figure: Figure, panels: Sequence[Axes], ratio: float, margins: Margins, columns: int = 1) -> None:
    """Arrange panels in rows, each ``ratio`` times as high as wide, and set the height of the figure to match.

    Maps with equal scales on both axes then fill their panels, at the column's width.
    """
    width = figure.get_size_inches()[0]
    panel_width = (width - margins.left - margins.right - margins.across * (columns - 1)) / columns
    step = ratio * panel_width + margins.down
    rows = math.ceil(len(panels) / columns)
    height = margins.top + rows * step - margins.down + margins.bottom
    figure.set_size_inches(width, height)
    for index, axes in enumerate(panels):
        row, column = divmod(index, columns)
        left = margins.left + column * (panel_width + margins.across)
        bottom = height - margins.top - row * step - ratio * panel_width
        axes.set_position(_share((left, bottom, panel_width, ratio * panel_width), figure))


def head_legend(figure: Figure, handles: Sequence[Artist], columns: int) -> None:
    """Add a centred legend in the top margin."""
    height = figure.get_size_inches()[1]
    figure.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1 - 0.03 / height), ncols=columns)


def foot_legend(figure: Figure, handles: Sequence[Artist], columns: int) -> None:
    """Add a centred legend in the bottom margin."""
    height = figure.get_size_inches()[1]
    figure.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 0.03 / height), ncols=columns)


def foot_note(figure: Figure, text: str) -> None:
    """Add a line of text in the bottom margin, starting at the left edge of the panels."""
    width, height = figure.get_size_inches()
    figure.text(Margins.left / width, 0.04 / height, text, fontsize=7, color="#555555")


def round_number(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above ``value``."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-12)))


def symmetric(axes: Axes) -> None:
    """Make the y limits symmetric about zero."""
    largest = max(abs(limit) for limit in axes.get_ylim())
    axes.set_ylim(-largest, largest)


def _share(rectangle: tuple[float, float, float, float], figure: Figure) -> tuple[float, float, float, float]:
    """A rectangle (left, bottom, width, height) [in] as shares of the figure's size."""
    width, height = figure.get_size_inches()
    left, bottom, across, up = rectangle
    return left / width, bottom / height, across / width, up / height


@dataclass(frozen=True)
class Frame:
    """Position and limits of the panels of a figure, for marking a time on it in a page.

    ``left``, ``right``, ``top`` and ``bottom`` are shares of the figure's width and height from its upper left corner,
    around all panels; ``x_low`` and ``x_high`` are the limits of the shared x axis.
    """

    left: float
    right: float
    top: float
    bottom: float
    x_low: float
    x_high: float


def frame_of(figure: Figure) -> Frame:
    """The frame of a figure with one column of panels."""
    first, last = figure.axes[0].get_position(), figure.axes[-1].get_position()
    low, high = figure.axes[0].get_xlim()
    return Frame(float(first.x0), float(first.x1), float(1 - first.y1), float(1 - last.y0), float(low), float(high))


def save_figure(
    figure: Figure, folder: FilePath, name: str, svg: str | None = None, formats: Sequence[str] = FORMATS
) -> tuple[FilePath, ...]:
    """Save a figure as ``name.pdf``, ``name.svg`` and ``name.png`` at its own width, each file atomically.

    Files of the figure in other than the ``formats`` are removed: they would show what it was before. ``svg`` is its
    :func:`svg_text`, if already made. The same figure gives the same bytes each time.

    Raises `InputError` when ``folder`` cannot be written to.
    """
    try:
        for ending in FORMATS:
            if ending not in formats:
                (folder / f"{name}.{ending}").unlink(missing_ok=True)
        paths = tuple(folder / f"{name}.{ending}" for ending in formats)
        for path in paths:
            if path.suffix == ".svg":
                write_text(path, svg or svg_text(figure))
            else:
                _save(figure, path)
        return paths
    except OSError as error:
        raise InputError(f"figure {name} could not be saved", got=error, remedy=f"make {folder} writable") from error


def _save(figure: Figure, path: FilePath) -> None:
    ending = path.suffix.removeprefix(".")
    with replacing(path) as temporary, house_style():
        figure.savefig(temporary, format=ending, metadata=_METADATA[ending])


def svg_text(figure: Figure) -> str:
    """The figure as an ``<svg>`` element without XML prologue, for an HTML page."""
    buffer = io.StringIO()
    with house_style():
        figure.savefig(buffer, format="svg", metadata=_METADATA["svg"])
    text = buffer.getvalue()
    return text[text.index("<svg") :]

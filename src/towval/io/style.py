"""The look of the figures: colours, widths, and saving them so that the same data give the same bytes."""

from __future__ import annotations

import functools
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import as_file, files
from pathlib import Path as FilePath
from typing import ParamSpec

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from towval.errors import InputError
from towval.io.atomic import replacing

COLUMN_WIDTH_IN = 85 / 25.4
"""Width of one column of a journal page, 85 mm [in]."""
PAGE_WIDTH_IN = 175 / 25.4
"""Width of both columns, 175 mm [in]."""

ROVER = "#1f63b4"
SIMULATED = "#000000"
MEASURED = "#e8412a"
"""The paper's blue, black and red; the red is light enough to stand off black for readers who do not see red."""
MUTED = "#8a8a8a"
SHADE = "#ececec"
BAND = "#c9d8ea"

FORMATS = ("pdf", "svg", "png")
# What a format would otherwise write into the file: the time of day, and with it new bytes at every run.
_METADATA = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}

_Arguments = ParamSpec("_Arguments")


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib's settings as ``towval.mplstyle`` gives them, for the length of a ``with`` block."""
    with as_file(files("towval.io") / "towval.mplstyle") as path, matplotlib.rc_context(fname=path):
        yield


def figure_function(draw: Callable[_Arguments, Figure]) -> Callable[_Arguments, Figure]:
    """Let a function draw in the house style, and freeze the layout of what it returns.

    A frozen layout is the same in every format, so that positions read off the figure hold in the files, too.
    """

    @functools.wraps(draw)
    def drawn(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> Figure:
        with house_style():
            figure = draw(*args, **kwargs)
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
            return figure

    return drawn


def fit_height(figure: Figure, axes: Axes, ratio: float, rows: int = 1) -> None:
    """Change the height of the figure until the frame of ``axes`` is ``ratio`` times as high as it is wide.

    Meant for maps: with the height right, equal scales on both axes leave no margins, and the width stays the column's.
    ``rows`` is the number of rows of panels like ``axes``.
    """
    for _ in range(2):
        figure.draw_without_rendering()
        box = axes.get_position()
        width, height = figure.get_size_inches()
        figure.set_size_inches(width, height + rows * (ratio * box.width * width - box.height * height))


def save_figure(figure: Figure, folder: FilePath, name: str) -> tuple[FilePath, ...]:
    """Save a figure as ``name.pdf``, ``name.svg`` and ``name.png`` at its own width; each appears whole or not at all.

    Parameters
    ----------
    figure : Figure
        What a function of :mod:`towval.io.figures` returned.
    folder : path
        Where to; made if it is not there.
    name : str
        Name of the files, without ending.

    Returns
    -------
    tuple of path
        The files written, in the order of :data:`FORMATS`. The same figure gives the same bytes each time.

    Raises
    ------
    InputError
        When ``folder`` cannot be written to.
    """
    try:
        return tuple(_save(figure, folder / f"{name}.{ending}", ending) for ending in FORMATS)
    except OSError as error:
        raise InputError(f"figure {name} could not be saved", got=error, remedy=f"make {folder} writable") from error


def _save(figure: Figure, path: FilePath, ending: str) -> FilePath:
    with replacing(path) as temporary, house_style():
        figure.savefig(temporary, format=ending, metadata=_METADATA[ending])
    return path


def svg_text(figure: Figure) -> str:
    """The figure as an ``<svg>`` element, without the XML prologue, to be put into an HTML page."""
    buffer = io.StringIO()
    with house_style():
        figure.savefig(buffer, format="svg", metadata=_METADATA["svg"])
    text = buffer.getvalue()
    return text[text.index("<svg") :]

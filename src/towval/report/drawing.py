"""Drawing of the report's figures, in parallel."""

import multiprocessing
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from pathlib import Path as FilePath

from matplotlib.figure import Figure

from towval.model.run_record import RunRecord
from towval.report.contents import CAMPAIGN_FIGURES, RUN_FIGURES, ReportFigure, RunFigure
from towval.report.data import ReportData
from towval.report.style import Frame, frame_of, save_figure, svg_text


@dataclass(frozen=True)
class Drawn:
    """A drawn figure: stem of its file names, the entry that describes it, its title and ``<svg>`` element.

    ``run`` is empty for the campaign's figures; ``frame`` is given where a cursor marks a time on the figure.
    """

    name: str
    entry: ReportFigure
    title: str
    run: str
    svg: str
    frame: Frame | None


_Result = tuple[str, str, Frame | None] | None
"""Title, SVG and frame of a figure; None where its data are missing."""


@dataclass(frozen=True)
class _Task:
    """A figure to draw and the formats of its files, its title, and the ``cursor`` of its entry.

    The title is to be requested only where there is a figure.
    """

    name: str
    entry: ReportFigure
    run: str
    cursor: str
    formats: tuple[str, ...]
    draw: Callable[[], Figure | None]
    title: Callable[[], str]

    def done(self, folder: FilePath | None) -> _Result:
        """Draw the figure, and save it in the folder."""
        figure = self.draw()
        if figure is None:
            return None
        svg = svg_text(figure)
        if folder is not None:
            save_figure(figure, folder, self.name, svg, self.formats)
        return self.title(), svg, frame_of(figure) if self.cursor else None


def draw_figures(data: ReportData, folder: FilePath | None = None, processes: int = 1) -> list[Drawn]:
    """Draw the figures of a report: the campaign's, then those of each run, without those whose data are missing.

    With a ``folder``, each is also saved there in the formats of the data. On Linux, up to ``processes`` forked
    processes draw in parallel; the figures do not depend on their number.

    Raises `InputError` when ``folder`` cannot be written to, `MemoryError` when the system has ended a process.
    """
    tasks = list(_tasks(data))
    if processes > 1 and sys.platform == "linux":
        results = _done_at_once(tasks, folder, processes)
    else:
        results = [task.done(folder) for task in tasks]
    return [
        Drawn(task.name, task.entry, result[0], task.run, *result[1:])
        for task, result in zip(tasks, results, strict=True)
        if result is not None
    ]


def _tasks(data: ReportData) -> Iterator[_Task]:
    for name, entry in CAMPAIGN_FIGURES.items():
        title = f"{entry.title[:1].upper()}{entry.title[1:]}."
        yield _Task(name, entry, "", "", data.formats, partial(entry.draw, data), partial(str, title))
    for run in data.records:
        for name, of_run in RUN_FIGURES.items():
            draw, title_of = partial(of_run.draw, run), partial(_title, of_run, run)
            yield _Task(f"{name}_{run.name}", of_run, run.name, of_run.cursor, data.formats, draw, title_of)


def _title(entry: RunFigure, run: RunRecord) -> str:
    return f"Run {run.name}: {entry.title}. {entry.describe(run)}".rstrip()


_shared: list[tuple[list[_Task], FilePath | None]] = []
"""In a drawing process: all tasks and their folder, in memory since before the fork."""


def _done_at_once(tasks: list[_Task], folder: FilePath | None, processes: int) -> list[_Result]:
    # A new process would need as long for its imports as it then draws.
    divided = multiprocessing.get_context("fork")
    shared = tasks, folder
    try:
        with ProcessPoolExecutor(processes, divided, _shared.append, (shared,)) as pool:
            return list(pool.map(_do, range(len(tasks))))
    except BrokenProcessPool as error:
        raise MemoryError("the system has ended a process that draws figures") from error


def _do(index: int) -> _Result:
    tasks, folder = _shared[0]
    return tasks[index].done(folder)

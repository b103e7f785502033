"""The report: one HTML file with figures, videos, numbers and provenance that opens offline."""

from pathlib import Path as FilePath

from towval.io.atomic import write_text
from towval.model.errors import InputError
from towval.report import view
from towval.report.data import ReportData
from towval.report.drawing import draw_figures
from towval.report.templating import PAGE_MARK, template_asset, template_environment


def write_report(
    path: FilePath, data: ReportData, figures_folder: FilePath | None = None, processes: int = 1
) -> FilePath:
    """Write the report of a campaign: one HTML file that loads nothing else; the same data give the same bytes.

    With a ``figures_folder``, the figures are also saved there in the formats of the data. ``processes`` draw
    in parallel.

    Raises `InputError` when there is no run, two runs share a name, or a video cannot be read.
    """
    _check(data)
    drawn = draw_figures(data, figures_folder, processes)
    template = template_environment().get_template("report.html.j2")
    text = template.render(
        view=view.build(data, drawn, path), css=template_asset("report.css"), script=template_asset("report.js")
    )
    write_text(path, text, own=PAGE_MARK)
    return path


def _check(data: ReportData) -> None:
    names = [run.record.name for run in data.runs]
    if not names or len(set(names)) < len(names):
        raise InputError("the runs of a report need distinct names", got=names, allowed="one run or more")
    for run in data.runs:
        if run.film is not None and not run.film.is_file():
            raise InputError(f"the video {run.film.name} of run {run.record.name} is missing", got=run.film)

"""Errors of repeated runs, and their common error."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from towval.model.repeats import Corridor
from towval.report.style import BAND, SIMULATED, Margins, column_of_panels, figure_function, foot_note, symmetric

_RUN = "#999999"


@figure_function
def repeats_figure(groups: Sequence[Corridor]) -> Figure | None:
    """Errors along and across the path [mm] over its length [m], two panels per group; None where no run is repeated.

    Thin lines are runs, the thick one their mean; the band holds the error common to all at one place with 95 %.
    """
    if not groups:
        return None
    figure, panels = column_of_panels([0.76] * 2 * len(groups), Margins(bottom=0.5), "Repeated runs: errors")
    for index, axes in enumerate(panels):
        group, column = groups[index // 2], index % 2
        mean, half_width = 1e3 * group.mean[:, column], 1e3 * group.half_width[:, column]
        axes.fill_between(group.length_m, mean - half_width, mean + half_width, color=BAND, linewidth=0)
        axes.axhline(0.0, color="#333333", linewidth=0.5)
        axes.plot(group.length_m, 1e3 * group.errors[:, :, column].T, color=_RUN, linewidth=0.5)
        axes.plot(group.length_m, mean, color=SIMULATED, linewidth=1.1)
        axes.set_ylabel(f"{', '.join(group.runs)}: {('along', 'across')[column]} (mm)")
        symmetric(axes)
    panels[-1].set_xlabel("length of the measured path (m)")
    panels[0].set_xlim(0.0, max(group.length_m[-1] for group in groups))
    foot_note(figure, "band: the common error, 95 % at one place")
    return figure

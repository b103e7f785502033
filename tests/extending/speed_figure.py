"""A figure from outside the package: speed of the simulated object over time."""

import numpy as np

from towval.report.contents import RUN_FIGURES, RunFigure
from towval.report.style import SIMULATED, Margins, column_of_panels, figure_function


@figure_function
def speed_figure(run):
    """Speed of the simulated object [mm/s] over time [s], one column wide."""
    figure, (axes,) = column_of_panels([0.8], Margins(), f"Run {run.name}: speed of the object")
    axes.plot(run.simulated.time_s, 1e3 * np.hypot(*run.simulated.twist[:, :2].T), color=SIMULATED, linewidth=0.9)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("speed (mm/s)")
    return figure


RUN_FIGURES.register("speed", RunFigure("run", "speed of the object over time", draw=speed_figure, cursor="time"))

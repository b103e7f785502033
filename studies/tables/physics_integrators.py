"""Integrators as work-precision curves: CPU time against error, on the lap of the oracles and on stick-slip.

    python -m studies.tables.physics_integrators [--out results/benchmarks]

Prints the table and writes it as CSV, with a chart beside it. Rows come from
``studies.comparators.work_precision``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from studies.comparators.tow_scenes import SCENES
from studies.comparators.work_precision import CVODE, LSODA, RADAU, ROSENBROCK, work_precision_rows
from towval.commands.console import errors_reported
from towval.report.style import MEASURED, MUTED, PAGE_WIDTH_IN, ROVER, SIMULATED, figure_function, save_figure

TOLERANCES_M = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
LOOKS = {
    ROSENBROCK: (SIMULATED, "o", "-"),
    CVODE: (ROVER, "s", "--"),
    RADAU: (MEASURED, "^", "-."),
    LSODA: (MUTED, "D", ":"),
}


@figure_function
def work_precision_figure(table: pd.DataFrame) -> Figure:
    """CPU time over error, a panel a scene, a line an integrator."""
    figure = Figure(figsize=(PAGE_WIDTH_IN, 0.45 * PAGE_WIDTH_IN), layout="constrained")
    panels = figure.subplots(1, len(SCENES), sharey=True)
    for axes, (scene, rows) in zip(panels, table.groupby("scene", sort=False), strict=True):
        for method, curve in rows.dropna(subset=["error_m"]).groupby("method", sort=False):
            colour, marker, line = LOOKS[method]
            axes.loglog(curve.error_m, 1e3 * curve.cpu_s, color=colour, marker=marker, ls=line, ms=4, label=method)
        axes.set_xlabel("largest error of the position [m]")
        axes.set_title(scene)
        axes.xaxis.set_major_locator(LogLocator(10, numticks=12))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.invert_xaxis()
    panels[0].set_ylabel("CPU time [ms]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(LOOKS))
    return figure


@errors_reported()
def main() -> None:
    """Print the table, write it as CSV, and draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/benchmarks"), help="folder for CSV and chart")
    folder = parser.parse_args().out
    tables = [
        pd.DataFrame(work_precision_rows(scene(), TOLERANCES_M)).assign(scene=name) for name, scene in SCENES.items()
    ]
    table = pd.concat(tables, ignore_index=True)
    shown = table.assign(cpu_ms=1e3 * table.cpu_s, call_us=1e6 * table.call_s).drop(columns=["cpu_s", "call_s"])
    print(shown.set_index(["scene", "method", "tolerance_m"]).to_string(float_format=lambda x: f"{x:.3g}"))
    folder.mkdir(parents=True, exist_ok=True)
    table.to_csv(folder / "integrators.csv", index=False)
    save_figure(work_precision_figure(table), folder, "integrators")


if __name__ == "__main__":
    main()

"""The summary of a campaign, a row a run: ``summary.csv`` and the same for LaTeX."""

import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from towval.io.atomic import write_text
from towval.model import Comparison

COLUMNS = (
    "run", "path_rms_m", "path_max_m", "heading_rms_rad", "path_length_m", "u_num_m", "u_input_m", "u_measurement_m",
    "u_val_m", "verdict", "tracked_frames", "lost_frames", "final_error_m", "frechet_m", "area_along_m",
    "area_across_m", "ratio_max", "aligned_rms_m", "tolerance_m", "error_upper_m", "model_error_lower_m",
    "model_error_upper_m", "detectable_m", "seen_share", "size_statistic", "size_limit", "shape_statistic",
    "shape_limit", "input_statistic", "input_limit", "findings",
)  # fmt: skip
_FIELDS = {"findings": "warnings"}


def summary_table(comparisons: Sequence[Comparison]) -> pd.DataFrame:
    """The summary of runs as a table with the columns :data:`COLUMNS`; lengths in metres, angles in radians."""
    return pd.DataFrame(
        [[getattr(c, _FIELDS.get(name, name)) for name in COLUMNS] for c in comparisons], columns=list(COLUMNS)
    )


def summary_csv(comparisons: Sequence[Comparison]) -> str:
    """The summary as CSV; an uncertainty that was not computed is left empty."""
    return str(summary_table(comparisons).to_csv(index=False, float_format="%.9g", lineterminator="\n"))


def summary_latex(comparisons: Sequence[Comparison]) -> str:
    """The summary as a LaTeX ``tabular`` for the package booktabs, in millimetres and degrees, "--" where missing."""
    rows = [" & ".join(_latex_cells(c)) + r" \\" for c in comparisons]
    return "\n".join([*_LATEX_HEAD, *rows, r"\bottomrule", r"\end{tabular}", ""])


def write_summary(path: Path, comparisons: Sequence[Comparison]) -> None:
    """Write ``summary.csv``, and beside it the same for LaTeX, ``figures/summary.tex``."""
    write_text(path, summary_csv(comparisons), own=f"{COLUMNS[0]},{COLUMNS[1]},")
    write_text(path.parent / "figures" / "summary.tex", summary_latex(comparisons))


_LATEX_HEAD = (
    "% needs \\usepackage{booktabs}; uncertainties are standard uncertainties; only the last column is aligned",
    r"\begin{tabular}{lrrrrrrrrlrrrrrr}",
    r"\toprule",
    r"Run & RMS & max. & heading & length & $u_\mathrm{num}$ & $u_\mathrm{input}$ & $u_D$ & $u_\mathrm{val}$ & verdict"
    r" & seen / lost & Fr\'echet & area along & area across & $\max |E|/u_\mathrm{val}$ & aligned RMS \\",
    r" & (mm) & (mm) & (\textdegree) & (m) & (mm) & (mm) & (mm) & (mm) & & (frames)"
    r" & (mm) & (mm) & (mm) & & (mm) \\",
    r"\midrule",
)


def _latex_cells(c: Comparison) -> list[str]:
    uncertainties = (c.u_num_m, c.u_input_m, c.u_measurement_m, c.u_val_m)
    return [
        c.run.replace("_", r"\_"),
        _decimal(1e3 * c.path_rms_m, 2),
        _decimal(1e3 * c.path_max_m, 2),
        _decimal(math.degrees(c.heading_rms_rad), 3),
        _decimal(c.path_length_m, 3),
        *(_decimal(1e3 * value, 2) for value in uncertainties),
        c.verdict.value,
        f"{c.tracked_frames} / {c.lost_frames}",
        *(_decimal(1e3 * value, 2) for value in (c.frechet_m, c.area_along_m, c.area_across_m)),
        _decimal(c.ratio_max, 2),
        _decimal(1e3 * c.aligned_rms_m, 2),
    ]


def _decimal(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "--"

"""The summary of a campaign, one row per run: ``summary.csv`` and the same for LaTeX."""

import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from towval.io.atomic import write_text
from towval.model import Comparison
from towval.model.statement import Verdict, rounded_up

COLUMNS = (
    "run", "path_rms_m", "path_max_m", "heading_rms_rad", "path_length_m", "u_num_m", "u_input_m", "u_measurement_m",
    "u_val_m", "verdict", "tracked_frames", "lost_frames", "final_error_m", "frechet_m", "area_along_m",
    "area_across_m", "ratio_max", "aligned_rms_m", "tolerance_m", "error_upper_m", "model_error_lower_m",
    "model_error_upper_m", "detectable_m", "seen_share", "size_statistic", "size_limit", "shape_statistic",
    "shape_limit", "input_statistic", "input_limit", "findings",
)  # fmt: skip
_FIELDS = {"findings": "warnings"}

SUMMARY_MARK = f"{COLUMNS[0]},{COLUMNS[1]},"
"""How a summary that may be replaced begins."""


def summary_table(comparisons: Sequence[Comparison]) -> pd.DataFrame:
    """The summary of runs as a table with the columns :data:`COLUMNS`; lengths in metres, angles in radians."""
    return pd.DataFrame(
        [[getattr(c, _FIELDS.get(name, name)) for name in COLUMNS] for c in comparisons], columns=list(COLUMNS)
    )


def summary_csv(comparisons: Sequence[Comparison]) -> str:
    """The summary as CSV; an uncertainty that was not computed is left empty."""
    return str(summary_table(comparisons).to_csv(index=False, float_format="%.9g", lineterminator="\n"))


def summary_latex(comparisons: Sequence[Comparison]) -> str:
    """The main columns as a LaTeX ``tabular`` for booktabs, narrow enough for a column; "--" where missing."""
    rows = [" & ".join(_latex_cells(c)) + r" \\" for c in comparisons]
    return "\n".join([*_LATEX_HEAD, *rows, r"\bottomrule", r"\end{tabular}}", ""])


def write_summary(path: Path, comparisons: Sequence[Comparison]) -> tuple[Path, Path]:
    """Write ``summary.csv``, and beside it the same for LaTeX, ``figures/summary.tex``; returns both paths."""
    for_latex = path.parent / "figures" / "summary.tex"
    write_text(path, summary_csv(comparisons), own=SUMMARY_MARK)
    write_text(for_latex, summary_latex(comparisons))
    return path, for_latex


_LATEX_HEAD = (
    "% needs \\usepackage{booktabs}; fits a column of 85 mm; all quantities are in summary.csv",
    r"{\footnotesize\setlength{\tabcolsep}{3pt}%",
    r"\begin{tabular}{lrrrrrl}",
    r"\toprule",
    r"Run & path & RMS & max. & $u_\mathrm{val}$ & error $\le$ & verdict \\",
    r" & (m) & (mm) & (mm) & (mm) & (mm) & \\",
    r"\midrule",
)


def _latex_cells(c: Comparison) -> list[str]:
    return [
        c.run.replace("_", r"\_"),
        _decimal(c.path_length_m, 2),
        *(_decimal(1e3 * value, 1) for value in (c.path_rms_m, c.path_max_m, c.u_val_m)),
        _decimal(math.nan if c.verdict is Verdict.NOT_JUDGED else rounded_up(1e3 * c.error_upper_m, 1), 1),
        c.verdict.value,
    ]


def _decimal(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "--"

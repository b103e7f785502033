"""``summary.csv``: a row a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from towval.io.atomic import replacing
from towval.types import Comparison

COLUMNS = (
    "run",
    "path_rms_m",
    "path_max_m",
    "heading_rms_rad",
    "path_length_m",
    "u_num_m",
    "u_input_m",
    "u_measurement_m",
    "u_val_m",
    "verdict",
    "tracked_frames",
    "lost_frames",
)


def summary_table(comparisons: Sequence[Comparison]) -> pd.DataFrame:
    """The summary of runs as a table with the columns :data:`COLUMNS`; lengths in metres, angles in radians."""
    return pd.DataFrame([[getattr(c, name) for name in COLUMNS] for c in comparisons], columns=list(COLUMNS))


def write_summary(path: Path, comparisons: Sequence[Comparison]) -> None:
    """Write ``summary.csv``; an uncertainty that was not computed is left empty."""
    with replacing(path) as temporary:
        summary_table(comparisons).to_csv(temporary, index=False, float_format="%.9g")

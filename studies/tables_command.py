"""Command of the paper's tables: the parts of a study → one CSV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from towval.io.plan_files import read_table, write_table


def gather(parts: Sequence[Path], output: Path) -> None:
    """Put the rows of all parts of a study into one table, in the order of the parts."""
    write_table(output, pd.concat([read_table(part) for part in parts], ignore_index=True))

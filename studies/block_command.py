"""Command of the studies: one block of a chart → its rows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from studies.frame import study
from studies.machine import machine, version_line
from towval.io.plan_files import write_table


def run_block(chart: str, part: Mapping[str, Any], output: Path) -> None:
    """Compute one part of a chart and write its rows, with machine and versions.

    Parameters
    ----------
    chart : str
        A name in :data:`studies.frame.TRADEOFF` or ``STABILITY``.
    part : mapping
        What the part varies.
    output : Path
        CSV to write.
    """
    rows = pd.DataFrame(study(chart).rows(**part))
    write_table(output, rows.assign(machine=machine(), versions=version_line()))

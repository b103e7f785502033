"""Commands of all studies that compute: one part → its rows, all parts → one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from studies.frame import Study, loaded, read_table
from studies.machine import machine, version_line
from towval.io.plan_files import write_table


def run_part(study: str, part: Mapping[str, Any], output: Path, *, short: bool = False) -> None:
    """Compute one part of a study and write its rows, with machine and versions.

    Parameters
    ----------
    study : str
        Reference ``module:name`` of the study.
    part : mapping
        What the part varies.
    output : Path
        CSV to write.
    short : bool, optional
        The part is one of the study's short variant: the rows say so, and with them chart and page.
    """
    found: Study = loaded(study)
    rows = pd.DataFrame(found.rows(**part))
    write_table(output, rows.assign(short=short, machine=machine(), versions=version_line()))


def gather(parts: Sequence[Path], output: Path) -> None:
    """Write the rows of all parts of a study as one table, in the order of the parts."""
    write_table(output, pd.concat([read_table(part) for part in parts], ignore_index=True))

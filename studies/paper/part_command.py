"""Command of the paper's studies: one part of a study → CSV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from studies.paper.studies import paper_rows
from towval.io.plan_files import write_table


def run_part(scene: Mapping[str, Any], study: str, part: Mapping[str, Any], output: Path) -> None:
    """Compute one part of a study and write its rows.

    Parameters
    ----------
    scene : mapping
        The configuration's section ``plan``.
    study : str
        Name of the study.
    part : mapping
        What the part varies.
    output : Path
        CSV to write.
    """
    write_table(output, pd.DataFrame(paper_rows(scene, study, part)))

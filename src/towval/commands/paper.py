"""Commands of the paper's studies: one part of a study → CSV, one plan → MCAP and CSV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from towval.commands.shared import provenance, tell
from towval.errors import InputError
from towval.io.plan_files import write_plan_csv, write_plan_mcap, write_table
from towval.study.paper_scene import paper_scene
from towval.study.paper_studies import paper_rows
from towval.study.sensitivity import cube_nominal, cube_patch, planned_loop


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


def run_plan(scene: Mapping[str, Any], curve: str, mcap: Path, csv: Path) -> None:
    """Plan the rover so that the cube follows a curve, tow the cube behind it, and write both.

    Parameters
    ----------
    scene : mapping
        The configuration's section ``plan``.
    curve : str
        Name of the curve.
    mcap, csv : Path
        Files to write.

    Raises
    ------
    InputError
        When the curve is not one of the paper's.
    """
    given = paper_scene(scene)
    if curve not in given.curves:
        raise InputError(f"the curve {curve} is not known", allowed=", ".join(given.curves))
    patch = cube_patch(given)
    nominal = cube_nominal(given, patch, curve, given.planner_step)
    loop = planned_loop(given, patch, nominal)
    tell((*nominal.findings, *loop.rover.findings, *loop.towed.findings), "plan")
    print(f"plan: {loop.rover.outcome}. {loop.rover.advice}")
    write_plan_mcap(mcap, loop.rover, loop.towed, provenance(scene, {}))
    write_plan_csv(csv, loop.rover, loop.towed)

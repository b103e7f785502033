"""Command of the paper's figures: tables of the studies → PDF, SVG and PNG."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.paper.figures.contact import contact_figure
from studies.paper.figures.mesh_table import mesh_table_figure
from studies.paper.figures.paths import loop_figure, nominal_figure
from studies.paper.figures.rover_model import rover_figure
from studies.paper.figures.sensitivity import dynamics_figure, surface_figure, threshold_figure
from studies.paper.scene import paper_scene
from towval.io.plan_files import read_table
from towval.report.style import save_figure

Tables = Mapping[str, pd.DataFrame]


def draw(name: str, plan: Mapping[str, Any], tables: Mapping[str, Path], folder: Path) -> None:
    """Draw one of the paper's figures and save it.

    Parameters
    ----------
    name : str
        ``figure_2`` to ``figure_8`` or ``table_1``.
    plan : mapping
        The configuration's section ``plan``.
    tables : mapping
        CSV files of the studies by name.
    folder : Path
        Where the figure goes.
    """
    save_figure(figure_of(name, plan, {study: read_table(path) for study, path in tables.items()}), folder, name)


def figure_of(name: str, plan: Mapping[str, Any], tables: Tables) -> Figure:
    """One of the paper's figures from the tables of the studies."""
    return _FIGURES[name](plan, tables)


def _figure_2(plan: Mapping[str, Any], tables: Tables) -> Figure:
    shape = plan["general_object"]
    return contact_figure(tables["contact"], np.array(shape["outline_m"]), np.array(shape["extreme_centre_of_mass_m"]))


def _figure_3(plan: Mapping[str, Any], _: Tables) -> Figure:
    scene = paper_scene(plan)
    return rover_figure(scene.rover, scene.cube.patch.outline, scene.cube.anchor, scene.tether.rest_length)


def _figure_4(plan: Mapping[str, Any], tables: Tables) -> Figure:
    shape = plan["general_object"]
    return nominal_figure(tables["nominal"], np.array(shape["outline_m"]), np.array(shape["anchor_m"]))


def _figure_6(plan: Mapping[str, Any], tables: Tables) -> Figure:
    studies = (tables[name] for name in ("speeds", "time_steps", "stiffnesses", "feedforward_paths"))
    return dynamics_figure(*studies, side=plan["cube"]["side_m"])


_FIGURES: dict[str, Callable[[Mapping[str, Any], Tables], Figure]] = {
    "figure_2": _figure_2,
    "figure_3": _figure_3,
    "figure_4": _figure_4,
    "figure_5": lambda _, tables: loop_figure(tables["loop"]),
    "figure_6": _figure_6,
    "figure_7": lambda _, tables: threshold_figure(tables["thresholds"]),
    "figure_8": lambda _, tables: surface_figure(tables["surface"]),
    "table_1": lambda _, tables: mesh_table_figure(tables["meshes"]),
}

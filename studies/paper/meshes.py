"""The paper's meshes beside our exact method: pressure (Fig. 2), and what the quasi-static model costs (Table 1)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, cast

import numpy as np

from studies.comparators.compiled_mesh import plan_on_mesh
from studies.costs import cpu_seconds
from studies.frame import Part, Row
from studies.paper.finite_volumes import MeshPressure, mesh_pressure, meshed_patch
from studies.paper.scene import PaperScene, paper_study
from towval.model import TimedPath
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.physics.contact import pressure_plane, resting_pressure
from towval.physics.friction_laws import Makkar, fitted_law
from towval.physics.quasistatic import quasistatic_plan
from towval.physics.wrench import sliding_patch
from towval.planning.paths import timed

PAPER_TABLE_1 = {
    0.0010: (132_900, 47.556),
    0.0025: (21_801, 9.30141),
    0.0050: (5_434, 5.3362),
    0.0075: (2_405, 4.3801),
    0.0100: (1_322, 4.4749),
}
"""SOURCE: Table 1: cells and seconds by element size [m]."""

SIDES_PER_ELEMENT_SIZE = 2.8
"""ASSUME: the paper's 1,322 cells of 0.01 m on a square of 0.4 m have sides of some 0.017 m; a longest side of 2.8
element sizes gives our meshes its numbers of cells."""

CELL_BUDGET = 2e7
"""A mesh is timed over as many steps as its cells times the steps stay below this."""

LEAST_STEPS = 100


def contact_rows(scene: PaperScene, centre: list[float], element_size: float) -> list[Row]:
    """Pressure under a very eccentric load on a mesh: cells, iterations, and the exact part in contact, Fig. 2.

    Rows ``cell`` hold the corners of a cell, whether it carries load in the end and which, rows ``iteration`` the
    residual and the coefficients of the pressure plane over those of the last iteration, rows ``exact`` the corners of
    the part in contact by clipping, the row ``load`` the load and its place.
    """
    towed = next(iter(scene.general.values()))
    loads = [(towed.mass * GRAVITY_M_PER_S2, centre)]
    exact = pressure_plane(towed.patch, loads)
    meshed = mesh_pressure(towed.patch, loads, element_size)
    rows = _cell_rows(meshed)
    rows.append({"row": "load", "force_n": loads[0][0], "x0": centre[0], "y0": centre[1]})
    last = meshed.history[-1].coefficients
    for number, iteration in enumerate(meshed.history, start=1):
        normalised = dict(zip(("a", "b", "c"), iteration.coefficients / last, strict=True))
        share = float(meshed.mesh.areas[iteration.in_contact].sum() / meshed.mesh.areas.sum())
        rows.append(
            {"row": "iteration", "number": number, "residual": iteration.residual, "contact": share} | normalised
        )
    for ring, corners in enumerate(exact.rings):
        rows += [{"row": "exact", "number": ring, "x0": x, "y0": y} for x, y in corners]
    for name, plane in (("mesh", last), ("exact", exact.coefficients)):
        rows.append({"row": f"{name} plane"} | dict(zip(("a", "b", "c"), plane, strict=True)))
    return rows


def _cell_rows(meshed: MeshPressure) -> list[Row]:
    corners = meshed.mesh.vertices[meshed.mesh.triangles].reshape(-1, 6)
    names = ("x0", "y0", "x1", "y1", "x2", "y2")
    final = meshed.history[-1].in_contact
    return [
        {"row": "cell", "contact": float(inside), "force_n": force} | dict(zip(names, cell, strict=True))
        for cell, inside, force in zip(corners, final, meshed.force, strict=True)
    ]


def mesh_rows(scene: PaperScene, element_size: float | None) -> list[Row]:
    """Computing time of the quasi-static model of the cube on a mesh, or with the boundary integral (None), Table 1.

    The lemniscate in the paper's 60,000 steps. A mesh is summed in compiled code and its moment balanced at every step,
    as in the paper; fine meshes are timed over the first steps alone and their time is scaled to all of them,
    ``timed_steps`` says over how many. The boundary integral is the package's own: it balances the moment at the nodes
    of few panels and gives all steps. The first heading rate is compared with the exact one.
    """
    specification = timed(scene.curves["lemniscate"], scene.time_step, duration=scene.duration)
    steps = len(specification.time_s) - 1
    law = cast(Makkar, fitted_law(scene.friction).law)
    exact = sliding_patch(resting_pressure(scene.towed), law)
    first = quasistatic_plan(scene.towed, exact, specification, scene.tether, times=specification.time_s[:3])
    reference = float(first.twist[0, 2])
    if element_size is None:
        whole = partial(quasistatic_plan, scene.towed, exact, specification, scene.tether)
        cells, count, seconds, rate = 0, steps, cpu_seconds(whole), reference
    else:
        loads = [(scene.towed.mass * GRAVITY_M_PER_S2, scene.towed.centre_of_mass)]
        pressure = mesh_pressure(scene.towed.patch, loads, SIDES_PER_ELEMENT_SIZE * element_size)
        cells = len(pressure.force)
        count = int(np.clip(CELL_BUDGET / cells, LEAST_STEPS, steps))
        given = scene.towed, meshed_patch(pressure, law), tuple(law.gamma.tolist())
        start = float(first.pose[0, 2]), reference
        rate = plan_on_mesh(*given, _first(specification, 2), start)[0, 1]
        seconds = cpu_seconds(partial(plan_on_mesh, *given, _first(specification, count), start)) * steps / count
    paper_cells, paper_seconds = PAPER_TABLE_1.get(element_size or 0.0, (np.nan, np.nan))
    return [
        {
            "method": "boundary integral" if element_size is None else "mesh",
            "element_size_m": element_size or np.nan,
            "cells": cells or np.nan,
            "seconds": seconds,
            "timed_steps": count,
            "steps": steps,
            "rate_error": abs(rate / reference - 1),
            "paper_cells": paper_cells,
            "paper_seconds": paper_seconds,
        }
    ]


def _first(path: TimedPath, steps: int) -> TimedPath:
    return TimedPath(path.time_s[: steps + 1], path.position[: steps + 1])


def _contact_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    shape = plan["general_object"]
    return {"extreme": {"centre": shape["extreme_centre_of_mass_m"], "element_size": shape["element_size_m"]}}


def _mesh_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    sizes = plan["table_1"]["element_sizes_m"]
    return {"boundary": {"element_size": None}} | {f"{1e4 * size:03.0f}": {"element_size": size} for size in sizes}


CONTACT = paper_study(_contact_parts, contact_rows)
MESHES = paper_study(_mesh_parts, mesh_rows)

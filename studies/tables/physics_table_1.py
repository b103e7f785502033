"""Table 1 of the paper: wrench and quasi-static model on its five meshes and by the boundary integral, timed.

    python -m studies.tables.physics_table_1

The meshes evaluate Makkar's law in every cell (``studies.comparators.compiled_mesh``). A mesh whose 60,000 steps would
take minutes is timed over fewer, see the column "timed steps", and its seconds are those of a step times 60,000. All
are CPU times of this run; the paper's seconds are from its own machine.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from studies.comparators.compiled_mesh import plan_on_mesh
from studies.comparators.tow_scenes import lemniscate
from studies.costs import least_cpu_seconds
from studies.paper.finite_volumes import mesh_pressure, meshed_patch
from studies.paper.meshes import PAPER_TABLE_1, SIDES_PER_ELEMENT_SIZE
from studies.tables.physics_must_reach import CUBE, GAMMA, LOADS, MAKKAR, seconds_a_mesh_wrench, seconds_a_wrench
from towval.commands.console import errors_reported
from towval.model import Tether, TimedPath
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.physics.contact import pressure_plane, resting_pressure
from towval.physics.quasistatic import quasistatic_plan
from towval.physics.wrench import SlidingPatch, sliding_patch

STEPS = 60_000
CELL_BUDGET = 4e8  # cells times steps that are timed


def mesh_of(element_size: float, loads: Sequence[tuple[float, ArrayLike]]) -> SlidingPatch:
    """The cube's footprint on a mesh of the paper's element size [m]."""
    return meshed_patch(mesh_pressure(CUBE.patch, loads, SIDES_PER_ELEMENT_SIZE * element_size), MAKKAR)


@dataclass(frozen=True)
class TimedPatch:
    """CPU times [s] of a wrench and of the quasi-static model's 60,000 steps, and over how many of these it was timed.

    ``element_m`` is the size of a mesh's elements [m] and ``cells`` their number, 0 for the boundary integral.
    """

    element_m: float
    cells: int
    wrench_s: float
    motion_s: float
    timed_steps: int


def timed_patches() -> Iterator[TimedPatch]:
    """The boundary integral, and then each mesh."""
    path, tether = lemniscate(600.0, STEPS + 1), Tether(0.6, 1000.0)
    resting = [(CUBE.mass * GRAVITY_M_PER_S2, CUBE.centre_of_mass)]
    exact = sliding_patch(resting_pressure(CUBE), MAKKAR)
    plan = quasistatic_plan(CUBE, exact, path, tether)
    start = plan.pose[0, 2], plan.twist[0, 2]
    wrench = seconds_a_wrench(sliding_patch(pressure_plane(CUBE.patch, LOADS), MAKKAR), 4000)
    motion = least_cpu_seconds(lambda: quasistatic_plan(CUBE, exact, path, tether))
    yield TimedPatch(0.0, 0, wrench, motion, STEPS)
    for size in PAPER_TABLE_1:
        mesh = mesh_of(size, LOADS)
        cells = len(mesh.area_nodes)
        a_wrench = seconds_a_mesh_wrench(mesh, max(1, round(2e5 / cells)))
        steps = int(np.clip(CELL_BUDGET / cells, 100, STEPS))
        part = TimedPath(path.time_s[: steps + 1], path.position[: steps + 1])
        resting_mesh = mesh_of(size, resting)
        seconds = least_cpu_seconds(partial(plan_on_mesh, CUBE, resting_mesh, GAMMA, part, start), 1) * STEPS / steps
        yield TimedPatch(size, cells, a_wrench, seconds, steps)


@errors_reported()
def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    head = ("element [m]", "cells", "paper's", "wrench [µs]", "ratio", "QSM [s]", "timed steps", "ratio", "paper [s]")
    print(" ".join(f"{title:>12s}" for title in head))
    exact, *meshes = timed_patches()
    print(
        f"{'boundary':>12s} {'':>12s} {'':>12s} {1e6 * exact.wrench_s:12.2f} {1:12d} {exact.motion_s:12.3f} {STEPS:12d}"
    )
    for mesh in meshes:
        paper_cells, paper_seconds = PAPER_TABLE_1[mesh.element_m]
        print(
            f"{mesh.element_m:12.4f} {mesh.cells:12d} {paper_cells:12d} {1e6 * mesh.wrench_s:12.1f} "
            f"{mesh.wrench_s / exact.wrench_s:12.0f} {mesh.motion_s:12.2f} {mesh.timed_steps:12d} "
            f"{mesh.motion_s / exact.motion_s:12.0f} {paper_seconds:12.2f}"
        )


if __name__ == "__main__":
    main()

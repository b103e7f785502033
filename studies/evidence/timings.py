"""Checks of what the physics cost: effects of a real tow, integrators side by side, and the paper's Table 1."""

from __future__ import annotations

from studies.comparators import work_precision
from studies.comparators.tow_scenes import SCENES
from studies.comparators.work_precision import CVODE, LSODA, RADAU, ROSENBROCK
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, given, repeated, replaced
from studies.tables import lap_effects, physics_must_reach, physics_table_1
from towval.physics.dynamics import Accuracy


def _lap_effects() -> Values:
    timed = lap_effects.timed_laps(12)
    found: dict[str, float] = {}
    for name, spent in timed.items():
        planar = timed[f"{name.split(':')[0]}: planar"]
        found |= {name: spent.cpu_s / planar.cpu_s, f"{name}, steps": spent.result.statistics["steps"]}
    return found


LAP_EFFECTS = Check(
    _lap_effects,
    {
        "a planar lap is simulated three times": replaced(
            lap_effects,
            "take_turns",
            lambda original: (
                lambda calls, rounds: original(
                    {name: repeated(3)(call) if name.endswith("planar") else call for name, call in calls.items()},
                    rounds,
                )
            ),
        ),
        "the tolerance counts a hundred-fold": replaced(lap_effects, "feedback", given(accuracy=Accuracy(1e-5))),
    },
)

_SHOWN = {
    "lap": {ROSENBROCK: (1e-4, 1e-6, 1e-7), CVODE: (1e-4, 1e-8), RADAU: (1e-5, 1e-9), LSODA: (1e-4, 1e-8)},
    "stick-slip": {ROSENBROCK: (1e-7,), CVODE: (1e-8,), RADAU: (1e-5, 1e-9), LSODA: (1e-8,)},
}
"""Tolerances [m] of which the documents speak, by scene and method."""


_OURS = {"lap": f"lap, {ROSENBROCK}, 1e-06 m, CPU", "stick-slip": f"stick-slip, {ROSENBROCK}, 1e-07 m, CPU"}
"""Ours at an error of about 5 µm, by scene."""


def _integrators() -> Values:
    found = _work_precision()
    for name, again in _work_precision().items():  # The least of two: another process beside one of them counts less.
        found[name] = min(found[name], again) if name.endswith(", CPU") else again
    costs = {name: cost for name, cost in found.items() if name.endswith(", CPU")}
    return found | {f"{name} over ours": cost / found[_OURS[name.split(",")[0]]] for name, cost in costs.items()}


def _work_precision() -> dict[str, float]:
    found: dict[str, float] = {}
    for name, methods in _SHOWN.items():
        scene = SCENES[name]()
        for method, tolerances in methods.items():
            for row in work_precision.work_precision_rows(scene, tolerances, (method,)):
                at = f"{name}, {method}, {row['tolerance_m']:g} m"
                found |= {f"{at}, CPU": 1e3 * row["cpu_s"], f"{at}, error": 1e6 * row["error_m"]}
                found |= {f"{at}, calls": row["rate_calls"]}
                if row["call_s"]:
                    found["a call from Python"] = 1e6 * row["call_s"]
    return found


INTEGRATORS = Check(
    _integrators,
    {
        "tolerances count a thousand-fold": both(
            replaced(work_precision, "Accuracy", lambda _: lambda tolerance, *rest: Accuracy(1000 * tolerance, *rest)),
            replaced(
                work_precision._Problem,
                "allowed",
                lambda original: staticmethod(lambda tolerance: original(1000 * tolerance)),
            ),
        ),
        "our solver works three times": replaced(
            work_precision, "_SOLVERS", lambda solvers: solvers | {ROSENBROCK: repeated(3)(solvers[ROSENBROCK])}
        ),
        "every call of the rates from Python works three times": replaced(work_precision, "natural_rates", repeated(3)),
    },
    needs=("sksundae",),
)


def _table_1() -> Values:
    exact, *meshes = physics_table_1.timed_patches()
    found: dict[str, float] = {"boundary, wrench": 1e6 * exact.wrench_s, "boundary, QSM": exact.motion_s}
    for mesh in meshes:
        at = f"{mesh.element_m:.4f} m"
        found |= {f"{at}, cells": mesh.cells, f"{at}, wrench": 1e6 * mesh.wrench_s, f"{at}, QSM": mesh.motion_s}
        found[f"{at}, QSM over the boundary's"] = mesh.motion_s / exact.motion_s
        found[f"{at}, wrench, a cell"] = 1e9 * mesh.wrench_s / mesh.cells
    return found


TABLE_1 = Check(
    _table_1,
    {
        "elements are taken twice as large": replaced(
            physics_table_1, "SIDES_PER_ELEMENT_SIZE", lambda sides: 2 * sides
        ),
        "the boundary integral computes ten times, wrenches of a mesh are summed three times": both(
            replaced(physics_must_reach, "many_wrenches", repeated(10)),
            replaced(physics_table_1, "quasistatic_plan", repeated(10)),
            replaced(physics_must_reach, "many_mesh_wrenches", repeated(3)),
        ),
    },
)

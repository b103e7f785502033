"""Checks of the physics: closed forms, quadrature, oracles, engines, and what it costs."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from studies.comparators import mujoco_engine, mujoco_loads, work_precision
from studies.comparators.tow_scenes import TowScene, lap_scene
from studies.costs import least_cpu_seconds
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, numbers_of, repeated, replaced, result_of
from studies.tables import physics_must_reach, physics_stability
from towval.model import FrictionSpecification
from towval.physics import contact
from towval.physics.dynamics import Accuracy
from towval.physics.friction_laws import Makkar, makkar
from towval.physics.spatial.problem import RISE, TowProblem

_HERE = sys.modules[__name__]


def lap() -> TowScene:
    """The lap of 400 s."""
    return lap_scene()


def _lap() -> Values:
    scene = lap()
    exact = work_precision.reference_places(scene, work_precision.REFERENCE_TOLERANCE_M)
    found = {
        f"largest error, {tolerance:g} m a step": 1e3
        * float(np.linalg.norm(work_precision.reference_places(scene, tolerance) - exact, axis=1).max())
        for tolerance in (1e-5, 1e-6, 1e-7)
    }
    end = np.abs(work_precision.reference_places(scene, 1e-7)[-1] - physics_must_reach.LAP_END).max()
    return found | {"end of the lap against the oracle": 1e9 * float(end)}


def _heavier(scene: TowScene) -> TowScene:
    return replace(scene, tether=replace(scene.tether, rest_length=scene.tether.rest_length + 1e-6))


LAP = Check(
    _lap,
    {
        "the tether is 1 µm too long": replaced(_HERE, "lap", result_of(_heavier)),
        "the tolerance counts a hundred-fold": replaced(
            work_precision, "Accuracy", lambda _: lambda tolerance, *rest: Accuracy(100 * tolerance, *rest)
        ),
    },
)


def _engine() -> Values:
    scene = lap()
    found: dict[str, float] = {}
    spent = least_cpu_seconds(lambda: work_precision.reference_places(scene, 1e-6))
    for row in mujoco_engine.mujoco_rows(scene):
        name = f"{row['contact']}, {1e3 * row['step_s']:g} ms"
        found |= {f"MuJoCo, {name}, largest distance": 1e3 * row["error_m"]}
        found |= {f"MuJoCo, {name}, CPU over ours": row["cpu_s"] / spent}
    return found


def _softer(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda scene, *rest, **kwargs: original(
        replace(scene, tether=replace(scene.tether, stiffness=0.02 * scene.tether.stiffness)), *rest, **kwargs
    )


ENGINE = Check(
    _engine,
    {
        "the engine's tether is fifty times as soft": replaced(mujoco_engine, "mujoco_model", _softer),
        "our solver works ten times": replaced(work_precision, "feedback", repeated(10)),
    },
    needs=("mujoco",),
)


def _loads() -> Values:
    """Differences of MuJoCo's loads from the program's, % of the normal force, the largest over the tows."""
    rows = {name: (tow, mujoco_loads.load_row(tow)) for name, tow in mujoco_loads.compared_tows()}
    found: dict[str, float] = {}
    for sole in ("box", "feet"):
        own = {name: (tow, row) for name, (tow, row) in rows.items() if name.startswith(sole)}
        far = {name: row for name, (_, row) in own.items() if "tipping" not in name}
        near = next(row for name, (_, row) in own.items() if "tipping" in name)
        for part in ("normal", "centre") if sole == "box" else ("normal", "centre", "feet"):
            found |= {f"{sole}, {part}": 100 * max(row[part] for row in far.values())}
            found |= {f"{sole} close to tipping, {part}": 100 * near[part]}
    found["shift of the centre, least"] = 100 * min(row["transfer"] for _, row in rows.values())
    found["shift of the centre, most"] = 100 * max(row["transfer"] for _, row in rows.values())
    middle = [
        row["feet"]
        for name, (tow, row) in rows.items()
        if tow.feet and "off the middle" not in name and "25 cm" not in name and "tipping" not in name
    ]
    return found | {"feet, centre of mass in the middle, tow below 0.25 m, feet": 100 * max(middle)}


def _lower(original: Callable[..., Any]) -> Callable[..., Any]:
    """The program lays out the tow with anchor and hinge 1 cm lower."""
    return lambda towed, sliding, tether, ground, hinge_height, *rest: original(
        replace(towed, anchor_height=towed.anchor_height - 0.01), sliding, tether, ground, hinge_height - 0.01, *rest
    )


def _level(problem: TowProblem) -> TowProblem:
    """The program takes hinge and anchor to be at one height."""
    numbers = problem.numbers.copy()
    numbers[RISE] = 0.0
    return problem._replace(numbers=numbers)


LOADS = Check(
    _loads,
    {
        "the program takes anchor and hinge to be 1 cm lower": replaced(mujoco_loads, "tow_problem", _lower),
        "the program's tether lifts nothing": replaced(mujoco_loads, "tow_problem", result_of(_level)),
        "the program's friction is a tenth too small": replaced(
            mujoco_loads, "Coulomb", lambda law: lambda coefficient, rise: law(0.9 * coefficient, rise)
        ),
        "the engine's loads are 1 % too large": replaced(
            mujoco_loads, "engine_loads", result_of(lambda loads: replace(loads, loads=1.01 * loads.loads))
        ),
    },
    needs=("mujoco",),
)


def _wrench() -> Values:
    rows = [*physics_must_reach.pressure_rows(1000), *physics_must_reach.accuracy_rows(40)]
    numbers = numbers_of(rows)
    wrench = [float(value) for name, value in numbers.items() if name.startswith("boundary wrench")]
    return {
        "pressure plane, 1,000 random polygons, imbalance": float(numbers["pressure plane, 1000 random polygons"]),
        "pressure plane, refused": float(numbers["pressure plane, 1000 random polygons, 2"]),
        "boundary wrench, 240 random scenes": max(wrench),
    }


def _one_step(original: Callable[..., Any]) -> Callable[..., Any]:
    """Newton's method for the pressure is content after three steps."""
    return lambda vertices, ends, limit, best: original(vertices, ends, 3, best)


WRENCH = Check(
    _wrench,
    {
        "the wrench is larger by 1e-6": replaced(
            physics_must_reach, "wrench_at_origin", result_of(lambda wrench: tuple(1.000001 * part for part in wrench))
        ),
        "Newton's method for the pressure makes three steps": replaced(contact, "solve_plane", _one_step),
        "Newton's method for the pressure makes three steps, and no residual is looked at": both(
            replaced(contact, "solve_plane", _one_step), replaced(contact, "_RESIDUAL_LIMIT", lambda _: np.inf)
        ),
    },
)


def _speed() -> Values:
    numbers = numbers_of([*physics_must_reach.wrench_rows(), *physics_must_reach.quasistatic_rows()])
    return {
        "boundary wrench": float(numbers["boundary wrench"]),
        "over 129,058 cells": float(numbers["boundary wrench against 129058 cells"]),
        "over 1,446 cells": float(numbers["boundary wrench against 1446 cells"]),
        "mesh, a cell": float(numbers["mesh is a fair opponent"]),
        "QSM, 60,000 steps": float(numbers["QSM, 60,000 steps"]),
        "QSM over 1,446 cells": float(numbers["QSM, 60,000 steps, against 1446 cells"]),
        "QSM by the mesh, headings": float(numbers["QSM by the mesh finds the same headings"]),
    }


SPEED = Check(
    _speed,
    {
        "every wrench is computed ten times": replaced(physics_must_reach, "many_wrenches", repeated(10)),
        "the quasi-static model runs twenty times": replaced(physics_must_reach, "quasistatic_plan", repeated(20)),
        "every mesh is summed five times, and its headings are 1 mrad off": both(
            replaced(physics_must_reach, "many_mesh_wrenches", repeated(5)),
            replaced(physics_must_reach, "plan_on_mesh", result_of(lambda found: found + 1e-3)),
        ),
    },
)


def _stability() -> Values:
    scenes = [physics_stability.judge(*scene) for scene in physics_stability.scenes()]
    verdicts = [scene.verdict for scene in scenes]
    right, silent = verdicts.count(physics_stability.RIGHT), verdicts.count(physics_stability.SILENTLY_WRONG)
    return {
        "scenes": float(len(scenes)),
        "converged to 0.1 mm": float(right),
        "silently wrong": float(silent),
        "ended with a name": float(len(scenes) - right - silent),
        "largest distance": 1e3 * float(np.nanmax([scene.error_m for scene in scenes])),
        "largest difference of the heading": 1e3 * float(np.nanmax([scene.error_rad for scene in scenes])),
    }


STABILITY = Check(
    _stability,
    {
        "the default tolerance is a hundred times as wide": replaced(
            physics_stability, "DEFAULT_TOLERANCE_M", lambda tolerance: 100 * tolerance
        ),
        "no scene starts with a slack tether": replaced(physics_stability, "STARTS", lambda _: {"straight": 0.0}),
        "a motion may have 300 steps": replaced(
            physics_stability, "Accuracy", lambda _: lambda tolerance: Accuracy(tolerance, 300)
        ),
    },
)


def _law() -> Values:
    behind = Makkar(0.06, 400, 40, 0.35, 800, 0)
    given = FrictionSpecification(kinetic=0.35, static=0.396, stiction_velocity=0.0052, friction_velocity=0.07)
    law = makkar.fit_specification(given).law
    speeds = np.linspace(0, 0.5, 20001)
    apart = np.abs(law.coefficient(speeds) - behind.coefficient(speeds))
    sliding = speeds >= given.stiction_velocity
    return {
        "from v_s on": float(apart[sliding].max()),
        "below v_s": float(apart[~sliding].max()),
        "speed of the peak": float(speeds[np.argmax(behind.coefficient(speeds))]),
    }


def _sooner(original: Any) -> Any:
    return lambda peak, rise, decay, *rest: original(peak, rise, 1.05 * decay, *rest)


def _later(original: Any) -> Any:
    # By the numbers that are given: the fit is compiled with the fraction in it.
    longer = math.atanh(0.99) / math.atanh(0.9)
    return lambda given: original(replace(given, friction_velocity=longer * given.friction_velocity))


LAW = Check(
    _law,
    {
        "Stribeck's part has settled at v_k to a tenth, not a hundredth": replaced(makkar, "fit_specification", _later),
        "the law behind loses its Stribeck part 5 % sooner": replaced(_HERE, "Makkar", _sooner),
    },
)


def _cold() -> Values:
    numbers = numbers_of(physics_must_reach.cold_rows())
    return {
        "first call after installing": float(numbers["first call after installing"]),
        "later processes": float(numbers["later processes, start to result"]),
    }


def _compiling_twice(original: Callable[..., Any]) -> Callable[..., Any]:
    """A process that finds no machine code, and one more."""

    def run(command: Any, *, env: Any, **options: Any) -> Any:
        for _ in range(2):
            with TemporaryDirectory() as empty:
                done = original(command, env=env | {"NUMBA_CACHE_DIR": empty}, **options)
        return done

    return run


COLD = Check(
    _cold,
    {
        "every process is started four times": replaced(physics_must_reach.subprocess, "run", repeated(4)),
        "machine code is not kept, and every process is started twice": replaced(
            physics_must_reach.subprocess, "run", _compiling_twice
        ),
    },
)

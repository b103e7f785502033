"""Feedback dynamics against MuJoCo on the lap of tests/oracles.py: time and error of both, in one run.

    python -m studies.tables.physics_mujoco [--period 400]

The cube, the tether (a tendon that only pulls) and the path of the hinge are the same; MuJoCo has Coulomb friction at
points, see ``studies.comparators.mujoco_engine``. Error is that of the cube's centre against our own solution at a
tight tolerance, which tests/physics/test_dynamics.py holds to the oracle. Times are CPU times, the least of several
runs; MuJoCo's include setting the hinge from Python, some 5 % of it.
"""

from __future__ import annotations

import argparse
from functools import partial

import numpy as np

from studies.comparators.mujoco_engine import mujoco_rows
from studies.comparators.tow_scenes import lap_scene
from studies.comparators.work_precision import REFERENCE_TOLERANCE_M, reference_places
from studies.costs import least_cpu_seconds
from towval.commands.console import errors_reported


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--period", type=float, default=400.0, help="duration of the lap [s]")
    scene = lap_scene(parser.parse_args().period)
    exact = reference_places(scene, REFERENCE_TOLERANCE_M)
    theirs = mujoco_rows(scene)
    reference = theirs[0]["cpu_s"]
    print(f"{'':32s} {'CPU [ms]':>10s} {'faster':>8s} {'RMS [mm]':>10s} {'max [mm]':>10s}")
    for tolerance in (1e-5, 1e-6, 1e-7, 1e-8):
        cpu = least_cpu_seconds(partial(reference_places, scene, tolerance))
        error = np.linalg.norm(reference_places(scene, tolerance) - exact, axis=1)
        _print(f"towval, {tolerance:.0e} m a step", cpu, reference, np.sqrt(np.mean(error**2)), error.max())
    for row in theirs:
        name = f"MuJoCo, {row['contact']}, {1000 * row['step_s']:.0f} ms"
        if row["outcome"] == "computed":
            _print(name, row["cpu_s"], reference, row["rms_m"], row["error_m"])
        else:
            print(name, row["outcome"])


def _print(name: str, cpu: float, reference: float, rms: float, largest: float) -> None:
    print(f"{name:32s} {1000 * cpu:10.1f} {reference / cpu:8.1f} {1000 * rms:10.4f} {1000 * largest:10.4f}")


if __name__ == "__main__":
    main()

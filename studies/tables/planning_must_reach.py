"""What planning must reach, measured and printed as one table.

    python -m studies.tables.planning_must_reach

Times are CPU times of a second call, so that compilation is left out.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

import numpy as np

from studies.costs import cpu_seconds, least_cpu_seconds
from studies.paper.closed_loop import planned_loop
from studies.paper.nominal import cube_nominal, general_nominal
from studies.paper.scene import CURVES, PaperScene, paper_scene
from studies.rover_geometry import constraint_residual, feasible_pieces, is_feasible
from towval.commands.console import errors_reported
from towval.io.yaml_text import read_yaml
from towval.planning.scene import resting_patch

PLAN = Path(__file__).resolve().parents[2] / "src" / "towval" / "workflow" / "plan.yaml"

SAMPLE = 8
"""The response surface is timed on a grid of so many by so many points, spread over the whole of it."""


def quasistatic(scene: PaperScene) -> tuple[str, float, str]:
    """CPU time of the quasi-static model."""
    worst = max(
        least_cpu_seconds(partial(general_nominal, scene, curve, centre), 1)
        for curve in CURVES
        for centre in scene.general
    )
    return "QSM of one path, 60,000 steps, the slowest of 12 [s]", worst, "under 1"


def closed_loop(scene: PaperScene) -> tuple[str, float, str]:
    """CPU time of a closed loop."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, "rounded_square", scene.planner_step)
    spent = least_cpu_seconds(lambda: planned_loop(scene, patch, nominal), 1)
    return "one closed loop on the rounded square [s]", spent, "under 1"


def response_surface(scene: PaperScene) -> tuple[str, float, str]:
    """CPU time of both response surfaces, from a sample."""
    patch, total = resting_patch(scene), 0.0
    for curve in ("lemniscate", "rounded_square"):
        nominal = cube_nominal(scene, patch, curve, scene.planner_step)
        for threshold in np.linspace(0.02, 1.5, SAMPLE):
            for steps in np.linspace(0, 600, SAMPLE).astype(int):
                settings = {"threshold": threshold, "look_ahead_steps": steps}
                total += cpu_seconds(partial(planned_loop, scene, patch, nominal, **settings))
    minutes = total / SAMPLE**2 * 40**2 / 2 / 60
    return "both response surfaces, 40 × 40 points, on 2 cores, from a sample [min]", minutes, "under 20"


def constraints(scene: PaperScene) -> list[tuple[str, float, str]]:
    """Kinematic residuals and steering angles along plans."""
    patch, residual, outside = resting_patch(scene), 0.0, -np.inf
    for curve in CURVES:
        nominal = cube_nominal(scene, patch, curve, scene.planner_step)
        for threshold in (0.02, 0.2, 1.0):
            plan = planned_loop(scene, patch, nominal, threshold=threshold).rover
            left = constraint_residual(scene.rover, plan.steering, plan.wheel_rates, plan.twist)
            residual = max(residual, float(left.max()))
            least, greatest = scene.rover.steering_ranges.T
            outside = max(outside, float(np.maximum(least - plan.steering, plan.steering - greatest).max()))
    return [
        ("rolling and sliding residual along 12 plans, of the speed", residual, "at most 1e-9"),
        ("farthest a steering angle gets beyond its range [rad]", outside, "at most 0"),
    ]


def region(scene: PaperScene) -> tuple[str, float, str]:
    """The feasible region against brute force."""
    points = np.random.default_rng(0).uniform(-6, 6, size=(100_000, 2))
    pieces = np.any([piece.contains(points) for piece in feasible_pieces(scene.rover, 6.0)], axis=0)
    swept = np.ones(len(points), dtype=bool)
    for position, (least, greatest) in zip(scene.rover.wheel_positions, scene.rover.steering_ranges, strict=True):
        angle = np.linspace(least, greatest, 181)
        signs = np.signbit((points - position) @ np.stack([np.cos(angle), np.sin(angle)]))
        swept &= (signs[:, 1:] != signs[:, :-1]).any(axis=1)
    wrong = int((pieces != swept).sum() + (is_feasible(scene.rover, points) != swept).sum())
    return "of 100,000 centres, those on which region and brute force differ", wrong, "0"


@errors_reported()
def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    scene = paper_scene(read_yaml(PLAN))
    rows = [quasistatic(scene), closed_loop(scene), response_surface(scene), *constraints(scene), region(scene)]
    for what, value, wanted in rows:
        print(f"{what:72} {value:10.3g}   {wanted}")


if __name__ == "__main__":
    main()

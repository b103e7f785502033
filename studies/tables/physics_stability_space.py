"""The tow in three dimensions over stiffness, damping, heights, speed, sticking and stops: right, flagged or wrong?

    python -m studies.tables.physics_stability_space

Every fifth, chosen at random, of 216 scenes: κ from 1e2 to 1e5 N/m, damping up to the critical, the hinge on the floor
or 0.2 m up, speeds from 2 mm/s to 0.5 m/s, a law that sticks or creeps, with a stop or without. "Right" is a converged
outcome within 0.1 mm of a hundred times tighter tolerance; another outcome is named; the rest is silently wrong and
gives exit code 1.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from typing import NamedTuple

import numpy as np

from towval.commands.console import errors_reported
from towval.model import FrictionLaw, Patch, SimulatedMotion, Tether, TimedPath, TowedObject
from towval.physics.dynamics import Accuracy, Outcome, feedback
from towval.physics.friction_laws import Makkar, risen_law
from towval.physics.spatial.tow import Sticking

ALLOWED_M, SHARE, SEED = 1e-4, 0.2, 5
_SQUARE = Patch(0.2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))
_CENTRE, _ANCHOR = np.array([0.02, -0.03]), np.array([0.2, 0.0])
_MASS, _WAY_M, _STEPS = 5.0, 1.0, 100_000


class Scene(NamedTuple):
    """Stiffness [N/m], damping over the critical, height of the hinge [m], speed [m/s]; if it sticks, and stops."""

    stiffness: float
    damping: float
    rise: float
    speed: float
    sticks: bool
    stops: bool


def scenes() -> list[Scene]:
    """Those that are run."""
    values = (1e2, 1e3, 1e5), (0.0, 0.1, 1.0), (0.0, 0.2), (2e-3, 0.05, 0.5), (False, True), (False, True)
    rng = np.random.default_rng(SEED)
    return [Scene(*each) for each in itertools.product(*values) if rng.random() <= SHARE]


def solve(scene: Scene, tolerance_m: float) -> SimulatedMotion:
    """The motion with a tolerance of a step [m]."""
    height = 0.05 if scene.rise else 0.0
    towed = TowedObject(_SQUARE, _MASS, _CENTRE, 0.13, _ANCHOR, height, 2 * height)
    tether = Tether(0.6, scene.stiffness, scene.damping * 2 * np.sqrt(scene.stiffness * _MASS))
    time = np.linspace(0, _WAY_M / scene.speed, 101)
    along, third = scene.speed * time, _WAY_M / 3
    if scene.stops:
        along = np.where(along < third, along, np.maximum(third, along - third))
    level = np.sqrt(0.36 - (scene.rise - height) ** 2)
    hinge = TimedPath(time, np.column_stack([0.195 + level + along, 0.1 * np.sin(3 * along)]))
    law: FrictionLaw = risen_law(0.4, 0.35, 1e-5, 0.01) if scene.sticks else Makkar(0.06, 400, 40, 0.35, 800, 0)
    return feedback(
        towed, law, tether, hinge, (0, 0, 0), time, accuracy=Accuracy(tolerance_m, _STEPS), hinge_height=scene.rise,
        sticking=Sticking(0.4, 2e-5) if scene.sticks else None,
    )  # fmt: skip


def judge(scene: Scene) -> tuple[str, float]:
    """Verdict and largest error [m] of a scene."""
    motion, reference = solve(scene, 1e-7), solve(scene, 1e-9)
    for each, title in ((motion, ""), (reference, "reference: ")):
        if each.outcome != Outcome.CONVERGED:
            return f"{title}{each.outcome}", np.nan
    error = float(np.abs(motion.pose - reference.pose)[:, :2].max())
    return ("right" if error <= ALLOWED_M else "SILENTLY WRONG"), error


@errors_reported()
def main() -> int:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    found = [(scene, *judge(scene)) for scene in scenes()]
    print(f"{'κ [N/m]':>9s} {'damping':>8s} {'rise':>5s} {'m/s':>6s} sticks stops {'verdict':>24s} {'error [m]':>10s}")
    for s, verdict, error in found:
        flags = f"{s.sticks!s:>6s} {s.stops!s:>5s}"
        print(f"{s.stiffness:9.0e} {s.damping:8.1f} {s.rise:5.1f} {s.speed:6.3f} {flags} {verdict:>24s} {error:10.1e}")
    verdicts = [verdict for _, verdict, _ in found]
    wrong = verdicts.count("SILENTLY WRONG")
    right = verdicts.count("right")
    print(f"{len(found)} scenes: {right} right to {np.nanmax([e for *_, e in found]):.1e} m, {wrong} silently wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

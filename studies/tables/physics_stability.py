"""Feedback dynamics over stiffness, stiction velocity and start: right, flagged or silently wrong?

    python -m studies.tables.physics_stability

κ from 1e2 to 1e6 N/m, v_s from 1e-2 to 1e-6 m/s, tether slack, just straight or stretched at the start. Each
scene is solved with the default tolerance and, for reference, with one a thousand times tighter. "Right" is a
converged outcome within 0.1 mm of the reference all along, by the place of the object's body frame; another outcome is
named; the rest is silently wrong and gives exit code 1. The heading's difference stands beside it.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from typing import NamedTuple

import numpy as np

from studies.maps.integrators import CUBE
from towval.commands.console import errors_reported
from towval.model import SimulatedMotion, Tether, TimedPath
from towval.physics.dynamics import DEFAULT_TOLERANCE_M, Accuracy, Outcome, feedback
from towval.physics.friction_laws import Coulomb

STARTS = {"slack": -0.05, "straight": 0.0, "stretched": 0.01}
ALLOWED_M = 1e-4
RIGHT, SILENTLY_WRONG = "right", "SILENTLY WRONG"


def hinge_path(stretch: float) -> TimedPath:
    """Five seconds of a curved tow that stops halfway and backs up a little, so that the tether slackens."""
    time = np.linspace(0, 5, 251)
    advance = 0.08 * time - 0.11 * np.sin(np.pi * time / 2.5) * (time > 1.25) * (time < 3.75)
    return TimedPath(time, np.column_stack([0.8 + stretch + advance, 0.3 * advance**2 + 0.05 * advance]))


def solve(stiffness: float, stiction: float, stretch: float, tolerance: float) -> SimulatedMotion:
    """The motion with a tolerance [m]."""
    tether, law = Tether(0.6, stiffness), Coulomb(0.35, stiction)
    times = np.linspace(0, 5, 51)
    accuracy = Accuracy(tolerance)
    return feedback(CUBE, law, tether, hinge_path(stretch), (0, 0, 0), times, accuracy=accuracy)


class Judged(NamedTuple):
    """Verdict, largest distance [m] and difference of the heading [rad] from the reference, and steps of a scene."""

    verdict: str
    error_m: float
    error_rad: float
    steps: float


def scenes() -> list[tuple[float, float, float]]:
    """Stiffness [N/m], stiction velocity [m/s] and stretch at the start [m]."""
    stiffnesses, stictions = 10.0 ** np.arange(2, 7), 10.0 ** -np.arange(2, 7)
    return list(itertools.product(stiffnesses, stictions, STARTS.values()))


def judge(stiffness: float, stiction: float, stretch: float) -> Judged:
    """One scene beside its reference."""
    motion = solve(stiffness, stiction, stretch, DEFAULT_TOLERANCE_M)
    steps = motion.statistics["steps"] + motion.statistics["rejections"]
    if motion.outcome != Outcome.CONVERGED:
        return Judged(str(motion.outcome), np.nan, np.nan, steps)
    reference = solve(stiffness, stiction, stretch, DEFAULT_TOLERANCE_M / 1000)
    if reference.outcome != Outcome.CONVERGED:
        return Judged(f"reference: {reference.outcome}", np.nan, np.nan, steps)
    apart = motion.pose - reference.pose
    error = float(np.linalg.norm(apart[:, :2], axis=1).max())
    return Judged(RIGHT if error <= ALLOWED_M else SILENTLY_WRONG, error, float(np.abs(apart[:, 2]).max()), steps)


@errors_reported()
def main() -> int:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    wrong = 0
    heads = f"{'verdict':>16s} {'[m]':>10s} {'[rad]':>10s} {'steps':>8s}"
    print(f"{'κ [N/m]':>9s} {'v_s [m/s]':>10s} {'stretch [m]':>12s} {heads}")
    for scene in scenes():
        found = judge(*scene)
        wrong += found.verdict == SILENTLY_WRONG
        print(
            f"{scene[0]:9.0e} {scene[1]:10.0e} {scene[2]:12.2f} {found.verdict:>16s} {found.error_m:10.1e} "
            f"{found.error_rad:10.1e} {found.steps:8.0f}",
            flush=True,
        )
    print(f"{wrong} of {len(scenes())} silently wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

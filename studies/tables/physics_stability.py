"""Feedback dynamics over stiffness, stiction velocity and start: right, flagged or silently wrong?

    python -m studies.tables.physics_stability

κ from 1e2 to 1e6 N/m, v_s from 1e-2 to 1e-6 m/s, tether slack, just straight or stretched at the start. Each
scene is solved with the default tolerance and, for reference, with one a thousand times tighter. "Right" is a
converged outcome within 0.1 mm of the reference all along; another outcome is named; the rest is silently wrong
and gives exit code 1.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from studies.maps.integrators import CUBE
from towval.model import SimulatedMotion, Tether, TimedPath
from towval.physics.dynamics import DEFAULT_TOLERANCE_M, Accuracy, Outcome, feedback
from towval.physics.friction_laws import Coulomb

STARTS = {"slack": -0.05, "straight": 0.0, "stretched": 0.01}
ALLOWED_M = 1e-4


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


def judge(stiffness: float, stiction: float, stretch: float) -> tuple[str, float, float]:
    """Verdict, largest error [m or rad] and steps of one scene."""
    motion = solve(stiffness, stiction, stretch, DEFAULT_TOLERANCE_M)
    steps = motion.statistics["steps"] + motion.statistics["rejections"]
    if motion.outcome != Outcome.CONVERGED:
        return motion.outcome, np.nan, steps
    reference = solve(stiffness, stiction, stretch, DEFAULT_TOLERANCE_M / 1000)
    if reference.outcome != Outcome.CONVERGED:
        return f"reference: {reference.outcome}", np.nan, steps
    error = float(np.abs(motion.pose - reference.pose).max())
    return ("right" if error <= ALLOWED_M else "SILENTLY WRONG"), error, steps


def main() -> int:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    wrong = 0
    print(f"{'start':10s} {'κ [N/m]':>9s} {'v_s [m/s]':>10s} {'verdict':>16s} {'error [m]':>10s} {'steps':>8s}")
    for start, stretch in STARTS.items():
        for stiffness in 10.0 ** np.arange(2, 7):
            for stiction in 10.0 ** -np.arange(2, 7):
                verdict, error, steps = judge(stiffness, stiction, stretch)
                wrong += verdict == "SILENTLY WRONG"
                print(
                    f"{start:10s} {stiffness:9.0e} {stiction:10.0e} {verdict:>16s} {error:10.1e} {steps:8.0f}",
                    flush=True,
                )
    print(f"{wrong} of 75 silently wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

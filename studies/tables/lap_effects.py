"""What each effect of a real tow adds to the CPU time of the lap, over the planar model, in one run.

    python -m studies.tables.lap_effects [--rounds 12]

A lap of 400 s of a cube on one sole or four feet. Effects are added one after another; a region of the floor, whose
edge is a jump of the friction, by itself.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from studies.comparators.tow_scenes import lap_scene
from studies.costs import Timed, take_turns
from towval.commands.console import errors_reported
from towval.model import FloorRegion, Ground, Patch, SimulatedMotion, Sliding, Tether, TowedObject
from towval.physics import Coulomb, feedback
from towval.physics.dynamics import LEVEL
from towval.physics.spatial.tow import Sticking

LAP = lap_scene()
LAW = Coulomb(0.35, 1e-3)
HINGE_HEIGHT_M = 0.25
SLOPE = np.array([0.003, 0.002])
REGION = FloorRegion(np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]), 1.1)


@dataclass(frozen=True)
class Tow:
    """What is towed, on what, by what, and how high the hinge is [m]."""

    towed: TowedObject
    sliding: Sliding
    tether: Tether
    ground: Ground = LEVEL
    hinge_height: float = 0.0
    sticking: Sticking | None = None

    def run(self) -> SimulatedMotion:
        """Simulate the lap."""
        scene = self.tether, LAP.hinge, LAP.start_pose, LAP.times
        more = {"ground": self.ground, "hinge_height": self.hinge_height, "sticking": self.sticking}
        return feedback(self.towed, self.sliding, *scene, **more)


def tows(towed: TowedObject) -> dict[str, Tow]:
    """The tows that are timed, by what they take in."""
    planar = Tow(towed, Sliding(LAW), LAP.tether)
    high = replace(towed, anchor_height=0.15, centre_of_mass_height=0.1)
    shifted = replace(planar, towed=high, ground=Ground(slope=SLOPE), hinge_height=HINGE_HEIGHT_M)
    turned = replace(shifted, sliding=Sliding(LAW, across_over_along=1.05, radius_over_planar=1.02))
    stiffening = replace(LAP.tether, stiffening=0.3, full_load=20.0)
    sagging = replace(stiffening, mass_per_length=0.02)
    sticking = Sticking(0.4, 1e-3)
    every = replace(turned, tether=replace(sagging, damping=5.0), sticking=sticking)
    return {
        "planar": planar,
        "heights, slope": shifted,
        "and anisotropy, friction radius": turned,
        "and stiffening": replace(turned, tether=stiffening),
        "and a tether of 0.02 kg/m": replace(turned, tether=sagging),
        "and sticking": replace(turned, tether=sagging, sticking=sticking),
        "and a damping of 5 N s/m": every,
        "and a region of the floor": replace(every, ground=Ground(slope=SLOPE, regions=(REGION,))),
    }


def on_four_feet(towed: TowedObject) -> TowedObject:
    """The same object on feet of 40 mm at its corners."""
    foot = 0.02 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    first, *others = (foot + 0.18 * corner for corner in 50 * foot)
    return replace(towed, patch=Patch(first, further=tuple(others)))


def timed_laps(rounds: int) -> dict[str, Timed[SimulatedMotion]]:
    """All laps, by sole and by what they take in, timed in turns."""
    calls: dict[str, Callable[[], SimulatedMotion]] = {}
    for sole, towed in (("one sole", LAP.towed), ("four feet", on_four_feet(LAP.towed))):
        calls |= {f"{sole}: {name}": tow.run for name, tow in tows(towed).items()}
    return take_turns(calls, rounds)


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=12, help="the least of so many is taken")
    timed = timed_laps(parser.parse_args().rounds)
    for name, spent in timed.items():
        planar = timed[f"{name.split(':')[0]}: planar"].cpu_s
        steps = spent.result.statistics["steps"]
        print(f"{name:45}{1e3 * spent.cpu_s:8.1f} ms{spent.cpu_s / planar:7.2f}{steps:8.0f} steps")


if __name__ == "__main__":
    main()

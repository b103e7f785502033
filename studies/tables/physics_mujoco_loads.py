"""Normal loads of a block towed at height: MuJoCo's rigid body in three dimensions beside the package's.

    python -m studies.tables.physics_mujoco_loads

Differences of means over a tow at 5 mm/s, in % of the normal force: of the sum of the loads, of their centre over
half the side, and the largest of a foot, with the part of it that has no resultant (+ - - +), which statics leaves
open; then how far the tow shifts the centre, and the scatter of MuJoCo's sum of loads, large where it hops.
See ``studies.comparators.mujoco_loads``. Exit code 1 where sum, centre or a foot differ by 1 % or more.
"""

from __future__ import annotations

import argparse
import sys

from studies.comparators.mujoco_engine import is_installed
from studies.comparators.mujoco_loads import compared_tows, load_row
from towval.commands.console import errors_reported

ALLOWED = 0.01
COLUMNS = {
    "normal": "sum",
    "centre": "centre",
    "feet": "feet",
    "self_stress": "open part",
    "transfer": "shift",
    "scatter": "scatter",
}
"""Entries of a row by the heads of their columns."""


@errors_reported()
def main() -> int:
    """Print the table; 1 where a line does not hold."""
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    if not is_installed():
        print("skipped: mujoco is not installed, the extra bench")
        return 0
    print(f"{'differences in % of N':58s}" + "".join(f"{name:>10s}" for name in COLUMNS.values()))
    missed = 0
    for name, tow in compared_tows():
        row = load_row(tow)
        holds = all(not row[key] >= ALLOWED for key in ("normal", "centre", "feet"))
        missed += not holds
        values = "".join(f"{100 * row[key]:10.3f}" for key in COLUMNS)
        print(f"{name:58s}{values}  {'holds' if holds else 'MISSED'}", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())

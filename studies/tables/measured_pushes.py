"""Measured pushes: what friction models predict of them, nothing trained, beside fitted and published models.

    python -m studies.tables.measured_pushes FOLDER [--quick]

FOLDER holds ``supports.csv``, ``pushes.csv`` and a CSV file a log. Without it nothing is computed and the reason is
printed. Exit code 1 where a line does not hold. ``--quick`` leaves out the courses, the fits and the whole face.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from studies.real.measured_pushes import PUBLISHED, foot_rows, scale_lines, slow_rows
from studies.real.push_data import read_logs
from towval.commands.console import errors_reported


@errors_reported()
def main(arguments: list[str] | None = None) -> int:
    """Print the table; 1 where a line does not hold."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--quick", action="store_true", help="only what takes seconds")
    given = parser.parse_args(arguments)
    absent = [name for name in ("supports.csv", "pushes.csv") if not (given.folder / name).is_file()]
    if absent:
        print(f"skipped: {given.folder} has no {' and no '.join(absent)}; the data is not part of the repository")
        return 0
    logs = read_logs(given.folder)
    feet, faces = [log for log in logs if len(log.feet)], [log for log in logs if not len(log.feet)]
    tables = [foot_rows(feet)]
    if not given.quick:
        tables += [scale_lines(feet), slow_rows(feet, faces[0])]
    missed = 0
    print(f"published: {PUBLISHED}\nangles in degrees: median (mean)\n{'what':60s} {'at least':14s} measured")
    for rows in tables:
        for what, wanted, measured, holds in rows:
            missed += not holds
            outcome = ("holds" if holds else "MISSED") if wanted else ""
            print(f"{what:60s} {wanted:14s} {measured:44s} {outcome}".rstrip(), flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())

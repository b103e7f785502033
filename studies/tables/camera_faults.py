"""Faults of cameras, planted into footage whose truth is known, and how each ended.

    python -m studies.tables.camera_faults [--quick] [--poses] [--longer 0.04] [--footage FOLDER:RUN:SECONDS]
                                         [--faults creep dropped] [--tows 7700:10]

``--footage FOLDER:RUN:SECONDS`` for each run. A cell is one fault at one strength in one run; the row that is printed
for a fault gives, for each strength, the worst over the runs. ``--tows FIRST:COUNT`` takes synthetic tows of so many
seeds instead: then a row counts, for each strength, how the tows ended.
"""

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from studies.camera_faults.faults import FAULTS, Fault
from studies.camera_faults.tows import filmed_tow
from studies.camera_faults.trial import Footage, footage, tried
from towval.commands import calibrate
from towval.commands.console import errors_reported

_SAMPLE = "data_samples/lab_small:a:8"
OUTCOMES = ("corrected", "covered", "reported", "silently wrong")
"""How poses or a verdict can end, the best first."""


def rows(
    source: Footage, camera: Path, faults: Sequence[Fault], strengths: Sequence[int], **how: Any
) -> Iterator[dict[str, object]]:
    """A row a cell; ``how`` as :func:`tried` takes it."""
    for fault in faults:
        for i in strengths:
            with tempfile.TemporaryDirectory() as folder:
                result = tried(source, fault, fault.strengths[i], Path(folder), camera, **how)
            cell = {"footage": source.name, "fault": fault.name, "strength": fault.strengths[i], "unit": fault.unit}
            yield cell | asdict(result)


@contextmanager
def filmed(entry: str) -> Iterator[tuple[Footage, Path]]:
    """The footage of ``FOLDER:RUN:SECONDS``, and the calibration of its camera."""
    folder, run, seconds = entry.split(":")
    with tempfile.TemporaryDirectory() as scratch:
        camera = Path(scratch) / "camera.mcap"
        calibrate.run(Path(folder), camera)
        yield footage(Path(folder), run, float(seconds), camera), camera


def counted(table: pd.DataFrame) -> str:
    """How the poses of all tows ended, as a table in Markdown: a row a fault and strength."""
    lines = ["| fault | " + " | ".join(OUTCOMES) + " | off, median | findings |", "|---" * (len(OUTCOMES) + 3) + "|"]
    for (fault, strength, unit), own in table.groupby(["fault", "strength", "unit"], sort=False):
        counts = own.poses.value_counts()
        cells = [str(counts.get(outcome, 0) or "") for outcome in OUTCOMES]
        off = f"{own.rms_mm.median():.1f} mm" if own.rms_mm.notna().any() else "refused"
        often = own.codes.explode().value_counts()
        codes = [code for code, count in often.items() if count >= len(own) / 2]
        lines.append(
            f"| {fault}, {strength:g} {unit}".strip() + f" | {' | '.join(cells)} | {off} | {', '.join(codes)} |"
        )
    return "\n".join(lines)


def printed(table: pd.DataFrame) -> str:
    """The map as a table in Markdown: for each strength the worst outcome over the runs.

    A cell holds the outcome of the poses and their RMS error in the worst run, and the outcome of the verdict where
    there is one; a row ends with the findings.
    """
    strengths = [f" {word} |" for word in ("weak", "middle", "strong")]
    most = int(table.groupby("fault").strength.nunique().max())
    lines = ["| fault |" + "".join(strengths if most == len(strengths) else strengths[1:2]) + " findings |"]
    lines.append("|---" * (most + 2) + "|")
    for (fault, unit), own in table.fillna({"said": ""}).groupby(["fault", "unit"], sort=False, dropna=False):
        cells = [_cell(cell, "" if pd.isna(unit) else unit) for _, cell in own.groupby("strength", sort=False)]
        codes = dict.fromkeys(code for found in own.codes for code in found)
        lines.append(f"| {fault} | {' | '.join(cells)} | {', '.join(codes)} |")
    return "\n".join(lines)


def _cell(runs: pd.DataFrame, unit: str) -> str:
    poses, verdict = (max(runs[column], key=OUTCOMES.index) for column in ("poses", "verdict"))
    text = f"{runs.strength.iloc[0]:g} {unit}".strip() + f": {poses}"
    if runs.said.str.startswith("refused").any():
        return f"{text} (refused)"
    return f"{text}, {runs.rms_mm.max():.1f} mm" + (f" / {verdict}" if runs.said.any() else "")


@errors_reported()
def main() -> None:
    """Plant the faults, write a row a cell, and print the map."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--footage", nargs="+", default=[_SAMPLE], metavar="FOLDER:RUN:SECONDS")
    parser.add_argument("--tows", metavar="FIRST:COUNT", help="synthetic tows, by their seeds, instead of footage")
    parser.add_argument("--faults", nargs="+", choices=[fault.name for fault in FAULTS], metavar="FAULT")
    parser.add_argument("--quick", action="store_true", help="the middle strength alone")
    parser.add_argument("--poses", action="store_true", help="no verdict, which takes most of the time")
    parser.add_argument(
        "--longer", type=float, default=0.0, metavar="M", help="how much too long the model's tether is"
    )
    parser.add_argument("--out", type=Path, default=Path("results/camera_faults.csv"))
    given = parser.parse_args()
    faults = [fault for fault in FAULTS if not given.faults or fault.name in given.faults]
    given.out.parent.mkdir(parents=True, exist_ok=True)
    cells: list[dict[str, object]] = []
    first, count = map(int, given.tows.split(":")) if given.tows else (0, 0)
    sources = [filmed_tow(first + i) for i in range(count)] or [filmed(entry) for entry in given.footage]
    strengths, how = [1] if given.quick else [0, 1, 2], {"judged": not given.poses, "longer_m": given.longer}
    for source in sources:
        with source as (footage_of, camera):
            for cell in rows(footage_of, camera, faults, strengths, **how):
                cells.append(cell)
                pd.DataFrame(cells).to_csv(given.out, index=False)
                print("  ".join(f"{value:.2f}" if isinstance(value, float) else f"{value}" for value in cell.values()),
                      flush=True)  # fmt: skip
    print((counted if count else printed)(pd.DataFrame(cells)))


if __name__ == "__main__":
    main()

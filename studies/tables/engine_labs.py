"""Laboratories that MuJoCo renders, through the whole workflow: how far tracked poses are off, beside what is stated.

Neither pictures nor lens nor the motion of the object come from code of the package. Each row is a campaign of its own.

python -m studies.tables.engine_labs [--seeds 1 2 3] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from studies.frame import Row
from studies.worlds.engine_campaign import write_engine_campaign
from studies.worlds.engine_lab import can_render
from towval.io.records import read_tracks
from towval.model import Array, Track
from towval.model.geometry import wrapped

_WORLDS = ("level", "heights", "floor", "tether", "lab", "engine")
"""Worlds of the runs, one after the other."""

_ALLOWED_M, _DEVIATIONS = 0.0005, 3.0


def engine_lab_rows(seeds: Iterable[int], folder: Path) -> list[Row]:
    """Render, run and measure a campaign for each seed; campaigns and results are left in a folder.

    Returns
    -------
    list of dict
        ``seed``, ``world``, ``verdict``, ``findings`` and by body ``rms_mm``, ``worst`` (distance from the truth over
        three stated deviations and 0.5 mm, at most) and ``within_2_std`` (share of coordinates); of a run that was
        refused only the reason in ``findings``.
    """
    return [_row(seed, folder) for seed in seeds]


def _row(seed: int, folder: Path) -> Row:
    world = _WORLDS[seed % len(_WORLDS)]
    campaign, results = folder / f"lab_{seed}", folder / "results"
    truth = write_engine_campaign(campaign, world, seed)
    line = [sys.executable, "-m", "towval", "run", str(campaign), "--results", str(results), "--cores", "1"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    row: Row = {"seed": seed, "world": world}
    summary = results / campaign.name / "summary.csv"
    if done.returncode or not summary.exists():
        reason = [text for text in done.stderr.splitlines() if text.startswith("towval:")]
        return row | {"verdict": "refused", "findings": reason[0] if reason else done.stderr[-200:]}
    told = pd.read_csv(summary, keep_default_na=False).iloc[0]
    row |= {"verdict": told["verdict"], "findings": told["findings"]}
    for name, track in read_tracks(results / campaign.name / "a" / "track.mcap").items():
        row |= {f"{name}_{what}": value for what, value in _off(track, truth[name]).items()}
    return row


def _off(track: Track, truth: Array) -> dict[str, float]:
    """How far poses are off that were seen in pictures of the true poses (n, 3)."""
    assert track.total_covariance is not None
    off = (track.pose - truth)[track.seen]
    off[:, 2] = wrapped(off[:, 2])
    std = np.sqrt(np.diagonal(track.total_covariance[track.seen], axis1=1, axis2=2))
    distance, stated = np.hypot(*off[:, :2].T), np.hypot(*std[:, :2].T)
    return {
        "rms_mm": 1e3 * float(np.sqrt(np.mean(distance**2))),
        "worst": float((distance / (_DEVIATIONS * stated + _ALLOWED_M)).max()),
        "within_2_std": float(np.mean(np.abs(off) <= 2 * std)),
    }


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(1, 13)))
    parser.add_argument("--keep", type=Path, help="folder for campaigns and results, which must be new")
    given = parser.parse_args()
    if not can_render():
        sys.exit("MuJoCo is not there or cannot render: install the extra bench, and a system with EGL")
    with tempfile.TemporaryDirectory() as scratch:
        rows = engine_lab_rows(given.seeds, given.keep or Path(scratch))
    print(pd.DataFrame(rows).round(3).to_string(index=False))


if __name__ == "__main__":
    main()

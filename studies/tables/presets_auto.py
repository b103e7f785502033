"""Preset auto beside fine on a campaign: CPU time, how far its paths move, and what they may move.

    python -m studies.tables.presets_auto [path/to/campaign] [--preset draft]

Both are run by the workflow from the calibration to the verdict, without figures. A measured or simulated path may move
by a third of the measurement uncertainty, root mean square over the run.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from studies.costs import wall_and_cpu_seconds
from studies.tables.workflow_time import REPOSITORY, SAMPLE
from towval.commands.console import errors_reported
from towval.io.campaign import Campaign, load_campaign
from towval.io.records import read_calibration, read_comparison, read_simulated, read_tracks
from towval.model import Choice, SimulatedMotion, Track
from towval.selection.margin import SHARE, measurement_std_m, seen_places

PRESETS = ("auto", "fine")


def run_workflow(campaign: Campaign, preset: str, results: Path) -> None:
    """All runs under a preset, up to their verdicts."""
    targets = [str(results / campaign.folder.name / run / "compare.mcap") for run in campaign.runs]
    keys = [f"campaign={campaign.folder}", f"results={results}", f"preset={preset}"]
    line = [sys.executable, "-m", "snakemake", "--cores", "2", "--quiet", "all", "--nolock", *targets]
    line += ["--config", *keys]
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL, cwd=REPOSITORY)


def moved_mm(one: Track | SimulatedMotion, other: Track | SimulatedMotion) -> float:
    """RMS distance of two motions with ``time_s`` and ``pose`` at their common times [mm]."""
    _, rows, others = np.intersect1d(one.time_s, other.time_s, return_indices=True)
    gap = (one.pose[rows] - other.pose[others])[:, :2]
    return 1e3 * float(np.sqrt(np.nanmean(np.sum(gap**2, axis=1))))


@dataclass(frozen=True)
class Beside:
    """A run under auto, or another preset, beside the same run under fine: how far its measured and simulated path
    ``moved`` and may move, ``path_rms`` of simulated minus measured under both, all [mm], both verdicts, and what the
    first chose."""

    moved: tuple[float, float]
    allowed: float
    path_rms: tuple[float, float]
    verdicts: tuple[str, str]
    chosen: tuple[Choice, ...]


def beside(campaign: Campaign, run: str, folders: Sequence[Path]) -> Beside:
    """Compare a run in the campaign's results under two presets, the finer last."""
    tracks = [read_tracks(folder / run / "track.mcap")["object"] for folder in folders]
    motions = [read_simulated(folder / run / "simulate.mcap") for folder in folders]
    compared = [read_comparison(folder / run / "compare.mcap") for folder in folders]
    camera = read_calibration(folders[1] / "camera.mcap")
    allowed = 1e3 * SHARE * measurement_std_m(camera, campaign.object, seen_places(tracks[1]))
    one, other = compared
    return Beside(
        (moved_mm(*tracks), moved_mm(*motions)),
        allowed,
        (1e3 * one.path_rms_m, 1e3 * other.path_rms_m),
        (str(one.verdict), str(other.verdict)),
        (*tracks[0].choices[:1], *motions[0].choices),
    )


def compared_presets(
    campaign: Campaign, presets: tuple[str, str]
) -> tuple[dict[str, tuple[float, float]], dict[str, Beside]]:
    """Wall and CPU time [s] of all runs by preset, and each run under the first beside the second."""
    with tempfile.TemporaryDirectory() as place:
        results = [Path(place) / preset for preset in presets]
        cost = {
            preset: wall_and_cpu_seconds(partial(run_workflow, campaign, preset, into))
            for preset, into in zip(presets, results, strict=True)
        }
        folders = [into / campaign.folder.name for into in results]
        return cost, {run: beside(campaign, run, folders) for run in campaign.runs}


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path, nargs="?", default=SAMPLE)
    parser.add_argument("--preset", default=PRESETS[0], help="another one in place of auto")
    given = parser.parse_args()
    campaign, presets = load_campaign(given.campaign.resolve()), (given.preset, PRESETS[1])
    cost, runs = compared_presets(campaign, presets)
    print(f"{campaign.name}, {len(campaign.runs)} runs, calibration to verdict")
    for preset, (wall, cpu) in cost.items():
        print(f"{preset}: {cpu:.1f} s CPU, {wall:.1f} s wall")
    print(f"moved against {presets[1]} and allowed, then simulated - measured under both, all mm RMS")
    print(f"{'run':4}{'measured':>10}{'simulated':>11}{'allowed':>9}{'':10}", end="")
    print(*(f"{preset:>9}" for preset in presets), " verdicts; taken", sep="")
    for run, found in runs.items():
        (measured, simulated), (one, other) = found.moved, found.path_rms
        print(
            f"{run:4}{measured:10.3f}{simulated:11.3f}{found.allowed:9.3f}"
            f"  {'kept' if max(found.moved) <= found.allowed else 'MISSED':8}{one:9.3f}{other:9.3f}"
            f"  {' / '.join(found.verdicts)}; {'; '.join(f'{each.what} {each.chosen}' for each in found.chosen)}"
        )


if __name__ == "__main__":
    main()

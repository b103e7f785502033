"""Presets draft and auto beside fine on a campaign: CPU time, how far paths move, and what they may move under auto.

    python -m studies.tables.presets_auto [path/to/campaign]

The workflow runs them from the calibration to the verdict, without figures. Under auto, measured and simulated paths
may move by a third of the measurement uncertainty, root mean square over the run.
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

PRESETS = ("draft", "auto", "fine")


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
    """A run under one preset beside the same run under a finer one: how far its measured and simulated path ``moved``
    and may move, ``path_rms`` of simulated minus measured under both, all [mm], both verdicts, what the first chose."""

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
    campaign: Campaign, presets: Sequence[str]
) -> tuple[list[tuple[float, float]], list[dict[str, Beside]]]:
    """Wall and CPU time [s] of all runs under each preset; under each but the last, every run beside the last's."""
    with tempfile.TemporaryDirectory() as place:
        results = [Path(place) / str(i) for i in range(len(presets))]
        cost = [
            wall_and_cpu_seconds(partial(run_workflow, campaign, preset, into))
            for preset, into in zip(presets, results, strict=True)
        ]
        *others, finest = [into / campaign.folder.name for into in results]
        return cost, [{run: beside(campaign, run, (each, finest)) for run in campaign.runs} for each in others]


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path, nargs="?", default=SAMPLE)
    campaign = load_campaign(parser.parse_args().campaign.resolve())
    cost, found = compared_presets(campaign, PRESETS)
    *presets, finest = PRESETS
    print(f"{campaign.name}, {len(campaign.runs)} runs, calibration to verdict")
    for preset, (wall, cpu) in zip(PRESETS, cost, strict=True):
        print(f"{preset}: {cpu:.1f} s CPU, {wall:.1f} s wall")
    print(f"moved against {finest}, allowed to auto, then simulated - measured under both, all mm RMS")
    print(f"{'preset':8}{'run':4}{'measured':>9}{'simulated':>11}{'allowed':>9}{'':10}  both  verdicts; taken")
    for preset, runs in zip(presets, found, strict=True):
        for run, each in runs.items():
            within = "within" if max(each.moved) <= each.allowed else "beyond"
            taken = "; ".join(f"{choice.what} {choice.chosen}" for choice in each.chosen)
            print(f"{preset:8}{run:4}{each.moved[0]:9.3f}{each.moved[1]:11.3f}{each.allowed:9.3f}  {within:8}", end="")
            print(f"{each.path_rms[0]:9.3f}{each.path_rms[1]:9.3f}  {' / '.join(each.verdicts)}; {taken}")


if __name__ == "__main__":
    main()

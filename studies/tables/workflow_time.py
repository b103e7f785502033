"""Wall and CPU time of the workflow on a campaign, by stage, beside pure decoding of its videos, in one run.

"Snakemake" is what the jobs' own processes do not account for; "again" a second call, with nothing to do.

python -m studies.tables.workflow_time [path/to/campaign]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from studies.costs import wall_and_cpu_seconds
from towval.io.campaign import Campaign, load_campaign
from towval.io.video import Video

SAMPLE = Path(__file__).resolve().parents[2] / "data_samples" / "lab_small"


def decode(campaign: Campaign) -> None:
    """Decode every frame of every video."""
    for run in campaign.runs.values():
        for _ in Video(run.video):
            pass


def workflow(campaign: Campaign, results: str) -> None:
    """Run the workflow into a folder of results."""
    line = [sys.executable, "-m", "snakemake", "--cores", "2", "--quiet", "all", "--nolock"]
    line += ["--config", f"campaign={campaign.folder}", f"results={results}"]
    subprocess.run(line, check=True, env=os.environ, stdout=subprocess.DEVNULL)


def stages(results: Path) -> dict[str, tuple[int, float, float]]:
    """Number of jobs of each stage, and their wall and CPU seconds, as Snakemake noted them."""
    found: dict[str, tuple[int, float, float]] = {}
    for path in sorted(results.rglob("benchmarks/*.tsv")):
        lines = [line.split("\t") for line in path.read_text().splitlines()]
        values = dict(zip(lines[0], lines[1], strict=True))
        jobs, wall, cpu = found.get(path.stem, (0, 0.0, 0.0))
        found[path.stem] = jobs + 1, wall + float(values["s"]), cpu + float(values["cpu_time"])
    return found


def main() -> None:
    """Print all, each as a multiple of decoding."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path, nargs="?", default=SAMPLE)
    campaign = load_campaign(parser.parse_args().campaign)
    with tempfile.TemporaryDirectory() as results:
        rows = [("decoding", len(campaign.runs), *wall_and_cpu_seconds(lambda: decode(campaign)))]
        whole = wall_and_cpu_seconds(lambda: workflow(campaign, results))
        rows += [(name, *spent) for name, spent in stages(Path(results)).items()]
        rows += [("Snakemake", 1, np.nan, whole[1] - sum(cpu for _, _, _, cpu in rows[1:])), ("all", 1, *whole)]
        rows.append(("again", 1, *wall_and_cpu_seconds(lambda: workflow(campaign, results))))
    print(f"{campaign.name}, {len(campaign.runs)} runs; wall and CPU seconds, CPU over that of decoding")
    for name, jobs, wall, cpu in rows:
        print(f"{name:12}{jobs:4}{wall:9.1f}{cpu:9.1f}{cpu / rows[0][3]:9.2f}")


if __name__ == "__main__":
    main()

"""Wall and CPU time of the whole workflow on a campaign, beside pure decoding of its videos, in one run.

python -m studies.tables.workflow_time [path/to/campaign]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

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
    """Run the workflow into a new folder."""
    line = [sys.executable, "-m", "snakemake", "--cores", "2", "--quiet", "all", "--nolock"]
    line += ["--config", f"campaign={campaign.folder}", f"results={results}"]
    subprocess.run(line, check=True, env=os.environ, stdout=subprocess.DEVNULL)


def main() -> None:
    """Print both, and the stages' own shares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path, nargs="?", default=SAMPLE)
    campaign = load_campaign(parser.parse_args().campaign)
    with tempfile.TemporaryDirectory() as results:
        rows = {
            "decoding": wall_and_cpu_seconds(lambda: decode(campaign)),
            "workflow": wall_and_cpu_seconds(lambda: workflow(campaign, results)),
        }
        stages: dict[str, list[float]] = {}
        for path in Path(results).rglob("benchmarks/*.tsv"):
            lines = [line.split("\t") for line in path.read_text().splitlines()]
            values = dict(zip(lines[0], lines[1], strict=True))
            stages.setdefault(path.stem, []).append(float(values["cpu_time"]))
    print(f"{campaign.name}, {len(campaign.runs)} runs: wall and CPU seconds")
    for name, (wall, cpu) in rows.items():
        print(f"{name:12}{wall:8.1f}{cpu:8.1f}")
    print(
        "CPU seconds by stage, all runs: " + ", ".join(f"{name} {sum(cpu):.1f}" for name, cpu in sorted(stages.items()))
    )


if __name__ == "__main__":
    main()

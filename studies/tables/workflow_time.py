"""Wall and CPU time, and memory, of the workflow on a campaign, by stage, beside pure decoding of its videos.

"Snakemake" is what the jobs' own processes do not account for; "again" a second call, with nothing to do.

python -m studies.tables.workflow_time [path/to/campaign]
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from studies.costs import children_cpu_seconds, wall_and_cpu_seconds
from towval.commands.console import errors_reported
from towval.io.campaign import Campaign, load_campaign
from towval.io.video import Video


@dataclass(frozen=True)
class Stage:
    """How many ``jobs`` a stage has, their wall and CPU time [s], and the most memory that one of them takes [MB]."""

    jobs: int
    wall_s: float
    cpu_s: float
    peak_mb: float = np.nan


_BETWEEN_LOOKS_S = 0.2  # of what a process spends after the last, "Snakemake" has the blame

REPOSITORY = Path(__file__).resolve().parents[2]
SAMPLE = REPOSITORY / "data_samples" / "lab_small"


def measured(campaign: Campaign) -> dict[str, Stage]:
    """What decoding, each stage, Snakemake, all of it, and a second call take."""
    with tempfile.TemporaryDirectory() as results:
        found = {"decoding": Stage(len(campaign.runs), *wall_and_cpu_seconds(lambda: decode(campaign)))}
        stages, wall, spent = workflow(campaign, results)
        rest = spent - sum(each.cpu_s for each in stages.values())
        found |= stages | {"Snakemake": Stage(1, np.nan, rest), "all": Stage(1, wall, spent)}
        return found | {"again": Stage(1, *workflow(campaign, results)[1:])}


def decode(campaign: Campaign) -> None:
    """Decode every frame of every video."""
    for run in campaign.runs.values():
        for _ in Video(run.video):
            pass


def workflow(campaign: Campaign, results: str) -> tuple[dict[str, Stage], float, float]:
    """Run the workflow into a folder of results: what each stage took, as its processes were seen, and all of it in
    wall and CPU time [s], without what looking costs."""
    line = [sys.executable, "-m", "snakemake", "--cores", "2", "--quiet", "all", "--nolock"]
    line += ["--config", f"campaign={campaign.folder}", f"results={results}"]
    seen: dict[int, Seen] = {}
    wall, before = time.perf_counter(), children_cpu_seconds()
    with subprocess.Popen(line, env=os.environ, stdout=subprocess.DEVNULL, cwd=REPOSITORY) as started:
        parent = psutil.Process(started.pid)
        while started.poll() is None:
            look(parent, seen)
            time.sleep(_BETWEEN_LOOKS_S)
    wall, spent = time.perf_counter() - wall, children_cpu_seconds() - before
    if started.returncode:
        raise subprocess.CalledProcessError(started.returncode, line)
    return by_stage(seen.values()), wall, spent


@dataclass
class Seen:
    """A process of a stage: when it was seen first and last [s], its CPU time by then, and the most memory [MB].

    Both contain its children's.
    """

    stage: str
    since: float
    until: float = 0.0
    cpu_s: float = 0.0
    peak_mb: float = 0.0


def by_stage(seen: Iterable[Seen]) -> dict[str, Stage]:
    """The processes of each stage together."""
    found: dict[str, Stage] = {}
    for each in seen:
        known = found.get(each.stage, Stage(0, 0.0, 0.0, 0.0))
        wall_s, cpu_s = known.wall_s + each.until - each.since, known.cpu_s + each.cpu_s
        found[each.stage] = Stage(known.jobs + 1, wall_s, cpu_s, max(known.peak_mb, each.peak_mb))
    return found


def look(parent: psutil.Process, seen: dict[int, Seen]) -> None:
    """Note what the jobs below a process have spent. (Snakemake's own benchmarks look every half a minute.)"""
    with suppress(psutil.Error):
        for child in parent.children():
            with suppress(psutil.Error, OSError, IndexError):  # it may begin or end just now
                if child.pid not in seen:
                    # A job is a copy of the workflow's script in which the name of the stage's function was written.
                    stage = re.search(rb"towval\.commands\.(\w+):", Path(child.cmdline()[-1]).read_bytes())
                    if stage is None:
                        continue
                    seen[child.pid] = Seen(stage[1].decode(), time.perf_counter())
                job = seen[child.pid]
                job.cpu_s, job.until = sum(child.cpu_times()[:4]), time.perf_counter()
                own = [each.memory_info().rss for each in (child, *child.children())]
                job.peak_mb = max(job.peak_mb, sum(own) / 1e6)


@errors_reported()
def main() -> None:
    """Print all, each as a multiple of decoding."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path, nargs="?", default=SAMPLE)
    campaign = load_campaign(parser.parse_args().campaign.resolve())
    rows = measured(campaign)
    print(
        f"{campaign.name}, {len(campaign.runs)} runs; wall and CPU seconds, CPU over that of decoding, peak memory [MB]"
    )
    for name, each in rows.items():
        times = f"{each.jobs:4}{each.wall_s:9.1f}{each.cpu_s:9.1f}{each.cpu_s / rows['decoding'].cpu_s:9.2f}"
        print(f"{name:12}{times}{each.peak_mb:9.0f}")


if __name__ == "__main__":
    main()

"""Wall and CPU time of the workflow on a campaign, by stage, beside pure decoding of its videos, in one run.

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
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from studies.costs import children_cpu_seconds, wall_and_cpu_seconds
from towval.io.campaign import Campaign, load_campaign
from towval.io.video import Video

Stage = tuple[int, float, float]
"""How many jobs, their wall and their CPU time [s]."""

_BETWEEN_LOOKS_S = 0.2  # of what a process spends after the last, "Snakemake" has the blame

SAMPLE = Path(__file__).resolve().parents[2] / "data_samples" / "lab_small"


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
    with subprocess.Popen(line, env=os.environ, stdout=subprocess.DEVNULL) as started:
        parent = psutil.Process(started.pid)
        while started.poll() is None:
            look(parent, seen)
            time.sleep(_BETWEEN_LOOKS_S)
    wall, spent = time.perf_counter() - wall, children_cpu_seconds() - before
    if started.returncode:
        raise subprocess.CalledProcessError(started.returncode, line)
    found: dict[str, Stage] = {}
    for each in seen.values():
        jobs, took, cpu = found.get(each.stage, (0, 0.0, 0.0))
        found[each.stage] = jobs + 1, took + each.until - each.since, cpu + each.cpu_s
    return found, wall, spent


@dataclass
class Seen:
    """A process of a stage: when it was seen first and last [s], and its CPU time by then, its children's included."""

    stage: str
    since: float
    until: float = 0.0
    cpu_s: float = 0.0


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
                seen[child.pid].cpu_s, seen[child.pid].until = sum(child.cpu_times()[:4]), time.perf_counter()


def main() -> None:
    """Print all, each as a multiple of decoding."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path, nargs="?", default=SAMPLE)
    campaign = load_campaign(parser.parse_args().campaign)
    with tempfile.TemporaryDirectory() as results:
        rows = [("decoding", len(campaign.runs), *wall_and_cpu_seconds(lambda: decode(campaign)))]
        stages, wall, spent = workflow(campaign, results)
        rows += [(name, *each) for name, each in stages.items()]
        rows += [("Snakemake", 1, np.nan, spent - sum(cpu for _, _, _, cpu in rows[1:])), ("all", 1, wall, spent)]
        rows.append(("again", 1, *workflow(campaign, results)[1:]))
    print(f"{campaign.name}, {len(campaign.runs)} runs; wall and CPU seconds, CPU over that of decoding")
    for name, jobs, wall, cpu in rows:
        print(f"{name:12}{jobs:4}{wall:9.1f}{cpu:9.1f}{cpu / rows[0][3]:9.2f}")


if __name__ == "__main__":
    main()

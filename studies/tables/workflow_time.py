"""Wall and CPU time of the whole workflow on a campaign, beside pure decoding of its videos, in one run.

python -m studies.tables.workflow_time [path/to/campaign]
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from towval.io.campaign import load_campaign
from towval.io.video import Video


def spent(action):
    """Wall and CPU seconds of an action, its child processes included."""
    wall, own, children = time.perf_counter(), time.process_time(), resource.getrusage(resource.RUSAGE_CHILDREN)
    action()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = time.process_time() - own + after.ru_utime + after.ru_stime - children.ru_utime - children.ru_stime
    return time.perf_counter() - wall, cpu


def decode(campaign):
    """Decode every frame of every video."""
    for run in campaign.runs.values():
        for _ in Video(run.video):
            pass


def workflow(campaign, results):
    """Run the workflow into a new folder."""
    line = [sys.executable, "-m", "snakemake", "--cores", "2", "--quiet", "all", "--nolock"]
    line += ["--config", f"campaign={campaign.folder}", f"results={results}"]
    subprocess.run(line, check=True, env=os.environ, stdout=subprocess.DEVNULL)


def main(folder):
    """Print both, and the stages' own shares."""
    campaign = load_campaign(folder)
    with tempfile.TemporaryDirectory() as results:
        rows = {"decoding": spent(lambda: decode(campaign)), "workflow": spent(lambda: workflow(campaign, results))}
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
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[2] / "data_samples" / "lab_small")

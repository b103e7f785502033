"""What many campaigns cost beyond their stages.

python -m studies.tables.many_campaigns layout [--campaigns 1000] [--of CAMPAIGN]
python -m studies.tables.many_campaigns jobs COMMAND ...

``layout`` plans copies of a campaign, without running anything: CPU time, wall time and memory of a first call, which
also reads all footage for its fingerprints, and of a second one. The copies consist of symbolic links.

``jobs`` runs a command that calls Snakemake, here or on a cluster of this machine, and shares out the CPU time of all
its Python processes: the process that plans, those that Snakemake starts on a node to run a job, and the stages.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from studies.tables.workflow_time import REPOSITORY, SAMPLE
from towval.commands.console import errors_reported

PLANNING, ON_A_NODE, STAGE = "planning", "Snakemake of a job", "stage"


@dataclass(frozen=True)
class Call:
    """What a process took: CPU and wall time [s], its children's included, and its own peak memory [MB]."""

    cpu_s: float
    wall_s: float
    peak_mb: float


@dataclass(frozen=True)
class Share:
    """Number and CPU time [s] of the processes of one kind."""

    processes: int
    cpu_s: float


def layout(campaign: Path, count: int, folder: Path) -> tuple[Call, Call]:
    """What it takes to plan ``count`` copies of a campaign that have no results: the first time, and once more."""
    _copy(campaign, count, folder / "campaigns")
    names = sorted(str(path) for path in (folder / "campaigns").iterdir())
    (folder / "many.yaml").write_text(yaml.safe_dump({"campaigns": names}), encoding="utf-8")
    line = [sys.executable, "-m", "snakemake", "--dry-run", "--cores", "2", "--quiet", "all"]
    line += ["--configfile", str(folder / "many.yaml"), "--config", f"results={folder / 'results'}"]
    return _call(line), _call(line)


def _copy(campaign: Path, count: int, folder: Path) -> None:
    files = [path.relative_to(campaign) for path in campaign.rglob("*") if path.is_file()]
    for k in range(count):
        for file in files:
            link = folder / f"{campaign.name}_{k:04d}" / file
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(campaign / file)


def _call(line: Sequence[str]) -> Call:
    start = time.perf_counter()
    with subprocess.Popen(line, cwd=REPOSITORY, stdout=subprocess.DEVNULL) as started:
        _, status, used = os.wait4(started.pid, 0)
        started.returncode = os.waitstatus_to_exitcode(status)
    if started.returncode:
        raise subprocess.CalledProcessError(started.returncode, line)
    return Call(used.ru_utime + used.ru_stime, time.perf_counter() - start, used.ru_maxrss / 1e3)


NOTE = """
import atexit, json, os, resource, sys

def note():
    used = resource.getrusage(resource.RUSAGE_SELF)
    with open(os.path.join(os.environ["TOWVAL_NOTES"], f"{os.getpid()}.json"), "w") as file:
        json.dump({"argv": sys.argv, "cpu_s": used.ru_utime + used.ru_stime}, file)

atexit.register(note)
"""
"""What each process of Python reads first: at its end it notes what it was called with, and its own CPU time."""


def shares(line: Sequence[str]) -> dict[str, Share]:
    """What the processes of Python below a command spend, by kind, however they are started."""
    with TemporaryDirectory() as notes:
        (Path(notes) / "sitecustomize.py").write_text(NOTE, encoding="utf-8")
        paths = [notes, *filter(None, [os.environ.get("PYTHONPATH")])]
        subprocess.run(
            line, check=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), "TOWVAL_NOTES": notes}
        )
        found = [json.loads(path.read_text(encoding="utf-8")) for path in Path(notes).glob("*.json")]
    kinds: dict[str, list[float]] = {PLANNING: [], ON_A_NODE: [], STAGE: []}
    for each in found:
        kind = _kind(each["argv"])
        if kind:
            kinds[kind].append(each["cpu_s"])
    return {kind: Share(len(spent), sum(spent)) for kind, spent in kinds.items()}


def _kind(argv: Sequence[str]) -> str | None:
    program = Path(argv[0])
    if program.parent.name == "scripts" and program.name.endswith(".run.py"):
        return STAGE
    if "snakemake" not in (program.name, program.parent.name):
        return None
    return ON_A_NODE if "--mode" in argv else PLANNING


@errors_reported()
def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    planned = commands.add_parser("layout")
    planned.add_argument("--campaigns", type=int, default=1000)
    planned.add_argument("--of", type=Path, default=SAMPLE, metavar="CAMPAIGN")
    commands.add_parser("jobs").add_argument("line", nargs=argparse.REMAINDER, metavar="COMMAND ...")
    given = parser.parse_args()
    if given.command == "layout":
        with TemporaryDirectory() as folder:
            calls = layout(given.of.resolve(), given.campaigns, Path(folder))
        for name, call in zip(("first", "again"), calls, strict=True):
            cost = f"{call.cpu_s:.1f} CPU s, {call.wall_s:.1f} s, {call.peak_mb:.0f} MB"
            print(f"{given.campaigns} campaigns, {name}: {cost}")
        return
    found = shares(given.line)
    for kind, share in found.items():
        print(f"{kind:20}{share.processes:4} processes {share.cpu_s:8.1f} CPU s")
    if not found[STAGE].processes:
        print("no stage was run")
        return
    beyond = found[PLANNING].cpu_s + found[ON_A_NODE].cpu_s
    print(f"{beyond / found[STAGE].processes:.2f} CPU s a stage beyond its own process")


if __name__ == "__main__":
    main()

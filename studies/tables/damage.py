"""Damaged campaigns, files and runs by the thousand, and how each ended: ``make damage``.

``python -m studies.tables.damage [--campaigns N] [--rewrites N] [--reads N] [--kills N] [--disks N] [--surroundings]
[--names]``. Whatever ends with a traceback, hangs, takes too much, or is wrong without a word is written into
``--corpus``, and the call fails.
"""

import argparse
import itertools
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.robustness import campaign_faults, file_faults
from studies.robustness.name_faults import name_trials
from studies.robustness.trial import Outcome, attempt
from studies.robustness.workflow_faults import (
    Workplace,
    full_disk_trials,
    kill_trials,
    read_only_trial,
    surroundings_trials,
)
from towval.commands.console import errors_reported
from towval.io.campaign import Campaign, load_campaign
from towval.io.images import read_gray
from towval.io.records import read_decimated, read_tracks
from towval.io.video import Video
from towval.validation.simulate import SimulateSettings, simulate

_SAMPLE = Path("data_samples/lab_small")


def campaign_trials(count: int, seed: int, results: Path, corpus: Path) -> Counter[str]:
    """Outcomes of reading damaged campaigns, looking at their files and simulating a run with what is accepted."""
    simulated = _simulation(results)
    simulated(load_campaign(_SAMPLE))

    def call(folder: Path) -> str:
        campaign = load_campaign(folder)
        look_at_files(campaign)
        return "returned" if np.isfinite(simulated(campaign)).all() else "not finite"

    return _trials(count, seed, corpus, campaign_faults.write_damaged, call, ("returned", "refused"))


def rewrite_trials(count: int, seed: int, results: Path, corpus: Path) -> Counter[str]:
    """Outcomes of reading and simulating campaigns written in another way: "same", or what is wrong."""
    simulated = _simulation(results)
    wanted = simulated(load_campaign(_SAMPLE))

    def call(folder: Path) -> str:
        return "same" if np.array_equal(simulated(load_campaign(folder)), wanted) else "other numbers"

    return _trials(count, seed, corpus, campaign_faults.write_rewritten, call, ("same",))


def _trials(
    count: int,
    seed: int,
    corpus: Path,
    write: Callable[[Path, Path, np.random.Generator], str],
    call: Callable[[Path], str],
    right: Sequence[str],
) -> Counter[str]:
    """Outcomes of calls on copies of the sample that ``write`` makes; those that are not right are kept."""
    outcomes: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    for i in range(count):
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) / "lab"
            folder.mkdir()
            kind = write(_SAMPLE, folder, rng)
            outcome = attempt(partial(call, folder))
            name = outcome.kind if outcome.value is None else str(outcome.value)
            outcomes[name] += 1
            if name not in right:
                _keep(corpus, f"{write.__name__}_{seed}_{i}", kind, folder / "campaign.yaml", outcome)
            campaign_faults.removed(folder)
    return outcomes


def _simulation(results: Path) -> Callable[[Campaign], NDArray[np.float64]]:
    """A function that simulates run a of a campaign with the tracks at hand: poses [m, m, rad] of shape (N, 3)."""
    tracks = read_decimated(results / "a" / "decimate.mcap")
    times = read_tracks(results / "a" / "track.mcap")["object"].time_s[::4]
    return lambda campaign: simulate(campaign.scene, tracks["rover"], tracks["object"], times, SimulateSettings()).pose


def look_at_files(campaign: Campaign) -> None:
    """What the stages open first: pictures, and the header of each video with its first frame."""
    for path in (campaign.calibration_images[0], *campaign.floor_images):
        read_gray(path, campaign.resolution_px)
    for run in campaign.runs.values():
        next(iter(Video(run.video, damaged=run.damaged_video)))


def _keep(corpus: Path, name: str, kind: str, file: Path, outcome: Outcome) -> None:
    corpus.mkdir(parents=True, exist_ok=True)
    if file.is_file():
        (corpus / f"{name}.yaml").write_bytes(file.read_bytes())
    (corpus / f"{name}.txt").write_text(f"{kind}\n{outcome.kind}\n{outcome.text}\n", encoding="utf-8")


@errors_reported()
def main() -> None:
    """Run what is asked for and print the counts; exits with code 1 where anything did not end as it should."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--campaigns", type=int, default=0)
    parser.add_argument("--rewrites", type=int, default=0, help="campaigns written in another way that means the same")
    parser.add_argument("--reads", type=int, default=0)
    parser.add_argument("--kills", type=int, default=0, help="calls of the workflow killed at a random moment")
    parser.add_argument("--disks", type=int, default=0, help="disks that are full at ever later points (as root)")
    parser.add_argument("--surroundings", action="store_true", help="no HOME, few files, little memory, ...")
    parser.add_argument("--names", action="store_true", help="names that a file system allows, everywhere")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--results", type=Path, default=Path("results/lab_small"), help="undamaged results of lab_small"
    )
    parser.add_argument("--corpus", type=Path, default=Path("results/damage"), help="where failures are kept")
    given = parser.parse_args()
    failed = False
    if given.campaigns:
        counts = campaign_trials(given.campaigns, given.seed, given.results, given.corpus)
        failed |= bool(set(counts) - {"returned", "refused"})
        print(f"{given.campaigns} damaged campaigns, seed {given.seed}: {dict(counts)}", flush=True)
    if given.rewrites:
        counts = rewrite_trials(given.rewrites, given.seed, given.results, given.corpus)
        failed |= set(counts) != {"same"}
        print(f"{given.rewrites} campaigns written in another way, seed {given.seed}: {dict(counts)}", flush=True)
    if given.reads:
        with tempfile.TemporaryDirectory() as scratch:  # a call that is killed must not leave a damaged result
            copied = Path(shutil.copytree(given.results, Path(scratch) / given.results.name))
            counts = file_faults.read_trials(copied, given.reads, given.seed, given.corpus)
        failed |= bool(set(counts) - {"same", "refused"})
        print(f"{given.reads} damaged reads, seed {given.seed}: {dict(counts)}", flush=True)
    if given.kills or given.disks or given.surroundings or given.names:
        with tempfile.TemporaryDirectory() as scratch:
            failed |= _workflow_trials(given, Workplace.made(Path(scratch)))
    raise SystemExit(int(failed))


def _workflow_trials(given: argparse.Namespace, place: Workplace) -> bool:
    """Print how the calls of the workflow ended; whether one failed."""
    trials = itertools.chain(
        kill_trials(place, given.kills, given.seed) if given.kills else (),
        full_disk_trials(place, given.disks) if given.disks else (),
        read_only_trial(place) if given.disks else (),
        surroundings_trials(place) if given.surroundings else (),
        name_trials(place.folder.parent) if given.names else (),
    )
    failed = False
    for i, (name, fault) in enumerate(trials):
        print(f"{name}: {fault.splitlines()[0] if fault else 'as it must'}", flush=True)
        if fault:
            failed = True
            given.corpus.mkdir(parents=True, exist_ok=True)
            (given.corpus / f"workflow_{given.seed}_{i}.txt").write_text(f"{name}\n{fault}", encoding="utf-8")
    return failed


if __name__ == "__main__":
    main()

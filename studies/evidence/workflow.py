"""Checks of the whole workflow: costs of its stages and of many campaigns, and preset auto beside fine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np

from studies.evidence import lab
from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import Planting, both, replaced
from studies.tables import many_campaigns, presets_auto, workflow_time
from studies.tables.workflow_time import REPOSITORY, SAMPLE, Stage, workflow
from towval.io.campaign import load_campaign
from towval.model.conventions import STAGES_OF_RUN

_SLOWER = """
import atexit, os, time

def work_again():
    held, until = b"x" * 400_000_000, 2.5 * time.process_time()
    while time.process_time() < until:
        pass

class Forked:
    pass

def in_a_fork():
    from multiprocessing import util
    util.register_after_fork(FORKED, lambda _: util.Finalize(None, work_again, exitpriority=0))

FORKED = Forked()
atexit.register(work_again)
os.register_at_fork(after_in_child=in_a_fork)
"""
"""What each process of Python reads first: at its end it takes 400 MB more and works on, to two and a half times its
time. One that multiprocessing forks, as the report does to draw, ends without calling what is registered for the end of
a program: it is given the same when it has begun."""


def _cost() -> Values:
    """CPU time of the stages over that of decoding, and their peak memory [MB], on lab_a."""
    with TemporaryDirectory() as results:
        # The first call also compiles what is not compiled yet.
        workflow(load_campaign(SAMPLE), results)
    found = workflow_time.measured(load_campaign(shared_folder() / "footage" / "lab_a"))
    values = {"all, wall": found["all"].wall_s, "again, wall": found["again"].wall_s}
    for name, each in found.items():
        values |= _of_stage(name, each, found["decoding"])
    return values


def _of_stage(name: str, stage: Stage, decoding: Stage) -> dict[str, float]:
    found = {f"{name}, CPU over decoding": stage.cpu_s / decoding.cpu_s, f"{name}, CPU a job": stage.cpu_s / stage.jobs}
    return found if np.isnan(stage.peak_mb) else found | {f"{name}, peak memory": stage.peak_mb}


def _read_first(code: str) -> Planting:
    """Each process of Python reads some code before anything else."""

    @contextmanager
    def planted() -> Iterator[None]:
        with TemporaryDirectory() as folder:
            (Path(folder) / "sitecustomize.py").write_text(code, encoding="utf-8")
            paths = [folder, *filter(None, [os.environ.get("PYTHONPATH")])]
            with patch.dict(os.environ, PYTHONPATH=os.pathsep.join(paths)):
                yield

    return planted


_ALL_PROCESSES_SLOWER = _read_first(_SLOWER)


def _planning() -> Values:
    """What it takes to plan copies of lab_a: CPU time [s] of a first call and of a second, and peak memory [MB]."""
    values: dict[str, float] = {}
    for count in (100, 1000):
        with TemporaryDirectory() as folder:
            first, again = many_campaigns.layout(shared_folder() / "footage" / "lab_a", count, Path(folder))
        values |= {f"{count}, first call, CPU": first.cpu_s, f"{count}, second call, CPU": again.cpu_s}
        values |= {f"{count}, peak memory": first.peak_mb}
    return values


def _jobs() -> Values:
    """What Snakemake spends in the jobs of a SLURM of one node, and in all, a stage of the sample campaign [s]."""
    script = REPOSITORY / "profiles" / "slurm" / "try_single_node.sh"
    groups = [f"{stage}=run" for stage in STAGES_OF_RUN] + ["exchange=run"]
    with TemporaryDirectory() as results:
        line = [str(script), "--config", f"results={results}", "quick=true"]
        found = many_campaigns.shares([*line, "--groups", *groups, "--group-components", "run=2"])
    stages, jobs = found[many_campaigns.STAGE].processes, found[many_campaigns.ON_A_NODE].cpu_s
    return {
        "in jobs, CPU a stage": jobs / stages,
        "all, CPU a stage": (jobs + found[many_campaigns.PLANNING].cpu_s) / stages,
    }


COST = Check(
    _cost,
    {"every process works two and a half times as long and takes 400 MB more": _ALL_PROCESSES_SLOWER},
    needs=("footage/lab_a",),
)

PLANNING = Check(
    _planning,
    {"every process works two and a half times as long and takes 400 MB more": _ALL_PROCESSES_SLOWER},
    needs=("footage/lab_a",),
)

JOBS = Check(
    _jobs,
    {"every process works two and a half times as long": replaced(many_campaigns, "NOTE", lambda note: note + _SLOWER)},
    needs=("slurmctld", "snakemake_executor_plugin_slurm"),
)


def _presets() -> Values:
    """How far paths under draft and auto are from those under fine, what auto allows, verdicts, and what it chose."""
    found: dict[str, float | str] = {}
    for source in (SAMPLE, shared_folder() / "footage" / "lab_a"):
        with TemporaryDirectory() as folder:
            place = Path(folder) / source.name
            lab.restated(source, place, lab.stated(source))
            campaign = load_campaign(place)
            cost, (draft, auto) = presets_auto.compared_presets(campaign, presets_auto.PRESETS)
        (_, of_auto), (_, of_fine) = cost[1:]
        found[f"{campaign.name}, CPU fine over auto"] = of_fine / of_auto
        for run in campaign.runs:
            at, one = f"{campaign.name} {run}", auto[run]
            found |= {f"{at}, measured path moved": one.moved[0], f"{at}, simulated path moved": one.moved[1]}
            found |= {f"{at}, allowed": one.allowed, f"{at}, simulated path moved by draft": draft[run].moved[1]}
            rms, verdicts = (draft[run].path_rms[0], *one.path_rms), (draft[run].verdicts[0], *one.verdicts)
            for preset, path_rms, verdict in zip(("draft", "auto", "fine"), rms, verdicts, strict=True):
                found |= {f"{at}, simulated − measured, {preset}": path_rms, f"{at}, verdict, {preset}": verdict}
            found |= {f"{at}, {choice.what}": choice.chosen for choice in one.chosen}
    return found


_CHOOSING_STRICTER = """
import importlib.machinery, sys

class Stricter(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name != "towval.selection.margin":
            return None
        spec = super().find_spec(name, path, target)
        execute = spec.loader.exec_module

        def exec_module(module):
            execute(module)
            module.SHARE /= 10

        spec.loader.exec_module = exec_module
        return spec

sys.meta_path.insert(0, Stricter)
"""
"""What each process of Python reads first: the share of the measurement's deviation that a choice may use is changed as
soon as its module has been read."""

PRESETS = Check(
    _presets,
    {
        "presets auto, draft and fine in place of draft, auto and fine; the tether is stated 5 cm too long": both(
            replaced(presets_auto, "PRESETS", lambda _: ("auto", "draft", "fine")), lab.stating(rest_length_m="0.65")
        ),
        "boards are stated to be known to 2 % of their size; preset auto stands in for fine": both(
            replaced(presets_auto, "PRESETS", lambda _: ("draft", "auto", "auto")),
            lab.stating(square_m="0.04\n    size_std: 0.02"),
        ),
        "a choice may move positions by a tenth of what it may": _read_first(_CHOOSING_STRICTER),
    },
    needs=("footage/lab_a",),
)

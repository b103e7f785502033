"""Checks of what is simulated on the filmed runs of lab_a and lab_c: the draws' tolerance, and a tether with mass."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced
from studies.tables import draws_tolerance
from towval.commands import calibrate, decimate, simulate, track
from towval.model import TowingScene
from towval.validation import simulate as validation_simulate
from towval.validation.sampler import Case

_HERE = sys.modules[__name__]
_MASSES_G_PER_M = (5, 20, 100, 500)
_RAISED_M = 0.05


def filmed(name: str, runs: str) -> Iterator[tuple[str, Case]]:
    """Runs of a campaign, from the pictures to the simulation, as the stage uncertainty reads them."""
    campaign = shared_folder() / "footage" / name
    with TemporaryDirectory() as folder:
        results = Path(folder)
        calibrate.run(campaign, results / "camera.mcap")
        for run in runs:
            files = {stage: results / run / f"{stage}.mcap" for stage in ("track", "decimate", "simulate")}
            (results / run).mkdir()
            track.run(campaign, run, results / "camera.mcap", files["track"])
            decimate.run(files["track"], files["decimate"])
            simulate.run(campaign, files["track"], files["decimate"], files["simulate"])
            yield f"{name}, {run}", draws_tolerance.case_of(campaign, results, run)


def _draws() -> Values:
    """RMS distance of the draws' paths from those at 1e-8 m [mm], by tolerance and run."""
    return {
        f"{each.tolerance_m:g} m, {run}": 1e3 * each.off_m
        for name, runs in (("lab_a", "abc"), ("lab_c", "gh"))
        for run, case in filmed(name, runs)
        for each in draws_tolerance.drawn_paths(case)
    }


def _coarser(original: Any) -> Any:
    return lambda batch, tolerance_m: original(batch, tolerance_m=10 * tolerance_m)


DRAWS = Check(
    _draws,
    {"the tolerance of the draws counts tenfold": replaced(draws_tolerance, "replace", _coarser)},
    needs=("footage/lab_a", "footage/lab_c"),
)


def with_mass(scene: TowingScene, grams_a_metre: float) -> TowingScene:
    """A scene whose tether has a mass; one on the floor is raised, or it could not hang."""
    raised = scene.hinge_height == 0 and scene.anchor_height == 0
    heights = (scene.anchor_height + raised * _RAISED_M, scene.hinge_height + raised * _RAISED_M)
    tether = replace(scene.tether, mass_per_length=1e-3 * grams_a_metre)
    return replace(scene, tether=tether, anchor_height=heights[0], hinge_height=heights[1])


def _tether_mass() -> Values:
    """RMS distance of the simulated paths from that without a mass [mm], by mass [g/m] and run."""
    found: dict[str, float] = {}
    for name, runs in (("lab_a", "ac"), ("lab_c", "gh")):
        for run, case in filmed(name, runs):
            given = case.rover_decimated, case.object_decimated, case.object_track.time_s
            without, *with_one = (
                validation_simulate.simulate(with_mass(case.scene, mass), *given).pose[:, :2]
                for mass in (0, *_MASSES_G_PER_M)
            )
            for mass, path in zip(_MASSES_G_PER_M, with_one, strict=True):
                found[f"{mass} g/m, {run}"] = 1e3 * float(np.sqrt(np.mean(np.sum((path - without) ** 2, axis=1))))
    return found


TETHER_MASS = Check(
    _tether_mass,
    {
        "the tether is half as heavy as it is said to be": replaced(
            _HERE, "with_mass", lambda original: lambda scene, mass: original(scene, 0.5 * mass)
        )
    },
    needs=("footage/lab_a", "footage/lab_c"),
)

"""Checks on campaigns whose pictures MuJoCo renders, through a lens that is none of the program's."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of
from studies.tables import engine_labs
from towval.model import Track, Verdict
from towval.tracking.planar_target import PlanarTarget
from towval.validation import compare

_HERE = sys.modules[__name__]
_SEEDS = range(1421, 1431)
_LOWER_M = 0.02


def _labs() -> Values:
    """Verdicts, errors of tracks [mm] and bounds [mm] over campaigns of fresh seeds."""
    with TemporaryDirectory() as folder:
        rows = pd.DataFrame(engine_labs.engine_lab_rows(_SEEDS, Path(folder)))
    verdicts = Counter(rows.verdict)
    found = {said: float(verdicts[said]) for said in (*(verdict.value for verdict in Verdict), "refused")}
    for body in ("rover", "object"):
        rms = rows[f"{body}_rms_mm"]
        found |= {f"{body}, median": float(rms.median()), f"{body}, most": float(rms.max())}
        found[f"{body}, within two deviations"] = 100 * float(rows[f"{body}_within_2_std"].mean())
        found[f"{body}, campaigns off by more than is allowed"] = float((rows[f"{body}_worst"] > 1).sum())
    bounded = rows[np.isfinite(rows.bound_mm)]
    found["simulations with a bound"] = float(len(bounded))
    found["of these, within it"] = float((bounded.off_mm <= bounded.bound_mm).sum())
    medians = bounded[["off_mm", "bound_mm"]].median()
    return found | {"simulation, median": float(medians.off_mm), "bound, median": float(medians.bound_mm)}


def _too_sure(tracks: dict[str, Track]) -> dict[str, Track]:
    return {
        name: replace(track, total_covariance=None if track.total_covariance is None else track.total_covariance / 100)
        for name, track in tracks.items()
    }


_FEWER = replaced(_HERE, "_SEEDS", lambda seeds: seeds[:3])

LABS = Check(
    _labs,
    {
        "tops are taken 20 mm lower than they are; three campaigns": both(
            _FEWER, replaced(PlanarTarget, "height", lambda stated: property(lambda self: stated.fget(self) - _LOWER_M))
        ),
        "deviations of tracks are taken a tenth as large, bounds of simulations too; three campaigns": both(
            _FEWER,
            replaced(engine_labs, "read_tracks", result_of(_too_sure)),
            replaced(compare, "bounds", result_of(lambda found: found * [[1.0], [0.1]])),
        ),
    },
    needs=("mujoco",),
)

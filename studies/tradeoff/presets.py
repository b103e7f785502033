"""Cost and error of the whole pipeline by preset, on a synthetic campaign with ground truth."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from studies.costs import take_turns
from studies.end_to_end import AUTO, Pipeline, PipelineResult, off_at_most_m
from studies.frame import Part, Row, Scatter, Settings, Study
from studies.worlds.folder import write_campaign
from towval.io.campaign import Campaign, load_campaign
from towval.model.presets import PRESETS, STANDARD


def preset_rows(presets: list[str], frames: int, rounds: int, seed: int) -> list[Row]:
    """A row a preset and path: CPU seconds of all stages but the pictures of the report, error in mm, u_val, wall time.

    The error is the RMS distance of the measured and of the simulated path from ground truth, and from each other: the
    model is exact here, so their difference is the pipeline's own error. Beside it the largest distance of the
    simulated path from ground truth, and the bound that the verdict states of it.
    """
    with TemporaryDirectory() as folder:
        place = Path(folder) / "synthetic"
        place.mkdir()
        truth = write_campaign(place, seed, frames)
        given = load_campaign(place)
        timed = take_turns({name: partial(_run, given, name) for name in presets}, rounds)
    rows = []
    for name, one in timed.items():
        result = one.result
        at = np.searchsorted(truth["time_s"], result.time_s - 1e-3)
        tracked = result.measured["object"]
        gaps = {
            "measured path": tracked.pose[tracked.seen] - truth["object"][tracked.seen],
            "simulated path": result.simulated - truth["object"][at],
        }
        errors = {path: float(np.sqrt(np.mean(np.sum(gap[:, :2] ** 2, axis=1)))) for path, gap in gaps.items()}
        errors["simulated - measured"] = result.comparison.path_rms_m
        errors["stated u_val"] = result.comparison.u_val_m
        errors["largest error"] = off_at_most_m(result, truth["time_s"], truth["object"])
        errors["bound of it"] = result.comparison.error_upper_m
        rows += [
            {
                "panel": quantity,
                "series": name,
                "setting": name,
                "cost": one.cpu_s,
                "cost_most": one.cpu_most_s,
                "wall_s": result.wall_s,
                "error": 1e3 * error,
                "verdict": str(result.comparison.verdict),
                "default": name == STANDARD,
            }
            for quantity, error in errors.items()
        ]
    return rows


def _run(given: Campaign, preset: str) -> PipelineResult:
    return Pipeline(given).run(PRESETS[preset])


def _parts(settings: Settings) -> dict[str, Part]:
    if settings.quick:
        return {"all": {"presets": ["draft", "standard", "auto"], "frames": 50, "rounds": 1, "seed": 0}}
    given = {"presets": list(PRESETS), "frames": 80, "rounds": 2}
    return {f"seed_{seed}": {**given, "seed": seed} for seed in range(27200, 27210)}


def _why(rows: pd.DataFrame) -> str:
    path = rows[rows["panel"] == "measured path"].set_index("setting")
    times = path["cost"] / path["cost"][STANDARD]
    errors = ", ".join(f"{name} {path['error'][name]:.2g} mm" for name in PRESETS)
    return (
        f"Draft takes {times['draft']:.0%} of its time, fine {times['fine']:.0%}, auto {times[AUTO]:.0%}. Measured "
        f"paths are off by: {errors}; frames of floor and body make most of it, which no preset changes. Draft's draws "
        "are too coarse for a verdict; auto is not the default, so that campaigns have the same settings and can be "
        "compared."
    )


STUDY = Study(
    parts=_parts,
    rows=preset_rows,
    chart=Scatter(
        title="The whole pipeline, preset by preset",
        cost="CPU time [s]",
        error="error [mm]",
        note="Synthetic campaigns, 800 × 450 pixels of 6 mm. CPU time of all stages, without figures and overlay; RMS "
        "errors but for the last two panels. Labels: presets. Stated u_val is what the errors are to "
        "stay below: less of it is no merit in itself. The bound is to be above the largest error, and no more than "
        "it must.",
        take="Take standard, the default.",
        why=_why,
        truth="The films share the camera model with calibration and tracking; the motion shares no code.",
    ),
)

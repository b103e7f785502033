"""Command uncertainty: covariance of the error of a run if the model is correct → uncertainty.mcap."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from towval.commands.console import Outcome, progress
from towval.commands.settings import settings_from
from towval.io.campaign import load_campaign
from towval.io.chain import check_together
from towval.io.provenance import provenance
from towval.io.records import read_calibration, read_decimated, read_simulated, read_tracks, write_uncertainty
from towval.model.geometry import position_rms
from towval.model.inputs import INPUTS, is_left_out
from towval.report.wording import decimal
from towval.selection.draws import sample_selecting
from towval.selection.margin import measurement_std_m, seen_places
from towval.validation.sampler import Case, UncertaintySettings


def run(
    campaign: Path, name: str, camera: Path, folder: Path, output: Path, keys: Mapping[str, Any] | None = None
) -> Outcome:
    """Sample the uncertainty of a run."""
    settings = settings_from(UncertaintySettings, keys, "uncertainty")
    given = load_campaign(campaign)
    files = {stage: folder / f"{stage}.mcap" for stage in ("track", "decimate", "simulate")}
    inputs = {"camera.mcap": camera, **{f"{stage}.mcap": path for stage, path in files.items()}}
    check_together(inputs, given.document, name)
    tracks, thin = read_tracks(files["track"]), read_decimated(files["decimate"])
    case = Case(
        given.scene,
        given.deviations,
        read_calibration(camera),
        *given.bodies,
        rover_track=tracks["rover"],
        rover_decimated=thin["rover"],
        object_track=tracks["object"],
        object_decimated=thin["object"],
        simulated=read_simulated(files["simulate"]),
        run=name,
        assumed=tuple(row.name for row in INPUTS.values() if is_left_out(row, given.document)),
    )
    measured = measurement_std_m(case.calibration, case.towed, seen_places(case.object_track))
    asked = None if settings.samples == "auto" else settings.samples
    with progress(f"uncertainty {name}", asked, "draw") as done:
        uncertainty = sample_selecting(case, settings, measurement_m=measured, progress=done)
    made_of = provenance("uncertainty", settings, inputs, run=name, document=given.document)
    write_uncertainty(output, uncertainty, case.simulated, made_of)
    u_val_mm = 1e3 * position_rms(uncertainty.validation)
    text = f"{uncertainty.samples} draws; u_val {decimal(u_val_mm)} mm, the RMS error that a right model would show"
    numbers = {"samples": uncertainty.samples, "u_val_mm": u_val_mm, "shares": dict(uncertainty.shares)}
    return Outcome(f"uncertainty {name}", (output,), text, numbers, uncertainty.findings)

"""Command simulate: decimate.mcap → simulate.mcap."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from towval.commands.console import Outcome
from towval.commands.settings import settings_from, without_auto
from towval.io.campaign import load_campaign
from towval.io.chain import check_together
from towval.io.provenance import provenance
from towval.io.records import read_calibration, read_decimated, read_tracks, write_simulated
from towval.model.errors import InputError
from towval.report.wording import millimetres
from towval.selection.margin import measurement_std_m, seen_places
from towval.selection.simulation import SELECTED, simulate_selecting
from towval.validation.simulate import SimulateSettings


def run(
    campaign: Path,
    track: Path,
    decimated: Path,
    output: Path,
    keys: Mapping[str, Any] | None = None,
    *,
    camera: Path | None = None,
) -> Outcome:
    """Simulate the towed object on the measured track of the rover.

    ``track`` gives the times of the output, ``decimated`` (``decimate.mcap``) the path of the rover and the first pose
    of the object; settings that are "auto" need the ``camera``.
    """
    keys, auto = without_auto(keys, *SELECTED)
    settings = settings_from(SimulateSettings, keys, "simulate")
    if auto and camera is None:
        raise InputError(
            f"simulate.{auto[0]} cannot be selected",
            got="auto without a camera",
            remedy="give camera.mcap, or a number",
        )
    given = load_campaign(campaign)
    inputs = {"track.mcap": track, "decimate.mcap": decimated, **({"camera.mcap": camera} if camera else {})}
    name = check_together(inputs, given.document)
    bodies = read_decimated(decimated)
    tracked = read_tracks(track)["object"]
    measured = np.inf
    if camera is not None:
        measured = measurement_std_m(read_calibration(camera), given.object, seen_places(tracked))
    settings, simulated = simulate_selecting(
        given.scene, bodies["rover"], bodies["object"], tracked.time_s, settings, auto=auto, measurement_m=measured,
        body=given.object, seen=tracked.seen,
    )  # fmt: skip
    write_simulated(output, simulated, provenance("simulate", settings, inputs, run=name, document=given.document))
    u_num_mm = 1e3 * simulated.statistics.get("u_num_m", np.nan)
    text = f"{simulated.rung}, {simulated.outcome}; numerical uncertainty {millimetres(u_num_mm / 1e3)}"
    numbers = {"rung": simulated.rung, "outcome": simulated.outcome, "u_num_mm": u_num_mm}
    return Outcome(f"simulate {name}".strip(), (output,), text, numbers, simulated.findings)

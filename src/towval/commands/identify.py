"""Command identify: all runs of a campaign → identify.mcap, identify.csv: inputs fitted to the runs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from towval.commands.console import Outcome
from towval.commands.run_folder import files
from towval.commands.settings import settings_from
from towval.io.atomic import check_own, check_plain, write_text
from towval.io.campaign import load_campaign
from towval.io.chain import check_together
from towval.io.provenance import provenance
from towval.io.records import read_calibration, read_decimated, read_simulated, read_tracks, read_uncertainty
from towval.io.records.identification import identified_table, write_identification
from towval.model import Body, Calibration
from towval.model.errors import InputError
from towval.validation.identify import IdentifySettings, MeasuredRun, identify
from towval.validation.seen_otherwise import seen_otherwise

_TABLE_MARK = "parameter,given,"
"""How a table that may be replaced begins."""


def run(campaign: Path, results: Path, output: Path, keys: Mapping[str, Any] | None = None) -> Outcome:
    """Fit inputs to the runs of a campaign, with results up to uncertainty, and predict each from the others."""
    settings = settings_from(IdentifySettings, keys, "identify")
    table = output.with_suffix(".csv")
    if table == output:
        raise InputError("-o names the table in place of the MCAP file beside it", got=output, allowed="identify.mcap")
    check_plain(table)
    check_own(table, _TABLE_MARK)
    given = load_campaign(campaign)
    runs: list[MeasuredRun] = []
    camera = results / "camera.mcap"
    inputs: dict[str, Path] = {"camera.mcap": camera}
    for name in given.runs:
        paths = files(results / name)
        stages = ("track", "decimate", "simulate", "uncertainty")
        together = {"camera.mcap": camera, **{f"{stage}.mcap": paths[stage] for stage in stages}}
        check_together(together, given.document, name)
        inputs |= {f"{name}/{stage}.mcap": paths[stage] for stage in stages}
        runs.append(_measured(name, paths, read_calibration(camera), given.bodies))
    identified = identify(given.scene, given.deviations, runs, settings)
    write_text(table, identified_table(identified), own=_TABLE_MARK)
    write_identification(output, identified, provenance("identify", settings, inputs, document=given.document))
    std = np.sqrt(np.diag(identified.covariance))
    values = {
        name: {"value": float(value), "std": float(deviation), "determined": bool(determined)}
        for name, value, deviation, determined in zip(
            identified.parameters, identified.values, std, identified.identifiable, strict=True
        )
    }
    text = "; ".join(f"{name} {found['value']:.5g} ± {found['std']:.2g}" for name, found in values.items())
    return Outcome("identify", (output, table), text, {"values": values}, identified.findings)


def _measured(name: str, paths: Mapping[str, Path], calibration: Calibration, bodies: tuple[Body, Body]) -> MeasuredRun:
    thin, simulated = read_decimated(paths["decimate"]), read_simulated(paths["simulate"])
    measured, uncertainty = read_tracks(paths["track"])["object"], read_uncertainty(paths["uncertainty"], draws=False)
    return MeasuredRun(
        name=name,
        rover=thin["rover"],
        towed=thin["object"],
        object_track=measured,
        time_s=simulated.time_s,
        measurement=uncertainty.measurement,
        rung=simulated.rung,
        sticking=simulated.sticking,
        findings=(*uncertainty.upstream, *measured.findings, *simulated.findings, *uncertainty.findings),
        otherwise=seen_otherwise(calibration, bodies, (thin["rover"], thin["object"]), measured),
    )

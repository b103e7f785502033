"""Command report: all results of a campaign → figures, summary.csv, report.html."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from towval.commands.overlay import run as write_run_overlay
from towval.commands.run_folder import files, read_run
from towval.commands.shared import settings_from
from towval.io.campaign import Campaign, load_campaign
from towval.io.figures import UncertaintyMap
from towval.io.identification import read_identification
from towval.io.provenance import file_hash, versions
from towval.io.records import read_calibration
from towval.io.report import write_report
from towval.io.report_data import InputRow, Provenance, ReportData, ReportSettings, RunReport
from towval.io.summary import write_summary
from towval.types import Body, Calibration
from towval.vision.uncertainty import uncertainty_map


def run(campaign: Path, results: Path, keys: Mapping[str, Any] | None = None, identified: Path | None = None) -> None:
    """Write the report of a campaign, its figures and its summary.

    Parameters
    ----------
    campaign : Path
        The campaign folder.
    results : Path
        Folder with ``camera.mcap`` and a folder a run; overlay videos that are missing there are made.
    keys : mapping, optional
        ``config["report"]``.
    identified : Path, optional
        ``identify.mcap`` to show in a section of its own.
    """
    settings = settings_from(ReportSettings, keys, "report")
    given = load_campaign(campaign)
    camera = results / "camera.mcap"
    calibration = read_calibration(camera)
    runs = []
    for name in given.runs:
        overlay = results / name / "overlay.mp4"
        if not overlay.is_file():
            write_run_overlay(campaign, name, camera, results / name, overlay, settings.overlay_width_px)
        runs.append(RunReport(read_run(given, name, results / name), overlay))
    data = ReportData(
        campaign=given.name,
        runs=tuple(runs),
        provenance=_provenance(given, results),
        calibration=calibration,
        uncertainty=_uncertainty(calibration, given.object),
        inputs=tuple(_inputs(given)),
        identification=None if identified is None else read_identification(identified),
    )
    write_summary(results / "summary.csv", [item.record.comparison for item in runs])
    write_report(results / "report.html", data, results / "figures")
    print(f"report: {results / 'report.html'}")


def _uncertainty(calibration: Calibration, body: Body) -> UncertaintyMap:
    """How sure a place on the plane of a body's top is, over the image."""
    height = body.tracked_plane_height_m
    grid = uncertainty_map(calibration, height, height_std_m=body.height_std_m)
    return UncertaintyMap(grid.pixels[0, :, 0], grid.pixels[:, 0, 1], grid.std_m, height)


def _provenance(given: Campaign, results: Path) -> Provenance:
    inputs = [given.folder / "campaign.yaml", *given.calibration_images, *given.floor_images]
    inputs += [entry.video for entry in given.runs.values()]
    made = [results / "camera.mcap", *(path for name in given.runs for path in files(results / name).values())]
    hashes = {path.name: file_hash(path) for path in inputs}
    hashes |= {str(path.relative_to(results)): file_hash(path) for path in made}
    return Provenance(
        command=f"snakemake --cores 2 --config campaign={given.folder}",
        versions=versions(),
        input_hashes=hashes,
        configuration=yaml.safe_dump(given.document, sort_keys=False, default_flow_style=None, allow_unicode=True),
    )


def _inputs(given: Campaign) -> Iterator[InputRow]:
    """The quantities that the simulation was given, as campaign.yaml has them."""
    scene, source = given.scene, "campaign.yaml"
    wish = scene.friction
    yield InputRow("mass of the object without load", f"{scene.body_mass:g}", "kg", source=source)
    yield InputRow("mass of the load", f"{scene.load.mass:g}", "kg", source=source)
    yield InputRow("place of the load", _point(scene.load.at), "m", source=source)
    yield InputRow("anchor on the object", _point(scene.anchor), "m", source=source)
    yield InputRow("hinge on the rover", _point(scene.hinge), "m", source=source)
    yield InputRow("rest length of the tether", f"{scene.tether.rest_length:g}", "m", source=source)
    yield InputRow("stiffness of the tether", f"{scene.tether.stiffness:g}", "N/m", source=source)
    yield InputRow("damping of the tether", f"{scene.tether.damping:g}", "N s/m", source=source)
    yield InputRow("kinetic friction coefficient", f"{wish.kinetic:g}", "", f"{wish.kinetic_std:g}", source)
    yield InputRow("static friction coefficient", f"{wish.static:g}", "", source=source)
    yield InputRow("stiction velocity", f"{wish.stiction_velocity:g}", "m/s", source=source)
    yield InputRow("friction velocity", f"{wish.friction_velocity:g}", "m/s", source=source)
    for body in given.bodies:
        height = f"{body.tracked_plane_height_m:g}"
        yield InputRow(f"height of the {body.name}'s top", height, "m", f"{body.height_std_m:g}", source)


def _point(xy: Any) -> str:
    return f"({xy[0]:g}, {xy[1]:g})"

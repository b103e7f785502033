"""Command report: all results of a campaign → figures, summary.csv, report.html."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from towval.commands.overlay import run as write_run_overlay
from towval.commands.run_folder import files, read_run
from towval.commands.settings import settings_from
from towval.io.campaign import Campaign, load_campaign
from towval.io.mcap_file import read_provenance
from towval.io.provenance import file_hash, versions
from towval.io.records import read_calibration
from towval.io.records.identification import read_identification
from towval.io.summary import write_summary
from towval.optics.plane_uncertainty import uncertainty_map
from towval.report.data import InputRow, Provenance, ReportData, ReportSettings, RunReport
from towval.report.page import write_report


def run(campaign: Path, results: Path, keys: Mapping[str, Any] | None = None, identified: Path | None = None) -> None:
    """Write the report of a campaign, its figures and its summary.

    Parameters
    ----------
    results : Path
        Folder with ``camera.mcap`` and one folder per run; missing overlay videos are made.
    identified : Path, optional
        ``identify.mcap``, shown in a section of its own.
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
        uncertainty=uncertainty_map(
            calibration, given.object.tracked_plane_height_m, height_std_m=given.object.height_std_m
        ),
        inputs=tuple(_inputs(given)),
        identification=None if identified is None else read_identification(identified),
    )
    write_summary(results / "summary.csv", [item.record.comparison for item in runs])
    write_report(results / "report.html", data, results / "figures")
    print(f"report: {results / 'report.html'}")


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
        settings=_settings(made),
        configuration=yaml.safe_dump(given.document, sort_keys=False, default_flow_style=None, allow_unicode=True),
    )


def _settings(made: Sequence[Path]) -> dict[str, str]:
    """Settings of each stage from its files; runs with the same settings together."""
    folders: dict[tuple[str, str], list[str]] = {}
    for path in made:
        settings = read_provenance(path).get("settings", "{}")
        if settings != "{}":
            folders.setdefault((path.stem, settings), []).append(path.parent.name)
    stages = Counter(stage for stage, _ in folders)
    return {
        stage if stages[stage] == 1 else f"{stage}, run {', '.join(runs)}": settings
        for (stage, settings), runs in folders.items()
    }


def _inputs(given: Campaign) -> Iterator[InputRow]:
    """The inputs of the simulation with the standard deviations that were drawn from."""
    scene, std, document = given.scene, given.deviations, given.document

    def row(name: str, value: str, unit: str, deviation: float | None, *key: str) -> InputRow:
        source, section = "campaign.yaml", document
        for part in key:
            section = section.get(part, {})
        if deviation is not None and section == {}:
            source += "; deviation: default"
        return InputRow(name, value, unit, "" if deviation is None else f"{float(f'{deviation:.1e}'):g}", source)

    load = ("object", "load")
    yield row("mass of the object without load", f"{scene.body_mass:g}", "kg", std.body_mass, "object", "mass_std_kg")
    yield row("mass of the load", f"{scene.load.mass:g}", "kg", std.load_mass, *load, "mass_std_kg")
    yield row("place of the load", _point(scene.load.at), "m", std.load_at, *load, "at_std_m")
    yield row("anchor on the object", _point(scene.anchor), "m", std.anchor, "object", "tether_anchor_std_m")
    yield row("hinge on the rover", _point(scene.hinge), "m", std.hinge, "rover", "tether_hinge_std_m")
    tether, friction = scene.tether, scene.friction
    yield row(
        "rest length of the tether", f"{tether.rest_length:g}", "m", std.rest_length, "tether", "rest_length_std_m"
    )
    yield row(
        "stiffness of the tether", f"{tether.stiffness:g}", "N/m", std.stiffness, "tether", "stiffness_std_N_per_m"
    )
    yield row("damping of the tether", f"{tether.damping:g}", "N s/m", None)
    yield row("kinetic friction coefficient", f"{friction.kinetic:g}", "", std.friction, "friction", "kinetic_std")
    static_std = std.friction * friction.static / friction.kinetic
    yield row("static friction coefficient", f"{friction.static:g}", "", static_std, "friction", "kinetic_std")
    yield row("stiction velocity", f"{friction.stiction_velocity:g}", "m/s", None)
    yield row("friction velocity", f"{friction.friction_velocity:g}", "m/s", None)
    for body in given.bodies:
        height, key = f"{body.tracked_plane_height_m:g}", "tracked_plane_height_std_m"
        yield row(f"height of the {body.name}'s top", height, "m", body.height_std_m, body.name, key)


def _point(xy: Any) -> str:
    return f"({xy[0]:g}, {xy[1]:g})".replace("-", "−")

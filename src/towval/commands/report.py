"""Command report: all results of a campaign → figures, summary.csv, report.html."""

import json
import os
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike

from towval.commands.console import Outcome
from towval.commands.run_folder import files, read_run, same_footage
from towval.commands.settings import settings_from
from towval.io.atomic import check_own
from towval.io.campaign import Campaign, load_campaign
from towval.io.chain import Origin, check_made_of, read_origin
from towval.io.manifest import MANIFEST, check_list, replacing_files, write_manifest
from towval.io.provenance import file_hash
from towval.io.reading import is_plain_file
from towval.io.records import read_calibration
from towval.io.records.identification import read_identification
from towval.io.schema import without_defaults
from towval.io.summary import SUMMARY_MARK, write_summary
from towval.model import Finding, Severity, Verdict
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.inputs import INPUTS, UncertainInput, is_left_out, stated_in
from towval.model.repeats import Corridor
from towval.model.run_record import RunRecord
from towval.optics.plane_uncertainty import uncertainty_map
from towval.report.data import InputRow, Provenance, ReportData, ReportSettings, RunReport
from towval.report.page import write_report
from towval.report.templating import PAGE_MARK
from towval.validation.campaign import campaign_verdict
from towval.validation.repeats import corridor, corridor_finding

_PROCESSES = 2  # that draw figures, as the rule of the workflow says


def run(
    campaign: Path, results: Path, keys: Mapping[str, Any] | None = None, identified: Path | None = None
) -> Outcome:
    """Write the report of a campaign, its figures and summary; ``identified`` inputs have a section of their own."""
    settings = settings_from(ReportSettings, keys, "report")
    check_list(results / MANIFEST)
    for name, mark in (("report.html", PAGE_MARK), ("summary.csv", SUMMARY_MARK)):
        check_own(results / name, mark)
    given = load_campaign(campaign)
    identified = None if identified is None else _among(results, identified)
    camera = results / "camera.mcap"
    calibration = read_calibration(camera)
    runs = [
        RunReport(read_run(given, name, results / name, camera), entry.video, entry.damaged_video)
        for name, entry in given.runs.items()
    ]
    if identified is not None:
        made = {f"{name}/{path.name}": path for name in given.runs for path in files(results / name).values()}
        check_made_of(identified, made, given.document)
    repeats = _repeats(given, runs)
    together = _together([item.record for item in runs])
    remarks = [*_left_out(given), *same_footage(given)]
    data = ReportData(
        campaign=given.name,
        runs=tuple(runs),
        embed_mb=settings.embed_mb,
        formats=settings.formats,
        provenance=_provenance(given, results, identified),
        calibration=calibration,
        uncertainty=uncertainty_map(
            calibration, given.object.tracked_plane_height_m, height_std_m=given.object.height_std_m
        ),
        inputs=tuple(_inputs(given)),
        findings=(together, *remarks, *map(corridor_finding, repeats)),
        repeats=repeats,
        identification=None if identified is None else read_identification(identified),
    )
    with replacing_files(results / "figures") as drawn:
        write_report(results / "report.html", data, drawn, _PROCESSES)
        figures = [results / "figures" / path.name for path in drawn.iterdir()]
    tables = write_summary(results / "summary.csv", [item.record.comparison for item in runs])
    write_manifest(results / MANIFEST, [*_made(results, given, identified), *figures, *tables])
    verdicts = {item.record.name: item.record.comparison.verdict.value for item in runs}
    text = "; ".join(f"run {name} {verdict}" for name, verdict in verdicts.items())
    written = (results / "report.html", results / "summary.csv")
    return Outcome("report", written, text, {"verdicts": verdicts}, (together, *remarks))


def _among(results: Path, identified: Path) -> Path:
    """What was identified as a file of the results: their list names no other, and its table as well."""
    place, folder = Path(os.path.abspath(identified)), Path(os.path.abspath(results))
    if not place.is_relative_to(folder):
        raise InputError(f"{identified} is not among the results", remedy=f"call identify with -o below {results}")
    table = identified.with_suffix(".csv")
    if not is_plain_file(table):
        raise InputError(f"{table} is missing", remedy="call identify again, which writes it, too")
    return results / place.relative_to(folder)


def _repeats(given: Campaign, runs: Sequence[RunReport]) -> tuple[Corridor, ...]:
    """The groups of repeated runs, without the runs that were not judged."""
    records = {run.record.name: run.record for run in runs if run.record.comparison.verdict is not Verdict.NOT_JUDGED}
    groups = [[records[name] for name in group if name in records] for group in given.repeats]
    return tuple(
        corridor([(record.object_track, record.comparison) for record in group]) for group in groups if len(group) > 1
    )


def _together(records: Sequence[RunRecord]) -> Finding:
    """The verdict on all runs together as a finding of the campaign."""
    stated = [record.uncertainty.confidence for record in records if record.uncertainty is not None]
    verdict = campaign_verdict([record.comparison for record in records], min(stated, default=0.99))
    severity = Severity.NOTE if verdict.verdict is Verdict.AGREES else Severity.WARNING
    return finding("campaign_verdict", severity, sentence=verdict.sentence)


def _left_out(given: Campaign) -> list[Finding]:
    """The finding that names the runs that are left out, if any are."""
    reasons = ", ".join(f"run {name} ({reason})" for name, reason in given.left_out.items())
    return [finding("runs_left_out", runs=reasons)] if reasons else []


def _made(results: Path, given: Campaign, identified: Path | None) -> list[Path]:
    """The files of a campaign's results up to the page, without figures and tables."""
    runs = [results / name for name in given.runs]
    found = [path for folder in runs for path in files(folder).values()]
    found += [results / "camera.mcap", results / "report.html"]
    return found if identified is None else [*found, identified, identified.with_suffix(".csv")]


def _provenance(given: Campaign, results: Path, identified: Path | None = None) -> Provenance:
    """What the results record of their inputs; campaign.yaml and the hashes of it and of the results are as of now."""
    made = [results / "camera.mcap", *(path for name in given.runs for path in files(results / name).values())]
    origins = {path: read_origin(path) for path in made}
    made_names = {path.name for path in made}
    stated = _stated([*origins.values(), *([] if identified is None else [read_origin(identified)])])
    hashes = {"campaign.yaml": file_hash(given.folder / "campaign.yaml")}
    for origin in origins.values():
        hashes |= {name: value for name, value in origin.inputs.items() if name not in made_names}
    hashes |= {str(path.relative_to(results)): file_hash(path) for path in made}
    return Provenance(
        command=shlex.join(["towval", "run", str(given.folder), "--results", str(results.parent), *stated]),
        versions=_versions(origins.values()),
        input_hashes=hashes,
        settings=_settings(origins),
        configuration=yaml.safe_dump(given.document, sort_keys=False, default_flow_style=None, allow_unicode=True),
    )


def _versions(origins: Iterable[Origin]) -> dict[str, str]:
    """Versions with which the results were made; all of them where they differ."""
    found: dict[str, dict[str, None]] = {}
    for origin in origins:
        for name, version in origin.versions.items():
            found.setdefault(name, {})[version] = None
    return {name: ", ".join(each) for name, each in found.items()}


def _stated(origins: Iterable[Origin]) -> Iterator[str]:
    """Options of ``towval run`` for the settings that are not the defaults, as far as all runs have the same."""
    found: dict[tuple[str, str], list[Any]] = {}
    for origin in origins:
        if origin.stage:  # else another program's, which records no settings
            for key, value in json.loads(origin.settings).items():
                found.setdefault((origin.stage, key), []).append(value)
    for (stage, key), values in found.items():
        same = all(value == values[0] for value in values)
        if same and values[0] is not None and without_defaults(stage, {key: values[0]}):
            yield from ("--set", f"{stage}.{key}={json.dumps(values[0])}")


def _settings(origins: Mapping[Path, Origin]) -> dict[str, str]:
    """Settings of each stage from its files; runs with the same settings together."""
    folders: dict[tuple[str, str], list[str]] = {}
    for path, origin in origins.items():
        if origin.settings != "{}":
            folders.setdefault((path.stem, origin.settings), []).append(path.parent.name)
    stages = Counter(stage for stage, _ in folders)
    return {
        stage if stages[stage] == 1 else f"{stage}, run {', '.join(runs)}": settings
        for (stage, settings), runs in folders.items()
    }


def _inputs(given: Campaign) -> Iterator[InputRow]:
    """Inputs that the scene has and that can have a deviation, with it, then gravity, which is taken as exact."""
    shown: dict[str, ArrayLike] = {f"{body.name}_height": body.tracked_plane_height_m for body in given.bodies}
    shown["board_thickness"] = given.floor_reference.board_thickness_m
    shown["regions"] = [region.factor for region in given.scene.ground.regions]  # of the row, a change of them all
    for row in INPUTS.values():
        if row.stated and row.present(given.scene):
            source = (
                "campaign.yaml" if stated_in(given.document, row.stated.key) is not None else _default_of(row, given)
            )
            value = _number(shown.get(row.name, row.values(given.scene)))
            std = float(f"{given.deviations[row.name]:.1e}")
            yield InputRow(row.label, value, row.unit, f"{std:g}", source)
    source = "campaign.yaml" if "gravity_m_per_s2" in given.document else "default"
    yield InputRow("gravity", f"{given.scene.ground.gravity:g}", "m/s²", "", source)


def _default_of(row: UncertainInput, given: Campaign) -> str:
    return "left out: default" if is_left_out(row, given.document) else "campaign.yaml; deviation: default"


def _number(value: ArrayLike) -> str:
    parts = [f"{part:g}" for part in np.atleast_1d(value)]
    return (parts[0] if len(parts) == 1 else f"({', '.join(parts)})").replace("-", "−")

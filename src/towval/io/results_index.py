"""Many folders of results as tables: one row per run, with its findings, inputs and costs; kept as SQLite."""

import csv
import json
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from towval.io.atomic import check_own, replacing
from towval.io.manifest import MANIFEST, is_copied, listed_folders
from towval.io.mcap_file import read_details
from towval.io.provenance import file_hash
from towval.io.summary import COLUMNS
from towval.model.conventions import STAGES_OF_RUN
from towval.model.errors import InputError
from towval.model.inputs import INPUTS

_FILES_OF_RUN = tuple(f"{stage}.mcap" for stage in STAGES_OF_RUN)
_LOG = "logs/track.log"
"""What the workflow leaves of a run that it could not track."""

INDEX_MARK = 'CREATE TABLE "runs" (\n"source" TEXT,\n  "campaign" TEXT,'
"""What an SQLite file that may be replaced says near its beginning."""

UNFINISHED = "unfinished"
"""In place of a verdict: the run has no comparison yet."""

_INPUTS = frozenset(row.label for row in INPUTS.values())

_KEY = ("source", "campaign", "run")
_MEASURES = tuple(name for name in COLUMNS if name not in ("run", "verdict", "findings"))
_SHAPES = {
    "runs": (*_KEY, "state", "verdict", *_MEASURES, "main_input", "main_share", "version", "made_s", "cpu_s", "wall_s"),
    "findings": (*_KEY, "stage", "code", "severity", "text"),
    "inputs": (*_KEY, "stage", "input", "sha256"),
    "settings": (*_KEY, "stage", "settings"),
}
"""Columns of each table; ``made_s`` is the time of the newest file [s since 1970], costs are sums over the stages."""


@dataclass(frozen=True)
class ResultsIndex:
    """Runs of many campaigns. A table each of runs, findings, inputs and settings.

    Every table begins with ``source`` (the folder that was given), ``campaign`` and ``run``. ``runs`` adds those of
    ``summary.csv`` but the findings, and in ``state`` the last stage; without a comparison the verdict is "unfinished".
    ``inputs`` names files, and parts of campaign.yaml as ``campaign.yaml: friction``.
    """

    runs: pd.DataFrame
    findings: pd.DataFrame
    inputs: pd.DataFrame
    settings: pd.DataFrame


def read_results(folders: Sequence[Path]) -> ResultsIndex:
    """Index of all runs below ``folders``, each the results of one campaign or of many.

    Only details and provenance of the files are read. A file that is damaged, vanishes meanwhile or is of a version
    that wrote them otherwise counts as not made, and so does one of another run, or one made of a file that is gone or
    has been replaced since.
    Results of a run that a later report of its campaign leaves out are passed over, and so is a campaign that one of
    the folders before has led to.

    Raises `InputError` when a folder is missing or none holds a run.
    """
    rows: dict[str, list[tuple[Any, ...]]] = {table: [] for table in _SHAPES}
    read: set[Path] = set()
    for source in folders:
        if not source.is_dir():
            raise InputError(f"{source} is no folder", remedy="give the folder of results, as results/")
        for campaign in _campaigns(source):
            if campaign.resolve() in read:
                continue
            read.add(campaign.resolve())
            shared = _stage_of(campaign / "camera.mcap")
            for run in current_runs(campaign):
                # By its name in this folder: of two links what they lead to may have the same name.
                key = (str(source), Path(os.path.abspath(campaign)).name, run.name)
                for table, row in _rows_of(run, shared):
                    rows[table].append((*key, *row))
    if not rows["runs"]:
        raise InputError(
            "there are no runs", got=", ".join(map(str, folders)), allowed="folders with <campaign>/<run>/track.mcap"
        )
    tables = {name: pd.DataFrame(rows[name], columns=list(columns)) for name, columns in _SHAPES.items()}
    return ResultsIndex(**tables)


def write_index(path: Path, index: ResultsIndex) -> None:
    """Write the tables as an SQLite file, whole or not at all."""
    check_own(path, INDEX_MARK)
    with replacing(path) as temporary, closing(sqlite3.connect(temporary)) as database:
        for name in _SHAPES:
            getattr(index, name).to_sql(name, database, index=False, if_exists="replace")
        database.commit()


def _campaigns(source: Path) -> list[Path]:
    """The folder itself and those in it, as far as they hold runs: beside campaigns there may be a run on its own."""
    return [folder for folder in (source, *_folders(source)) if _runs(folder)]


def _runs(campaign: Path) -> list[Path]:
    return [path for path in _folders(campaign) if any((path / name).is_file() for name in ("track.mcap", _LOG))]


def current_runs(campaign: Path) -> list[Path]:
    """The runs but those that the last report leaves out: older than its list of files, and not on it.

    In a copy that has lost the order of times, all that are not on it.
    """
    listing = campaign / MANIFEST
    try:
        listed, made = listed_folders(listing), listing.stat().st_mtime
        further = [run for run in _runs(campaign) if run.name not in listed and _newest_s(run) > made]
        if further and is_copied(listing):
            further = []
    except (InputError, FileNotFoundError):
        return _runs(campaign)
    return [run for run in _runs(campaign) if run.name in listed or run in further]


def _newest_s(run: Path) -> float:
    """When the newest file of a run was made [s since 1970]."""
    times = []
    for name in (*_FILES_OF_RUN, _LOG):
        with suppress(FileNotFoundError):
            times.append((run / name).stat().st_mtime)
    return max(times, default=0.0)


def _folders(folder: Path) -> list[Path]:
    return sorted(entry for entry in folder.iterdir() if entry.is_dir())


class _Stage(NamedTuple):
    """What a file says of itself, with parts of campaign.yaml among the inputs; when it was made [s since 1970]."""

    details: dict[str, Any]
    findings: list[tuple[str, str, str]]
    run: str | None
    inputs: dict[str, str]
    settings: str
    version: str | None
    made_s: float


def _stage_of(path: Path) -> _Stage | None:
    try:
        details, provenance = read_details(path)
        inputs, sections, versions = (
            dict(json.loads(provenance.get(key, "{}"))) for key in ("inputs_sha256", "campaign_sha256", "versions")
        )
        return _Stage(
            details,
            list(_findings(details)),
            provenance.get("run"),
            inputs | {f"campaign.yaml: {name}": digest for name, digest in sections.items()},
            provenance.get("settings", "{}"),
            versions.get("towval"),
            path.stat().st_mtime,
        )
    except (InputError, FileNotFoundError, AttributeError, LookupError, TypeError, ValueError):
        return None  # damaged, gone meanwhile, or of a version that wrote otherwise


def _rows_of(run: Path, camera: _Stage | None) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Rows of a run, each with the name of its table and without the key."""
    made = _belonging(run, camera)
    stages = {**({"calibrate": camera} if camera else {}), **made}
    for stage, known in stages.items():
        yield from (("findings", (stage, *row)) for row in known.findings)
        yield from (("inputs", (stage, name, digest)) for name, digest in known.inputs.items())
        yield "settings", (stage, known.settings)
    compared, sampled = (made[stage].details if stage in made else {} for stage in ("compare", "uncertainty"))
    # What no input explains alone has a share, too; of few draws that is all.
    shares = sampled.get("shares", {})
    main = max((name for name in shares if name in _INPUTS and shares[name]), key=shares.get, default="")
    yield (
        "runs",
        (
            next(reversed(made), ""),
            compared.get("verdict", UNFINISHED),
            *(compared.get(name) for name in _MEASURES),
            main,
            shares.get(main),
            ", ".join(dict.fromkeys(known.version for known in stages.values() if known.version)) or None,
            max((known.made_s for known in made.values()), default=None),
            *_costs(run),
        ),
    )


def _belonging(run: Path, camera: _Stage | None) -> dict[str, _Stage]:
    """The stages of a run, without what is of another run or was made of files that are gone or have been replaced.

    Only a file that is newer than what was made of it is hashed: copies lose the order of times, results are many.
    """
    kept: dict[str, _Stage] = {}
    before = {"camera": (run.parent / "camera.mcap", camera)}
    for stage in STAGES_OF_RUN:
        path = run / f"{stage}.mcap"
        known = _stage_of(path)
        if known is not None:
            named = [(*before[name], known.inputs[f"{name}.mcap"]) for name in before if f"{name}.mcap" in known.inputs]
            stale = any(
                origin is None or (origin.made_s > known.made_s and _replaced(place, digest))
                for place, origin, digest in named
            )
            if not stale and known.run in (None, "", run.name):
                kept[stage] = known
        # The workflow takes a file away before it makes it anew: where that fails, what was made of it stays.
        before[stage] = path, kept.get(stage)
    return kept


def _replaced(path: Path, digest: str) -> bool:
    try:
        return file_hash(path) != digest
    except FileNotFoundError:
        return True


def _findings(notes: dict[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Code, severity and text of a stage's findings; those of ``track`` and ``decimate`` stand by body."""
    bodies = [part for part in notes.values() if isinstance(part, dict)]
    for part in (notes, *bodies):
        for row in part.get("findings") or ():
            yield row["code"], row["severity"], row["text"]


def _costs(run: Path) -> tuple[float | None, float | None]:
    """CPU and wall time of the stages of a run [s], where the workflow left its benchmarks.

    The CPU time is a lower limit: Snakemake misses what a job spends after its last look.
    """
    cpu, wall = [], []
    for path in sorted((run / "benchmarks").glob("*.tsv")):
        with path.open(encoding="utf-8") as stream:
            for row in csv.DictReader(stream, delimiter="\t"):
                cpu.append(_seconds(row.get("cpu_time")))
                wall.append(_seconds(row.get("s")))
    return (sum(cpu), sum(wall)) if wall else (None, None)


def _seconds(text: str | None) -> float:
    try:
        return float(text or 0)
    except ValueError:  # Snakemake writes "NA" for a job that ended before it was measured.
        return 0.0

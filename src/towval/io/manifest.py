"""The list of a campaign's results with their SHA-256, and whether a folder still is what its list says.

The list has the format of ``sha256sum``, so that ``sha256sum --check`` reads it, too.
"""

import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from towval.io.atomic import not_ours, write_text
from towval.io.campaign import Campaign
from towval.io.chain import read_origin
from towval.io.mcap_file import is_own
from towval.io.provenance import file_hash
from towval.io.reading import check_name, is_folder, is_plain_file, read_bytes
from towval.model.conventions import STAGES_OF_RUN
from towval.model.errors import InputError

MANIFEST = "files.sha256"
_LINE = re.compile(r"([0-9a-f]{64})  (\S.*)")
_MOST_BYTES = 16 * 2**20
_VARIABLE = re.compile(r"<\w+>")
_PERIODIC = re.compile(r"(.+)\1{19,}$")
_UNLISTED = ("logs", "benchmarks")
"""Folders that hold no results."""

LATER = (
    "exchange.mcap", "lichtblick.json", "rerun.rbl", "overlay.mp4", "start.png", "identify.mcap", "identify.csv",
    MANIFEST,
)  # fmt: skip
"""Files that may be made after the list, or without it; all but pictures, films and the list are checked elsewhere."""


@dataclass(frozen=True)
class Listed:
    """A file of the list: its name in the folder, its SHA-256 there and now (None where it is missing)."""

    name: str
    stated: str
    found: str | None


def write_manifest(path: Path, files: Iterable[Path]) -> None:
    """Write the list of files in the folder of ``path`` or below; raises as :func:`check_list`."""
    names = {file.relative_to(path.parent).as_posix(): file for file in files}
    check_list(path)
    write_text(path, "".join(f"{file_hash(names[name])}  {name}\n" for name in sorted(names)))


@contextmanager
def replacing_files(folder: Path) -> Iterator[Path]:
    """An empty folder whose files take their places in ``folder`` when the block ends without an error.

    Those that the list beside ``folder`` names there, and that are made no more, are removed where they still are as
    the list says; all else stays.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        yield fresh
        folder.mkdir(exist_ok=True)
        placed = {path.replace(folder / path.name) for path in fresh.iterdir()}
        manifest = folder.parent / MANIFEST
        for stated, name in _entries(manifest) if is_plain_file(manifest) else ():
            path = folder.parent / name
            if path.parent == folder and path not in placed and is_plain_file(path) and file_hash(path) == stated:
                path.unlink()
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def check_list(path: Path) -> None:
    """Refuse to replace a file that is no list: it is somebody else's, or too damaged to tell.

    Raises `InputError`; nothing is checked where there is no file.
    """
    if is_plain_file(path) and not _is_list(path):
        raise not_ours(path)


def _is_list(path: Path) -> bool:
    try:
        _entries(path)
    except InputError:
        return False
    return True


def read_manifest(path: Path) -> list[Listed]:
    """The list and what is on the disk.

    Raises `InputError` when it is missing, or a line of it is no line of ``sha256sum`` or leads out of the folder.
    """
    return [
        Listed(name, stated, file_hash(path.parent / name) if is_plain_file(path.parent / name) else None)
        for stated, name in _entries(path)
    ]


def listed_folders(path: Path) -> set[str]:
    """Folders beside the list of which it names a file, such as those of runs; raises as :func:`read_manifest`."""
    return {name.split("/")[0] for _, name in _entries(path) if "/" in name}


def is_copied(path: Path) -> bool:
    """Whether times in the folder are those of copying: a page, table or figure is newer than the list of it.

    The stage report writes the list last. Raises as :func:`read_manifest`.
    """
    made = path.stat().st_mtime_ns
    of_report = [(stated, path.parent / name) for stated, name in _entries(path) if not name.endswith(".mcap")]
    newer = (row for row in of_report if is_plain_file(row[1]) and row[1].stat().st_mtime_ns > made)
    return any(file_hash(file) == stated for stated, file in newer)


def _entries(path: Path) -> list[tuple[str, str]]:
    """SHA-256 and name of each line."""
    text = read_bytes(path, _MOST_BYTES, "run the stage report").decode("utf-8", errors="replace")
    entries = []
    for number, line in enumerate(text.removesuffix("\n").split("\n"), start=1):
        match = _LINE.fullmatch(line)
        if not match or match[2].startswith("/") or ".." in match[2].split("/"):
            raise InputError(f"{path} is damaged", got=f"line {number}: {line[:120]!r}", remedy="run report again")
        entries.append((match[1], match[2]))
    return entries


def unlisted(folder: Path, listed: Iterable[Listed]) -> Iterator[str]:
    """Names of files that lie among the results and are on no list."""
    known = {row.name for row in listed}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        aside = any(part.startswith(".") or part in _UNLISTED for part in name.parts) or name.name in LATER
        if not (aside or path.is_dir() or name.as_posix() in known):
            yield name.as_posix()


def _check_names_for_snakemake(folder: Path, lab: Iterable[Path]) -> None:
    """Refuse paths that Snakemake would misread in a rule; variables and repetition matter in that of results only."""
    braces = [path for path in (folder, *lab) if "{" in str(path) or "}" in str(path)]
    variable, periodic = _VARIABLE.search(str(folder)), _PERIODIC.search(folder.name)
    if braces:
        fault = f"{braces[0]} has a brace in its path, which Snakemake takes for one of its own"
    elif variable:
        fault = f"{folder} has {variable[0]} in its path, which Snakemake takes for a variable"
    elif periodic:
        fault = f"the campaign's name repeats {periodic[1]!r} twenty times or more, which Snakemake refuses"
    else:
        return
    raise InputError(fault, remedy="rename it")


def check_results(results: Path, campaigns: Mapping[str, Campaign]) -> None:
    """Refuse a folder of results in which the workflow would replace files of the lab.

    Snakemake removes what it is about to make; what stands at these names must be ours.

    Raises `InputError` where the results would go into the campaign's own folder, over a file that no stage made, or
    over those of another campaign.
    """
    check_name(results, "config: results")
    for name, campaign in campaigns.items():
        lab = [*campaign.calibration_images, *campaign.floor_images, *(run.video for run in campaign.runs.values())]
        _check_names_for_snakemake(results / name, lab)
        folder = results / name
        if folder.resolve() == campaign.folder.resolve():
            raise InputError(
                "the results would go into the campaign's own folder",
                got=folder,
                remedy="set another folder as results",
            )
        _check_others(folder, campaign.runs)
        if not _is_of(folder, lab):
            raise InputError(
                f"{folder} holds the results of another campaign of this name",
                got=f"made of none of the pictures and videos of {campaign.folder}",
                remedy="set another folder as results (--results); or move those of the other campaign away",
            )


def _is_of(folder: Path, lab: Iterable[Path]) -> bool:
    """Whether results may be of a campaign: some were made of a file of the lab, or there are none.

    Footage may be exchanged and pictures taken anew, and campaigns may be moved; but not all of that at once.
    """
    hashed, others = cache(file_hash), False
    for path in (folder / "camera.mcap", *folder.glob("*/track.mcap")):
        with suppress(InputError):  # missing or damaged
            made_of = {digest for name, digest in read_origin(path).inputs.items() if name != "camera.mcap"}
            if made_of and any(hashed(file) in made_of for file in lab):
                return True
            others |= bool(made_of)
    return not others


def _check_others(folder: Path, runs: Iterable[str]) -> None:
    """Refuse files of others where the results of a campaign are to be made; raises `InputError`."""
    of_runs = [folder / run for run in runs]
    results = [folder / "camera.mcap", folder / "identify.mcap"]
    results += [run / f"{stage}.mcap" for run in of_runs for stage in (*STAGES_OF_RUN, "exchange")]
    there = [path for path in results if is_plain_file(path)]
    others = [path for path in there if not is_own(path)]
    # The workflow writes logs, and `towval report` by hand a list: where there are these, all else is ours.
    if not ((folder / "logs").is_dir() or (is_plain_file(folder / MANIFEST) and _is_list(folder / MANIFEST))):
        figures = folder / "figures"
        others += [figures] if is_folder(figures) and any(figures.iterdir()) else []
        beside = [(folder / "identify.mcap", "identify.csv")]
        beside += [(run / "exchange.mcap", name) for run in of_runs for name in ("lichtblick.json", "rerun.rbl")]
        alone = [folder / "report.html", folder / "summary.csv", folder / MANIFEST]
        alone += [made.with_name(name) for made, name in beside if made not in there]
        others += [path for path in alone if is_plain_file(path)]
    if others:
        raise not_ours(others[0])

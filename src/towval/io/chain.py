"""Whether results belong together: each file records what it was made of, and every reader compares."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from towval.io.mcap_file import read_provenance
from towval.io.provenance import canonical, file_hash, read_sections, text_hash
from towval.model.errors import InputError


@dataclass(frozen=True)
class Origin:
    """What a result was made of, as it says itself.

    ``stage`` and ``run`` (empty for what all runs share); ``inputs`` and ``sections``, of campaign.yaml, by name, each
    with its SHA-256; ``versions`` of programs; ``settings`` as JSON.
    """

    stage: str
    run: str
    inputs: Mapping[str, str]
    sections: Mapping[str, str]
    versions: Mapping[str, str] = field(default_factory=dict)
    settings: str = "{}"


def read_origin(path: Path) -> Origin:
    """The origin that a file records, empty for one that no stage wrote.

    Raises `InputError` when the file is missing, damaged, or of an older version.
    """
    known = read_provenance(path)
    if not known:
        return Origin("", "", {}, {})
    try:
        inputs, sections, versions = (
            {str(name): str(value) for name, value in json.loads(known[key]).items()}
            for key in ("inputs_sha256", "campaign_sha256", "versions")
        )
        return Origin(known["stage"], known["run"], inputs, sections, versions, known["settings"])
    except (KeyError, ValueError, AttributeError, RecursionError):
        raise InputError(
            f"{path} does not say what it was made of",
            allowed="a result of this version of towval",
            remedy="run the stage that makes it again",
        ) from None


def check_together(files: Mapping[str, Path], document: Mapping[str, Any] | None = None, run: str | None = None) -> str:
    """Check that results were made of each other, of one run and of one campaign.yaml.

    Returns the run, empty where none of the files has one. ``files`` are results by the names by which they record each
    other (``camera.mcap``, ``track.mcap``, ...), ``document`` campaign.yaml as it is now, ``run`` the one that is asked
    for. `InputError` for the first file that does not belong to the others names both, and what differs.
    """
    origins = {name: read_origin(path) for name, path in files.items()}
    hashes = {name: file_hash(path) for name, path in files.items()}
    found, owner = run, "the run asked for"
    for name, origin in origins.items():
        _check_kind(files[name], origin, name)
        if origin.run and found not in (None, origin.run):
            raise _apart(files[name], f"run {origin.run}", f"run {found}, as {owner}")
        if origin.run and found is None:
            found, owner = origin.run, str(files[name])
        _check_made_of(files[name], origin, files, hashes)
        _check_sections(files[name], origin, document)
    return found or ""


def check_made_of(path: Path, files: Mapping[str, Path], document: Mapping[str, Any] | None = None) -> None:
    """Check that one result was made of others, of all runs perhaps, and of campaign.yaml as it is.

    Raises `InputError` as :func:`check_together` does.
    """
    origin = read_origin(path)
    _check_made_of(path, origin, files, {name: file_hash(files[name]) for name in origin.inputs.keys() & files.keys()})
    _check_sections(path, origin, document)


def _check_made_of(path: Path, origin: Origin, files: Mapping[str, Path], hashes: Mapping[str, str]) -> None:
    for name in sorted(origin.inputs.keys() & hashes.keys()):
        if origin.inputs[name] != hashes[name]:
            got = f"made from another {name} ({origin.inputs[name][:12]}…)"
            raise _apart(path, got, f"made from {files[name]} ({hashes[name][:12]}…)")


def _check_sections(path: Path, origin: Origin, document: Mapping[str, Any] | None) -> None:
    changed = changed_sections(origin, document) if document is not None else []
    if changed:
        # Another version of towval may read a part of it that the stage did not read then.
        got = f"campaign.yaml, or what this stage reads of it, was changed since in: {', '.join(changed)}"
        raise _apart(path, got, "made with campaign.yaml as it is")


def changed_sections(origin: Origin, document: Mapping[str, Any]) -> list[str]:
    """Parts of campaign.yaml that are no longer what a result was made with."""
    if not origin.sections or (origin.stage == "track" and origin.run not in document["runs"]):
        return [f"runs.{origin.run}"] if origin.sections else []
    now = read_sections(origin.stage, document, origin.run, simulating="friction" in origin.sections)
    names = sorted(origin.sections.keys() | now.keys())
    return [name for name in names if origin.sections.get(name) != text_hash(canonical(now.get(name)))]


def _check_kind(path: Path, origin: Origin, name: str) -> None:
    stage = Path(name).stem
    wanted = "calibrate" if stage == "camera" else stage
    if origin.stage not in ("", wanted):
        raise InputError(
            f"{path} was made by another stage", got=origin.stage, allowed=wanted, remedy=f"give the {name} of the run"
        )


def _apart(path: Path, got: str, allowed: str) -> InputError:
    return InputError(
        f"{path} does not belong to the others",
        got=got,
        allowed=allowed,
        remedy="give files of one run and one campaign, or run the stages again from the first that differs",
    )

"""Command verify: whether a folder of results is whole, and which figure stems from which bytes."""

from collections.abc import Collection, Iterator
from pathlib import Path

from towval.commands.console import Outcome
from towval.io.campaign import load_campaign, names_in
from towval.io.chain import Origin, changed_sections, read_origin
from towval.io.exchange import packaged_layouts
from towval.io.manifest import MANIFEST, read_manifest, unlisted
from towval.io.mcap_file import read_mcap
from towval.io.provenance import file_hash
from towval.io.reading import is_plain_file
from towval.io.records.identification import identified_table, read_identification
from towval.io.results_index import current_runs
from towval.model.errors import InputError, TowvalError
from towval.report.contents import RUN_FIGURES

_SHORT = 12
"""Digits of a hash that are printed."""


def run(results: Path, campaign: Path | None = None) -> Outcome:
    """Verify the results of a campaign, from the inputs to the page.

    One `InputError` names every file that is not what it was, and how that shows. Checked are every checksum within
    every file, every file against the list of the report, every file against those that were made of it, and with
    ``campaign`` the pictures, videos and campaign.yaml that the results were made of. What a run left that the last
    report leaves out is passed over, and named.
    """
    if not results.is_dir():
        raise InputError(f"{results} is no folder of results", allowed="results/CAMPAIGN, with camera.mcap")
    below = sorted(path.parent for path in results.glob("*/camera.mcap"))
    if below and not (results / "camera.mcap").exists():
        raise InputError(
            f"{results} holds the results of campaigns, and is not those of one",
            got=", ".join(folder.name for folder in below),
            remedy=f"verify each: towval verify {below[0]}",
        )
    aside = {path.parent for path in results.glob("*/track.mcap")}.difference(current_runs(results))
    made = sorted(path for path in results.rglob("*.mcap") if not path.name.startswith("."))
    made = [path for path in made if aside.isdisjoint(path.parents)]
    if not made and not (results / MANIFEST).exists():
        is_campaign = (results / "campaign.yaml").exists()
        raise InputError(
            f"{results} holds no results",
            got="a campaign" if is_campaign else None,
            allowed="results/CAMPAIGN, with camera.mcap",
            remedy=f"give the folder of its results, as results/{results.resolve().name}" if is_campaign else None,
        )
    origins: dict[Path, Origin] = {}
    faults = []
    for path in made:
        try:
            read_mcap(path)
            origins[path] = read_origin(path)
        except TowvalError as error:
            faults.append(_in_a_line(error))
    faults += [*_broken_links(results, origins), *_faults_of_list(results, aside), *_faults_beside(results, origins)]
    if campaign is not None:
        faults += _changed_inputs(campaign, origins)
    if faults:
        raise InputError(f"{results} is not as it was made:\n  - " + "\n  - ".join(dict.fromkeys(faults)))
    derivations, left_out = tuple(_derivations(results, origins)), sorted(run.name for run in aside)
    details = (*derivations, *(f"{name}: left out by the report, not verified" for name in left_out))
    inputs = "inputs not compared: give --campaign" if campaign is None else "inputs as recorded"
    text = f"{len(made)} results, each whole and made of the others; {inputs}"
    numbers = {"results": len(made), "derivations": derivations, "left_out": left_out}
    return Outcome("verify", (results,), text, numbers, details=details)


def _in_a_line(error: TowvalError) -> str:
    return "; ".join(line.strip() for line in str(error).splitlines())


def _place(results: Path, path: Path, stage: str, name: str) -> Path | None:
    """Where in the results the input of a file is; None for what the lab handed in and for plugins."""
    if name == "camera.mcap":
        return results / name
    if stage in ("calibrate", "track") or Path(name).suffix != ".mcap":
        return None
    return results / name if stage == "identify" else path.parent / name


def _broken_links(results: Path, origins: dict[Path, Origin]) -> Iterator[str]:
    sections: dict[str, tuple[str, str]] = {}
    for path, origin in origins.items():
        name = path.relative_to(results)
        if not origin.stage:
            yield f"{name} does not say what it was made of"
        if origin.run and origin.run != path.parent.name:
            yield f"{name} is a result of run {origin.run}"
        for other, digest in origin.inputs.items():
            place = _place(results, path, origin.stage, other)
            if place is not None and not is_plain_file(place):
                yield f"{place.relative_to(results)} is missing, of which {name} was made"
            elif place is not None and file_hash(place) != digest:
                yield f"{place.relative_to(results)} is not the one of which {name} was made"
        for section, digest in origin.sections.items():
            stated, first = sections.setdefault(section, (digest, str(name)))
            if stated != digest:
                yield f"{name} and {first} were made with different campaign.yaml, in {section}"


def _faults_of_list(results: Path, aside: Collection[Path]) -> Iterator[str]:
    try:
        listed = read_manifest(results / MANIFEST)
    except TowvalError as error:
        yield _in_a_line(error)
        return
    for row in listed:
        if row.found is None:
            yield f"{row.name} is missing, which {MANIFEST} lists"
        elif row.found != row.stated:
            yield f"{row.name} is not the file that {MANIFEST} lists"
    names = unlisted(results, listed)
    yield from (f"{name} is on no list" for name in names if not any(map((results / name).is_relative_to, aside)))


def _faults_beside(results: Path, origins: dict[Path, Origin]) -> Iterator[str]:
    """Files that come after the list: layouts as written with the file for viewers, the table as identified."""
    for name, packaged in packaged_layouts().items():
        for path in sorted(results.glob(f"*/{name}")):
            made = origins.get(path.with_name("exchange.mcap"))
            # Another version may have another layout; what does not record its own counts as made by this one.
            written = made.inputs.get(name) if made else None
            if file_hash(path) != (written or file_hash(packaged)):
                yield f"{path.relative_to(results)} is not the layout that belongs to exchange.mcap"
    table, values = results / "identify.csv", results / "identify.mcap"
    if table.exists() and values.exists():
        try:
            if table.read_text(encoding="utf-8", errors="replace") != identified_table(read_identification(values)):
                yield "identify.csv is not the table of identify.mcap"
        except TowvalError:
            return  # named already


def _changed_inputs(campaign: Path, origins: dict[Path, Origin]) -> Iterator[str]:
    given = load_campaign(campaign)
    pictures = [*given.calibration_images, *given.floor_images]
    named = names_in(given.folder, [*pictures, *(run.video for run in given.runs.values())])
    now = {name: file_hash(path) for name, path in named.items()}
    yield from (
        f"run {name} of campaign.yaml has no results"
        for name in given.runs
        if not any(origin.run == name for origin in origins.values())
    )
    for path, origin in origins.items():
        if origin.stage == "calibrate" and origin.inputs.keys() - now.keys():
            yield f"{path.name} was made with {sorted(origin.inputs.keys() - now.keys())[0]}, which is not used now"
        if origin.stage == "calibrate":
            added = sorted(name for name, place in named.items() if place in pictures and name not in origin.inputs)
            yield from (f"{path.name} was made without {name}, which is used now" for name in added[:1])
        for name, digest in origin.inputs.items():
            if now.get(name, digest) != digest:
                yield f"{name} is not the file of which {path.parent.name}/{path.name} was made"
        changed = changed_sections(origin, given.document)
        if changed:
            yield f"{path.parent.name}/{path.name} was made with another campaign.yaml, in {', '.join(changed)}"


def _derivations(results: Path, origins: dict[Path, Origin]) -> Iterator[str]:
    """One line per result and figure: what it was made of."""
    for path, origin in origins.items():
        made_of = ", ".join(f"{name} {digest[:_SHORT]}" for name, digest in origin.inputs.items())
        yield f"{path.relative_to(results)} {file_hash(path)[:_SHORT]} from {made_of}"
    runs = sorted({origin.run for origin in origins.values() if origin.run})
    for path in sorted((results / "figures").glob("[!.]*")):  # not what Snakemake leaves there
        owner = next((run for run in runs if path.stem.removesuffix(f"_{run}") in RUN_FIGURES), None)
        source = f"{owner}/*.mcap, camera.mcap" if owner else "all results of the campaign"
        yield f"figures/{path.name} {file_hash(path)[:_SHORT]} from {source}"

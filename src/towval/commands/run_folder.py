"""Result files of a run, films that runs share, and what is the lab's own."""

from collections import defaultdict
from pathlib import Path

from towval.io.atomic import not_ours
from towval.io.campaign import Campaign
from towval.io.chain import check_together
from towval.io.provenance import file_hash
from towval.io.records import read_comparison, read_decimated, read_simulated, read_tracks, read_uncertainty
from towval.model import Finding
from towval.model.conventions import STAGES_OF_RUN
from towval.model.findings import finding
from towval.model.run_record import RunRecord


def files(folder: Path) -> dict[str, Path]:
    """The MCAP file of each stage in a run's folder."""
    return {stage: folder / f"{stage}.mcap" for stage in STAGES_OF_RUN}


def named(folder: Path, camera: Path) -> dict[str, Path]:
    """The result files of a run, and the camera, by the names under which results record each other."""
    return {path.name: path for path in files(folder).values()} | {"camera.mcap": camera}


def read_run(campaign: Campaign, name: str, folder: Path, camera: Path) -> RunRecord:
    """The record of a run from its result files in ``folder``.

    Raises `InputError` when a file is missing or damaged, when the files were not made of each other, of ``camera``
    and of the campaign as it is, or when the campaign has no such run.
    """
    campaign.run(name)
    check_together(named(folder, camera), campaign.document, name)
    paths = files(folder)
    tracks = read_tracks(paths["track"])
    return RunRecord(
        name=name,
        rover=campaign.rover,
        towed=campaign.object,
        hinge=campaign.scene.hinge,
        anchor=campaign.scene.anchor,
        rover_track=tracks["rover"],
        object_track=tracks["object"],
        simulated=read_simulated(paths["simulate"]),
        comparison=read_comparison(paths["compare"]),
        decimated=read_decimated(paths["decimate"])["rover"],
        uncertainty=read_uncertainty(paths["uncertainty"], draws=False),
        hinge_height_m=campaign.scene.hinge_height,
        anchor_height_m=campaign.scene.anchor_height,
    )


def check_spared(path: Path, campaign: Campaign) -> None:
    """Refuse to write a picture where one of the lab's own, or a video, stands; raises `InputError`."""
    videos = (run.video for run in campaign.runs.values())
    if path.resolve() in {file.resolve() for file in (*campaign.calibration_images, *campaign.floor_images, *videos)}:
        raise not_ours(path)


def same_footage(campaign: Campaign) -> list[Finding]:
    """A finding for each film that more than one run shows, byte for byte."""
    sizes: dict[int, list[str]] = defaultdict(list)
    for name, entry in campaign.runs.items():
        sizes[entry.video.stat().st_size].append(name)
    films: dict[str, list[str]] = defaultdict(list)
    for names in sizes.values():
        for name in names if len(names) > 1 else ():
            films[file_hash(campaign.runs[name].video)].append(name)
    return [finding("footage_twice", runs=" and ".join(names)) for names in films.values() if len(names) > 1]

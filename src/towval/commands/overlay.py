"""Command overlay: footage of a run with measured and simulated outlines → overlay.mp4."""

from pathlib import Path

from towval.commands.console import Outcome
from towval.commands.run_folder import read_run
from towval.io.atomic import not_ours
from towval.io.campaign import load_campaign
from towval.io.records import read_calibration
from towval.model.errors import InputError
from towval.report.overlay import write_overlay


def run(campaign: Path, name: str, camera: Path, folder: Path, output: Path, width_px: int = 960) -> Outcome:
    """Draw a run onto its footage, at most ``width_px`` wide."""
    given = load_campaign(campaign)
    target, films = output.resolve(), [each.video.resolve() for each in given.runs.values()]
    lab, results = given.folder.resolve(), camera.resolve().parent
    # What is in the campaign folder, but for results below it, is the lab's, and so are films that it keeps elsewhere.
    of_lab = target.is_relative_to(lab) and (results == lab or not target.is_relative_to(results))
    if target in films or (of_lab and target.exists()):
        raise not_ours(output)
    if of_lab:
        raise InputError(
            "the overlay cannot be written to the campaign folder",
            got=output,
            remedy="name a file elsewhere: towval new takes every video of this folder for a run",
        )
    record = read_run(given, name, folder, camera)
    entry, calibration = given.run(name), read_calibration(camera)
    write_overlay(entry.video, output, calibration, record, width_px=width_px, damaged=entry.damaged_video)
    size_mb = output.stat().st_size / 1e6
    return Outcome(f"overlay {name}", (output,), f"{size_mb:.1f} MB, {width_px} px wide at most", {"size_mb": size_mb})

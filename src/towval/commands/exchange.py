"""Command exchange: results of a run → exchange.mcap and layouts for viewers."""

from collections.abc import Iterator
from pathlib import Path

from towval.commands.console import Outcome
from towval.commands.run_folder import named, read_run
from towval.io.campaign import Run, load_campaign, names_in
from towval.io.coded_video import coded_video
from towval.io.exchange import check_layouts, packaged_layouts, write_layouts, write_run_file
from towval.io.provenance import provenance
from towval.io.records import read_calibration
from towval.io.video import Video
from towval.model import Calibration
from towval.model.run_record import RunRecord, Still
from towval.report.overlay import drawn_pictures


def run(campaign: Path, name: str, camera: Path, folder: Path, output: Path) -> Outcome:
    """Write footage, bodies, tether and errors of a run into one file for viewers."""
    check_layouts(output)
    given, calibration = load_campaign(campaign), read_calibration(camera)
    entry, record = given.run(name), read_run(given, name, folder, camera)
    pictures = film_pictures(entry, calibration, record)
    inputs = named(folder, camera) | names_in(given.folder, [entry.video]) | packaged_layouts()
    write_run_file(
        output, record, calibration, pictures, provenance("exchange", None, inputs, run=name, document=given.document)
    )
    layouts = write_layouts(output.parent)
    size_mb = output.stat().st_size / 1e6
    return Outcome(f"exchange {name}", (output, *layouts), f"{size_mb:.1f} MB for viewers", {"size_mb": size_mb})


def film_pictures(entry: Run, calibration: Calibration, record: RunRecord) -> Iterator[Still]:
    """The pictures of the footage as they are stored, where viewers take them and each has a pose; else drawn ones."""
    coded, time_s = coded_video(Video(entry.video, quarter_turns=record.quarter_turns)), record.rover_track.time_s
    if coded is None or len(coded.time_s) != len(time_s):
        yield from drawn_pictures(entry.video, calibration, record, damaged=entry.damaged_video)
        return
    for picture_s, data in zip(time_s, coded, strict=True):
        yield Still(float(picture_s), calibration.camera.resolution_px, data, coded.coding)

"""Command exchange: results of a run → exchange.mcap and layouts for viewers."""

from pathlib import Path

from towval.commands.console import Outcome
from towval.commands.run_folder import named, read_run
from towval.io.campaign import load_campaign
from towval.io.exchange import write_layouts, write_run_file
from towval.io.provenance import provenance
from towval.io.records import read_calibration
from towval.report.overlay import drawn_pictures


def run(campaign: Path, name: str, camera: Path, folder: Path, output: Path) -> Outcome:
    """Write footage, bodies, tether and errors of a run into one file for viewers."""
    given, calibration = load_campaign(campaign), read_calibration(camera)
    entry, record = given.run(name), read_run(given, name, folder, camera)
    pictures = drawn_pictures(entry.video, calibration, record, damaged=entry.damaged_video)
    inputs = named(folder, camera) | {entry.video.name: entry.video}
    write_run_file(output, record, calibration, pictures, provenance("exchange", None, inputs, run=name))
    layouts = write_layouts(output.parent)
    size_mb = output.stat().st_size / 1e6
    return Outcome(f"exchange {name}", (output, *layouts), f"{size_mb:.1f} MB for viewers", {"size_mb": size_mb})

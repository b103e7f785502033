"""Command exchange: results of a run → exchange.mcap and layouts for viewers."""

from pathlib import Path

from towval.commands.run_folder import named, read_run
from towval.io.campaign import load_campaign
from towval.io.exchange import write_layouts, write_run_file
from towval.io.provenance import provenance
from towval.io.records import read_calibration


def run(campaign: Path, name: str, camera: Path, folder: Path, overlay: Path, output: Path) -> None:
    """Write video, bodies, tether and errors of a run into one file for viewers.

    ``overlay``: ``overlay.mp4`` of the run.
    """
    record = read_run(load_campaign(campaign), name, folder, camera)
    inputs = named(folder, camera) | {"overlay.mp4": overlay}
    write_run_file(output, record, read_calibration(camera), overlay, provenance("exchange", None, inputs, run=name))
    write_layouts(output.parent)

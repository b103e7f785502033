"""Command decimate: track.mcap → decimate.mcap."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from towval.commands.console import print_findings
from towval.commands.settings import settings_from
from towval.io.chain import check_together
from towval.io.provenance import provenance
from towval.io.records import read_tracks, write_decimated
from towval.validation.decimate import DecimateSettings, decimate


def run(track: Path, output: Path, keys: Mapping[str, Any] | None = None) -> None:
    """Decimate the tracks of a run.

    ``track``: ``track.mcap`` of the run.
    """
    settings = settings_from(DecimateSettings, keys, "decimate")
    run_name = check_together({"track.mcap": track})
    decimated = {name: decimate(body, settings) for name, body in read_tracks(track).items()}
    for body in decimated.values():
        print_findings(body.findings, "decimate")
    write_decimated(output, decimated, provenance("decimate", settings, {"track.mcap": track}, run=run_name))

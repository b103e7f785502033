"""Command compare: track.mcap and simulate.mcap → compare.mcap."""

from __future__ import annotations

from pathlib import Path

from towval.commands.shared import provenance, tell
from towval.compare import compare
from towval.io.campaign import load_campaign
from towval.io.records import read_calibration, read_simulated, read_tracks, write_comparison


def run(campaign: Path, name: str, camera: Path, track: Path, simulated: Path, output: Path) -> None:
    """Compare the simulated with the measured path of the object.

    Parameters
    ----------
    campaign : Path
        The campaign folder.
    name : str
        The run.
    camera, track, simulated : Path
        ``camera.mcap``, ``track.mcap`` and ``simulate.mcap``.
    output : Path
        ``compare.mcap`` to write.
    """
    given = load_campaign(campaign)
    measured, motion = read_tracks(track)["object"], read_simulated(simulated)
    comparison = compare(name, motion, measured, read_calibration(camera), given.object)
    tell(comparison.findings, f"compare {name}")
    files = {path.name: path for path in (camera, track, simulated)}
    write_comparison(output, comparison, measured, motion, provenance({}, files))

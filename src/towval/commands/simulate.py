"""Command simulate: decimate.mcap → simulate.mcap."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from towval.commands.shared import provenance, settings_from, tell
from towval.io.campaign import load_campaign
from towval.io.records import read_decimated, read_tracks, write_simulated
from towval.simulate import SimulateSettings, simulate


def run(campaign: Path, track: Path, decimated: Path, output: Path, keys: Mapping[str, Any] | None = None) -> None:
    """Simulate the towed object on the measured track of the rover.

    Parameters
    ----------
    campaign : Path
        The campaign folder.
    track : Path
        ``track.mcap`` of the run: gives the times of the output.
    decimated : Path
        ``decimate.mcap`` of the run: gives the rover's way and the object's first pose.
    output : Path
        ``simulate.mcap`` to write.
    keys : mapping, optional
        ``config["simulate"]``.
    """
    settings = settings_from(SimulateSettings, keys, "simulate")
    given = load_campaign(campaign)
    bodies = read_decimated(decimated)
    times = read_tracks(track)["object"].time_s
    simulated = simulate(given.scene, bodies["rover"], bodies["object"], times, settings)
    tell(simulated.findings, "simulate")
    write_simulated(output, simulated, provenance(settings, {track.name: track, decimated.name: decimated}))

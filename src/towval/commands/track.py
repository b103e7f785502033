"""Command track: a video → track.mcap."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from towval.commands.shared import progress, provenance, settings_from, tell
from towval.errors import InputError
from towval.io.campaign import load_campaign
from towval.io.records import read_calibration, write_tracks
from towval.io.video import Video
from towval.track import TrackSettings, track


def run(campaign: Path, name: str, camera: Path, output: Path, keys: Mapping[str, Any] | None = None) -> None:
    """Track rover and object through the video of a run.

    Parameters
    ----------
    campaign : Path
        The campaign folder.
    name : str
        The run.
    camera : Path
        ``camera.mcap`` of the campaign.
    output : Path
        ``track.mcap`` to write.
    keys : mapping, optional
        ``config["track"]``.
    """
    settings = settings_from(TrackSettings, keys, "track")
    given = load_campaign(campaign)
    entry = given.run(name)
    video = Video(entry.video)
    if tuple(video.header.resolution_px) not in (given.resolution_px, given.resolution_px[::-1]):
        raise InputError(
            f"the video {entry.video.name} has another size than camera.resolution_px",
            got=" × ".join(map(str, video.header.resolution_px)),
            allowed=" × ".join(map(str, given.resolution_px)),
            remedy="calibrate with pictures of the size of the video",
        )
    calibration = read_calibration(camera)
    with progress(f"track {name}", video.header.frames) as done:
        tracks = track(video, calibration, given.bodies, entry.clicks_px, settings, progress=done)
    for body in tracks.values():
        tell(body.findings, f"track {name}")
    write_tracks(output, tracks, provenance(settings, {entry.video.name: entry.video, camera.name: camera}))

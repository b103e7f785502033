"""Command track: a video → track.mcap."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from towval.choosing.tracking import PROBE_FRAMES, PROBE_STRIDE, choose_tracking
from towval.commands.shared import progress, provenance, settings_from, tell, without_auto
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
    keys, auto = without_auto(keys, "samples")
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
    frames = list(itertools.islice(Video(entry.video), 0, PROBE_FRAMES * PROBE_STRIDE, PROBE_STRIDE))
    settings, choices = choose_tracking(
        frames, calibration, given.bodies, entry.clicks_px, settings, auto="samples" in auto
    )
    with progress(f"track {name}", video.header.frames) as done:
        tracks = track(video, calibration, given.bodies, entry.clicks_px, settings, progress=done)
    tracks = {body: replace(one, choices=(choices[body],)) for body, one in tracks.items()}
    for body in tracks.values():
        tell(body.findings, f"track {name}")
    write_tracks(output, tracks, provenance(settings, {entry.video.name: entry.video, camera.name: camera}))

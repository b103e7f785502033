"""Footage of a run on the page: embedded or linked unchanged, its frame times, and what is drawn over it."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from towval.model import Array, Calibration
from towval.model.run_record import RunRecord, pose_at
from towval.report.inline import packed, script_json
from towval.report.outlines import film_layers


@dataclass(frozen=True)
class FilmView:
    """A film for the template.

    ``content``: the bytes of the file as written by :func:`towval.report.inline.packed`, None where the page refers to
    ``address`` instead; ``kind``: its media type; ``coding``: its coding in words; ``layers``: the numbers and
    ``places`` the points that the page draws.
    """

    name: str
    size_px: tuple[int, int]
    length_bytes: int
    content: Markup | None
    address: str
    kind: str
    coding: str
    layers: Markup
    places: Markup


def run_times(run: RunRecord, presented_s: Array) -> Array:
    """Times (m,) of the frames of a film on the clock of the run [s]: its track has one row per frame."""
    own = run.rover_track.time_s
    return own if len(own) == len(presented_s) else presented_s


def film_view(
    path: FilePath, run: RunRecord, calibration: Calibration, time_s: Array, coding: str, page: FilePath, embed: bool
) -> FilmView:
    """A film and its layers at the times (m,) of its frames on the clock of the run [s]; ``page`` is the HTML file."""
    # Browsers turn a film as its tag says, whatever was done with it since.
    size_px, turns = calibration.camera.resolution_px, -run.quarter_turns
    drawn = film_layers(run, calibration, time_s).turned(size_px, turns)
    size_px = size_px[::-1] if turns % 2 else size_px
    layers = {"size": size_px, "unit": drawn.unit_px, "counts": drawn.counts}
    layers["taut"] = drawn.taut.astype(int).tolist()
    content = path.read_bytes() if embed else b""
    return FilmView(
        name=path.name,
        size_px=size_px,
        length_bytes=len(content),
        content=packed(content) if embed else None,
        address=_address(path, page),
        kind="video/webm" if path.suffix.lower() in (".webm", ".mkv") else "video/mp4",
        coding=coding.partition(" (")[0],
        layers=script_json(layers),
        places=packed(drawn.places.astype("<i2").tobytes()),
    )


def series(run: RunRecord, presented_s: Array, time_s: Array) -> Markup:
    """Times in the film and of the run, errors and tension at each frame as JSON; null where missing."""
    c, simulated = run.comparison, run.simulated
    shift, heading = pose_at(c.time_s, c.along_across, time_s), pose_at(c.time_s, c.error, time_s)[:, 2]
    tension = np.linalg.norm(pose_at(simulated.time_s, simulated.tether_force, time_s), axis=1)
    return script_json(
        {
            "film_s": _rounded(presented_s - presented_s[0], 6),
            "time_s": _rounded(time_s, 6),
            "along_mm": _rounded(1e3 * shift[:, 0], 2),
            "across_mm": _rounded(1e3 * shift[:, 1], 2),
            "heading_deg": _rounded(np.rad2deg(heading), 3),
            "tension_N": _rounded(tension, 2),
        }
    )


def deciding_time(run: RunRecord) -> float:
    """Time of the largest error, in units of its uncertainty where known [s]."""
    c = run.comparison
    size = c.ratio if np.isfinite(c.ratio).any() else np.hypot(c.error[:, 0], c.error[:, 1])
    return float(c.time_s[int(np.nanargmax(size))] if np.isfinite(size).any() else c.time_s[0])


def embedded(paths: Sequence[FilePath], budget_mb: float) -> bool:
    """Whether films are small enough in total to be part of the page."""
    return sum(path.stat().st_size for path in paths) <= 1e6 * budget_mb


def _address(path: FilePath, page: FilePath) -> str:
    try:
        return quote(FilePath(os.path.relpath(path, page.parent)).as_posix())
    except ValueError:  # another drive
        return path.resolve().as_uri()


def _rounded(values: Array, digits: int) -> list[float | None]:
    return [round(float(v), digits) if np.isfinite(v) else None for v in values]

"""Overlay video: simulated and measured outlines drawn onto the footage.

The outlines are those of the planar targets at their height. The video is H.264 for phones and browsers, scaled down,
with the presentation times of the source.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path as FilePath

import av
import cv2
import numpy as np

from towval.io.film import (
    Picture,
    as_rgb,
    check_film_replaceable,
    decoded,
    frame_times,
    opened_film,
    seconds,
    ticks,
    time_base,
    upright_size,
    write_film,
)
from towval.io.video import shown
from towval.model import Calibration
from towval.model.errors import InputError
from towval.model.run_record import RunRecord, Still
from towval.report.film import run_times
from towval.report.overlay_painter import Painter

_JPEG_QUALITY = 75
_PICTURE_PX, _PICTURE_S = 960, 0.2  # width of the pictures for viewers, and time between them
_STILL_PX = 640


def write_overlay(
    source: FilePath,
    target: FilePath,
    calibration: Calibration,
    run: RunRecord,
    *,
    width_px: int = 960,
    damaged: bool = False,
) -> FilePath:
    """Draw a run onto its footage; see :func:`towval.io.film.write_film`.

    Time 0 is the first frame of the source; what is drawn is on the clock of the run. Footage narrower than
    ``width_px`` keeps its size; of a ``damaged`` source the part before the damage is used.

    Raises `InputError` when the source is no video, is damaged, or has another size than the camera, or where a file
    that is no overlay stands at ``target``.
    """
    check_film_replaceable(target)
    painter = Painter(calibration, run, width_px)
    with opened_film(source) as film:
        stream, clock = shown(film), _Clock(source, run)
        drawn = _drawn(source, decoded(film, damaged), stream, painter, clock)
        write_film(target, stream, painter.size_px, drawn)
    return target


def drawn_pictures(
    source: FilePath, calibration: Calibration, run: RunRecord, *, damaged: bool = False
) -> Iterator[Still]:
    """Pictures of the footage with the run drawn in, five a second; otherwise as :func:`write_overlay`.

    Frames that no other is coded from are skipped: a picture is the first at or after its time that others need.
    """
    painter = Painter(calibration, run, _PICTURE_PX)
    due_s = -np.inf
    with opened_film(source) as film:
        stream, clock = shown(film), _Clock(source, run)
        stream.codec_context.skip_frame = "NONREF"
        for frame in decoded(film, damaged):
            time_s = seconds(frame, stream)
            if time_s + 1e-6 >= due_s:
                due_s = (time_s if due_s == -np.inf else due_s) + _PICTURE_S
                yield _still(source, frame, clock.of_run(time_s), painter)


def stills(
    source: FilePath, calibration: Calibration, run: RunRecord, times_s: Sequence[float], *, damaged: bool = False
) -> tuple[Still, ...]:
    """The first pictures at or after given presentation times [s], with the run drawn in; none after the last one."""
    painter, found = Painter(calibration, run, _STILL_PX), []
    with opened_film(source) as film:
        stream, clock = shown(film), _Clock(source, run)
        for wanted_s in times_s:
            wanted = int(wanted_s / time_base(stream))
            film.seek(wanted, stream=stream)
            for frame in decoded(film, damaged, wanted):
                time_s = seconds(frame, stream)
                if time_s + 1e-6 >= wanted_s:
                    found.append(_still(source, frame, clock.of_run(time_s), painter))
                    break
    return tuple(found)


class _Clock:
    """The clock of a run: where a video's own times were not to be trusted, tracking has found others."""

    def __init__(self, source: FilePath, run: RunRecord):
        self.presented_s, _ = frame_times(source)
        self.own_s = run_times(run, self.presented_s)

    def of_run(self, presented_s: float) -> float:
        """Time of the frame with a presentation time [s]."""
        return float(np.interp(presented_s, self.presented_s, self.own_s))


def _still(source: FilePath, frame: av.VideoFrame, time_s: float, painter: Painter) -> Still:
    _check_size(source, frame, painter)
    picture = as_rgb(frame, painter.size_px, painter.quarter_turns)
    painter.draw(picture, time_s)
    coded = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1]
    return Still(time_s, painter.size_px, coded.tobytes())


def _check_size(source: FilePath, frame: av.VideoFrame, painter: Painter) -> None:
    size, allowed = upright_size(frame, painter.quarter_turns), painter.calibration.camera.resolution_px
    if size != tuple(allowed):
        raise InputError(
            f"{source.name} has another size than the calibrated camera",
            got=f"{size[0]} × {size[1]}",
            allowed="{} × {}".format(*allowed),
            remedy="calibrate with pictures of the size of the video",
        )


def _drawn(
    source: FilePath, frames: Iterator[av.VideoFrame], stream: av.VideoStream, painter: Painter, clock: _Clock
) -> Iterator[tuple[int, Picture]]:
    """Frames with the run drawn in, and their times in units of the stream's time base, from zero on."""
    first = None
    for frame in frames:
        if first is None:
            _check_size(source, frame, painter)
            first = ticks(frame)
        picture = as_rgb(frame, painter.size_px, painter.quarter_turns)
        painter.draw(picture, clock.of_run(seconds(frame, stream)))
        yield ticks(frame) - first, picture

"""Command track: a video → track.mcap."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.commands.console import Outcome, progress
from towval.commands.run_folder import check_spared
from towval.commands.settings import settings_from, without_auto
from towval.io.campaign import Campaign, Run, load_campaign, names_in
from towval.io.chain import check_together
from towval.io.images import GrayPictures, write_picture
from towval.io.provenance import provenance
from towval.io.records import read_calibration, write_tracks
from towval.io.video import Luma, Video
from towval.model import Array, Body, Calibration, Finding, Track
from towval.model.conventions import FEWEST_FRAMES
from towval.model.errors import InputError
from towval.model.findings import finding, leaves_unjudged
from towval.model.geometry import polygon_area, turned_pixels
from towval.report.wording import millimetres
from towval.selection.tracking import PROBE_FRAMES, PROBE_STRIDE, neighbour_of_tracking
from towval.tracking.camera_motion import CONSTANTS as CAMERA_MOTION
from towval.tracking.clicks import Clicked, check_clicks, overstretched, unsure_start
from towval.tracking.markers import clicks_from_tags
from towval.tracking.outline import observe_outline, pose_from_clicks
from towval.tracking.overlay import standing_still
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.rate import rate_findings, usual_steps_s
from towval.tracking.start import Start, Tow, find_starts, starts_drawn
from towval.tracking.total_covariance import with_readout, with_wider_start
from towval.tracking.track import TrackSettings, track
from towval.tracking.view_at_start import calibration_at_start

_MOST_PICTURES = 16  # for the background
_TILES, _FAINTEST = (16, 9), 0.5  # Half a grey level is what rounding leaves of a picture.
_MOST_FLOORS = 8  # pictures of the floor, to see whether the camera moved since


def run(
    campaign: Path,
    name: str,
    camera: Path,
    output: Path,
    keys: Mapping[str, Any] | None = None,
    *,
    later: Mapping[str, Mapping[str, Any]] | None = None,
) -> Outcome:
    """Track rover and object through the video of a run.

    ``later`` holds the sections decimate and simulate of the configuration, which the probe of "auto" uses.
    """
    keys, auto = without_auto(keys, "samples")
    settings = settings_from(TrackSettings, keys, "track")
    given = load_campaign(campaign)
    entry = given.run(name)
    check_together({"camera.mcap": camera}, given.document)
    measured = read_calibration(camera)
    begun = begin(given, entry, open_video(given, entry), measured)
    entry, video, calibration, since = begun.entry, begun.video, begun.calibration, begun.findings
    first_and_late = begun.luma, video.late_picture()
    with _blaming_the_camera(since):
        starts = _starts(given, entry, video, first_and_late, calibration, output.with_name("start.png"))
        clicks = {name: start.corners_px for name, start in starts.items()}
        bodies = [_uncovered(body, starts, first_and_late, calibration) for body in given.bodies]
        scene = (calibration, bodies, clicks)
        with progress(f"track {name}", video.header.frames) as done:
            # The paper's method has no sample points to select.
            if "samples" in auto and settings.method == "plane":
                settings, tracks = _selecting(video, *scene, settings, given, later or {}, done)
            else:
                tracks = _with_neighbour(video, *scene, settings, done)
    tow = overstretched(tracks["rover"], tracks["object"], Tow.of(given.scene))
    added = (*tow, *since, *findings_of_rate(given, video, tracks["rover"].time_s), *video.findings)
    for body in given.bodies:
        start, found = starts[body.name], tracks[body.name]
        findings = (*start.findings, *found.findings, *(one for one in added if one not in start.findings))
        found = with_readout(with_wider_start(found, start.spread), calibration, body, *_readout(given))
        camera_track = found.camera and found.camera.with_added(calibration.covariance - measured.covariance)
        camera_track = camera_track and replace(camera_track, quarter_turns=video.quarter_turns)
        tracks[body.name] = replace(found, findings=findings, camera=camera_track)
    seen = entry.video, *given.floor_images[:_MOST_FLOORS]
    made_of = provenance(
        "track", settings, names_in(given.folder, seen) | {"camera.mcap": camera},
        run=name, document=given.document, simulating="samples" in auto, constants=True,
    )  # fmt: skip
    write_tracks(output, tracks, made_of)
    return _outcome(name, output, tracks)


@contextmanager
def _blaming_the_camera(since: Sequence[Finding]) -> Iterator[None]:
    """Say first what findings tell of the camera since its calibration, where they are why a run is refused.

    Where the camera does not show the floor as the pictures of the floor do, neither starts nor clicks fit.
    """
    try:
        yield
    except InputError as error:
        wrong = [found.text for found in since if leaves_unjudged(found)]
        if not wrong:
            raise
        raise InputError(" ".join(wrong), got=error.what) from error


def _outcome(name: str, output: Path, tracks: Mapping[str, Track]) -> Outcome:
    seen_of = {body: _seen(tracked) for body, tracked in tracks.items()}
    numbers = {f"{body}_{key}": value for body, seen in seen_of.items() for key, value in seen.items()}
    texts = []
    for body, seen in seen_of.items():
        std = millimetres(seen["position_std_mm"] / 1e3)
        texts.append(f"{body} seen in {seen['frames_seen']} of {seen['frames']} frames, ±{std}")
    findings = tuple(dict.fromkeys(one for tracked in tracks.values() for one in tracked.findings))
    return Outcome(f"track {name}", (output,), "; ".join(texts), numbers, findings)


def _with_neighbour(
    video: Video, calibration: Calibration, bodies: Sequence[Body], clicks_px: Mapping[str, Array],
    settings: TrackSettings, done: Callable[[int], None],
) -> dict[str, Track]:  # fmt: skip
    """Track with the settings as stated; the tracks' choices state what the next finer ones would change."""
    few: list[tuple[float, Luma]] = []
    tracks = track(_keeping(few, video), calibration, bodies, clicks_px, settings, progress=done)
    choices = neighbour_of_tracking(few, calibration, bodies, clicks_px, settings)
    return {body: replace(found, choices=(choices[body],)) for body, found in tracks.items()}


def _selecting(
    video: Video, calibration: Calibration, bodies: Sequence[Body], clicks_px: Mapping[str, Array],
    settings: TrackSettings, given: Campaign, later: Mapping[str, Mapping[str, Any]], done: Callable[[int], None],
) -> tuple[TrackSettings, dict[str, Track]]:  # fmt: skip
    """Track with as many sample points as the simulation of the run needs."""
    # Not at start-up: nothing else of this stage simulates.
    from towval.selection.sample_points import track_selecting  # noqa: PLC0415
    from towval.selection.simulation import SELECTED  # noqa: PLC0415
    from towval.validation.decimate import DecimateSettings  # noqa: PLC0415
    from towval.validation.simulate import SimulateSettings  # noqa: PLC0415

    simulation, _ = without_auto(dict(later.get("simulate", {})), *SELECTED)
    return track_selecting(
        video, calibration, bodies, clicks_px, settings, given.scene,
        decimation=settings_from(DecimateSettings, dict(later.get("decimate", {})), "decimate"),
        simulation=settings_from(SimulateSettings, simulation, "simulate"),
        progress=done,
    )  # fmt: skip


def floor_pictures(given: Campaign) -> GrayPictures:
    """Pictures of the floor, by which it is recognised at the start of a video."""
    return GrayPictures(given.floor_images[:_MOST_FLOORS], given.resolution_px)


def calibrated_at_start(
    calibration: Calibration, video: Video, first: Luma, floors: Sequence[tuple[str, Luma]]
) -> tuple[Calibration, tuple[Finding, ...]]:
    """The calibration at the video's first picture, or where that shows too much noise, at the mean of the first."""
    found, findings = calibration_at_start(calibration, first, floors)
    if any(one.code == "floor_not_recognised" for one in findings):
        mean, of_mean = calibration_at_start(calibration, video.mean_of_first(CAMERA_MOTION.averaged), floors)
        if not any(one.code == "floor_not_recognised" for one in of_mean):
            return mean, of_mean
    return found, findings


def _keeping(few: list[tuple[float, Luma]], video: Iterable[tuple[float, Luma]]) -> Iterator[tuple[float, Luma]]:
    """The frames of a video; those on which tracking is compared with its neighbour are copied to ``few``."""
    for i, (time_s, luma) in enumerate(video):
        if i < PROBE_FRAMES * PROBE_STRIDE and i % PROBE_STRIDE == 0:
            few.append((time_s, luma.copy()))
        yield time_s, luma


def _seen(tracked: Track) -> dict[str, float]:
    """Frames in which a body was seen, and the median standard deviation of its position."""
    std = np.hypot(*tracked.std[tracked.seen, :2].T)
    position = 1e3 * float(np.median(std)) if len(std) else float("nan")
    return {"frames": len(tracked.time_s), "frames_seen": int(tracked.seen.sum()), "position_std_mm": position}


def open_video(given: Campaign, entry: Run) -> Video:
    """The video of a run.

    Raises `InputError` when it is no video, or of another size than the calibration pictures however it is turned, or
    holds too few pictures for a run.
    """
    video = Video(entry.video, damaged=entry.damaged_video)
    if tuple(video.header.resolution_px) not in (given.resolution_px, given.resolution_px[::-1]):
        raise InputError(
            f"the video {entry.video.name} has another size than camera.resolution_px",
            got=" × ".join(map(str, video.header.resolution_px)),
            allowed=" × ".join(map(str, given.resolution_px)),
            remedy="calibrate with pictures of the size of the video",
        )
    stored = video.stored_pictures(FEWEST_FRAMES)
    if stored < FEWEST_FRAMES:
        raise InputError(
            f"the video {entry.video.name} is too short for a run",
            got=f"{stored} picture{'s' * (stored != 1)}",
            allowed=f"{FEWEST_FRAMES} or more",
            remedy="name the film of the run: a photo or a preview may have the same name",
        )
    return video


def first_picture(entry: Run, video: Video) -> Luma:
    """The first picture of a run (height, width); raises `InputError` when it shows nothing."""
    luma = video.first_picture()
    # Each tile is the mean of so many pixels that little of the sensor's noise is left.
    tiles = cv2.resize(luma.astype(np.float32), _TILES, interpolation=cv2.INTER_AREA)
    if tiles.std() < _FAINTEST:
        raise InputError(
            f"the first picture of the video {entry.video.name} shows nothing",
            got=f"the grey level {luma.mean():.0f} throughout" + " but for noise" * bool(np.ptp(luma)),
            allowed="a picture of floor and bodies, which are followed from there on",
            remedy="cut the video so that it begins with such a picture, and click in that",
        )
    return luma


@dataclass(frozen=True)
class Begun:
    """The start of a run's video, which is turned to lie as the pictures of the calibration.

    ``entry`` has its clicks in the first picture ``luma`` (height, width), ``calibration`` is that of this picture;
    ``findings`` are about the camera since the calibration.
    """

    entry: Run
    video: Video
    luma: Luma
    calibration: Calibration
    findings: tuple[Finding, ...]


def begin(given: Campaign, entry: Run, video: Video, measured: Calibration) -> Begun:
    """Turn a video to lie as the pictures of the calibration ``measured``, and refer that to its first picture.

    A phone that lies flat guesses which way is up, for each picture and video anew, and states that in a tag. So the
    floor decides: pictures are those of one sensor, and where a video as players turn it has another size, or shows the
    floor upside down, it is turned.
    """
    luma, floors = first_picture(entry, video), floor_pictures(given)
    if luma.shape[::-1] != given.resolution_px:
        # As it is stored: so are the pictures.
        video = video.turned(-video.tagged_turns())
        luma = video.first_picture()
    calibration, since = calibrated_at_start(measured, video, luma, floors)
    if any(found.code == "video_upside_down" for found in since):
        other_way = video.turned(2)
        other_luma = other_way.first_picture()
        again, found = calibrated_at_start(measured, other_way, other_luma, floors)
        if not any(map(leaves_unjudged, found)):
            video, luma, calibration, since = other_way, other_luma, again, found
    if video.quarter_turns:
        since = (*since, finding("video_turned", degrees=90 * video.quarter_turns))
        clicks_px = _clicks_in(luma, entry.clicks_px, video.quarter_turns, given.bodies, calibration)
        entry = replace(entry, clicks_px=clicks_px)
    return Begun(entry, video, luma, calibration, since)


def _clicks_in(
    luma: Luma, clicks_px: Mapping[str, Array], quarter_turns: int, bodies: Sequence[Body], calibration: Calibration
) -> dict[str, Array]:
    """Clicks (n, 2) in a first picture that was turned: made in it, or in the picture as players turn it.

    They count as made in it unless more tops show their edges where the others would be.
    """
    height, width = luma.shape
    shown_px = (width, height) if quarter_turns % 2 == 0 else (height, width)
    turned = {name: turned_pixels(pixels, shown_px, quarter_turns) for name, pixels in clicks_px.items()}

    def seen(clicks: Mapping[str, Array]) -> int:
        targets = [PlanarTarget(body, calibration.camera, calibration.floor) for body in bodies if body.name in clicks]
        poses = [pose_from_clicks(target, clicks[target.body.name])[0] for target in targets]
        return sum(observe_outline(luma, *each) is not None for each in zip(targets, poses, strict=True))

    return max((dict(clicks_px), turned), key=seen)


def findings_of_rate(given: Campaign, video: Video, time_s: Array) -> tuple[Finding, ...]:
    """Findings about the time scale of a run whose pictures have the times (n,) [s]."""
    return rate_findings(
        usual_steps_s(time_s), given.document["camera"].get("fps"), video.header.length_s, video.header.sound_s
    )


def _readout(given: Campaign) -> tuple[float, float]:
    """Time from the first row to the last, and its deviation [s]."""
    return given.document["camera"].get("readout_s", 0.0), given.deviations["readout"]


def known_starts(
    given: Campaign, entry: Run, first_and_late: tuple[Luma, Luma], calibration: Calibration
) -> dict[str, Clicked]:
    """Corners of planar targets in the first frame, as far as they need no search: clicked and checked, or by tags."""
    luma, tow = first_and_late[0], Tow.of(given.scene)
    starts = check_clicks(first_and_late, calibration, given.bodies, entry.clicks_px, tow)
    for body in given.bodies:
        if body.name not in starts and given.tags[body.name]:
            corners = clicks_from_tags(luma, body, given.tags[body.name], calibration.camera, calibration.floor)
            starts[body.name] = Clicked(corners, np.zeros((3, 3)))
    return starts


def _starts(
    given: Campaign, entry: Run, video: Video, first_and_late: tuple[Luma, Luma], calibration: Calibration, drawn: Path
) -> dict[str, Clicked]:
    """Corners of both planar targets in the first frame: those known, else found."""
    starts = known_starts(given, entry, first_and_late, calibration)
    unclicked = [body.name for body in given.bodies if body.name not in starts]
    if not unclicked:
        return starts
    pictures = spread_pictures(video)
    found = find_starts(pictures, calibration, given.bodies, Tow.of(given.scene))
    for name in unclicked:
        if found[name].doubt:
            check_spared(drawn, given)
            write_picture(drawn, starts_drawn(pictures[0], found))
            raise _ask_for_clicks(name, entry, found[name], drawn)
        starts[name] = Clicked(found[name].corners_px, found[name].spread, _found_findings(name, found[name]))
    return starts


def _found_findings(name: str, start: Start) -> tuple[Finding, ...]:
    """That a body was found by itself, and that its outline fits in several places nearby, where it does."""
    found = (finding("start_found", name=name),)
    return (*found, unsure_start(name, start.spread)) if start.spread.any() else found


def _uncovered(
    body: Body, starts: dict[str, Clicked], first_and_late: tuple[Luma, Luma], calibration: Calibration
) -> Body:
    """A body without the parts of its top over which something stands still in the first frame; with a finding."""
    target, start = PlanarTarget(body, calibration.camera, calibration.floor), starts[body.name]
    pose, _, _ = pose_from_clicks(target, start.corners_px)
    outlines = standing_still(*first_and_late, target, pose)
    if not outlines:
        return body
    share = sum(abs(polygon_area(outline)) for outline in outlines) / abs(polygon_area(body.top_corners_m))
    covered = finding("covered_at_start", name=body.name, percent=100 * share)
    starts[body.name] = replace(start, findings=(*start.findings, covered))
    return replace(body, obstructions=(*body.obstructions, *outlines))


def _ask_for_clicks(name: str, entry: Run, start: Start, drawn: Path) -> InputError:
    """An error with the best guess, as a picture and as clicks to correct and paste."""
    return InputError(
        f"runs.{entry.name}: where {name} starts is not certain, and first_frame_clicks_px.{name} is missing",
        got=f"{start.doubt}; best guess {np.round(start.corners_px, 1).tolist()}",
        allowed=f"the corners of the planar target in the first frame, in the order of top_corners_m; see {drawn}",
        remedy=f"correct the guess and paste it as first_frame_clicks_px.{name}",
    )


def spread_pictures(video: Video) -> list[NDArray[np.uint8]]:
    """The first frame and others at equal steps over the video."""
    pictures, every = [], 1
    for i, (_, luma) in enumerate(video):
        if i % every == 0:
            pictures.append(luma.copy())
        if len(pictures) > _MOST_PICTURES:
            pictures, every = pictures[::2], 2 * every
    return pictures

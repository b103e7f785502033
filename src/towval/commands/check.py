"""Command check: every fault of a campaign folder at once, the starts to look at, expected accuracy and cost."""

import json
import math
import os
import re
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from towval.calibration.board_search import find_boards
from towval.calibration.calibrate import CalibrateSettings
from towval.calibration.corners import outer_corners
from towval.commands.calibrate import calibrated
from towval.commands.console import step
from towval.commands.run_folder import check_spared, same_footage
from towval.commands.track import Begun, begin, findings_of_rate, known_starts, open_video, spread_pictures
from towval.io.atomic import check_own, not_ours
from towval.io.campaign import Campaign, Run, read_campaign, read_document
from towval.io.campaign_text import text_in_parts
from towval.io.images import GrayPictures, read_gray, stated_size, write_picture
from towval.io.reading import is_plain_file
from towval.io.schema import key_lines
from towval.model import Array, Body, Finding, Severity
from towval.model.errors import Faults, InputError, TowvalError
from towval.model.findings import leaves_unjudged
from towval.model.input_types import value_of
from towval.report.preview import draw_start
from towval.report.start_page import START_MARK, FloorBoard, StartOfRun, write_start_page
from towval.selection.margin import measurement_std_m
from towval.tracking.clicks import unsure_start
from towval.tracking.outline import judge_clicks, pose_from_clicks
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.start import Tow, find_starts


@dataclass(frozen=True)
class CostConstants:
    """Processor time of a campaign, measured on two cores of 2026 with lab_a (docs/scaling.md)."""

    campaign_s: float = 15.0
    run_s: float = 20.0  # Start-up of the stages, and 256 to 512 draws.
    megapixel_s: float = 0.02  # A frame, tracked and drawn, by its megapixels.


COST = CostConstants()


def run(campaign: Path, pictures: Path | None = None, as_json: bool = False) -> None:
    """Check a campaign folder and print what was found, as lines for people or as one JSON object.

    Into ``pictures``, by default ``check`` in the campaign folder, go a picture of each run's start and the page on
    which starts are put right, ``start.html``.

    Raises `InputError` when the folder or its campaign.yaml cannot be read at all, and `SystemExit` with code 1 when
    there are faults.
    """
    found = check(campaign, pictures or campaign / "check")
    print(json.dumps(found, indent=1) if as_json else for_people(found))
    if found["faults"]:
        raise SystemExit(1)


def check(folder: Path, pictures: Path) -> dict[str, Any]:
    """Faults, warnings and expectations of a campaign folder, as JSON takes them; draws each run's start.

    Faults are in the order of campaign.yaml; those that name no line of it come last.
    """
    document = read_document(folder)
    lines = key_lines(_text_of(folder))
    given, faults = read_campaign(folder, document)
    warnings: list[str] = []
    runs = {} if given is None else _runs(given, pictures, faults, warnings)
    listed = sorted((_fault(fault, lines) for fault in faults), key=lambda row: row["line"] or math.inf)
    return {
        "campaign": str(folder),
        "faults": listed,
        "warnings": warnings,
        "runs": runs,
        "cpu_s": round(COST.campaign_s + sum(row["cpu_s"] for row in runs.values())),
    }


def _runs(given: Campaign, pictures: Path, faults: Faults, warnings: list[str]) -> dict[str, dict[str, Any]]:
    """What to expect of each run whose start is known, by its name; adds to the faults and warnings."""
    warnings += [found.text for found in same_footage(given)]
    videos = {name: faults.attempt(open_video, given, entry) for name, entry in given.runs.items()}
    step(f"check: calibrate from {len(given.calibration_images)} pictures")
    calibration = faults.attempt(calibrated, given, CalibrateSettings())
    if calibration is None:
        # The calibration ended at the first picture that it could not read.
        for path in dict.fromkeys((*given.calibration_images, *given.floor_images)):
            if stated_size(path) in (None, given.resolution_px):
                faults.attempt(read_gray, path, given.resolution_px)
        return {}
    warnings += [found.text for found in calibration.findings if found.severity is Severity.WARNING]
    starts: dict[str, StartOfRun] = {}
    frames: dict[str, int] = {}
    for name, video in videos.items():
        if video is None:
            continue
        step(f"check: look at the start of run {name}")
        stamps_s = faults.attempt(video.stamps_s)
        begun = faults.attempt(begin, given, given.runs[name], video, calibration)
        if stamps_s is None or begun is None:
            continue
        for found in (*findings_of_rate(given, video, stamps_s), *begun.findings):
            _tell(found, given.runs[name], faults, warnings)
        # Where the camera does not show the floor as its pictures do, neither starts nor clicks fit, as for that stage.
        told = Faults() if any(map(leaves_unjudged, begun.findings)) else faults
        start = told.attempt(_start, given, begun, told)
        if start is None:
            continue
        starts[name], frames[name] = start, len(stamps_s)
        if told is faults:
            warnings += [f"run {name}, {body}: {text}" for body, text in start.doubts.items()]
    drawn = _drawn(pictures, given, starts, faults) if starts else {}
    return {name: _expected(given, frames[name], start, drawn.get(name, "")) for name, start in starts.items()}


def _drawn(pictures: Path, given: Campaign, starts: Mapping[str, StartOfRun], faults: Faults) -> dict[str, str]:
    """Write the page on the starts, and draw each; returns where, by the run.

    Nothing is written where somebody else's pictures have these names: beside our own lies the page.
    """
    page, places = pictures / "start.html", {name: pictures / f"{name}.jpg" for name in starts}
    try:
        check_own(page, START_MARK)
        for place in () if is_plain_file(page) else filter(is_plain_file, places.values()):
            raise not_ours(place)
    except InputError as error:
        faults.append(error)
        return {}
    faults.attempt(_write_page, page, given, starts)
    drawn = {name: faults.attempt(_draw_start, place, given, starts[name]) for name, place in places.items()}
    return {name: place for name, place in drawn.items() if place}


def _tell(found: Finding, entry: Run, faults: Faults, warnings: list[str]) -> None:
    """Add what the stage track will find of a run: a fault where it leaves the run without a verdict."""
    if leaves_unjudged(found):
        fault = InputError(f"run {entry.name}: {found.text}")
        fault.key = f"runs.{entry.name}"
        faults.append(fault)
    elif found.severity is Severity.WARNING:
        warnings.append(f"run {entry.name}: {found.text}")


def _start(given: Campaign, begun: Begun, faults: Faults) -> StartOfRun:
    """Where rover and object are in the first frame of a run: clicked and checked, or found.

    Clicks for which the stage track would refuse the run are a fault; their start is drawn all the same.
    """
    entry, video, luma, at_start = begun.entry, begun.video, begun.luma, begun.calibration
    tow = Tow.of(given.scene)
    corners, doubts = {}, {}
    for name, clicked in known_starts(given, entry, (luma, video.late_picture()), at_start).items():
        corners[name] = clicked.corners_px
        if clicked.findings:
            doubts[name] = " ".join(found.text for found in clicked.findings)
    if len(corners) < len(given.bodies):
        for name, found in find_starts(spread_pictures(video), at_start, given.bodies, tow).items():
            if name not in corners:
                corners[name] = found.corners_px
                if found.doubt:
                    doubts[name] = f"not certain where it starts: {found.doubt}"
                elif found.spread.any():
                    doubts[name] = unsure_start(name, found.spread).text
    targets = {body.name: PlanarTarget(body, at_start.camera, at_start.floor) for body in given.bodies}
    poses = {}
    for name, pixels in corners.items():
        poses[name], _, misfit_px = pose_from_clicks(targets[name], pixels)
        for missed in faults.attempt(_judged, entry.name, targets[name], poses[name], misfit_px) or ():
            doubts.setdefault(name, missed.text)
    return StartOfRun(luma, at_start, poses, doubts)


def _judged(run: str, target: PlanarTarget, pose: Array, misfit_px: float) -> list[Finding]:
    """What the stage track says of clicks that miss an outline; its refusal names the run."""
    try:
        return judge_clicks(target.body, misfit_px, target.metres_per_pixel(pose))
    except InputError as error:
        what = f"runs.{run}: {error.what}"
        raise InputError(what, got=error.got, allowed=error.allowed, remedy=error.remedy) from None


def _expected(given: Campaign, frames: int, start: StartOfRun, picture: str) -> dict[str, Any]:
    """What to expect of a run; ``picture``: where its start is drawn, empty where that failed."""
    calibration = start.calibration
    row: dict[str, Any] = {"picture": picture, "frames": frames}
    for name, (body, pose) in _placed(given, start).items():
        target = PlanarTarget(body, calibration.camera, calibration.floor)
        row[f"{name}_pixel_mm"] = round(1e3 * target.metres_per_pixel(pose), 2)
        corners = target.pixels(body.top_corners_m, pose)
        row[f"{name}_corners_px"] = [] if name in start.doubts else np.round(corners, 1).tolist()
        row[f"{name}_position_std_mm"] = round(1e3 * measurement_std_m(calibration, body, pose[None]), 2)
    row["cpu_s"] = round(COST.run_s + COST.megapixel_s * start.luma.size / 1e6 * frames)
    return row


def _placed(given: Campaign, start: StartOfRun) -> dict[str, tuple[Body, Array]]:
    """Bodies whose start is known, with their poses (3,)."""
    return {body.name: (body, start.poses[body.name]) for body in given.bodies if body.name in start.poses}


def _draw_start(picture: Path, given: Campaign, start: StartOfRun) -> str:
    """Draw the start of a run, and return where."""
    check_spared(picture, given)
    drawn = draw_start(start.luma, start.calibration, given.scene, _placed(given, start))
    with _writing_to(picture.parent):
        write_picture(picture, drawn)
    return str(picture)


@contextmanager
def _writing_to(folder: Path) -> Iterator[None]:
    """Tell which folder cannot be written to: one fault, however many files it is."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{folder} cannot be written to",
            got=error.strerror,
            remedy="name another folder: towval check CAMPAIGN --pictures FOLDER",
        ) from None


def _text_of(folder: Path) -> str:
    """The text of campaign.yaml with its own line ends, without the mark of coding that editors put before it."""
    return (folder / "campaign.yaml").read_bytes().decode("utf-8-sig")


def _write_page(page: Path, given: Campaign, starts: dict[str, StartOfRun]) -> None:
    text = _text_of(given.folder)
    longest_m = Tow.of(given.scene).longest_m
    bodies = {body.name: body for body in given.bodies}
    board = _floor_board(given)
    with _writing_to(page.parent):
        write_start_page(page, given.name, text_in_parts(text), given.scene, bodies, longest_m, starts, board)


IN_FLOOR_AXES = ("floor.slope_mm_per_m", "friction.regions")
"""Keys of campaign.yaml with values in the axes of the floor."""


def _floor_board(given: Campaign) -> FloorBoard | None:
    """The board that defines the floor frame, with the picture around it; None where surveyed marks do."""
    reference = given.floor_reference
    if reference.origin_corner_px is None or reference.x_axis_end_corner_px is None or len(reference.marks_px):
        return None
    pictures = GrayPictures(given.floor_images[:1], given.resolution_px)
    marked_px = {given.floor_images[0].name: reference.origin_corner_px}
    board = find_boards(pictures, given.board, 1, marked_px)[0][0]
    corners_px = board.corners_px[outer_corners(board.board_m)]
    origin, end = (
        int(np.argmin(np.hypot(*(corners_px - pixel).T)))
        for pixel in (reference.origin_corner_px, reference.x_axis_end_corner_px)
    )
    around = 0.15 * np.ptp(corners_px, axis=0).max()
    low = np.maximum(corners_px.min(axis=0) - around, 0).astype(int)
    high = (corners_px.max(axis=0) + around).astype(int)
    luma = np.ascontiguousarray(pictures[0][1][low[1] : high[1], low[0] : high[0]])
    stated = [key for key in IN_FLOOR_AXES if value_of(given.document, key) is not None]
    return FloorBoard(luma, (int(low[0]), int(low[1])), corners_px, origin, end, stated)


_KEY = re.compile(r"\b(?:camera|floor|rover|object|tether|friction|runs)(?:\.\w[\w-]*|\[\d+\])+")
_LAST_PART = re.compile(r"(\.[^.\[\]]+|\[\d+\]|^[^.\[\]]+)$")


def _fault(error: TowvalError, lines: dict[str, int]) -> dict[str, Any]:
    named = _KEY.search(error.what)
    key = error.key or (named.group() if named else "")
    # A key that is missing has the line of what it is missing from.
    known = key
    while known not in lines and (shorter := _LAST_PART.sub("", known)) != known:
        known = shorter
    return {
        "line": lines.get(known),
        "key": key,
        "what": error.what.removeprefix("campaign.yaml: "),
        "got": None if error.got is None else str(error.got),
        "allowed": error.allowed,
        "remedy": error.remedy,
        "text": str(error).removeprefix("campaign.yaml: "),
    }


def for_people(found: dict[str, Any]) -> str:
    """What :func:`check` found, in lines."""
    rows = []
    for fault in found["faults"]:
        where = f"line {fault['line']}: " if fault["line"] else ""
        rows.append(f"fault: {where}{fault['text']}")
    rows += [f"warning: {text}" for text in found["warnings"]]
    for name, row in found["runs"].items():
        known = ", ".join(
            f"{body} ±{row[f'{body}_position_std_mm']:g} mm at {row[f'{body}_pixel_mm']:g} mm a pixel"
            for body in ("rover", "object")
            if f"{body}_pixel_mm" in row
        )
        told = filter(None, (f"{row['frames']} frames", known, row["picture"]))
        rows.append(f"run {name}: {'; '.join(told)}")
    if found["faults"]:
        one = len(found["faults"]) == 1
        counted = "1 fault; correct it" if one else f"{len(found['faults'])} faults; correct them"
        rows.append(f"{found['campaign']}: {counted} and check again")
    else:
        cores, count = os.cpu_count() or 1, len(found["warnings"])
        warned = f", but {count} warning{'s' * (count != 1)}" if count else ""
        rows.append(
            f"{found['campaign']}: no fault{warned}. towval run {shlex.quote(found['campaign'])} takes about "
            f"{found['cpu_s'] / cores:.0f} s on {cores} cores"
        )
    return "\n".join(rows)

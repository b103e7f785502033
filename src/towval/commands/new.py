"""Command new: videos, pictures and measured facts → campaign.yaml, completed with what the pictures show."""

import glob
import re
import sys
import unicodedata
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
import yaml

from towval.calibration.behind_boards import some_of
from towval.calibration.board_search import fitting_corner_counts
from towval.calibration.corners import (
    BoardObservation,
    charuco_layouts,
    observe_charuco,
    observe_chessboard,
    observe_small_chessboard,
    outer_corners,
)
from towval.commands.check import IN_FLOOR_AXES, check, for_people
from towval.commands.console import Outcome, step
from towval.commands.settings import nested
from towval.io.atomic import write_text
from towval.io.campaign import IMAGE_SUFFIXES, OWN_FOLDERS, board_of, campaign_schema, pictures_of, whole
from towval.io.campaign_text import GUESS, RunClicks, campaign_text, text_in_parts
from towval.io.images import GrayPictures, stated_size
from towval.io.schema import faults_of
from towval.io.video import Video
from towval.io.yaml_text import read_value, read_yaml
from towval.model import Board
from towval.model.errors import Faults, InputError, shortened
from towval.model.input_types import value_of

VIDEO_SUFFIXES = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".mts", ".webm")

_SAMPLE = 6
"""Pictures of the board from which its corners are counted."""


@dataclass(frozen=True)
class Fact:
    """A key that every campaign needs, or should have.

    ``guess`` gives a value and a reason where nobody measured it, from what is known of the same section; ``std`` is
    the key of its standard deviation in that section and the deviation of the guess; a key that is not ``needed`` is
    left out where nobody states it.
    """

    key: str
    guess: Callable[[Mapping[str, Any]], tuple[Any, str]] | None = None
    std: tuple[str, float] | None = None
    needed: bool = True


def _end(at: float, where: str) -> Callable[[Mapping[str, Any]], tuple[Any, str]]:
    def guess(body: Mapping[str, Any]) -> tuple[Any, str]:
        return [at * float(np.abs(np.array(body["top_corners_m"])[:, 0]).max()), 0.0], f"the middle of its {where} edge"

    return guess


FACTS = (
    Fact("camera.fps", needed=False),  # A guess from the stamps would confirm the stamps.
    Fact("camera.board.type", lambda _: ("chessboard", "the usual kind")),
    Fact("camera.board.square_m"),
    Fact("floor.board_thickness_m", needed=False),
    Fact("rover.tracked_plane_height_m"),
    Fact("rover.top_corners_m"),
    Fact("rover.tether_hinge_m", _end(-1, "rear"), ("tether_hinge_std_m", 0.05)),
    Fact("rover.tether_hinge_height_m", needed=False),  # Assumed heights are wide, and a high tow moves the path most.
    Fact("object.tracked_plane_height_m"),
    Fact("object.top_corners_m"),
    Fact("object.footprint_m", lambda body: (body["top_corners_m"], "the outline of its top")),
    Fact("object.mass_kg"),
    Fact("object.tether_anchor_m", _end(1, "front"), ("tether_anchor_std_m", 0.02)),
    Fact("object.tether_anchor_height_m", needed=False),
    Fact("tether.rest_length_m"),
    Fact("tether.stiffness_N_per_m", lambda _: (1000.0, "a thin cord"), ("stiffness_std_N_per_m", 300.0)),
    Fact("friction.kinetic", lambda _: (0.35, "wood on a hard floor"), ("kinetic_std", 0.1)),
    Fact("friction.static", lambda keys: (1.1 * keys["kinetic"], "a tenth above kinetic"), ("static_std", 0.1)),
    Fact("friction.stiction_velocity_m_per_s", lambda _: (0.005, "usual"), ("stiction_velocity_std_m_per_s", 0.003)),
    Fact("friction.friction_velocity_m_per_s", lambda _: (0.05, "usual"), ("friction_velocity_std_m_per_s", 0.02)),
)  # fmt: skip


@dataclass
class Draft:
    """A campaign.yaml in the making: what is known by section, and by full key where it comes from."""

    folder: Path
    document: dict[str, Any]
    marks: dict[str, str] = field(default_factory=dict)

    def known(self, key: str) -> Any:
        """The value of a key, or None."""
        return value_of(self.document, key)

    def put(self, key: str, value: Any, mark: str = "") -> None:
        """Set a key that is not known yet."""
        section = self.document
        *names, last = key.split(".")
        for name in names:
            section = section.setdefault(name, {})
        if last not in section:
            section[last] = value
            if mark:
                self.marks[key] = mark


def run(
    folder: Path,
    keys: Mapping[str, Any] | None = None,
    facts: Path | None = None,
    ask: bool | None = None,
    force: bool = False,
    find: bool = True,
) -> Outcome:
    """Write campaign.yaml for a folder with videos and pictures.

    ``keys`` are facts by full key of campaign.yaml (``object.mass_kg``), a top perhaps as its length and width;
    ``facts`` a YAML file with more of them, in its sections. Asks for what is not known where ``ask``, by default on a
    terminal; replaces a campaign.yaml that is there with ``force``; with ``find`` checks what was written, finds where
    the bodies start, and writes ``check/start.html``.

    Raises `InputError` when facts are missing that cannot be guessed, or the folder holds no video or picture.
    """
    file = folder / "campaign.yaml"
    if file.exists() and not force:
        raise InputError(f"{file} is there already", remedy="edit it and run towval check, or replace it with --force")
    document = read_yaml(facts) if facts else {}
    if not isinstance(document, dict):
        raise InputError(f"{facts} has no sections", allowed="sections and keys of campaign.yaml")
    draft = Draft(folder, nested(keys or {}, document))
    _check_facts(draft.document)
    _look_at_files(draft)
    _fill(draft, sys.stdin.isatty() if ask is None else ask)
    _look_at_boards(draft)
    text = campaign_text(draft.document, draft.marks)
    write_text(file, text)
    checked: dict[str, Any] = {}
    if find:
        checked = check(folder, folder / "check")
        write_text(file, _with_starts(text, checked["runs"]))
    return _outcome(draft, file, checked)


def _outcome(draft: Draft, file: Path, checked: dict[str, Any]) -> Outcome:
    """What was written, what of it is a guess or missing, and what the check found, if there was one."""
    guessed = [key for key, mark in draft.marks.items() if mark.startswith(GUESS)]
    runs = list(draft.document["runs"])
    text = f"run{'s' * (len(runs) != 1)} {shortened(', '.join(runs))}; "
    text += f"guessed, so measure first: {', '.join(guessed) or 'nothing'}"
    unstated = [fact.key for fact in FACTS if not fact.needed and draft.known(fact.key) is None]
    text += f"; not stated: {', '.join(unstated)}" if unstated else ""
    aside = (draft.marks.get(key, "") for key in ("camera.calibration_images", "floor.more_images"))
    text += "".join(f"; {mark.rstrip('.')}" for mark in aside if mark)
    in_axes = [key for key in IN_FLOOR_AXES if draft.known(key) is not None]
    if in_axes and "floor.origin_corner_px" in draft.marks:
        text += (
            f"; the floor's axes were chosen, and {' and '.join(in_axes)} must be given in them: see check/start.html"
        )
    numbers = {"runs": runs, "guessed": guessed, "check": checked}
    return Outcome("new", (file,), text, numbers, details=(for_people(checked),) if checked else ())


def _check_facts(document: Mapping[str, Any]) -> None:
    """Refuse facts that campaign.yaml does not allow, before anything is made of them; a top may be two lengths."""
    whole = deepcopy(dict(document))
    for section in whole.values():
        top = section.get("top_corners_m") if isinstance(section, dict) else None
        if _is_pair(top):
            section["top_corners_m"] = _rectangle(*top)
    Faults(faults_of(whole, _of_parts(campaign_schema()), "the list of facts").values()).raise_any("the list of facts")


def _of_parts(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema by which no section has to be complete."""
    properties = {name: _of_parts(each) for name, each in schema.get("properties", {}).items()}
    return {**schema, "required": [], **({"properties": properties} if properties else {})}


def _with_starts(text: str, runs: Mapping[str, Any]) -> str:
    """The text with the corners of the tops that were found for certain, marked; what is stated stays."""
    pieces = []
    for piece in text_in_parts(text):
        if isinstance(piece, str):
            pieces.append(piece)
            continue
        found = runs.get(piece.run, {}) if isinstance(piece, RunClicks) and not piece.stated else {}
        corners = {body: found.get(f"{body}_corners_px") for body in ("rover", "object")}
        if all(corners.values()):
            before = piece.before
            pieces.append(
                before.replace("first_frame", f"# Found by their outlines.{before.partition('f')[0]}first_frame")
            )
            pieces.append(yaml.safe_dump(corners, default_flow_style=True, width=10_000, sort_keys=False).strip())
        else:
            pieces.append(piece.stated)
    return "".join(pieces)


def _look_at_files(draft: Draft) -> None:
    """Videos, pictures and resolution."""
    found = sorted(path.relative_to(draft.folder) for path in draft.folder.rglob("*") if path.is_file())
    # Results of an earlier run below the folder hold figures and overlays.
    results = {path.parent for path in found if path.name == "camera.mcap"}
    found = [path for path in found if results.isdisjoint(path.parents) and not _is_hidden(path)]
    videos = [path for path in found if path.suffix.lower() in VIDEO_SUFFIXES]
    pictures = [path for path in found if path.suffix.lower() in IMAGE_SUFFIXES and path.parts[0] != "check"]
    if not draft.known("runs"):
        if not draft.folder.is_dir():
            raise InputError(f"{draft.folder} is no folder", remedy="give the folder with the videos and pictures")
        if not videos:
            raise InputError(f"{draft.folder} holds no video", allowed=f"files ending in {', '.join(VIDEO_SUFFIXES)}")
        taken = set(OWN_FOLDERS)
        for path in videos:
            parted = unicodedata.normalize("NFKD", path.stem)
            plain = "".join(letter for letter in parted if not unicodedata.combining(letter))  # Ü without its dots
            name = re.sub(r"[^A-Za-z0-9_-]+", "_", plain).strip("_-") or "run"
            while name.lower() in taken:  # a.mp4 beside a.mov, or beside A.mp4: some disks take both for one
                name += "_2"
            taken.add(name.lower())
            draft.put(f"runs.{name}", {"video": path.as_posix()})
    if not draft.known("camera.resolution_px"):
        # A phone held upright stores videos lying, with a tag by which they are turned; its photos, too, or upright.
        height, width = Video(draft.folder / next(iter(draft.document["runs"].values()))["video"]).first_picture().shape
        sizes = {stated_size(draft.folder / path) for path in pictures}
        lies = (height, width) in sizes and (width, height) not in sizes
        size, source = ([height, width], "pictures") if lies else ([width, height], "first video")
        draft.put("camera.resolution_px", size, f"From the {source}.")
    if not pictures and not draft.known("camera.calibration_images"):
        raise InputError(f"{draft.folder} holds no picture of the board", allowed=", ".join(IMAGE_SUFFIXES))
    flat = [path for path in pictures if "floor" in path.stem.lower()]
    held = [path for path in pictures if path not in flat] or pictures
    if held:
        draft.put("camera.calibration_images", *_pattern(held, "*"))
    if not (draft.known("floor.image") or draft.known("floor.surveyed_marks")) and flat:
        draft.put("floor.image", flat[0].as_posix())
        if flat[1:]:
            draft.put("floor.more_images", *_pattern(flat[1:], "*[fF][lL][oO][oO][rR]*"))


def _is_hidden(path: Path) -> bool:
    """Whether a file or a folder of a path begins with a dot: macOS puts such a one beside each file on other disks."""
    return any(part.startswith(".") for part in path.parts)


def _pattern(pictures: Sequence[Path], name: str) -> tuple[str, str]:
    """A pattern for the pictures of the folder that holds most of them, and a mark that names those elsewhere."""
    ((folder, _),) = Counter(path.parent for path in pictures).most_common(1)
    suffixes = {path.suffix for path in pictures if path.parent == folder}
    others = [path.as_posix() for path in pictures if path.parent != folder]
    mark = f"Pictures in other folders are not used: {some_of(others)}." if others else ""
    where = Path(glob.escape(folder.as_posix()))
    return (where / f"{name}{suffixes.pop() if len(suffixes) == 1 else ''}").as_posix(), mark


def _fill(draft: Draft, ask: bool) -> None:
    """Fill in what was not stated: ask for it, guess it, or report it as missing."""
    missing = Faults()
    for fact in FACTS:
        if draft.known(fact.key) is None:
            section = draft.known(fact.key.rpartition(".")[0]) or {}
            guessed = _guessed(fact, section)
            value = _asked(fact, guessed) if ask else None
            if value is not None:
                draft.put(fact.key, value)
            elif guessed:
                draft.put(fact.key, guessed[0], f"{GUESS}: {guessed[1]}.")
                if fact.std:
                    draft.put(f"{fact.key.rpartition('.')[0]}.{fact.std[0]}", fact.std[1], f"{GUESS}: of a guess.")
            elif fact.guess is None and fact.needed:
                missing.append(_unknown(fact.key))
        value = draft.known(fact.key)
        if fact.key.endswith("top_corners_m") and _is_pair(value):
            draft.known(fact.key.split(".")[0])["top_corners_m"] = _rectangle(*value)
    if not (draft.known("floor.image") or draft.known("floor.surveyed_marks")):
        missing.append(_unknown("floor.image"))
    missing.raise_any("the list of facts")


def _guessed(fact: Fact, section: Mapping[str, Any]) -> tuple[Any, str] | None:
    try:
        return fact.guess(section) if fact.guess else None
    except KeyError:  # What it rests on is not known either.
        return None


def _is_pair(top: Any) -> TypeGuard[list[float]]:
    """Whether a top is stated as its length and width."""
    return isinstance(top, list) and len(top) == 2 and all(type(length) in (int, float) for length in top)


def _rectangle(length: float, width: float) -> list[list[float]]:
    return [[x * length / 2, y * width / 2] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def _meaning(key: str) -> tuple[dict[str, Any], str]:
    """The schema of a key, and its meaning with its unit."""
    whole = campaign_schema()
    schema = whole
    for name in key.split("."):
        schema = schema["properties"][name]
    text = "length and width of the flat top" if key.endswith("top_corners_m") else schema["description"].rstrip(".")
    return {**schema, "$defs": whole["$defs"]}, text + (
        f" [{schema['unit']}]" if schema.get("unit", "1") != "1" else ""
    )


def _unknown(key: str) -> InputError:
    # Without quotes the shell of macOS takes brackets for a pattern.
    given = f'"{key}=[0.5,0.35]"' if key.endswith("top_corners_m") else f"{key}=..."
    remedy = f"give it: --set {given}"
    remedy += ", or put floor into the name of that picture" * (key == "floor.image")
    return InputError(f"{key} is not known: {_meaning(key)[1]}", remedy=remedy)


def _asked(fact: Fact, guessed: tuple[Any, str] | None) -> Any:
    """An answer from the terminal that the schema accepts; None where it is left empty and may be."""
    key = fact.key
    schema, meaning = _meaning(key)
    empty = f" (empty: a guess, {guessed[0]})" if guessed else "" if fact.needed else " (empty: not known)"
    while True:
        try:
            answer = input(f"{key}: {meaning}{empty}: ").strip()
        except EOFError:
            raise InputError(f"nobody answers what {key} is", remedy="give facts with --set or --facts") from None
        if not answer:
            if guessed or not fact.needed:
                return None
            continue
        try:
            value = read_value(answer)
        except InputError as error:
            print(error)
            continue
        whole = _rectangle(*value) if key.endswith("top_corners_m") and _is_pair(value) else value
        faults = faults_of({key: whole}, {"properties": {key: schema}, "$defs": schema["$defs"]}, "the answer")
        if not faults:
            return value
        print(next(iter(faults.values())))


def _look_at_boards(draft: Draft) -> None:
    """Corners of the board, and of the floor's frame in its picture."""
    camera, floor = draft.document["camera"], draft.document["floor"]
    resolution = whole(camera["resolution_px"])
    if draft.known("camera.board.inner_corners") is None:
        paths = pictures_of(camera["calibration_images"], draft.folder, "camera.calibration_images")
        pictures = GrayPictures(paths[:: max(1, len(paths) // _SAMPLE)], resolution)
        step(f"new: count the corners of the board in {len(pictures)} pictures")
        counts = fitting_corner_counts(pictures)
        if counts is None:
            raise _unknown("camera.board.inner_corners")
        draft.put("camera.board.inner_corners", list(counts), "Counted in the pictures.")
    if "image" not in floor or "origin_corner_px" in floor:
        return
    seen = _whole_board(GrayPictures((draft.folder / floor["image"],), resolution), board_of(camera["board"]))
    if seen is None:
        raise InputError(
            "the board is not found in the floor picture",
            got=floor["image"],
            remedy="give floor.origin_corner_px and floor.x_axis_end_corner_px, or another floor.image",
        )
    if draft.marks.get("camera.board.type", "").startswith(GUESS):
        draft.marks["camera.board.type"] = "Found in the pictures."
    ends = seen.corners_px[outer_corners(seen.board_m)]
    # Of the board's first and last row the lower in the picture, from left to right.
    row = max((ends[[0, 1]], ends[[3, 2]]), key=lambda row: row[:, 1].sum())
    origin, end = row[np.argsort(row[:, 0])]
    draft.put("floor.origin_corner_px", [round(float(x), 1) for x in origin], "Chosen: the lower left corner found.")
    draft.put("floor.x_axis_end_corner_px", [round(float(x), 1) for x in end], "Chosen: the lower right corner found.")


def _whole_board(pictures: GrayPictures, board: Board) -> BoardObservation | None:
    """The board in the first of the pictures, with all its corners; None where it is not found."""
    name, picture = pictures[0]
    if board.kind == "chessboard":
        thorough = observe_chessboard(name, picture, board, thorough=True)
        return thorough or observe_small_chessboard(name, picture, board)
    found = (observe_charuco(name, picture, one, old_layout=old) for one, old in charuco_layouts(board))
    return next((each for each in found if each and len(each.corners_px) == np.prod(board.inner_corners)), None)

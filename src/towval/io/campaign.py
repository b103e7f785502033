"""The campaign folder of a lab: read from ``campaign.yaml`` and checked before anything is computed."""

import glob
import itertools
import os
import shlex
import stat
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from towval.io.campaign_scene import LEAST_TOP_M2, outline, towing_scene
from towval.io.reading import check_name, is_folder, is_plain_file, kind_of, reason
from towval.io.schema import faults_of, packaged_schema
from towval.io.yaml_text import read_yaml
from towval.model import Array, Board, Body, FloorReference, Tag, TowingScene, locked
from towval.model.errors import Faults, InputError
from towval.model.inputs import INPUTS, StatedDeviation, deviations

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp")

_MOST_PICTURES = 2000
"""Of one pattern: calibration uses some tens."""

_LEAST_CLICKS_PX2 = 16.0

OWN_FOLDERS = ("figures", "logs", "benchmarks")
"""Names of folders beside those of the runs, in the results."""


@dataclass(frozen=True)
class Run:
    """One run: its name, its video and where the corners of the tops are in the first frame, by body's name [px].

    ``damaged_video`` allows the use of the good part of a damaged video.
    """

    name: str
    video: Path
    clicks_px: dict[str, Array]
    damaged_video: bool = False


@dataclass(frozen=True)
class Campaign:
    """A campaign as handed in.

    ``calibration_images`` and ``floor_images`` are files that exist; the first floor image defines the floor frame.
    ``tags`` are the markers on each body's top, by its name; ``scene`` is the input of the simulation, ``deviations``
    the standard deviations of the uncertain inputs by name; ``repeats`` are the names of runs that repeat one drive,
    by group; ``left_out`` are the reasons why other runs of the file are left out, by name; ``document`` is the file as
    read.
    """

    folder: Path
    name: str
    resolution_px: tuple[int, int]
    calibration_images: tuple[Path, ...]
    board: Board
    floor_images: tuple[Path, ...]
    floor_reference: FloorReference
    rover: Body
    object: Body
    tags: dict[str, tuple[Tag, ...]]
    scene: TowingScene
    deviations: dict[str, float]
    runs: dict[str, Run]
    repeats: tuple[tuple[str, ...], ...]
    left_out: dict[str, str]
    document: dict[str, Any]

    @property
    def bodies(self) -> tuple[Body, Body]:
        """Rover and object."""
        return self.rover, self.object

    def run(self, name: str) -> Run:
        """The run of that name; raises `InputError` when there is none, or where it is left out."""
        if name in self.left_out:
            raise InputError(
                f"run {name} of the campaign {self.name} is left out",
                got=self.left_out[name],
                remedy=f"take runs.{name}.left_out out of campaign.yaml",
            )
        try:
            return self.runs[name]
        except KeyError:
            raise InputError(
                f"the campaign {self.name} has no such run", got=name, allowed=", ".join(self.runs)
            ) from None


def names_in(folder: Path, files: Iterable[Path]) -> dict[str, Path]:
    """Files by their names in a folder, for the record; those elsewhere by their paths."""
    return {str(path.relative_to(folder) if path.is_relative_to(folder) else path): path for path in files}


def load_campaign(folder: Path) -> Campaign:
    """Read and check a folder that holds ``campaign.yaml``.

    Raises `InputError` for a key that is unknown, missing or out of range, a file that is not there, or numbers that
    contradict each other; every message names the key.
    """
    folder = Path(folder)
    campaign, faults = read_campaign(folder, read_document(folder))
    faults.raise_any("campaign.yaml")
    assert campaign is not None
    return campaign


def read_document(folder: Path) -> Any:
    """The content of ``campaign.yaml`` in a campaign folder, as YAML has it, unchecked.

    Raises `InputError` where there is no such folder, or where the file cannot be read as YAML.
    """
    if not is_folder(folder):
        file = is_plain_file(folder)
        raise InputError(
            "the campaign folder is a file" if file else "the campaign folder is missing",
            got=folder,
            allowed="a folder with a campaign.yaml",
            remedy=f"give its folder, {folder.parent}" if file else "correct the path of the folder",
        )
    check_name(folder, "the campaign folder")
    missing = f"towval new {shlex.quote(str(folder))} writes it; or give the folder that holds it"
    return read_yaml(folder / "campaign.yaml", missing)


def read_campaign(folder: Path, document: Any) -> tuple[Campaign | None, Faults]:
    """The campaign that a document, read from campaign.yaml, describes; None and every fault where it has any.

    Checks that depend on a faulty part of the document are left out, all others are made.
    """
    wrong = faults_of(document, campaign_schema(), "campaign.yaml")
    faults = Faults(wrong.values())
    read: dict[str, Any] = {}

    def part(needs: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """The result of a call with the keys that it needs, or None where one of them has a fault."""
        keys = needs.split()
        related = (pair for fault in wrong for key in keys for pair in ((fault, key), (key, fault)))
        if "the document" in wrong or any(f"{inner}.".startswith(f"{outer}.") for inner, outer in related):
            return None
        try:
            found = [reduce(lambda keys, key: keys.get(key, {}), key.split("."), document) for key in keys]
            return faults.attempt(function, *found, *arguments)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
            if not wrong:
                raise
            return None  # caused by a fault that is reported, or by one beyond the most that are

    read["calibration_images"] = part("camera.calibration_images", pictures_of, folder, "camera.calibration_images")
    read["board"] = part("camera.board", board_of)
    read["floor_images"] = part("floor", floor_pictures_of, folder)
    read["floor_reference"] = part("floor", floor_reference_of)
    scene = part("floor rover object tether friction", lambda *_: towing_scene(document))
    corners = {body: part(body, _top, body) for body in ("rover", "object")}
    listed = document["runs"] if isinstance(document, dict) and isinstance(document.get("runs"), dict) else {}
    read["left_out"] = _left_out(listed)
    part("runs", _check_some_are_left, read["left_out"])
    names = [name for name in listed if str(name) not in read["left_out"]]
    runs = {str(name): part(f"runs.{name} camera.resolution_px", _run, folder, str(name), corners) for name in names}
    read["repeats"] = part("runs repeats", _repeats)
    if faults:
        return None, faults
    return _campaign(folder, document, scene, corners, runs, read), faults


def _campaign(
    folder: Path,
    document: dict[str, Any],
    scene: TowingScene,
    corners: dict[str, Array],
    runs: dict[str, Run],
    read: dict[str, Any],
) -> Campaign:
    known, load = deviations(scene, document), scene.load
    hidden = {"rover": (), "object": (load.outline,) if load.size[:2].all() else ()}
    bodies = {
        name: Body(
            name=name,
            tracked_plane_height_m=document[name]["tracked_plane_height_m"],
            top_corners_m=corners[name],
            obstructions=hidden[name],
            height_std_m=known[f"{name}_height"],
        )
        for name in corners
    }
    return Campaign(
        folder=folder,
        name=folder.resolve().name,
        resolution_px=whole(document["camera"]["resolution_px"]),
        rover=bodies["rover"],
        object=bodies["object"],
        tags={name: _tags(document[name]) for name in bodies},
        scene=scene,
        deviations=known,
        runs=runs,
        document=document,
        **read,
    )


def campaign_schema() -> dict[str, Any]:
    """The packaged schema of campaign.yaml with the deviations of :data:`towval.model.inputs.INPUTS`."""
    schema = deepcopy(packaged_schema("campaign.schema.yaml"))
    for row in INPUTS.values():
        if row.stated is None:
            continue
        *sections, key = row.stated.key.split(".")
        section = schema
        for name in sections:
            section = section["properties"][name]
        section["properties"][key] = {
            "description": f"Standard deviation of {row.stated.of}; by default {_default(row.stated)}.",
            "unit": row.stated.unit or row.unit or "1",
            "type": "number",
            "minimum": 0,
            "maximum": row.stated.maximum,
        }
    return schema


def _default(stated: StatedDeviation) -> str:
    left_out = stated.left_out
    if left_out is None:
        return stated.default_text
    return f"{stated.default_text}, or {left_out.std_text} where {left_out.key} is left out"


def whole(numbers: Sequence[float]) -> tuple[int, int]:
    """Two whole numbers, which a file may state as 9.0, as those that count something."""
    first, second = map(int, numbers)
    return first, second


def board_of(keys: dict[str, Any]) -> Board:
    """The board that section camera.board describes."""
    if keys["type"] == "charuco" and not {"marker_m", "dictionary"} <= keys.keys():
        raise InputError(
            "campaign.yaml: camera.board of type charuco needs more keys",
            got=", ".join(keys),
            allowed="type, inner_corners, square_m, marker_m and dictionary",
        )
    return Board(
        kind=keys["type"],
        inner_corners=whole(keys["inner_corners"]),
        square_m=keys["square_m"],
        marker_m=keys.get("marker_m", float("nan")),
        dictionary=keys.get("dictionary", ""),
        size_std=keys.get("size_std", Board.size_std),
        bow_std_m=keys.get("bow_std_m", Board.bow_std_m),
    )


def floor_reference_of(floor: dict[str, Any]) -> FloorReference:
    """The reference for the floor frame that section floor states."""
    board_keys = [key for key in ("image", "origin_corner_px", "x_axis_end_corner_px") if key in floor]
    marks = floor.get("surveyed_marks", [])
    by_board = len(board_keys) == 3
    if not by_board and not (marks and set(board_keys) <= {"image"}):
        raise InputError(
            "campaign.yaml: the floor frame is not fixed",
            got=f"floor.{', floor.'.join(board_keys) or '(nothing)'}",
            allowed="floor.image with floor.origin_corner_px and floor.x_axis_end_corner_px, or floor.surveyed_marks",
        )
    return FloorReference(
        origin_corner_px=np.array(floor["origin_corner_px"], dtype=float) if by_board else None,
        x_axis_end_corner_px=np.array(floor["x_axis_end_corner_px"], dtype=float) if by_board else None,
        board_thickness_m=floor.get("board_thickness_m", FloorReference.board_thickness_m),
        board_thickness_std_m=floor.get("board_thickness_std_m", _thickness_std_m("board_thickness_m" in floor)),
        marks_px=np.array([mark["at_px"] for mark in marks], dtype=float).reshape(-1, 2),
        marks_m=np.array([mark["at_m"] for mark in marks], dtype=float).reshape(-1, 2),
        mark_std_px=floor.get("surveyed_mark_std_px", FloorReference.mark_std_px),
    )


def _thickness_std_m(stated: bool) -> float:
    """Deviation of the board's thickness by default, where that is stated or left out."""
    row = INPUTS["board_thickness"].stated
    return FloorReference.board_thickness_std_m if stated or not row or not row.left_out else row.left_out.std


def pictures_of(pattern: str, folder: Path, key: str) -> tuple[Path, ...]:
    """Pictures of a name or pattern in the campaign folder, or elsewhere where the pattern says so."""
    # Anywhere but in the campaign's own folder ** may walk through whole disks.
    if "**" in pattern and (Path(pattern).is_absolute() or ".." in Path(pattern).parts):
        raise InputError(f"campaign.yaml: {key} is too wide", got=pattern, allowed="** in the campaign folder only")
    # A name with brackets is no pattern of itself.
    itself = [pattern] if is_plain_file(folder / pattern) else []
    names = map(Path, itertools.chain(itself, glob.iglob(pattern, root_dir=folder, recursive=True)))
    # In a folder of this name `towval check` draws starts, which are no pictures of a board.
    spared = "check" if "**" in pattern else ""
    pictures = (name for name in names if name.suffix.lower() in IMAGE_SUFFIXES and name.parts[0] != spared)
    found = sorted({folder / name for name in itertools.islice(pictures, _MOST_PICTURES + 2)})
    if not found:
        raise InputError(
            f"campaign.yaml: {key} finds no picture",
            got=pattern,
            allowed=f"a file or pattern of pictures in {folder} ({', '.join(IMAGE_SUFFIXES)})",
            remedy=_with_slashes(pattern) or "check the pattern, or copy the missing pictures there",
        )
    if len(found) > _MOST_PICTURES:
        raise InputError(f"campaign.yaml: {key} finds too many pictures", allowed=f"at most {_MOST_PICTURES}")
    return tuple(_plain(path, key) for path in found)


def _plain(path: Path, key: str) -> Path:
    """The path of a plain file that can be read; pipes would block, and devices never end."""
    check_name(path, f"campaign.yaml: {key}")
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        raise InputError(
            f"campaign.yaml: the file of {key} is missing",
            got=f"{path}: {reason(error)}",
            allowed="a file in the campaign folder",
            remedy=_with_slashes(path.name) or _written_otherwise(path) or "check the name, or copy the file there",
        ) from None
    if not stat.S_ISREG(mode):
        raise InputError(f"campaign.yaml: {key} names no plain file", got=f"{path} is {kind_of(mode)}")
    if not os.access(path, os.R_OK):
        raise InputError(f"campaign.yaml: the file of {key} may not be read", got=path, remedy="change its rights")
    return path


def _with_slashes(name: str) -> str:
    """What to do where a name that was not found holds backslashes, which part folders on Windows alone; else empty."""
    return "write / between folders in place of \\" if "\\" in name and os.sep != "\\" else ""


def _written_otherwise(path: Path) -> str:
    """What to do where a file is there whose name only looks the same: capitals, or macOS's accents; else empty."""
    with suppress(OSError, ValueError):
        for name in os.listdir(path.parent):
            if unicodedata.normalize("NFC", name).casefold() == unicodedata.normalize("NFC", path.name).casefold():
                return f"write the name as that of the file, with the same capitals and coding of accents: {name!a}"
    return ""


def floor_pictures_of(floor: dict[str, Any], folder: Path) -> tuple[Path, ...]:
    """Pictures of the board on the floor, that of the frame first."""
    first = (_plain(folder / floor["image"], "floor.image"),) if "image" in floor else ()
    more = pictures_of(floor["more_images"], folder, "floor.more_images") if "more_images" in floor else ()
    return (*first, *(path for path in more if path not in first))


def _top(keys: dict[str, Any], name: str) -> Array:
    return outline(keys["top_corners_m"], f"{name}.top_corners_m", LEAST_TOP_M2)


def _tags(keys: dict[str, Any]) -> tuple[Tag, ...]:
    return tuple(
        Tag(tag["dictionary"], int(tag["number"]), tag["size_m"], np.array([*tag["at_m"], tag.get("heading_rad", 0.0)]))
        for tag in keys.get("tags", ())
    )


def _repeats(runs: dict[str, Any], groups: Sequence[Sequence[str]]) -> tuple[tuple[str, ...], ...]:
    named = [name for group in groups for name in group]
    wrong = [name for name in dict.fromkeys(named) if name not in runs or named.count(name) > 1]
    if wrong:
        raise InputError(
            "campaign.yaml: repeats names what is no run, or a run twice",
            got=", ".join(wrong),
            allowed=f"each of {', '.join(map(str, runs))} at most once",
        )
    return tuple(map(tuple, groups))


def _left_out(runs: dict[str, Any]) -> dict[str, str]:
    """Reasons why runs are left out, by name."""
    return {
        str(name): entry["left_out"] for name, entry in runs.items() if isinstance(entry, dict) and "left_out" in entry
    }


def _check_some_are_left(runs: dict[str, Any], left_out: dict[str, str]) -> None:
    if len(left_out) == len(runs):
        raise InputError("campaign.yaml: every run is left out", allowed="at least one run without left_out")


def _run(
    entry: dict[str, Any], resolution_px: list[int], folder: Path, name: str, corners: dict[str, Array | None]
) -> Run:
    if name.lower() in OWN_FOLDERS:
        raise InputError(
            f"campaign.yaml: no run may be named {name}", allowed=f"a name that is none of {', '.join(OWN_FOLDERS)}"
        )
    faults = Faults()
    video = faults.attempt(_plain, folder / entry["video"], f"runs.{name}.video")
    clicks = {}
    for body, pixels in entry.get("first_frame_clicks_px", {}).items():
        key = f"runs.{name}.first_frame_clicks_px.{body}"
        found = faults.attempt(_clicks, pixels, corners[body], resolution_px, key)
        if found is not None:
            clicks[body] = found
    faults.raise_any("campaign.yaml")
    assert video is not None
    return Run(name, video, clicks, damaged_video=entry.get("damaged_video", False))


def _clicks(pixels: Any, corners: Array | None, resolution_px: list[int], key: str) -> Array:
    if corners is not None and len(pixels) != len(corners):
        raise InputError(
            f"campaign.yaml: {key} has another number of corners than {key.rpartition('.')[2]}.top_corners_m",
            got=len(pixels),
            allowed=str(len(corners)),
            remedy="click every corner once, in the same order",
        )
    clicks = locked(pixels, key, (len(pixels), 2))
    _check_clicks(clicks, resolution_px, key)
    return clicks


def _check_clicks(clicks: Array, resolution_px: list[int], key: str) -> None:
    """Refuse clicks far outside the image, on one spot or with crossing outline: not made on the first frame."""
    size = np.array(resolution_px)
    if (clicks < -0.5 * size).any() or (clicks > 1.5 * size).any():
        raise InputError(
            f"campaign.yaml: {key} is outside the image",
            got=clicks.tolist(),
            allowed=f"pixels of a {size[0]} × {size[1]} image",
            remedy="click the corners in the first frame",
        )
    outline(clicks, key, _LEAST_CLICKS_PX2)

"""The campaign folder: what a lab hands in, read from ``campaign.yaml`` and checked before anything is computed."""

from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from towval.io.schema import check, packaged_schema, read_yaml
from towval.model import (
    Array,
    Board,
    Body,
    FloorReference,
    FrictionSpecification,
    Load,
    Patch,
    Tether,
    TowingScene,
    locked,
)
from towval.model.errors import InputError
from towval.model.geometry import inside_polygon, polygon_area
from towval.model.inputs import INPUTS, deviations
from towval.physics.mass import towed_object
from towval.tracking.markers import Tag

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp")


@dataclass(frozen=True)
class Run:
    """One run: its name, its video and where the corners of the tops are in the first frame, by body's name [px].

    ``damaged_video`` allows to go on with the good part of a damaged video.
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
    the standard deviations of the uncertain inputs by name; ``document`` is the file as read.
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
    document: dict[str, Any]

    @property
    def bodies(self) -> tuple[Body, Body]:
        """Rover and object."""
        return self.rover, self.object

    def run(self, name: str) -> Run:
        """The run of that name.

        Raises `InputError` when there is none.
        """
        try:
            return self.runs[name]
        except KeyError:
            raise InputError(
                f"the campaign {self.name} has no such run", got=name, allowed=", ".join(self.runs)
            ) from None


def load_campaign(folder: Path) -> Campaign:
    """Read and check a campaign folder.

    Parameters
    ----------
    folder : Path
        The folder that holds ``campaign.yaml``.

    Raises
    ------
    InputError
        For a key that is unknown, missing or out of range, a file that is not there, or numbers that contradict each
        other; every message names the key.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(
            "the campaign folder is missing",
            got=folder,
            allowed="a folder with a campaign.yaml",
            remedy="check the path after campaign=",
        )
    document = read_yaml(folder / "campaign.yaml")
    check(document, campaign_schema(), "campaign.yaml")
    camera, floor = document["camera"], document["floor"]
    rover, towed = document["rover"], document["object"]
    load = _load(towed)
    _check_load(towed, load)
    _check_friction(document["friction"])
    scene = _scene(document, load)
    _check_weight(scene)
    known = deviations(scene, document)
    return Campaign(
        folder=folder,
        name=folder.resolve().name,
        resolution_px=tuple(camera["resolution_px"]),
        calibration_images=_images(folder, camera["calibration_images"], "camera.calibration_images"),
        board=_board(camera["board"]),
        floor_images=_floor_images(folder, floor),
        floor_reference=_floor_reference(floor),
        rover=_body("rover", rover, known["rover_height"], ()),
        object=_body("object", towed, known["object_height"], (load.outline,) if load.size[:2].all() else ()),
        tags={"rover": _tags(rover), "object": _tags(towed)},
        scene=scene,
        deviations=known,
        runs={str(name): _run(folder, str(name), entry, document) for name, entry in document["runs"].items()},
        document=document,
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
            "description": f"Standard deviation of {row.stated.of}; by default {row.stated.default_text}.",
            "unit": row.unit or "1",
            "type": "number",
            "minimum": 0,
            "maximum": row.stated.maximum,
        }
    return schema


def _board(keys: dict[str, Any]) -> Board:
    if keys["type"] == "charuco" and not {"marker_m", "dictionary"} <= keys.keys():
        raise InputError(
            "campaign.yaml: camera.board of type charuco needs more keys",
            got=", ".join(keys),
            allowed="type, inner_corners, square_m, marker_m and dictionary",
        )
    return Board(
        kind=keys["type"],
        inner_corners=tuple(keys["inner_corners"]),
        square_m=keys["square_m"],
        marker_m=keys.get("marker_m", float("nan")),
        dictionary=keys.get("dictionary", ""),
    )


def _floor_reference(floor: dict[str, Any]) -> FloorReference:
    board_keys = [key for key in ("image", "origin_corner_px", "x_axis_end_corner_px") if key in floor]
    marks = floor.get("surveyed_marks", [])
    if len(board_keys) not in (0, 3) or not (board_keys or marks):
        raise InputError(
            "campaign.yaml: the floor frame is not fixed",
            got=f"floor.{', floor.'.join(board_keys) or '(nothing)'}",
            allowed="floor.image with floor.origin_corner_px and floor.x_axis_end_corner_px, or floor.surveyed_marks",
        )
    return FloorReference(
        origin_corner_px=np.array(floor["origin_corner_px"], dtype=float) if board_keys else None,
        x_axis_end_corner_px=np.array(floor["x_axis_end_corner_px"], dtype=float) if board_keys else None,
        board_thickness_m=floor.get("board_thickness_m", 0.0),
        marks_px=np.array([mark["at_px"] for mark in marks], dtype=float).reshape(-1, 2),
        marks_m=np.array([mark["at_m"] for mark in marks], dtype=float).reshape(-1, 2),
        mark_std_px=floor.get("surveyed_mark_std_px", 0.7),
    )


def _images(folder: Path, pattern: str, key: str) -> tuple[Path, ...]:
    found = tuple(sorted(p for p in folder.glob(pattern) if p.suffix.lower() in IMAGE_SUFFIXES))
    if not found:
        raise InputError(
            f"campaign.yaml: {key} finds no picture",
            got=pattern,
            allowed=f"a file or pattern of pictures in {folder} ({', '.join(IMAGE_SUFFIXES)})",
            remedy="check the pattern, or copy the missing pictures there",
        )
    return found


def _file(folder: Path, name: str, key: str) -> Path:
    path = folder / name
    if not path.is_file():
        raise InputError(
            f"campaign.yaml: the file of {key} is missing",
            got=path,
            allowed="a file in the campaign folder",
            remedy="check the name, or copy the file there",
        )
    return path


def _floor_images(folder: Path, floor: dict[str, Any]) -> tuple[Path, ...]:
    first = (_file(folder, floor["image"], "floor.image"),) if "image" in floor else ()
    more = _images(folder, floor["more_images"], "floor.more_images") if "more_images" in floor else ()
    return (*first, *(path for path in more if path not in first))


def _body(name: str, keys: dict[str, Any], height_std_m: float, obstructions: tuple[Array, ...]) -> Body:
    corners = np.array(keys["top_corners_m"], dtype=float)
    if abs(polygon_area(corners)) < 1e-4:
        raise InputError(
            f"campaign.yaml: {name}.top_corners_m encloses no area",
            got=corners.tolist(),
            allowed="the corners of a polygon, one after the other around it",
        )
    return Body(
        name=name,
        tracked_plane_height_m=keys["tracked_plane_height_m"],
        top_corners_m=corners,
        obstructions=obstructions,
        height_std_m=height_std_m,
    )


def _tags(keys: dict[str, Any]) -> tuple[Tag, ...]:
    return tuple(
        Tag(tag["dictionary"], tag["number"], tag["size_m"], np.array([*tag["at_m"], tag.get("heading_rad", 0.0)]))
        for tag in keys.get("tags", ())
    )


def _load(towed: dict[str, Any]) -> Load:
    keys = towed.get("load", {"mass_kg": 0.0, "at_m": [0.0, 0.0]})
    return Load(
        mass=keys["mass_kg"],
        at=np.array(keys["at_m"], dtype=float),
        size=np.array(keys.get("size_m", [0, 0, 0]), dtype=float),
    )


def _check_load(towed: dict[str, Any], load: Load) -> None:
    """The load must stand on the top."""
    top = np.array(towed["top_corners_m"], dtype=float)
    if "load" in towed and not inside_polygon(top, load.at):
        raise InputError(
            "campaign.yaml: object.load.at_m is not on the object's top",
            got=load.at.tolist(),
            allowed=f"a point inside object.top_corners_m {top.tolist()}",
            remedy="give the centre of the load in metres, in the object's frame",
        )


def _check_weight(scene: TowingScene) -> None:
    """The weight of object and load must act within the hull of the footprint, or the object tips over."""
    hull = shapely.MultiPoint(scene.patch.corners).convex_hull
    centre = towed_object(scene).centre_of_mass
    point = shapely.Point(centre)
    if not hull.contains(point):
        raise InputError(
            "campaign.yaml: the weight of the object and its load is not on object.footprint_m",
            got=f"centre of mass ({centre[0]:.3f}, {centre[1]:.3f}) m, {hull.distance(point):.3f} m outside",
            allowed="a centre of mass inside the convex hull of the footprint",
            remedy="check object.footprint_m, object.mass_kg and object.load",
        )


def _check_friction(friction: dict[str, Any]) -> None:
    if friction["static"] < friction["kinetic"]:
        raise InputError(
            "campaign.yaml: friction.static is below friction.kinetic",
            got=f"static {friction['static']}, kinetic {friction['kinetic']}",
            allowed="static >= kinetic",
            remedy="give the same number twice if there is no peak",
        )
    if friction["stiction_velocity_m_per_s"] >= friction["friction_velocity_m_per_s"]:
        raise InputError(
            "campaign.yaml: friction.stiction_velocity_m_per_s is not below friction_velocity_m_per_s",
            got=f"{friction['stiction_velocity_m_per_s']} and {friction['friction_velocity_m_per_s']} m/s",
            allowed="stiction velocity < friction velocity",
        )


def _scene(document: dict[str, Any], load: Load) -> TowingScene:
    towed, tether, friction = document["object"], document["tether"], document["friction"]
    holes = tuple(np.array(hole, dtype=float) for hole in towed.get("footprint_holes_m", ()))
    return TowingScene(
        patch=Patch(outline=np.array(towed["footprint_m"], dtype=float), holes=holes),
        body_mass=towed["mass_kg"],
        load=load,
        anchor=np.array(towed["tether_anchor_m"], dtype=float),
        hinge=np.array(document["rover"]["tether_hinge_m"], dtype=float),
        tether=Tether(
            rest_length=tether["rest_length_m"],
            stiffness=tether["stiffness_N_per_m"],
            damping=tether.get("damping_Ns_per_m", 0.0),
        ),
        friction=FrictionSpecification(
            static=friction["static"],
            kinetic=friction["kinetic"],
            stiction_velocity=friction["stiction_velocity_m_per_s"],
            friction_velocity=friction["friction_velocity_m_per_s"],
            law=friction.get("law", "makkar"),
        ),
    )


def _run(folder: Path, name: str, entry: dict[str, Any], document: dict[str, Any]) -> Run:
    clicks = {}
    for body, pixels in entry.get("first_frame_clicks_px", {}).items():
        key = f"runs.{name}.first_frame_clicks_px.{body}"
        corners = document[body]["top_corners_m"]
        if len(pixels) != len(corners):
            raise InputError(
                f"campaign.yaml: {key} has another number of corners than {body}.top_corners_m",
                got=len(pixels),
                allowed=str(len(corners)),
                remedy="click every corner once, in the same order",
            )
        clicks[body] = locked(pixels, key, (len(corners), 2))
        _check_clicks(clicks[body], document["camera"]["resolution_px"], key)
    video = _file(folder, entry["video"], f"runs.{name}.video")
    return Run(name, video, clicks, damaged_video=entry.get("damaged_video", False))


def _check_clicks(clicks: Array, resolution_px: list[int], key: str) -> None:
    """Clicks far outside the image, or on one spot, were not made on the first frame."""
    size = np.array(resolution_px)
    if (clicks < -0.5 * size).any() or (clicks > 1.5 * size).any():
        raise InputError(
            f"campaign.yaml: {key} is outside the image",
            got=clicks.tolist(),
            allowed=f"pixels of a {size[0]} × {size[1]} image",
            remedy="click the corners in the first frame",
        )
    if abs(polygon_area(clicks)) < 16:
        raise InputError(
            f"campaign.yaml: {key} encloses no area", got=clicks.tolist(), allowed="the corners of the top"
        )

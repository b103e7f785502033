"""A campaign with only a camera and a floor: all that ``towval calibrate`` needs, without bodies and runs."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from towval.io.campaign import (
    Campaign,
    board_of,
    campaign_schema,
    floor_pictures_of,
    floor_reference_of,
    load_campaign,
    pictures_of,
    whole,
)
from towval.io.reading import is_plain_file
from towval.io.schema import check
from towval.io.yaml_text import read_yaml
from towval.model import Board, Body, FloorReference
from towval.model.errors import InputError


@dataclass(frozen=True)
class CameraSetup:
    """Pictures and floor reference of a camera, as a :class:`Campaign` has them; without bodies.

    Without a ``board`` there are surveyed marks alone. ``document`` is campaign.yaml as read.
    """

    document: Mapping[str, Any]
    resolution_px: tuple[int, int]
    calibration_images: tuple[Path, ...]
    board: Board | None
    floor_images: tuple[Path, ...]
    floor_reference: FloorReference
    bodies: tuple[Body, ...] = ()


def load_camera(folder: Path) -> Campaign | CameraSetup:
    """The campaign in a folder, or its camera alone where campaign.yaml has no section but camera and floor.

    Raises `InputError` for a key that is unknown, missing or out of range, for pictures without a board or the reverse,
    and where there are neither these nor surveyed marks.
    """
    file = folder / "campaign.yaml"
    document: Any = read_yaml(file) if is_plain_file(file) else None
    if isinstance(document, Mapping) and document and set(document) <= {"camera", "floor"}:
        return _camera_setup(folder, document)
    return load_campaign(folder)


def _camera_setup(folder: Path, document: Mapping[str, Any]) -> CameraSetup:
    schema = campaign_schema()
    schema["required"] = ["camera", "floor"]
    schema["properties"]["camera"]["required"] = ["resolution_px"]
    check(document, schema, "campaign.yaml")
    camera, floor = document["camera"], document["floor"]
    boards = [key for key in ("calibration_images", "board") if key in camera]
    if len(boards) == 1 or not (boards or floor.get("surveyed_marks")):
        raise InputError(
            "campaign.yaml: nothing to calibrate the camera from",
            got=f"camera.{boards[0]} alone" if boards else "neither a board nor surveyed marks",
            allowed="camera.calibration_images with camera.board, or floor.surveyed_marks",
        )
    return CameraSetup(
        document=document,
        resolution_px=whole(camera["resolution_px"]),
        calibration_images=pictures_of(camera["calibration_images"], folder, "camera.calibration_images")
        if boards
        else (),
        board=board_of(camera["board"]) if boards else None,
        floor_images=floor_pictures_of(floor, folder) if boards else (),
        floor_reference=floor_reference_of(floor),
    )

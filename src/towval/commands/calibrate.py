"""Command calibrate: board pictures → camera.mcap."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from towval.calibration.calibrate import CalibrateSettings, calibrate
from towval.calibration.marks_alone import calibrate_marks
from towval.commands.console import Outcome
from towval.commands.settings import settings_from
from towval.io.campaign import load_campaign
from towval.io.campaign_camera import CameraSetup, camera_setup, is_camera_alone
from towval.io.images import GrayPictures
from towval.io.provenance import provenance, read_sections
from towval.io.reading import is_plain_file
from towval.io.records import write_calibration
from towval.io.yaml_text import read_yaml
from towval.model import Calibration
from towval.selection.lens import with_lens_choice


def run(campaign: Path, output: Path, keys: Mapping[str, Any] | None = None) -> Outcome:
    """Calibrate the camera and the floor of a campaign; its campaign.yaml may have these two sections only."""
    settings = settings_from(CalibrateSettings, keys, "calibrate")
    document: Any = read_yaml(campaign / "campaign.yaml") if is_plain_file(campaign / "campaign.yaml") else None
    if is_camera_alone(document):
        given, heights_m = camera_setup(campaign, document), []
    else:
        full = load_campaign(campaign)
        document, heights_m = full.document, [body.tracked_plane_height_m for body in full.bodies]
        given = CameraSetup(
            full.resolution_px, full.calibration_images, full.board, full.floor_images, full.floor_reference
        )
    calibration = _calibrated(given, settings, heights_m)
    pictures = (*given.calibration_images, *given.floor_images)
    inputs = {str(path.relative_to(campaign) if path.is_relative_to(campaign) else path): path for path in pictures}
    sections = read_sections("calibrate", document)
    write_calibration(output, calibration, provenance("calibrate", settings, inputs, document=sections, constants=True))
    numbers = {"lens_model": calibration.camera.lens_model, **calibration.quality}
    return Outcome("calibrate", (output,), _how_good(calibration), numbers, calibration.findings)


def _how_good(calibration: Calibration) -> str:
    used = sum(not view.dropped for view in calibration.views)
    views = f"{used} of {len(calibration.views)} views, " if calibration.views else ""
    stated = ((name.partition(" ")[2], std) for name, std in calibration.quality.items() if "position_std" in name)
    known = ", ".join(f"±{std:.2g} mm {at}" for at, std in stated)
    return f"{views}lens {calibration.camera.lens_model}" + (f"; positions {known} above the floor" if known else "")


def _calibrated(given: CameraSetup, settings: CalibrateSettings, heights_m: Sequence[float]) -> Calibration:
    if given.board is None:
        return calibrate_marks(given.resolution_px, given.floor_reference, settings.lens_models, heights_m=heights_m)
    calibration = calibrate(
        GrayPictures(given.calibration_images, given.resolution_px),
        GrayPictures(given.floor_images, given.resolution_px),
        given.board,
        given.floor_reference,
        settings,
        heights_m=heights_m,
    )
    height_m = heights_m[-1] if heights_m else 0.0
    return with_lens_choice(calibration, given.board, given.floor_reference, settings, height_m)

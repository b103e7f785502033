"""Command calibrate: board pictures → camera.mcap."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from towval.calibration.calibrate import CalibrateSettings, calibrate
from towval.calibration.marks_alone import calibrate_marks
from towval.commands.console import Outcome
from towval.commands.settings import settings_from
from towval.io.campaign import Campaign, names_in
from towval.io.campaign_camera import CameraSetup, load_camera
from towval.io.images import GrayPictures, turned_by_tag
from towval.io.provenance import provenance
from towval.io.records import write_calibration
from towval.model import Calibration
from towval.model.findings import finding
from towval.report.wording import decimal
from towval.selection.lens import with_lens_choice


def run(campaign: Path, output: Path, keys: Mapping[str, Any] | None = None) -> Outcome:
    """Calibrate the camera and the floor of a campaign; its campaign.yaml may have these two sections only."""
    settings = settings_from(CalibrateSettings, keys, "calibrate")
    given = load_camera(campaign)
    calibration = calibrated(given, settings)
    if given.board is not None:
        height_m = given.bodies[-1].tracked_plane_height_m if given.bodies else 0.0
        calibration = with_lens_choice(calibration, given.board, given.floor_reference, settings, height_m)
    inputs = names_in(campaign, (*given.calibration_images, *given.floor_images))
    made_of = provenance("calibrate", settings, inputs, document=given.document, constants=True)
    write_calibration(output, calibration, made_of)
    numbers = {"lens_model": calibration.camera.lens_model, **calibration.quality}
    return Outcome("calibrate", (output,), _how_good(calibration), numbers, calibration.findings)


def _how_good(calibration: Calibration) -> str:
    used = sum(not view.dropped for view in calibration.views)
    views = f"{used} of {len(calibration.views)} views, " if calibration.views else ""
    stated = ((name.partition(" ")[2], std) for name, std in calibration.quality.items() if "position_std" in name)
    known = ", ".join(f"±{decimal(std)} mm {at}" for at, std in stated)
    return f"{views}lens {calibration.camera.lens_model}" + (f"; positions {known} above the floor" if known else "")


def calibrated(given: Campaign | CameraSetup, settings: CalibrateSettings) -> Calibration:
    """Camera and floor from the pictures of a campaign, or from surveyed marks where there is no board."""
    heights_m = [body.tracked_plane_height_m for body in given.bodies]
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
    pictures = dict.fromkeys((*given.calibration_images, *given.floor_images))
    turned = [path.name for path in pictures if turned_by_tag(path)]
    if not turned:
        return calibration
    told = finding("pictures-tagged", count=len(turned), pictures=len(pictures), first=turned[0])
    return replace(calibration, findings=(*calibration.findings, told))

"""Command calibrate: board pictures → camera.mcap."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from towval.calibration.calibrate import CalibrateSettings, calibrate
from towval.commands.console import print_findings
from towval.commands.settings import settings_from
from towval.io.campaign import load_campaign
from towval.io.images import GrayPictures
from towval.io.provenance import provenance, read_sections
from towval.io.records import write_calibration
from towval.selection.lens import with_lens_choice


def run(campaign: Path, output: Path, keys: Mapping[str, Any] | None = None) -> None:
    """Calibrate the camera and the floor of a campaign."""
    settings = settings_from(CalibrateSettings, keys, "calibrate")
    given = load_campaign(campaign)
    calibration = calibrate(
        GrayPictures(given.calibration_images, given.resolution_px),
        GrayPictures(given.floor_images, given.resolution_px),
        given.board,
        given.floor_reference,
        settings,
        heights_m=[body.tracked_plane_height_m for body in given.bodies],
    )
    calibration = with_lens_choice(
        calibration, given.board, given.floor_reference, settings, given.object.tracked_plane_height_m
    )
    print_findings(calibration.findings, "calibrate")
    inputs = given.files((*given.calibration_images, *given.floor_images))
    sections = read_sections("calibrate", given.document)
    write_calibration(output, calibration, provenance("calibrate", settings, inputs, document=sections, constants=True))

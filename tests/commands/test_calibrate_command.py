"""What the command calibrate adds to the stage: findings about the files of the pictures."""

from types import SimpleNamespace

import numpy as np
from PIL import Image

import towval.commands.calibrate
from studies.worlds.scenes import ceiling
from towval.calibration.calibrate import CalibrateSettings
from towval.commands.calibrate import calibrated
from towval.model import Calibration


def test_pictures_that_viewers_turn_are_named(tmp_path, monkeypatch):
    """Nothing was said, while the tag of a video is applied."""
    camera, floor = ceiling((160, 120), focal_px=130.0)
    calibration = Calibration(camera, floor, np.zeros((18, 18)), 0.1, ())
    monkeypatch.setattr(towval.commands.calibrate, "calibrate", lambda *_, **__: calibration)
    for name, tag in (("board.jpg", 1), ("floor.jpg", 3), ("floor_2.jpg", 8)):
        exif = Image.Exif()
        exif[0x0112] = tag
        Image.new("L", (160, 120)).save(tmp_path / name, exif=exif)

    def codes(*floors):
        given = SimpleNamespace(
            bodies=(), board=object(), resolution_px=(160, 120), floor_reference=None,
            calibration_images=(tmp_path / "board.jpg",), floor_images=tuple(tmp_path / name for name in floors),
        )  # fmt: skip
        return [(found.code, found.text[:31]) for found in calibrated(given, CalibrateSettings()).findings]

    assert codes() == []
    assert codes("floor.jpg", "floor_2.jpg") == [("pictures-tagged", "2 of 3 pictures (floor.jpg the ")]

"""Laboratories that MuJoCo renders: its pictures show what the truth says."""

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from studies.tables import engine_labs
from studies.worlds.engine_lab import INNER_CORNERS, SQUARE_M, THICKNESS_M, EngineLab, Look, can_render
from studies.worlds.engine_textures import FLOORS, TOPS, board_texture, floor_texture, top_texture

needs_engine = pytest.mark.skipif(
    not can_render(), reason="MuJoCo cannot render here: install the extra bench, on a system with EGL"
)
LOOK = Look("tiles", ("parts", "parts"), 1.0, 850.0, -0.08, 2, 3.1, 0.2, 1.0)


def test_each_texture_differs_from_place_to_place_and_repeats_with_its_seed():
    for kind in FLOORS:
        picture = floor_texture(np.random.default_rng(1), kind)
        assert picture.std() > 3
        assert np.array_equal(picture, floor_texture(np.random.default_rng(1), kind))
    for kind in TOPS:
        assert top_texture(np.random.default_rng(2), kind).std() > 3


def test_the_board_has_its_corners_where_its_size_says():
    picture, sheet = board_texture((9, 6), 0.04)
    assert sheet == pytest.approx([0.04 * 11.4, 0.04 * 8.4])
    found, corners = cv2.findChessboardCornersSB(picture[::4, ::4, 0].copy(), (9, 6))
    assert found
    steps = np.diff(corners.reshape(6, 9, 2), axis=1)
    assert np.hypot(*np.moveaxis(steps, -1, 0)) * 4 * sheet[0] / picture.shape[1] == pytest.approx(0.04, abs=4e-4)


@needs_engine
def test_a_board_is_seen_where_the_camera_projects_it():
    """OpenCV finds the corners in the picture; the division model that places them is that of the picture's rays."""
    lab = EngineLab(np.random.default_rng(3), LOOK, np.array([0.2, -0.1]), 0.4)
    turned = Rotation.from_euler("z", 0.3)
    at = np.array([0.9, 0.3, THICKNESS_M])
    lab.put("board", at, turned)
    grey = cv2.cvtColor(lab.picture(), cv2.COLOR_RGB2GRAY)
    found, corners = cv2.findChessboardCornersSB(grey, INNER_CORNERS, flags=cv2.CALIB_CB_ACCURACY)
    assert found
    grid = np.stack(np.meshgrid(*(np.arange(n) - (n - 1) / 2 for n in INNER_CORNERS)), axis=-1).reshape(-1, 2)
    places = turned.apply(np.column_stack([grid * SQUARE_M, np.zeros(len(grid))])) + at
    expected = lab.project(places)
    apart = corners.reshape(-1, 1, 2) - expected
    off = apart[np.arange(len(apart)), np.linalg.norm(apart, axis=2).argmin(axis=1)]
    # A board of 13 px squares is found to a tenth of a pixel, and all of it to some hundredths.
    assert np.abs(off.mean(axis=0)).max() < 0.06
    assert np.sqrt(np.mean(off**2)) < 0.1


def test_a_simulation_that_ends_early_is_held_against_the_truth_of_its_times(monkeypatch):
    truth = pd.DataFrame({"t_s": np.arange(50) / 25, "object_x_m": np.arange(50) / 100, "object_y_m": 0.0})
    seen = np.arange(20) / 25
    pose = np.column_stack([seen / 4, np.full(20, 3e-3), np.zeros(20)])
    monkeypatch.setattr(engine_labs, "read_simulated", lambda _: SimpleNamespace(time_s=seen, pose=pose))
    result = SimpleNamespace(verdict=SimpleNamespace(value="agrees"), warnings="", error_upper_m=4e-3)
    row = engine_labs._simulated(result, Path("simulate.mcap"), truth)
    assert row == {"verdict": "agrees", "warnings": "", "off_mm": pytest.approx(3.0), "bound_mm": 4.0}

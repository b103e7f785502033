"""Surveyed marks alone: on a real arena through the command, and against known cameras."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml
from scipy.optimize import least_squares

from studies.worlds.boards import calibration_set, ceiling_camera
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.marks_alone import calibrate_marks
from towval.commands import calibrate as command
from towval.io.records import read_calibration
from towval.model import Camera, Floor, FloorReference
from towval.model.errors import InputError
from towval.model.geometry import lifted
from towval.optics.plane_uncertainty import position_covariance, shared_parameters
from towval.optics.projection import to_plane


@pytest.mark.shared
def test_sixty_nine_surveyed_marks_through_the_command(shared_dir, tmp_path):
    table = np.genfromtxt(shared_dir / "real" / "surveyed_floor" / "marks.csv", delimiter=",", names=True)
    marks = [{"at_px": [float(r["u_px"]), float(r["v_px"])], "at_m": [float(r["x_m"]), float(r["y_m"])]} for r in table]
    floor = {"surveyed_marks": marks, "surveyed_mark_std_px": 0.3}
    (tmp_path / "campaign.yaml").write_text(yaml.safe_dump({"camera": {"resolution_px": [640, 480]}, "floor": floor}))
    command.run(tmp_path, tmp_path / "camera.mcap")
    calibration = read_calibration(tmp_path / "camera.mcap")
    assert calibration.camera.lens_model == "k1"
    assert calibration.quality["held_out_rms_mm"] < 0.50
    assert [finding.code for finding in calibration.findings] == ["marks-alone"]
    assert calibration.quality["focal_length_std_px"] > 0.1 * calibration.camera.matrix[0, 0]


def test_places_on_the_floor_are_right_and_the_focal_length_is_not_claimed():
    scene = calibration_set(9300)
    rng, camera, floor = np.random.default_rng(3), scene.camera, scene.floor
    # A lens that bends as much as a wide one: of a straight one marks tell no focal length at all.
    camera = replace(camera, distortion=np.array([-0.3, 0.05, 0, 0, 0, 0, 0, 0]))
    pixels = rng.uniform([50, 50], [1870, 1030], (40, 2))
    marks = to_plane(camera, floor, pixels, 0.0)
    seen = pixels + rng.normal(0, 0.2, pixels.shape)
    reference = FloorReference(marks_px=seen, marks_m=marks, mark_std_px=0.2)
    calibration = calibrate_marks(camera.resolution_px, reference, ("none", "k1", "k1 k2"), heights_m=(0.35,))
    probes = rng.uniform([200, 200], [1700, 900], (60, 2))
    error = to_plane(calibration.camera, calibration.floor, probes, 0.0) - to_plane(camera, floor, probes, 0.0)
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 1e-3
    stated = np.sqrt(np.trace(position_covariance(calibration, probes, 0.0), axis1=1, axis2=2))
    assert 0.3 < np.sqrt(np.mean(np.sum(error**2, axis=1)) / np.mean(stated**2)) < 3
    focal_off = abs(calibration.camera.matrix[0, 0] - camera.matrix[0, 0])
    assert focal_off < 3.5 * calibration.quality["focal_length_std_px"]
    raised, low = (calibration.quality[f"position_std_mm at {height} m"] for height in ("0.350", "0.000"))
    assert raised > low


def test_the_deviations_hold_in_the_corners_where_a_coefficient_too_few_is_selected():
    """A few marks predict as well without k2, in one of seven sets: errors were three times what was stated."""
    rng = np.random.default_rng(13)
    matrix, lens = np.array([[1400.0, 0, 955], [0, 1403, 548], [0, 0, 1]]), np.array([-0.12, 0.03, 0, 0, 0, 0, 0, 0])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(np.array([2.6, 0.1, 0.15]))[0], [0.1, -0.1, 2.7]
    camera, floor = Camera((1920, 1080), matrix, lens, "k1 k2"), Floor(pose)
    grid = [np.stack(np.meshgrid(x, y), -1).reshape(-1, 2) for x, y in (([0, 1919], [0, 1079]), (COLUMNS, ROWS))]
    corners, marks = (to_plane(camera, floor, pixels, 0.0) for pixels in grid)
    squares, models = [], []
    for _ in range(24):
        reference = FloorReference(marks_px=grid[1] + rng.normal(0, 0.7, grid[1].shape), marks_m=marks)
        found = calibrate_marks((1920, 1080), reference, ("k1", "k1 k2", "k1 k2 p1 p2"))
        off = to_plane(found.camera, found.floor, grid[0], 0.0) - corners
        stated = np.linalg.inv(position_covariance(found, grid[0], 0.0))
        squares.append(np.einsum("ni,nij,nj->n", off, stated, off) / 2)
        models.append(found.camera.lens_model)
    smaller = np.array(models) == "k1"
    assert smaller.any()
    assert np.mean(np.array(squares)[smaller]) < 4.0
    assert 0.7 < np.mean(squares) < 1.5


COLUMNS, ROWS = np.linspace(60, 1860, 6), np.linspace(60, 1020, 4)


def test_too_few_marks_are_refused():
    scene = calibration_set(9301)
    few = FloorReference(marks_px=scene.seen.reference.marks_px[:5], marks_m=scene.seen.reference.marks_m[:5])
    with pytest.raises(InputError, match="too few surveyed marks"):
        calibrate_marks(scene.camera.resolution_px, few, ("none", "k1"))


@pytest.mark.parametrize("with_boards", [True, False])
def test_left_handed_marks_are_refused_by_name(with_boards):
    scene = calibration_set(9302)
    reference = scene.seen.reference
    swapped = replace(reference, marks_m=reference.marks_m[:, ::-1].copy())
    seen, quick = replace(scene.seen, reference=swapped), CalibrateSettings(lens_models=("k1",), folds=2)

    def calibrated():
        if with_boards:
            return calibrate_observations(seen, quick, {})
        return calibrate_marks(scene.camera.resolution_px, swapped, ("none",))

    with pytest.raises(InputError, match="left-handed"):
        calibrated()


@pytest.mark.parametrize(
    ("camera", "floor", "message"),
    [
        ({"calibration_images": "a*.png"}, {}, "calibration_images alone"),
        ({}, {"board_thickness_m": 0.003}, "neither a board nor surveyed marks"),
    ],
)
def test_a_camera_without_anything_to_calibrate_it_is_refused(tmp_path, camera, floor, message):
    document = {"camera": {"resolution_px": [640, 480], **camera}, "floor": floor}
    (tmp_path / "campaign.yaml").write_text(yaml.safe_dump(document))
    with pytest.raises(InputError, match=message):
        command.run(tmp_path, tmp_path / "camera.mcap")
    assert not (tmp_path / "camera.mcap").exists()


@pytest.mark.parametrize("seed", [602, 614])
def test_the_fit_does_not_stop_on_the_way_to_its_minimum(seed):
    """Marks tell the focal length so little that the way is long; SciPy comes from the truth."""
    rng = np.random.default_rng(seed)
    camera, floor = ceiling_camera(rng)
    camera = replace(camera, distortion=np.array([-0.2, 0.03, 0, 0, 0, 0, 0, 0]))
    pixels = rng.uniform([50, 50], [1870, 1030], (20, 2))
    marks = to_plane(camera, floor, pixels, 0.0)
    seen = pixels + rng.normal(0, 0.3, pixels.shape)
    calibration = calibrate_marks(
        camera.resolution_px, FloorReference(marks_px=seen, marks_m=marks, mark_std_px=0.3), ("k1 k2",)
    )

    def misfit(values: np.ndarray) -> np.ndarray:
        fx, fy, cx, cy, k1, k2 = values[:6]
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
        lens = np.array([k1, k2, 0, 0])
        return (cv2.projectPoints(lifted(marks, 0.0), values[6:9], values[9:], K, lens)[0][:, 0] - seen).ravel() / 0.3

    truth = shared_parameters(camera, floor)[[0, 1, 2, 3, 4, 5, *range(12, 18)]]
    least = 2 * least_squares(misfit, truth, x_scale="jac", max_nfev=600).cost
    found = len(seen) * 2 * (calibration.quality["marks_rms_px"] / 0.3) ** 2
    assert found == pytest.approx(least, abs=0.01)

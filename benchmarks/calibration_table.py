"""The calibration rows of the must-reach table, on synthetic sets that tuned nothing.

Run ``python benchmarks/calibration_table.py``.

Each set is a made-up ceiling camera (focal length, lens, height and tilt random) and a board of 9 × 6 corners, 40 mm
squares, held at 0.8 to 1.8 m; see ``towval/synthetic/boards.py``. Errors are root mean squares over the whole picture.
"""

from __future__ import annotations

import argparse

import numpy as np

from towval.calibrate import CalibrateSettings, calibrate_sightings
from towval.geometry import rigid_fit, transform
from towval.synthetic.boards import CornerScene, calibration_set
from towval.types import Array, Calibration
from towval.vision.camera import to_plane
from towval.vision.uncertainty import pixel_grid, uncertainty_map

HEIGHTS_M = (0.0, 0.35)
DEGENERATE = {
    "tilt 0°": {"tilt_deg": (0.0, 0.0)},
    "tilt 2°": {"tilt_deg": (2.0, 2.0)},
    "tilt 4°": {"tilt_deg": (4.0, 4.0)},
    "tilt 0° to 4°": {"tilt_deg": (0.0, 4.0)},
    "boards in the middle 30 %": {"share": 0.3},
    "3 views": {"views": 3},
}
GOOD = {"12 views": {}, "10 views": {"views": 10}, "20 views, 0.3 px": {"views": 20, "noise_px": 0.3}}


def position_errors_m(calibration: Calibration, scene: CornerScene, height_m: float) -> tuple[float, float]:
    """RMS distance between estimated and true positions on a plane, over the picture [m].

    The second number is without the shift and turn of the floor frame itself, which one small board defines.
    """
    pixels = pixel_grid(scene.camera.resolution_px, 24).reshape(-1, 2)
    estimated = to_plane(calibration.camera, calibration.floor, pixels, height_m)
    true = to_plane(scene.camera, scene.floor, pixels, height_m)
    aligned = transform(rigid_fit(estimated, true), estimated)
    return rms(estimated - true), rms(aligned - true)


def rms(shift: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(shift**2, axis=-1))))


def accuracy(seeds: range, floor: str) -> None:
    errors, predicted = np.zeros((len(seeds), 2, 2)), np.zeros((len(seeds), 2))
    for i, seed in enumerate(seeds):
        scene = calibration_set(seed, floor=floor)
        calibration = calibrate_sightings(scene.seen, CalibrateSettings(), {})
        for j, height in enumerate(HEIGHTS_M):
            errors[i, j] = position_errors_m(calibration, scene, height)
            predicted[i, j] = uncertainty_map(calibration, height, columns=24).rms_m
    median = 1e3 * np.median(errors, axis=0)
    ratio = np.sqrt(np.mean(predicted**2, axis=0) / np.mean(errors[:, :, 0] ** 2, axis=0))
    print(f"  floor from {'nine marks' if floor == 'marks' else 'seven boards, the frame from the first of them'}")
    for j, plane in enumerate(("floor", "plane at 0.35 m")):
        print(
            f"    {plane:16s}{median[j, 0]:.2f} mm RMS, {median[j, 1]:.2f} mm but for the frame's shift and turn; "
            f"predicted / actual {ratio[j]:.2f}",
            flush=True,
        )


def flagged(seed: int, keys: dict[str, object]) -> list[str]:
    """Codes of the warnings and refusals of one set."""
    floor = "marks" if seed % 2 else "boards"
    scene = calibration_set(seed, floor=floor, **keys)
    calibration = calibrate_sightings(scene.seen, CalibrateSettings(), {})
    return [finding.code for finding in calibration.findings if finding.severity != "note"]


def flags(seeds: range, sets: dict[str, dict[str, object]]) -> None:
    for name, keys in sets.items():
        codes = [flagged(seed, keys) for seed in seeds]
        count = sum(bool(c) for c in codes)
        print(
            f"  {name:28s} {count:2d} of {len(codes)} flagged  {sorted({c for each in codes for c in each})}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first-seed", type=int, default=5000)
    parser.add_argument("--sets", type=int, default=12)
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.sets)
    print(f"12 views tilted by 20° to 40°, corner noise 0.15 px, medians, seeds {seeds.start} to {seeds.stop - 1}")
    for floor in ("marks", "boards"):
        accuracy(seeds, floor)
    print("degenerate sets")
    flags(seeds, DEGENERATE)
    print("good sets")
    flags(seeds, GOOD)


if __name__ == "__main__":
    main()

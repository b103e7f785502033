"""The calibration rows of the must-reach table, on synthetic sets.

    python -m studies.tables.calibration_table [--seeds 10] [--first-seed 5000]

Each set has a random ceiling camera (focal length, lens, height and tilt) and a board of 9 × 6 corners, 40 mm squares,
held at 0.8 to 1.8 m; see ``studies.worlds.boards``. Errors are root mean squares over the whole picture.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from tqdm import tqdm

from studies.worlds.boards import CornerScene, calibration_set
from towval.calibration.blocks import Estimate
from towval.calibration.bundle_adjustment import adjust, marginal_covariance
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.lens import active_parameters
from towval.calibration.observations import placed
from towval.commands.console import errors_reported
from towval.model import Array, Calibration
from towval.model.geometry import rigid_fit, transform
from towval.optics.plane_uncertainty import pixel_grid, shared_parameters, uncertainty_map
from towval.optics.projection import to_plane

HEIGHTS_M = (0.0, 0.35)
NOISE_PX = 0.15
BOOTSTRAPS = 2000
DEGENERATE: dict[str, dict[str, Any]] = {
    "tilt 0°": {"tilt_deg": (0.0, 0.0)},
    "tilt 2°": {"tilt_deg": (2.0, 2.0)},
    "tilt 4°": {"tilt_deg": (4.0, 4.0)},
    "tilt 0° to 4°": {"tilt_deg": (0.0, 4.0)},
    "boards in the middle 30 %": {"share": 0.3},
    "3 views": {"views": 3},
}
GOOD: dict[str, dict[str, Any]] = {
    "12 views": {},
    "10 views": {"views": 10},
    "20 views, 0.3 px": {"views": 20, "noise_px": 0.3},
}


FLOORS = {
    "marks": "floor from nine surveyed marks",
    "boards": "floor from seven boards, the frame from the first of them",
    "both": "floor from seven boards and four marks in the corners",
}


def bound_m(scene: CornerScene, noise_px: float) -> list[float]:
    """Cramér-Rao bound of the RMS position error on each plane [m].

    The inverse of the Fisher information of all corners at the true camera, floor and places: no unbiased fit of this
    lens model to these pictures can do better.
    """
    observed, shared = scene.seen, shared_parameters(scene.camera, scene.floor)
    truth = placed(observed, Estimate(shared, ()))
    # The places are those that fit best under the true camera; the camera and the floor are put back to the truth.
    truth = adjust(observed.blocks, replace(truth, shared=shared), np.zeros(0, dtype=np.intp))
    active = active_parameters(scene.camera.lens_model, with_floor=True)
    covariance, _ = marginal_covariance(observed.blocks, replace(truth, noise_px=noise_px), active)
    calibration = Calibration(scene.camera, scene.floor, covariance, noise_px)
    return [uncertainty_map(calibration, height, columns=24).rms_m for height in HEIGHTS_M]


def position_errors_m(calibration: Calibration, scene: CornerScene, height_m: float) -> tuple[float, float]:
    """RMS distance between estimated and true positions on a plane, over the picture [m].

    The second number is without the shift and turn of the floor frame itself, which one small board defines.
    """
    pixels = pixel_grid(scene.camera.resolution_px, 24).reshape(-1, 2)
    estimated = to_plane(calibration.camera, calibration.floor, pixels, height_m)
    true = to_plane(scene.camera, scene.floor, pixels, height_m)
    aligned = transform(rigid_fit(estimated, true), estimated)
    return rms(estimated - true), rms(aligned - true)


def progress(seeds: range, name: str) -> Iterable[int]:
    """Seeds with a progress bar on stderr."""
    return tqdm(seeds, desc=name, unit="set", leave=False, file=sys.stderr)


def rms(shift: Array) -> float:
    """Root mean square length of shifts (..., 2)."""
    return float(np.sqrt(np.mean(np.sum(shift**2, axis=-1))))


@dataclass(frozen=True)
class Accuracy:
    """Of n random sets with one kind of floor reference, on the planes of :data:`HEIGHTS_M`.

    RMS position errors over the picture [mm], all (n, 2): ``errors_mm``, ``aligned_mm`` without the frame's shift and
    turn, ``predicted_mm`` as stated, and ``bound_mm``, the Cramér-Rao bound. That bounds a root mean square, so it is
    compared with the root mean square over the sets, not with their median, which may lie below it.
    """

    errors_mm: Array
    aligned_mm: Array
    predicted_mm: Array
    bound_mm: Array

    @property
    def median_mm(self) -> Array:
        """Medians over the sets (3, 2): of the error, of that without the frame's shift and turn, of the bound."""
        return np.median([self.errors_mm, self.aligned_mm, self.bound_mm], axis=1)

    @property
    def rms_mm(self) -> Array:
        """Root mean square error over the sets (2,)."""
        return over_sets(self.errors_mm)

    @property
    def aligned_rms_mm(self) -> Array:
        """The same without the frame's shift and turn (2,)."""
        return over_sets(self.aligned_mm)

    @property
    def bound_rms_mm(self) -> Array:
        """Root mean square of the bounds over the sets (2,)."""
        return over_sets(self.bound_mm)

    @property
    def over_bound(self) -> Array:
        """RMS error over RMS bound, and between what 95 % of bootstrapped sets lie (3, 2)."""
        return _ratio(self.errors_mm, self.bound_mm)

    @property
    def predicted_over_actual(self) -> Array:
        """RMS stated over RMS actual error, and between what 95 % of bootstrapped sets lie (3, 2)."""
        return _ratio(self.predicted_mm, self.errors_mm)


def over_sets(values: Array) -> Array:
    """Root mean square over sets (..., n, 2)."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=-2)))


def _ratio(above: Array, below: Array) -> Array:
    drawn = np.random.default_rng(0).integers(len(above), size=(BOOTSTRAPS, len(above)))
    low, high = np.percentile(over_sets(above[drawn]) / over_sets(below[drawn]), [2.5, 97.5], axis=0)
    return np.array([over_sets(above) / over_sets(below), low, high])


def accuracy(seeds: Iterable[int], floor: str) -> Accuracy:
    """Accuracy on floor and plane over random sets, with one kind of floor reference."""
    errors, predicted, bound = [], [], []
    for seed in seeds:
        scene = calibration_set(seed, floor=floor)
        calibration = calibrate_observations(scene.seen, CalibrateSettings(), {})
        errors.append([position_errors_m(calibration, scene, height) for height in HEIGHTS_M])
        predicted.append([uncertainty_map(calibration, height, columns=24).rms_m for height in HEIGHTS_M])
        bound.append(bound_m(scene, NOISE_PX))
    found = 1e3 * np.array(errors)
    return Accuracy(found[:, :, 0], found[:, :, 1], 1e3 * np.array(predicted), 1e3 * np.array(bound))


def print_accuracy(found: Accuracy, floor: str) -> None:
    """Print the accuracy with one kind of floor reference."""
    print(f"  {FLOORS[floor]}")
    for j, (plane, required) in enumerate((("floor", 0.6), ("plane at 0.35 m", 0.8))):
        median = found.median_mm[0, j]
        verdict = "reached" if median <= required else "MISSED"
        (over, low, high), (stated, least, most) = found.over_bound[:, j], found.predicted_over_actual[:, j]
        print(
            f"    {plane:16s}median {median:.2f} mm (required {required}: {verdict}); RMS over the sets "
            f"{found.rms_mm[j]:.2f} mm, {over:.2f} ({low:.2f} to {high:.2f}) of the Cramér-Rao bound "
            f"{found.bound_rms_mm[j]:.2f}, {found.aligned_rms_mm[j]:.2f} mm but for the frame's shift and turn; "
            f"predicted / actual {stated:.2f} ({least:.2f} to {most:.2f})",
            flush=True,
        )


def flagged(seed: int, keys: dict[str, Any]) -> list[str]:
    """Codes of the warnings and refusals of one set."""
    floor = "marks" if seed % 2 else "boards"
    scene = calibration_set(seed, floor=floor, **keys)
    calibration = calibrate_observations(scene.seen, CalibrateSettings(), {})
    return [finding.code for finding in calibration.findings if finding.severity != "note"]


def flags(seeds: range, sets: dict[str, dict[str, Any]]) -> None:
    """Print how many sets of each kind carry a warning or are refused."""
    for name, keys in sets.items():
        codes = [flagged(seed, keys) for seed in progress(seeds, name)]
        count = sum(bool(c) for c in codes)
        print(
            f"  {name:28s} {count:2d} of {len(codes)} flagged  {sorted({c for each in codes for c in each})}",
            flush=True,
        )


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first-seed", type=int, default=5000)
    parser.add_argument("--seeds", type=int, default=10)
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    print(f"12 views tilted by 20° to 40°, corner noise 0.15 px, seeds {seeds.start} to {seeds.stop - 1}")
    for floor in FLOORS:
        print_accuracy(accuracy(progress(seeds, floor), floor), floor)
    print("degenerate sets")
    flags(seeds, DEGENERATE)
    print("good sets")
    flags(seeds, GOOD)


if __name__ == "__main__":
    main()

"""Alignment on picture pairs of known displacement: bias, scatter and stated deviation against the Cramér-Rao bound.

    python -m studies.real.displaced_windows ../shared/real/dic

A window is what the tracker's template reads: N × N px of sample points, one a pixel. The body is larger by the margin
that the template keeps from its outline. The camera is one straight above, a pixel a millimetre. Tracking starts at the
true shift rounded to whole pixels: what is measured is the rest, 0.4, -0.2 and 0 px of the rigid pairs.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from studies.worlds.scenes import rectangle
from towval.commands.console import errors_reported
from towval.model import Array, Body, Camera, Floor
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.plane_tracker import PlaneTracker
from towval.tracking.template import CONSTANTS as TEMPLATE

Luma = NDArray[np.uint8]

RIGID = {"04": 0.4, "08": 0.8, "10": 1.0, "25": 25.0, "50": 50.0}
"""Pictures and their shift to the right and up [px]."""

STAR_NOISE = 2.0
"""Deviation of each picture of the star pair [grey levels]."""


@dataclass(frozen=True)
class WindowErrors:
    """Errors (n, 2) of the shifts measured in ``windows`` windows [px], and their stated deviations (n, 2) [px]."""

    windows: int
    errors: Array
    stated: Array

    @property
    def bias(self) -> float:
        """Larger mean error of both coordinates [px]."""
        return float(np.abs(self.errors.mean(axis=0)).max())

    @property
    def scatter(self) -> float:
        """Deviation of the error down the picture, the direction in which the star moves [px]."""
        return float(self.errors[:, 1].std())

    @property
    def stated_std(self) -> float:
        """Root mean square of the stated deviations in that direction [px]."""
        return float(np.sqrt(np.mean(self.stated[:, 1] ** 2)))


def window_errors(reference: Luma, other: Luma, centres_px: Array, shifts_px: Array, size: int) -> WindowErrors:
    """Track windows of ``size`` px at ``centres_px`` (n, 2) from one picture to another shifted by ``shifts_px``."""
    height, width = reference.shape
    matrix = np.array([[1000.0, 0, width / 2], [0, 1000.0, height / 2], [0, 0, 1]])
    camera = Camera((width, height), matrix, np.zeros(8), "none")
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = 1.0
    side = (size + 2 * TEMPLATE.margin_px) / 1000
    target = PlanarTarget(Body("window", 0.0, rectangle(side, side)), camera, Floor(T))
    errors, stated = [], []
    for centre, shift in zip(centres_px, shifts_px, strict=True):
        pose = np.array([*target.floor_xy(centre[None])[0], 0.0])
        tracker = PlaneTracker(target, reference, pose, samples=(size + 6) ** 2)
        found = tracker.measure(other, pose + np.array([*np.round(shift) * [1, -1] / 1000, 0.0]))
        if found is not None:
            errors.append((found.pose[:2] - pose[:2]) * [1000, -1000] - shift)
            stated.append(1000 * np.sqrt(np.diag(found.covariance)[:2]))
    return WindowErrors(len(centres_px), np.array(errors), np.array(stated))


def star_errors(folder: Path, size: int) -> tuple[WindowErrors, float]:
    """Windows on crests and troughs of the star pair, and the root mean square of their Cramér-Rao bounds [px]."""
    reference, other = (_read(folder / f"star_{name}.png") for name in ("ref", "def"))
    windows = pd.read_csv(folder / "star_windows.csv").query("size == @size")
    centres = windows[["cx", "cy"]].to_numpy(dtype=np.float64)
    shifts = windows[["u_mean", "v_weighted"]].to_numpy(dtype=np.float64)
    slopes = np.gradient(reference.astype(np.float64), axis=0)
    half = size // 2
    bounds = [
        np.sqrt(2) * STAR_NOISE / np.linalg.norm(slopes[v - half : v + half + 1, u - half : u + half + 1])
        for u, v in centres.astype(int)
    ]
    return window_errors(reference, other, centres, shifts, size), float(np.sqrt(np.mean(np.square(bounds))))


def rigid_errors(folder: Path, name: str, size: int = 31) -> WindowErrors:
    """Windows side by side on a pair of the rigid set, by its name in :data:`RIGID`."""
    reference, other = _read(folder / "rigid_00.png"), _read(folder / f"rigid_{name}.png")
    # Far enough from the border to stay in the picture after a shift of 50 px.
    rows, columns = (np.arange(60, side - 59, size - 5) for side in reference.shape)
    centres = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(np.float64)
    return window_errors(reference, other, centres, np.tile([RIGID[name], -RIGID[name]], (len(centres), 1)), size)


def _read(path: Path) -> Luma:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


@errors_reported()
def main() -> None:
    """Print a row a pair and window size."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of the picture pairs")
    folder = parser.parse_args().folder
    print(f"{'pair':10}{'px':>4}{'windows':>9}{'bias px':>10}{'scatter px':>12}{'bound px':>10}{'stated px':>11}")
    for size in (21, 31, 51):
        found, bound = star_errors(folder, size)
        _print_row("star", size, found, f"{bound:.4f}")
    for name in RIGID:
        _print_row(f"rigid {name}", 31, rigid_errors(folder, name), "")


def _print_row(pair: str, size: int, found: WindowErrors, bound: str) -> None:
    count = f"{len(found.errors)}/{found.windows}"
    print(f"{pair:10}{size:4}{count:>9}{found.bias:10.4f}{found.scatter:12.4f}{bound:>10}{found.stated_std:11.4f}")


if __name__ == "__main__":
    main()

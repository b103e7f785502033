"""The scale of a calibration, checked against what is of known size in every picture: the outlines of the tops."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from towval.model import Array, Calibration, Finding
from towval.model.findings import finding
from towval.model.geometry import transform
from towval.optics.plane_uncertainty import position_sensitivity
from towval.tracking.outline import CONSTANTS as OUTLINE
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import STD_OF_MEDIAN
from towval.tracking.start import CONSTANTS as START


@dataclass(frozen=True)
class KnownLengthConstants:
    """Tuned constants of the check."""

    edge_std_px: float = 0.05  # [px] By which an edge in the picture may stand off the top's: 0.02 to 0.06 measured.
    doubtful: float = 2.5  # Deviations: 1 in 80 sound runs, and a board at 99.7 % with tops known to 1 mm.
    wrong: float = 0.004  # Of the size, beyond which wider deviations do not help.


CONSTANTS = KnownLengthConstants()

_LOOKS = 7
"""Looks at an outline by whose median a top is larger: half a second or so, of which three may be at something else."""


@dataclass(frozen=True)
class OutlineSizes:
    """Sizes of a top in some pictures over the stated one, less 1, and its pose (3,) in one of them.

    ``sides_m`` (2,): by how much length and width, each by itself, are usually found other than stated [m].
    """

    target: PlanarTarget
    pose: Array
    sizes: Sequence[float]
    sides_m: Array = field(default_factory=lambda: np.zeros(2))


def size_of_tops(calibration: Calibration, observed: Sequence[OutlineSizes]) -> tuple[float, float]:
    """Size of the tops in the pictures over the stated one, less 1, and its deviation; NaN where none shows edges."""
    seen = [each for each in observed if each.sizes]
    if not seen:
        return np.nan, np.nan
    information = np.array([1 / _variance(each) for each in seen])
    share = information / information.sum()
    size = float(share @ [np.median(each.sizes) for each in seen])
    by_camera = share @ np.array([_size_sensitivity(calibration, each) for each in seen])
    return size, float(np.sqrt(1 / information.sum() + by_camera @ calibration.covariance @ by_camera))


def as_lengths_show(calibration: Calibration, size: float, std: float) -> Calibration:
    """The calibration, its deviations enlarged until they explain the ``size`` of the tops (less 1), known to ``std``.

    SOURCE: Birge's ratio (Phys. Rev. 40, 207, 1932): where measurements disagree, and none can be blamed, the
    deviations of all are multiplied alike.
    """
    ratio = abs(size) / std if np.isfinite(size) else 0.0
    return replace(calibration, covariance=calibration.covariance * max(1.0, ratio) ** 2)


def length_findings(observed: Sequence[OutlineSizes], size: float, std: float) -> tuple[Finding, ...]:
    """A warning where the ``size`` of the tops in the pictures (less 1), known to ``std``, is not the stated one."""
    if not abs(size) >= CONSTANTS.doubtful * std:
        return ()
    code = "lengths_wrong" if abs(size) > CONSTANTS.wrong else "lengths_differ"
    names = " and ".join(each.target.body.name for each in observed if each.sizes)
    return (finding(code, names=names, percent=100 * size, std_percent=100 * std),)


def scale_findings(calibration: Calibration, observed: Sequence[OutlineSizes]) -> tuple[Finding, ...]:
    """A warning where one top is seen larger than stated and the others are not: its height or its size is wrong.

    What all tops share is the scale of the camera, which says nothing of a single height. The top that is named is the
    one that is more deviations off what is stated.
    """
    seen = [each for each in observed if each.sizes]
    if len(seen) < 2:
        return ()
    sizes = np.array([np.median(each.sizes) for each in seen])
    variances = np.array([_variance(each) for each in seen])
    worst = int(np.argmax(np.abs(sizes) / np.sqrt(variances)))
    # The mean of the others, by their variances, taken off.
    against = -np.delete(1 / variances, worst) / np.delete(1 / variances, worst).sum()
    against = np.insert(against, worst, 1.0)
    apart = float(against @ sizes)
    by_camera = against @ np.array([_size_sensitivity(calibration, each) for each in seen])
    std = float(np.sqrt(against**2 @ variances + by_camera @ calibration.covariance @ by_camera))
    if abs(apart) < max(CONSTANTS.doubtful * std, CONSTANTS.wrong):
        return ()
    height_m = abs(apart) * _distance_m(seen[worst].target, seen[worst].pose)
    name, percent = seen[worst].target.body.name, {"percent": 100 * apart, "std_percent": 100 * std}
    # Sound runs are as far apart as this 1 in 80 times, too often to leave them without a verdict for it.
    code = "tops_scale" if abs(apart) > START.scales_apart * std else "tops_differ"
    return (finding(code, name=name, height_mm=1e3 * height_m, **percent),)


def lift_findings(target: PlanarTarget, time_s: Array, pose: Array, size_m: Array) -> tuple[Finding, ...]:
    """A warning where a top grows or shrinks for a while as a whole, as one does that is lifted.

    ``size_m`` (m, 2): length and width of the outline over the stated ones [m] at the times (m,) [s] and poses (m, 3).
    """
    if len(size_m) < _LOOKS:
        return ()
    sizes = size_m / np.ptp(target.body.top_corners_m, axis=0)
    usual = np.median(sizes, axis=0)
    # Where an edge is not found, or is the top's for once, a side that is usually off comes out as stated.
    grown = sizes - np.clip(sizes, np.minimum(usual, 0.0), np.maximum(usual, 0.0))
    # An edge that is hidden, or another one that is taken for it, changes the length or the width. Both may hop between
    # edges in one half of a second, but hardly in the same pictures.
    same_way = grown[:, 0] * grown[:, 1] > 0
    both = np.where(same_way, np.sign(grown[:, 0]) * np.abs(grown).min(axis=1), 0.0)
    windows = np.lib.stride_tricks.sliding_window_view(np.column_stack([grown, both, sizes]), _LOOKS, axis=0)
    along, across, together = np.median(windows[:, :3], axis=-1).T
    alike = np.minimum(np.minimum(np.abs(along), np.abs(across)) - np.abs(along - across), np.abs(together))
    # Of a top that hardly stands out sizes scatter from look to look by more than that.
    scatter = STD_OF_MEDIAN / np.sqrt(2) * np.median(np.abs(np.diff(windows[:, 3:], axis=-1)), axis=-1)
    std = np.sqrt(np.pi / 2 / _LOOKS) * np.linalg.norm(scatter, axis=1)
    alike = np.where(alike > START.scales_apart * std, alike, 0.0)
    worst = int(np.argmax(alike))
    if alike[worst] <= CONSTANTS.wrong:
        return ()
    middle = worst + _LOOKS // 2
    size = float(np.mean(np.median(windows[worst, 3:], axis=-1) - usual))
    by_mm = 1e3 * abs(size) * _distance_m(target, pose[middle])
    at_s = float(time_s[worst : worst + _LOOKS].mean())
    return (finding("top_lifted", name=target.body.name, percent=100 * size, time_s=at_s, by_mm=by_mm),)


def _variance(observed: OutlineSizes) -> float:
    """Variance of one top's size without that of the camera: lengths, height, edges, and scatter between pictures.

    The scatter grows where something else than the edge is found in some of the pictures. Where it is in all of them,
    length and width are hardly off by the same share, as a wrong scale has it: they say how far edges may be off.
    """
    body, distance = observed.target.body, _distance_m(observed.target, observed.pose)
    diagonal = float(np.linalg.norm(np.ptp(body.top_corners_m, axis=0)))
    edge_m = CONSTANTS.edge_std_px * observed.target.metres_per_pixel(observed.pose)
    spread = float(np.std(observed.sizes))
    length, width = observed.sides_m / np.ptp(body.top_corners_m, axis=0)
    parts = OUTLINE.length_std_m / diagonal, body.height_std_m / distance, 2 * edge_m / diagonal, spread
    return float(np.sum(np.square([*parts, (length - width) / 2])))


def _distance_m(target: PlanarTarget, pose: Array) -> float:
    """Distance of a top from the camera along its axis [m]: a top that is so much higher by 1 % is 1 % larger."""
    place = [*pose[:2], target.body.tracked_plane_height_m, 1.0]
    return float((target.floor.T_camera_floor @ place)[2])


def _size_sensitivity(calibration: Calibration, observed: OutlineSizes) -> Array:
    """Derivative (18,) of a top's size in the picture by the calibration's parameters."""
    target, body = observed.target, observed.target.body
    corners = transform(observed.pose, body.top_corners_m)
    pixels = target.picture_of(corners)
    moves, _ = position_sensitivity(calibration.camera, calibration.floor, pixels, body.tracked_plane_height_m)
    arms = corners - corners.mean(axis=0)
    # A size above the stated one is a measured length above it: that of the corners' measured places.
    return np.asarray(np.einsum("nk,nkp->p", arms, moves) / np.sum(arms**2))

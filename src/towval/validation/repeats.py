"""Runs that repeat one drive: their common error, and their scatter about it."""

from collections.abc import Sequence

import numpy as np

from towval.model import Array, Comparison, Finding, Track
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import rms_length
from towval.model.repeats import Corridor
from towval.validation.path_frame import PathFrame

_PLACES = 400
"""Places along the path at which the runs are compared: 5 mm apart on two metres."""

_APART = 0.1
"""Share of the path's length by which measured paths of one drive may differ."""

_COVERAGE = 2.0
"""Scatter of repeats over u_val up to which the deviations allow it."""

_CONFIDENCE = 0.95
"""Of the interval of the common error at one place."""


def corridor(runs: Sequence[tuple[Track, Comparison]]) -> Corridor:
    """Common error and scatter of runs that repeat one drive, over the length of the path that all cover.

    ``runs``: measured track of the object and comparison of each of two or more runs; `InputError` where there are
    fewer, or one in which it was not seen.
    """
    if len(runs) < 2:
        raise InputError("a corridor needs repeated runs", got=len(runs), allowed="two runs or more")
    from scipy.special import stdtrit  # noqa: PLC0415  # not at start-up: few campaigns repeat a drive

    frames = [PathFrame(track, comparison.time_s) for track, comparison in runs]
    for frame, (_, comparison) in zip(frames, runs, strict=True):
        if not frame.seen.any():
            raise InputError(f"the object was not seen in run {comparison.run}", remedy="take it out of repeats")
    length = np.linspace(0.0, min(frame.length[-1] for frame in frames), _PLACES)
    columns = [
        _over_length(frame, np.column_stack([comparison.along_across, frame.pose[:, :2]]), length)
        for frame, (_, comparison) in zip(frames, runs, strict=True)
    ]
    errors, paths = np.array(columns)[..., :2], np.array(columns)[..., 2:]
    std = errors.std(axis=0, ddof=1)
    half_width = stdtrit(len(runs) - 1, 0.5 * (1 + _CONFIDENCE)) / np.sqrt(len(runs)) * std
    apart = np.linalg.norm(paths[:, None] - paths[None], axis=-1)
    return Corridor(
        runs=tuple(comparison.run for _, comparison in runs),
        length_m=length,
        errors=errors,
        mean=errors.mean(axis=0),
        half_width=half_width,
        std=std,
        apart_m=float(apart.max()),
        u_val_m=rms_length([[comparison.u_val_m] for _, comparison in runs]),
    )


def corridor_finding(found: Corridor) -> Finding:
    """The finding on repeats: a warning where their paths differ, or scatter by more than the deviations allow."""
    code = "repeats_scatter" if found.scatter_m > _COVERAGE * found.u_val_m else "repeats"
    return finding(
        "repeats_apart" if found.apart_m > _APART * found.length_m[-1] else code,
        runs=", ".join(found.runs),
        apart_mm=1e3 * found.apart_m,
        common_mm=1e3 * found.common_m,
        scatter_mm=1e3 * found.scatter_m,
        u_val_mm=1e3 * found.u_val_m,
    )


def _over_length(frame: PathFrame, columns: Array, length: Array) -> Array:
    """Columns (n, m) over times as columns (k, m) over the length of the path; their mean where the object rests."""
    seen = frame.seen & np.isfinite(columns).all(axis=1)
    places, group = np.unique(frame.length[seen], return_inverse=True)
    count = np.bincount(group)
    means = [np.bincount(group, weights=column) / count for column in columns[seen].T]
    return np.column_stack([np.interp(length, places, mean) for mean in means])

"""Whether surveyed marks and boards on the floor are of one scale: units confused, pixels of a reduced picture.

The adjustment cannot tell: it believes the marks, and leaves out all boards that do not fit, or bends the lens. Before
it, the boards alone say how far apart the marks are, roughly, since their lens is not known yet.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import pdist

from towval.calibration.blocks import FLOOR_START
from towval.calibration.floor import floor_from_boards
from towval.calibration.observations import CalibrationObservations, first_guess
from towval.model.errors import InputError
from towval.optics.projection import to_plane_kernel


@dataclass(frozen=True)
class MarksScaleConstants:
    """Tuned constant of the comparison."""

    apart: float = 1.6  # Factor by which all distances differ at least; of two marks the lens of a fisheye makes 1.4.


CONSTANTS = MarksScaleConstants()

_UNITS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 1 / 0.0254, "feet": 1 / 0.3048}


def check_scale(observed: CalibrationObservations) -> None:
    """Raise `InputError` where all distances between marks are far longer, or shorter, than the floor boards say."""
    if observed.marks < 2 or not observed.floor_boards:
        return
    factor = _common_factor(observed, fisheye=False)
    as_fisheye = _common_factor(observed, fisheye=True) if _is_apart(factor) else 1.0
    if not _is_apart(as_fisheye) or (factor > 1) != (as_fisheye > 1):
        return
    like = [name for name, unit in _UNITS.items() if max(factor / unit, unit / factor) < CONSTANTS.apart]
    raise InputError(
        "the surveyed marks and the boards on the floor are not of one scale",
        got=f"marks {float(f'{factor:.2g}'):g} times as far apart as the squares of the boards say",
        allowed="metres in floor.surveyed_marks and camera.board.square_m, and pixels of pictures of the videos' size",
        remedy=f"if the marks are in {like[0]}, give metres" if like else "check units, and where the pixels were read",
    )


def _is_apart(factor: float) -> bool:
    return max(factor, 1 / factor) >= CONSTANTS.apart


def _common_factor(observed: CalibrationObservations, *, fisheye: bool) -> float:
    """The factor by which all distances between marks are longer than the boards say, or shorter; else one."""
    boards, reference = observed.observations, observed.floor_reference
    camera = first_guess(replace(observed, boards=boards, floor_boards=(), reference=None), fisheye=fisheye)
    flat, shared = camera.places[len(observed.boards) :], camera.shared.copy()
    shared[FLOOR_START:] = floor_from_boards(flat[0], flat, reference.board_thickness_m)
    seen = replace(camera, shared=shared)
    pixels, lens = np.ascontiguousarray(reference.marks_px), np.ascontiguousarray(seen.lens)
    by_boards = pdist(to_plane_kernel(pixels, 0.0, seen.T_camera_floor, seen.matrix, lens))
    # Where a ray misses the floor, nothing is said; of a mark given twice neither.
    stated = pdist(reference.marks_m)
    told = (by_boards != 0) & (stated != 0)
    logs = np.log(stated[told] / by_boards[told])
    alike = len(logs) and (np.all(logs > 0) or np.all(logs < 0))
    return float(np.exp(logs[np.argmin(np.abs(logs))])) if alike else 1.0

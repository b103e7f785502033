"""Echoes: what temporal noise reduction leaves of earlier pictures in the picture of a moving body.

A camera that averages its noise away keeps a share k of the picture before in each, so the body appears at its old
places, too: at that of one picture before by k (1 − k), of two by k² (1 − k), and so on. Such pictures are late, by
up to k / (1 − k) pictures where the body moves by less than its texture is fine, by less where it is faster, and
texture and outline are late together. An open shutter reaches at most halfway to the next picture; a defocus or a codec
blurs on all sides. So the place of two pictures before distinguishes the echo: nothing else puts the body there.
"""

from array import array
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Finding
from towval.model.findings import finding
from towval.tracking.blur import SharpTarget, paths
from towval.tracking.late import delayed
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import STD_OF_MEDIAN, tukey_weights
from towval.tracking.template import Luma, Template, make_template


@dataclass(frozen=True)
class EchoConstants:
    """Tuned constants of the echoes; measured on the films of docs/camera_faults.md."""

    samples: int = 400  # Points of the top that are compared.
    least_path_px: float = 0.5  # [px] From one picture to the next: a shorter way looks like a shift.
    first_lessons: int = 10  # Pictures in a row that are compared,
    lesson_every: int = 10  # then one in so many.
    least_lessons: int = 8  # For the scatter of their echoes to be known.
    blur_px: float = 1.0  # [px] Over which a picture out of focus differs from a sharp one.
    named: float = 0.07  # Of the picture, from two pictures back: 0.05 at most without, 0.13 where half is kept.
    deviations: float = 3.0  # By which it is beyond that,
    faint: float = 0.25  # and by so much of (what pictures are off by over what texture shows)².
    # Noise makes 1/8: in the first picture it, too, makes a point differ from the seven places around, and more so
    # there than later. A codec leaves faint texture at its old place: 0.17 to 0.27 on films of plain tops at crf 23.
    sharp_px: float = 1.0  # [px] Blur by focus up to which a part of a run is asked: 1.5 px looks like echoes there.


CONSTANTS = EchoConstants()

_NEXT, _PAST = -1, (1, 2)  # pictures back
ROBUST_ROUNDS = 4
"""Rounds of the fit to a picture, weighted anew in each."""
_NUMBERS = 7  # Row of one sample: information (2, 2) and vector (2,) of the normal equations, and all weights.


class Echoes:
    """Collects what pictures of a body show of it at its places of one and two pictures before.

    The body is at ``pose`` (3,) in the first picture, ``luma``.
    """

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array):
        self.target, self.rows, self.seen = target, array("d"), 0
        template = make_template(luma, target, pose, CONSTANTS.samples)
        self.sharp = None if template is None else SharpTarget.cut(luma, target, pose, template)

    @property
    def template(self) -> Template | None:
        """Points that are compared; None where too little of the body is in the first picture."""
        return None if self.sharp is None else self.sharp.template

    def is_due(self, step: Array) -> bool:
        """Whether to look at a picture that the body reached by ``step`` (3,): at some of those it moved enough for."""
        if self.template is None or np.hypot(step[0], step[1]) < CONSTANTS.least_path_px * self.template.pixel_m:
            return False
        self.seen += 1
        return self.seen <= CONSTANTS.first_lessons or self.seen % CONSTANTS.lesson_every == 0

    def look(self, luma: Luma, pose: Array, step: Array) -> None:
        """Take in a picture of the body at ``pose`` (3,), reached by ``step`` (3,) in its own frame [m, m, rad]."""
        if self.sharp is None:
            return
        template = self.sharp.template
        path = paths(template.points, step)
        kept = self.sharp.clear(template.points, 2 * max(_PAST) * path)
        # A pixel that shows the point p now showed p + k steps k pictures ago.
        points = template.points[kept]
        values = self.target.grey_values(luma, points, pose)
        around = CONSTANTS.blur_px * template.pixel_m * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        places = [points + by for by in around] + [points + back * path[kept] for back in (_NEXT, *_PAST)]
        sharp, *others = self.sharp.read(np.concatenate(places)).reshape(len(places), -1)
        softer, echoes = np.sum(others[:4], axis=0) - 4 * sharp, [other - sharp for other in others[4:]]
        columns = np.column_stack([values - sharp, template.slopes[kept], softer, *echoes])
        known = np.isfinite(columns).all(axis=1)
        if known.sum() >= CONSTANTS.samples / 4:
            self.rows.extend(_normal(columns[known], sharp[known], template.tile[kept][known]))

    def kept(self, widest_blur_px: float = 0.0) -> float:
        """Least share of the picture before that is kept in each; zero where the echoes do not clearly say so.

        Over the run, or where it was most in a part of it: cameras reduce noise by as much as they amplify. A focus
        that hunts as wide as ``widest_blur_px`` [px] looks like that in a part, and then only the whole run counts.
        """
        rows = np.array(self.rows).reshape(-1, _NUMBERS)
        return largest_of_parts(rows, _kept, parts=widest_blur_px <= CONSTANTS.sharp_px)


def largest_of_parts(rows: Array, found: Callable[[Array], float], *, parts: bool = True) -> float:
    """What is ``found`` in the rows of a run, or in the part of it where that is largest; zero where they are few."""
    size = CONSTANTS.least_lessons
    if len(rows) < size:
        return 0.0
    if not parts:
        return found(rows)
    some = (rows[i : i + size] for i in range(0, len(rows) - size + 1, size // 2))
    return max(map(found, (rows, rows[-size:], *some)))


def _kept(rows: Array) -> float:
    """As :meth:`Echoes.kept`, of some samples (n, 7)."""
    information, vector, weight = rows[:, :4].reshape(-1, 2, 2), rows[:, 4:6], rows[:, 6]
    if (np.linalg.pinv(information.sum(axis=0)) @ vector.sum(axis=0))[0] < 0:
        # No picture shows less than nothing of the one before: a picture out of focus looks like that.
        information, vector = information[:, 1:, 1:], vector[:, 1:]
    inverse = np.linalg.pinv(information.sum(axis=0))
    echo = inverse @ vector.sum(axis=0)
    # Samples scatter by more than their residuals suggest: texture is not white noise.
    std = np.sqrt(np.sum(((vector - information @ echo) @ inverse)[:, -1] ** 2))
    faint = CONSTANTS.faint * weight.sum() / max(information[:, -1, -1].sum(), np.finfo(float).tiny)
    certain = CONSTANTS.named + faint + CONSTANTS.deviations * std
    # Of two pictures back and all before them, as far as the texture does not tell them apart, it is the square.
    return float(np.sqrt(echo[-1])) if echo[-1] > certain else 0.0


def _normal(columns: Array, light: Array, tile: NDArray[np.int64]) -> tuple[float, ...]:
    """Normal equations of the last two columns (n, k), for the first; the others, and the tiles' light, are free."""
    own = (tile == np.arange(tile.max() + 1)[:, None]) / np.maximum(np.bincount(tile), 1)[:, None]
    columns, gain = columns - (own @ columns)[tile], (light - (own @ light)[tile])[:, None]
    columns = columns - gain * (own @ (gain * columns) / np.maximum(own @ gain**2, 1e-9))[tile]
    misfit, others = columns[:, 0], columns[:, 1:]
    weight = np.ones(len(misfit))
    for _ in range(ROBUST_ROUNDS):
        weighed = others.T * weight
        information = weighed @ others
        # Numerical: a direction without texture stays solvable.
        information += np.diag(1e-9 * np.diag(information) + 1e-9)
        left = misfit - others @ np.linalg.solve(information, weighed @ misfit)
        scale = STD_OF_MEDIAN * float(np.median(np.abs(left))) + 1e-6
        weight = tukey_weights(left, scale)
    root = np.sqrt(weight)[:, None] / scale
    basis = np.linalg.qr(others[:, :-2] * root)[0]
    free = np.column_stack([others[:, -2:], misfit]) * root
    free -= basis @ (basis.T @ free)
    echoes = free[:, :2]
    return (*(echoes.T @ echoes).ravel(), *(echoes.T @ free[:, 2]), weight.sum())


def lateness(time_s: Array, pose: Array, kept: float) -> Array:
    """Covariance (n, 3, 3) of poses (n, 3) whose pictures keep a share of those before.

    Where between its time and the mean age of what its picture shows a pose belongs depends on texture and speed.
    """
    return delayed(time_s, pose, _late_s(time_s, kept) if kept else 0.0)


def echo_findings(time_s: Array, kept: float) -> tuple[Finding, ...]:
    """A warning where pictures at times (n,) [s] keep a share of those before."""
    if not kept:
        return ()
    return (finding("pictures_mixed", percent=100 * kept, late_ms=1000 * _late_s(time_s, kept)),)


def _late_s(time_s: Array, kept: float) -> float:
    """Mean age [s] of what a picture shows that keeps a share of the one before."""
    return kept / (1 - kept) * float(np.median(np.diff(time_s)))

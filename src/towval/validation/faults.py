"""Faults put into a run on purpose: the smallest of each kind that its uncertainty leaves visible.

A fault is put into the scene and simulated; the shift of the path that it makes is added to the draws of a right
model's error, and its size is changed until nine in ten of them are rejected.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, FloorRegion, MassSpread, SimulatedMotion, TowingScene
from towval.model.geometry import path_length, transform
from towval.model.statement import VisibleFault
from towval.physics.mass import spread_over
from towval.validation.statistics import RightModel

Acts = Callable[[TowingScene], TowingScene]
"""A change of a scene."""

POWER = 0.9
"""Share of the draws in which a visible fault is seen."""

STRIPE_M = 0.3
"""Length along the path of the floor on which the stripe's friction is another."""

_STRIPE_WIDTH_M = 2.0
_TIMES, _DRAWS = 200, 256  # of a run that the search uses: the size is then known to two digits
_SIMULATED = 32  # of these, simulated again with the fault: its share is then known to 5 %
_NEAR = 0.1  # of one: how much a size may still change that these were simulated with
_ROUNDS, _HALVINGS, _GROWTH = 3, 10, 4.0


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault: how a size [unit] acts on a scene, where the search starts and ends, and whether it has two
    signs."""

    name: str
    unit: str
    acts: Callable[[TowingScene, float], TowingScene]
    first: float
    most: float
    both: bool

    def of(self, size: float) -> Acts:
        """The change of a scene by a fault of a size."""
        return lambda scene: self.acts(scene, size)


def fault_kinds(motion: SimulatedMotion) -> tuple[FaultKind, ...]:
    """The kinds that are tried; the stripe lies half-way along a simulated motion."""
    return (
        FaultKind("rest length", "m", _longer, 0.01, 0.3, True),
        FaultKind("centre of mass, sideways", "m", _mass_moved, 0.01, 0.2, True),
        FaultKind(f"friction over {STRIPE_M:g} m of floor", "", _stripe(motion), 0.2, 3.0, False),
        FaultKind("tow height", "m", _raised, 0.1, 0.5, False),
    )


def _longer(scene: TowingScene, size: float) -> TowingScene:
    return replace(scene, tether=replace(scene.tether, rest_length=scene.tether.rest_length + size))


def _raised(scene: TowingScene, size: float) -> TowingScene:
    return replace(scene, hinge_height=scene.hinge_height + size, anchor_height=scene.anchor_height + size)


def _mass_moved(scene: TowingScene, size: float) -> TowingScene:
    """Moves the common centre of mass to the object's left."""
    spread = scene.spread or spread_over(scene.patch)
    shift = np.array([0.0, size * scene.mass / scene.body_mass])
    return replace(scene, spread=MassSpread(spread.centre + shift, spread.gyration))


def _stripe(motion: SimulatedMotion) -> Callable[[TowingScene, float], TowingScene]:
    length = np.array([path_length(motion.pose[: i + 1, :2]) for i in range(len(motion.pose))])
    middle = int(np.searchsorted(length, length[-1] / 2))
    ahead = motion.pose[min(len(length) - 1, int(np.searchsorted(length, length[middle] + 0.02))), :2]
    step = ahead - motion.pose[middle, :2]
    direction = float(np.arctan2(step[1], step[0]))

    def acts(scene: TowingScene, size: float) -> TowingScene:
        place = np.array([*motion.pose[middle, :2], direction])
        corners = transform(motion.pose[middle], scene.patch.corners)
        front = float(((corners - place[:2]) @ [np.cos(direction), np.sin(direction)]).max())
        half = 0.5 * _STRIPE_WIDTH_M
        ring = np.array([[front, -half], [front + STRIPE_M, -half], [front + STRIPE_M, half], [front, half]])
        region = FloorRegion(transform(place, ring), 1 + size)
        return replace(scene, ground=replace(scene.ground, regions=(*scene.ground.regions, region)))

    return acts


@dataclass(frozen=True)
class Drawing:
    """The draws of a right model's error that faults are put into.

    ``error`` (k, n, 3) at the times at which the object was seen, along and across the path; ``inputs`` (k, d) that it
    comes from; ``confidence`` of the test of a right model; ``shifts(acts, rows)`` by how much a changed scene moves
    the simulated path (m, n, 3) of the draws with these numbers, and of the nominal run where there are none.
    """

    error: Array
    inputs: Array
    confidence: float
    shifts: Callable[[Sequence[Acts], NDArray[np.intp] | None], Array]


def visible_faults(motion: SimulatedMotion, drawing: Drawing) -> tuple[VisibleFault, ...]:
    """The smallest fault of each kind that shows in :data:`POWER` of the draws; ``motion`` is the nominal one.

    Sought first with the shift of the nominal run, added to the draws. What the fault does there depends on the other
    inputs, too (a longer tether tightens later): some draws are simulated again with the fault in them, of either sign
    where it has two, and the size is corrected by the ratio that the two ways have on these draws.
    """
    times = slice(None, None, max(1, drawing.error.shape[1] // _TIMES))
    # The test at these times: means over fewer times are others where the object sticks and slips.
    right = RightModel.of(drawing.error[:, times], drawing.inputs, drawing.confidence)
    rows = np.arange(0, len(drawing.error), max(1, len(drawing.error) // _DRAWS))
    few = rows[:: max(1, len(rows) // _SIMULATED)]
    kinds = fault_kinds(motion)
    sizes = [kind.first for kind in kinds]
    for _ in range(_ROUNDS):
        moved = drawing.shifts([kind.of(size) for kind, size in zip(kinds, sizes, strict=True)], None)
        for i, (kind, shift) in enumerate(zip(kinds, moved, strict=True)):
            # Where it is not finite it tips, or the simulation ends early.
            growth = _growth(right, shift[times], drawing.error[few][:, times]) if np.isfinite(shift).all() else 0.5
            sizes[i] = min(growth * sizes[i], kind.most)
    search = _Search(drawing, right, times, rows, few)
    return tuple(search.visible(kind, size) for kind, size in zip(kinds, sizes, strict=True))


@dataclass(frozen=True)
class _Search:
    """The ``drawing``, its test ``right`` at some ``times``, ``rows`` of its draws, and those that are simulated."""

    drawing: Drawing
    right: RightModel
    times: slice
    rows: NDArray[np.intp]
    few: NDArray[np.intp]

    def visible(self, kind: FaultKind, size: float) -> VisibleFault:
        """The fault of a kind, of about a ``size`` that shows with the nominal shift."""
        shift, growth = self._corrected(kind, size)
        if abs(growth - 1) > _NEAR and growth * size <= kind.most:
            size *= growth
            shift, growth = self._corrected(kind, size)
        if not (growth < 0.999 * _GROWTH and growth * size <= kind.most):
            return VisibleFault(kind.name, np.nan, kind.unit, np.nan, np.nan, kind.most)
        distance = growth * np.linalg.norm(shift[:, :2], axis=1)
        rms, largest = float(np.sqrt(np.mean(distance**2))), float(distance.max())
        return VisibleFault(kind.name, growth * size, kind.unit, rms, largest, kind.most)

    def _corrected(self, kind: FaultKind, size: float) -> tuple[Array, float]:
        """Nominal shift (n, 3) of a fault and by how much it has to grow to show; NaN where it cannot be simulated."""
        (shift,) = self.drawing.shifts([kind.of(size)], None)
        signs = np.resize([1.0, -1.0] if kind.both else [1.0], len(self.rows))
        own = self.drawing.shifts([kind.of(sign * size) for sign in signs[: len(self.few)]], self.few)
        done = np.isfinite(own).all(axis=(1, 2))
        if not (np.isfinite(shift).all() and done.any()):
            return shift, np.nan
        error, nominal = self.drawing.error[:, self.times], signs[:, None, None] * shift[self.times]
        added = _growth(self.right, nominal, error[self.rows])
        few = error[self.few[done]]
        apart = _growth(self.right, own[done][:, self.times], few)
        return shift, added * apart / _growth(self.right, nominal[: len(self.few)][done], few)


def _growth(right: RightModel, shift: Array, error: Array) -> float:
    """By how much shifts ((k,) n, 3) have to grow to show in :data:`POWER` of the draws (k, n, 3)."""
    low, high = 0.0, _GROWTH
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if right.rejects(middle * shift + error).mean() >= POWER else (middle, high)
    return high

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
_TIMES = 200  # of a run that the search uses
_SIMULATED = 32  # draws that a round of the search simulates with the fault in them
_ENOUGH = 64  # of these make the share of those that show known to 4 %
_NEAR = 0.2  # of a size: from how far off what a fault does may be scaled to it
_ROUNDS, _MOST_ROUNDS, _GROWTH = 3, 4, 4.0


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
    inputs, too (a longer tether tightens later), and does not grow with its size alone: so draws are simulated with the
    fault in them, of either sign where it has two, others at each size that is tried.
    """
    times = slice(None, None, max(1, drawing.error.shape[1] // _TIMES))
    # The test at these times: means over fewer times are others where the object sticks and slips.
    right = RightModel.of(drawing.error[:, times], drawing.inputs, drawing.confidence)
    search, kinds = _Search(drawing, right, times), fault_kinds(motion)
    sizes = [kind.first for kind in kinds]
    for _ in range(_ROUNDS):
        moved = drawing.shifts([kind.of(size) for kind, size in zip(kinds, sizes, strict=True)], None)
        for i, (kind, shift) in enumerate(zip(kinds, moved, strict=True)):
            shown = _visible(search.thresholds(shift[None], search.rows(0)))
            # Where there is none it tips, or the simulation ends early.
            growth = min(shown, _GROWTH) if np.isfinite(shift).all() else 0.5
            sizes[i] = min(growth * sizes[i], kind.most)
    return tuple(search.visible(kind, size) for kind, size in zip(kinds, sizes, strict=True))


@dataclass(frozen=True)
class _Search:
    """The ``drawing`` and its test ``right`` at some ``times``."""

    drawing: Drawing
    right: RightModel
    times: slice

    def rows(self, part: int) -> NDArray[np.intp]:
        """Draws that a round simulates: others in each."""
        return np.arange(part, len(self.drawing.error), max(1, len(self.drawing.error) // _SIMULATED))[:_SIMULATED]

    def thresholds(self, shift: Array, rows: NDArray[np.intp]) -> Array:
        """Multiples of shifts ((k,) n, 3) from which on they show in draws (k,)."""
        return self.right.thresholds(shift[:, self.times], self.drawing.error[rows][:, self.times])

    def visible(self, kind: FaultKind, size: float) -> VisibleFault:
        """The fault of a kind, of about a ``size`` that shows with the nominal shift."""
        tried: list[tuple[float, Array]] = []
        near: list[Array] = []
        for part in range(_MOST_ROUNDS):
            found = self._sizes(kind, size, self.rows(part))
            tried.append((size, found))
            size = min(_visible(found), _GROWTH * size, kind.most) if len(found) else 0.5 * size
            near = [sizes for at, sizes in tried if abs(at / size - 1) <= _NEAR]
            if sum(map(len, near)) >= _ENOUGH:
                break
        size = _visible(np.concatenate(near or [found]))
        if not size <= kind.most:
            return VisibleFault(kind.name, np.nan, kind.unit, np.nan, np.nan, kind.most)
        (shift,) = self.drawing.shifts([kind.of(size)], None)
        distance = np.linalg.norm(shift[:, :2], axis=1)
        return VisibleFault(
            kind.name, size, kind.unit, float(np.sqrt(np.mean(distance**2))), float(distance.max()), kind.most
        )

    def _sizes(self, kind: FaultKind, size: float, rows: NDArray[np.intp]) -> Array:
        """From which size on a fault shows in each of those draws (k,) that can be simulated with about that size."""
        signs = np.resize([1.0, -1.0] if kind.both else [1.0], len(rows))
        shift = self.drawing.shifts([kind.of(sign * size) for sign in signs], rows)
        done = np.isfinite(shift).all(axis=(1, 2))
        return size * self.thresholds(shift[done], rows[done]) if done.any() else np.empty(0)


def _visible(sizes: Array) -> float:
    """What :data:`POWER` of the sizes (k,) from which on a fault shows lie below; infinite where too few show it."""
    slowest = float(np.quantile(1 / sizes, 1 - POWER, method="weibull")) if len(sizes) else 0.0
    return 1 / slowest if slowest > 0 else np.inf

"""Faults put into a run on purpose: the smallest of each kind that is visible despite the uncertainty.

A fault is put into the scene and simulated; the shift of the path that it causes is added to the draws of a right
model's error, and its size is changed until nine in ten of them are rejected.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, FloorRegion, MassSpread, SimulatedMotion, TowingScene
from towval.model.geometry import arc_lengths, transform
from towval.model.statement import VisibleFault
from towval.physics.mass import spread_over
from towval.validation.statistics import RightModel

Acts = Callable[[TowingScene], TowingScene]
"""A change of a scene."""

POWER = 0.9
"""Share of the draws in which a visible fault is detected."""

STRIPE_M = 0.3
"""Length along the path of the stripe of floor with another friction."""

_STRIPE_WIDTH_M = 2.0
_TIMES = 200  # about as many times of a run are used by the search
_SIMULATED = 24  # draws that a round of the search simulates with the fault in them
_KNOWN = 0.05  # standard error of the logarithm of a size at which the search ends
_NEIGHBOURS = 2  # simulated draws on each side whose ratios to the expected size are used for a draw
_LEAST = 1e-3  # smallest multiple of a shift: some draws are rejected without a fault
_NEAR = 0.2  # relative distance of sizes within which the effect of a fault may be scaled
_ROUNDS, _MOST_ROUNDS, _GROWTH = 3, 4, 4.0


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault.

    ``acts``: the scene with a fault of a size in ``unit``; ``first`` and ``most``: sizes at which the search starts and
    ends; ``both``: whether it has two signs.
    """

    name: str
    unit: str
    acts: Callable[[TowingScene, float], TowingScene]
    first: float
    most: float
    both: bool

    def of(self, size: float) -> Acts:
        """The change that puts a fault of a size into a scene."""
        return lambda scene: self.acts(scene, size)


def fault_kinds(motion: SimulatedMotion) -> tuple[FaultKind, ...]:
    """The kinds that are tried; the stripe of floor lies half-way along the simulated ``motion``."""
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
    """The scene with the common centre of mass farther to the object's left."""
    spread = scene.spread or spread_over(scene.patch)
    shift = np.array([0.0, size * scene.mass / scene.body_mass])
    return replace(scene, spread=MassSpread(spread.centre + shift, spread.gyration))


def _stripe(motion: SimulatedMotion) -> Callable[[TowingScene, float], TowingScene]:
    length = arc_lengths(motion.pose[:, :2])
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

    ``error`` (k, n, 3) along and across the path, at the times at which the object was seen; ``inputs`` (k, d), the
    standard normal numbers of the draws; ``confidence`` of the test. ``shifts(acts, rows)`` simulates: by how much each
    of m changes moves the path (m, n, 3) of the draw in its row, or of the nominal run where ``rows`` is None.
    """

    error: Array
    inputs: Array
    confidence: float
    shifts: Callable[[Sequence[Acts], NDArray[np.intp] | None], Array]


def visible_faults(motion: SimulatedMotion, drawing: Drawing) -> tuple[VisibleFault, ...]:
    """The smallest fault of each kind that shows in :data:`POWER` of the draws; ``motion`` is the nominal one.

    At first the shift of the nominal run is added to the draws. But the effect of a fault also depends on the other
    inputs (a longer tether tightens later), and is not proportional to its size: so, at each size that is tried, other
    draws are simulated with the fault in them, of either sign where it has two. They are spread over the sizes at which
    it shows with the nominal shift, and the ratio of the actual size to this one is also used for draws of similar
    size, because most of the spread among draws is that of their errors.
    """
    times = slice(None, None, max(1, drawing.error.shape[1] // _TIMES))
    # The test at these times: where the object sticks and slips, means over fewer times differ.
    right = RightModel.of(drawing.error[:, times], drawing.inputs, drawing.confidence)
    search, kinds = _Search(drawing, right, times), fault_kinds(motion)
    sizes = [kind.first for kind in kinds]
    for _ in range(_ROUNDS):
        moved = drawing.shifts([kind.of(size) for kind, size in zip(kinds, sizes, strict=True)], None)
        for i, (kind, shift) in enumerate(zip(kinds, moved, strict=True)):
            shown = _visible(search.shows(shift[None], search.all[::8]))
            # A shift that is not finite: the object tips, or the simulation ends early.
            growth = min(shown, _GROWTH) if np.isfinite(shift).all() else 0.5
            sizes[i] = min(growth * sizes[i], kind.most)
    return tuple(search.visible(kind, size) for kind, size in zip(kinds, sizes, strict=True))


@dataclass(frozen=True)
class _Search:
    """The search for the size of a fault that shows in the ``drawing``, by the test ``right`` at some of its times."""

    drawing: Drawing
    right: RightModel
    times: slice

    @property
    def all(self) -> NDArray[np.intp]:
        """Row numbers of all draws."""
        return np.arange(len(self.drawing.error))

    def shows(self, shift: Array, rows: NDArray[np.intp]) -> Array:
        """One over the smallest multiple of a shift ((k,) n, 3) at which the test rejects each of these draws (k,)."""
        found = self.right.thresholds(shift[:, self.times], self.drawing.error[rows][:, self.times])
        return 1 / np.maximum(found, _LEAST)

    def visible(self, kind: FaultKind, size: float) -> VisibleFault:
        """The visible fault of a kind; the search starts from the ``size`` that shows with the nominal shift.

        Where the rounds come to no common size, the largest that one of them found.
        """
        tried: list[_Round] = []
        found = np.inf
        for part in range(_MOST_ROUNDS):
            tried.append(self._round(kind, min(size, kind.most), part))
            latest = tried[-1].found
            near = [each for each in tried if abs(each.size / min(latest, kind.most) - 1) <= _NEAR]
            found = _visible(np.concatenate([each.shows for each in near])) if near else latest
            if near and np.sum([each.error**-2 for each in near]) >= _KNOWN**-2:
                break
            size = min(found, _GROWTH * tried[-1].size) if np.isfinite(tried[-1].error) else 0.5 * tried[-1].size
        else:
            found = max((each.found for each in tried if np.isfinite(each.error)), default=np.inf)
        if not found <= kind.most:
            simulated = max((each.size for each in tried if np.isfinite(each.error)), default=0.0)
            return VisibleFault(kind.name, np.nan, kind.unit, np.nan, np.nan, simulated)
        signs = (1.0, -1.0) if kind.both else (1.0,)
        shifts = self.drawing.shifts([kind.of(sign * found) for sign in signs], None)
        # With a fault of one sign the nominal run may tip.
        shift = next((each for each in shifts if np.isfinite(each).all()), shifts[0])
        distance = np.linalg.norm(shift[:, :2], axis=1)
        return VisibleFault(
            kind.name, found, kind.unit, float(np.sqrt(np.mean(distance**2))), float(distance.max()), kind.most
        )

    def _round(self, kind: FaultKind, size: float, part: int) -> "_Round":
        """Simulate some draws with a fault of a size in them."""
        signs = np.resize([1.0, -1.0] if kind.both else [1.0], len(self.all))
        both = np.unique(signs)
        nominal = self.drawing.shifts([kind.of(sign * size) for sign in both], None)
        expected = np.ones(len(signs))
        if np.isfinite(nominal).all():
            expected = np.maximum(self.shows(nominal[np.searchsorted(both, signs)], self.all), 0.5 / _GROWTH)
        order, count = np.argsort(expected, kind="stable"), min(_SIMULATED, len(signs))
        ranks = ((np.arange(count) + (part + 0.5) / _MOST_ROUNDS) * len(order) / count).astype(int)
        shift = self.drawing.shifts([kind.of(sign * size) for sign in signs[order[ranks]]], order[ranks])
        done = np.isfinite(shift).all(axis=(1, 2))
        ranks, shift = ranks[done], shift[done]
        if not done.any():
            return _Round(size, np.zeros(1), np.inf)
        ratio = self.shows(shift, order[ranks]) / expected[order[ranks]]
        nearest = np.searchsorted((ranks[1:] + ranks[:-1]) / 2, np.arange(len(order)))
        about = nearest[:, None] + np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)
        shows = expected[order][:, None] * ratio[np.clip(about, 0, len(ranks) - 1)]
        spread = np.std(np.log(np.maximum(ratio, 0.5 / _GROWTH)))
        return _Round(size, shows.ravel() / size, max(float(spread), 1e-3) / np.sqrt(len(ranks)))


@dataclass(frozen=True)
class _Round:
    """Result of one round of the search, in which faults of one ``size`` were simulated.

    ``shows`` (k,): one over the sizes at which the fault shows in draws; ``error``: standard error of the logarithm of
    the size found, infinite where nothing could be simulated.
    """

    size: float
    shows: Array
    error: float

    @property
    def found(self) -> float:
        """The size that shows in :data:`POWER` of the draws."""
        return _visible(self.shows)


def _visible(shows: Array) -> float:
    """The size at which a fault shows in :data:`POWER` of the draws, infinite where it shows in fewer.

    ``shows`` (k,) is one over the size at which it shows in each draw.
    """
    slowest = float(np.quantile(shows, 1 - POWER, method="weibull"))
    return 1 / slowest if slowest > 0 else np.inf
